"""The unit of a file: declared, guessed or refused."""

from __future__ import annotations

import pytest

from study.mesh.kinds import MeshError
from study.mesh.load import load_mesh
from tests.mesh_samples import CUBE_VOLUME, SIDE, cube, write_tetrahedra

METRES = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254}


@pytest.fixture
def load_cube(tmp_path):
    """Load a cube of a side given in metres that is stored in one unit and declared in another."""

    def load(stored, declared, side=SIDE):
        points, tetrahedra = cube()
        path = tmp_path / "cube.vtu"
        write_tetrahedra(path, points * (side / SIDE) / METRES[stored], tetrahedra)
        return load_mesh(path, declared)

    return load


@pytest.mark.parametrize("unit", METRES)
def test_a_declared_unit_is_used(load_cube, unit):
    _, report = load_cube(unit, unit)
    assert (report.unit, report.scale) == (unit, METRES[unit])
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=1e-13)
    assert report.extent == pytest.approx([SIDE] * 3, rel=1e-13)
    assert report.notes == ()


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_metres_and_millimetres_are_guessed_and_said(load_cube, unit):
    _, report = load_cube(unit, None)
    assert report.unit == unit
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=1e-13)
    assert report.notes == (f"unit {unit} guessed: it makes the volume 1.73 L, a liver's",)


@pytest.mark.parametrize("unit", ["cm", "dm", "in", "um"])
def test_other_units_are_suspected_but_not_assumed(load_cube, unit):
    with pytest.raises(MeshError, match=rf"perhaps {unit}, but.*declare `organ.unit`"):
        load_cube(unit, None)


def test_a_shape_without_any_likely_unit(load_cube):
    # 4 units wide: no unit in the table makes a liver of it.
    with pytest.raises(MeshError, match=r"unit unknown; declare `organ.unit`"):
        load_cube("m", None, side=0.3)


@pytest.mark.parametrize(
    ("side", "guessed"), [(0.0794, True), (0.0793, False), (0.1518, True), (0.152, False)]
)
def test_the_band_is_half_a_litre_to_three_and_a_half(load_cube, side, guessed):
    if guessed:
        assert load_cube("m", None, side)[1].unit == "m"
    else:
        with pytest.raises(MeshError, match="unit unknown"):
            load_cube("m", None, side)


def test_a_declared_unit_wins_over_the_band_with_a_warning(load_cube):
    _, report = load_cube("cm", "mm")  # a tenth too small
    assert report.unit == "mm"
    assert report.extent == pytest.approx([SIDE / 10] * 3)
    assert report.notes[0].startswith("WARNING: 0.001728 L with the declared unit mm")
    assert report.notes[0].endswith("; as cm it would be 1.73 L, a liver's")


@pytest.mark.parametrize(("stored", "declared"), [("mm", "m"), ("m", "mm"), ("mm", "um")])
def test_a_wrong_unit_by_a_thousand_is_refused(load_cube, stored, declared):
    with pytest.raises(MeshError, match=r"0.001 to 1 m: correct `organ.unit`"):
        load_cube(stored, declared)


@pytest.mark.parametrize(("side", "message"), [(0.00099, "measures"), (1.01, "measures")])
def test_the_box_is_limited(load_cube, side, message):
    with pytest.raises(MeshError, match=message):
        load_cube("m", "m", side)


@pytest.mark.parametrize("unit", ["metre", "km", "MM", ""])
def test_unknown_names_are_refused(load_cube, unit):
    names = "m, dm, cm, mm, um, in"
    with pytest.raises(MeshError, match=rf"`organ.unit` = .* is not one of {names}; as m it would"):
        load_cube("m", unit)


@pytest.mark.parametrize(
    ("stored", "declared"),
    [("mm", "cm"), ("mm", "MM"), ("cm", "m"), ("in", "inch"), ("mm", "in"), ("cm", "Cm")],
)
def test_a_mistaken_unit_is_answered_with_the_one_that_makes_a_liver(load_cube, stored, declared):
    hint = f"as {stored} it would be 1.73 L, a liver's"
    with pytest.raises(MeshError) as caught:
        load_cube(stored, declared)
    assert str(caught.value).endswith(hint)


def test_no_unit_is_proposed_for_what_is_no_liver_in_any(load_cube):
    with pytest.raises(MeshError) as caught:
        load_cube("m", "MM", side=0.3)
    assert "it would be" not in str(caught.value)
