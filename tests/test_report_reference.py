"""The reference's meshes, method and error are printed as the run recorded them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fem_reference import error_estimate as convergence
from fem_reference.elements import ELEMENTS
from fem_reference.model import METHODS
from reports import reference as section
from reports import report
from reports.content import document
from reports.digits import fixed
from reports.ranking import leads
from reports.summary import sentences
from reports.tables import numerics_rows
from study.results.records import CurveErrors, LargeStrain
from study.scene.schema import Organ
from tests.report_samples import (
    LEVELS,
    bare,
    printed,
    results_of,
    with_elements,
    with_mesh_error,
    with_model,
)


def found(**changes):
    return section.reference(with_elements(**changes))


def test_each_control_point_has_its_peak_error_and_order():
    """Orders of 0.8 and 3.4, and none, give way to what the estimate takes in their place."""
    assert found()["errors"] == [
        ["tool", "1.00 ± 0.01", "1.0 %", "0.8, 1 taken", "1.2 %", "3.4, 3 taken"],
        ["far", "1.00 ± 0.02", "2.0 %", "2.5", "5.0 %", "none"],
        ["whole field at the peak", "–", "3.0 %", "1.6", "–", "–"],
    ]


def test_the_order_of_the_elements_bounds_that_of_the_error():
    section_of = section.reference(with_mesh_error(formal_order=2.0))
    assert section_of["errors"][1][3] == "2.5, 2 taken"
    assert section_of["formal_order"] == "2"


def test_meshes_are_listed_from_coarse_to_fine():
    """By the edge [mm] of a regular tetrahedron, a³ / (6 √2), as large as their mean one."""
    first, *_, last = found()["levels"]
    assert first == ["24.2", "100", "1\u202f215", "0.90"]
    assert last == ["12.1", "800", "7\u202f803", "3.5"]
    assert pytest.approx(0.0121**3 / (6 * 2**0.5), rel=1e-2) == 1.667e-4 / 800


def test_with_two_meshes_the_order_is_assumed():
    two = found(levels=LEVELS[1:])
    assert (two["formal_order"], two["safety_assumed"]) == ("", "3")
    assert [row[3] for row in two["errors"]] == ["2 assumed"] * 3


def test_the_estimate_is_described_as_the_run_makes_it():
    for name in (
        "SAFETY",
        "SAFETY_ASSUMED",
        "SAFETY_GRADED",
        "ASSUMED_ORDER",
        "LEAST_ORDER",
        "BEYOND",
    ):
        assert getattr(section, name) == getattr(convergence, name)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("method", METHODS)
def test_element_and_method_are_said_in_words(element, method):
    stepping = {"subspace_vectors": None, "truncation_error": None}
    steps = stepping if method in section.STEPPING else {}
    said = found(element=element, method=method, **steps)["how"]
    assert section.ELEMENTS[element] in said
    shown = {
        "ritz-vectors": "57 load-dependent Ritz vectors",
        "modal": "56 modes of vibration",
        "tr-bdf2": "1\u202f000 implicit steps of TR-BDF2, 1.00 ms",
        "hht-alpha": "implicit steps of HHT-α",
    }
    assert shown[method] in said
    assert ("0.040 %" in said) is (method not in section.STEPPING)


@pytest.mark.parametrize(
    ("element", "organ", "curved"),
    [
        ("p2", Organ(), True),
        ("taylor-hood", Organ(), True),
        ("p1", Organ(), False),
        ("p2", Organ(shape="block"), False),
        ("p2", Organ(mesh="mine.stl"), False),
    ],
)
def test_only_quadratic_elements_of_the_built_in_liver_are_said_to_be_curved(
    element, organ, curved
):
    results = with_elements(element=element)
    results = replace(results, scene=replace(results.scene, organ=organ))
    assert ("curved along the organ's surface" in section.reference(results)["how"]) is curved


@pytest.mark.parametrize(
    ("levels", "shown"),
    [(LEVELS, "the three finest"), (LEVELS[1:], "an assumed order"), (LEVELS[2:], None)],
)
def test_the_document_says_how_many_meshes_the_error_comes_from(levels, shown):
    changes = {} if shown else {"mesh_error": None}
    content = bare(with_elements(levels=levels, **changes))
    said = " ".join(" ".join(printed(content)).split())
    assert "Meshes of the reference." in said
    for text in ("the three finest", "an assumed order"):
        assert (text in said) is (text == shown)
    assert report.compile_pdf(content, {"motion": []}).startswith(b"%PDF")


def test_a_run_without_the_reference_has_no_section_of_it():
    assert document(results_of(["basafa"]))["reference"] is None
    assert "Meshes of the reference." not in " ".join(printed(bare(results_of(["basafa"]))))


def test_the_first_page_says_how_many_meshes_the_error_comes_from():
    assert "error, estimated from 3 meshes, is 3.0 %" in " ".join(sentences(results_of()))
    two = with_elements(levels=LEVELS[1:])
    assert "error, estimated from 2 meshes, is 3.0 %" in " ".join(sentences(two))


HYPERELASTIC = LargeStrain(
    law="neo-hookean", field_difference=0.034, largest_strain=0.081, unknowns=7803
)


@pytest.mark.parametrize(
    ("strain", "found", "said"),
    [
        (0.06, HYPERELASTIC, True),
        (0.06, None, False),
        (0.05, HYPERELASTIC, False),  # the limit itself is trusted
    ],
)
def test_large_deformation_is_said_where_linear_strain_is_not_trusted(strain, found, said):
    results = with_model(with_elements(large_strain=found), "fem", largest_strain=strain)
    text = " ".join(sentences(results))
    whole = "The field of a neo-Hookean solid on the same mesh differs by 3.4 % at the peak load"
    assert (whole in text) is said
    assert ("large deformation" in text) is said


def test_what_a_subspace_leaves_out_is_part_of_the_error_by_the_mesh():
    curve = next(leads(results_of(), "fem", "tool"))
    assert curve.error == pytest.approx(0.01 + 3 * 0.001)
    unknown = next(leads(with_elements(mesh_error=None), "fem", "tool"))
    assert unknown.error == pytest.approx(0.0004 + 3 * 0.001)
    assert not unknown.is_whole
    stepped = next(leads(with_elements(truncation_error=None), "fem", "tool"))
    assert stepped.error == pytest.approx(0.013)
    assert stepped.is_whole


def test_an_error_of_rounding_is_not_printed_as_a_number():
    def shown(error):
        by_probe = {"tool": CurveErrors(displacement=error, velocity=error)}
        return numerics_rows(with_model(results_of(), "fem", time_step_errors=by_probe))[0][1]

    assert shown(9.2e-14) == "< 1.0·10⁻⁶ %"
    assert shown(2e-8) == "2.0·10⁻⁶ %"


def test_a_planted_error_reaches_the_page():
    """Negative control of what is printed."""
    planted = CurveErrors(displacement=0.777, velocity=0.012)
    content = bare(with_mesh_error(by_probe={"tool": planted}))
    assert "77.7 %" in printed(content)
    assert "77.7 %" not in printed(bare())
    assert fixed(77.7, 1) not in str(found())
