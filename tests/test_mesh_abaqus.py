"""Abaqus files: where instances are put, and that no way of writing them loses a part."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.mesh.abaqus import read_abaqus
from study.mesh.abaqus_words import cell_type
from study.mesh.kinds import MeshError
from tests.mesh_features_volume import keyword_text, part
from tests.mesh_samples import cube


def test_an_instance_is_shifted_then_turned():
    """A quarter turn about the line through (1, 2, 0) along z sends x to y."""
    text = part(
        "*INSTANCE, NAME=I, PART=ORGAN", "1., 2.", "1., 2., 0., 1., 2., 5., 90.", "*END INSTANCE"
    )(keyword_text())
    points = cube(2)[0]
    expected = np.stack([1 - points[:, 1], 2 + points[:, 0], points[:, 2]], axis=1)
    np.testing.assert_allclose(read_abaqus(text.encode()).points, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["1., x"], "line 83: expected 3 numbers"),
        (["1., 2., 3., 4."], "line 83: 4 numbers, expected 3"),
        (["0.", "1., 2., 3., 1., 2., 3., 90."], "line 84: the two points of the axis"),
        (["0.", "0.,0.,0.,1.,0.,0.,9.", "0."], "line 85: an instance has a translation"),
    ],
)
def test_placements_that_are_none(lines, message):
    text = part("*INSTANCE, NAME=I, PART=ORGAN", *lines, "*END INSTANCE")(keyword_text())
    with pytest.raises(MeshError, match=message):
        read_abaqus(text.encode())


@pytest.mark.parametrize("word", ["x", "1.5", "1_3", "9" * 30, "\xa0x5", "5\x1c", "", "<n>"])
def test_numbers_that_are_none_are_named_with_their_line(word):
    text = keyword_text() + f"49, 1, 2, {word}, 5\n"
    with pytest.raises(MeshError, match="line 80: "):
        read_abaqus(text.encode("latin-1"))


@pytest.mark.parametrize(
    ("name", "cell"),
    [
        *((f"C3D4{end}", "tetra") for end in ("", "H", "T", "HT", "P", "E")),
        *((f"C3D10{end}", "tetra10") for end in ("", "H", "HS", "M", "MH", "MT", "I")),
        *((f"C3D8{end}", "hexahedron") for end in ("", "R", "H", "RH", "I", "IH")),
        ("DC3D4", "tetra"),
        ("AC3D10", "tetra10"),
        ("C3D20RH", "hexahedron20"),
        ("C3D5", "pyramid"),
        ("C3D15V", "wedge15"),
        ("CPS3", "triangle"),
        ("S3RS", "triangle"),
        ("S4R5", "quad"),
        ("STRI65", "triangle6"),
        ("M3D4R", "quad"),
        ("B31H", "line"),
        ("CONN3D2", "line"),
        ("U1", ""),
        ("C3D7", ""),
    ],
)
def test_element_types_by_their_shape(name, cell):
    assert cell_type(name)[0] == cell


@st.composite
def disguises(draw):
    """The cube's file, written in another way at every line."""
    ending = draw(st.sampled_from(["\n", "\r\n"]))
    blanks = draw(st.sampled_from(["", " ", "\t", "   "]))
    rows = []
    for i, row in enumerate(keyword_text().split("\n")[:-1]):
        changed = re.sub(r", ?", f",{blanks}", row)
        if row.startswith("*"):
            changed = draw(st.sampled_from([str.upper, str.lower, str.title]))(changed)
        elif row.count(",") == 4 and draw(st.booleans()):
            at = draw(st.integers(1, 4))
            words = changed.split(",")
            changed = ",".join(words[:at]) + "," + ending + blanks + ",".join(words[at:])
        if i > 2 and draw(st.integers(0, 9)) == 0:
            rows.append(draw(st.sampled_from(["** a", "**,", "", "  ", "***"])))
        rows.append(changed)
    return ending.join([*rows, ""])


@settings(max_examples=25, deadline=None)
@given(disguises())
def test_no_way_of_writing_loses_anything(text):
    mesh = read_abaqus(text.encode())
    assert np.array_equal(mesh.points, cube(2)[0])
    assert np.array_equal(mesh.tetrahedra, cube(2)[1])
    assert mesh.notes == ()
