"""Every cell of the report's tables is the number that it says, and not one beside it.

In the samples no two numbers are alike, so a table that reads a wrong column prints a wrong text.
What is expected is written out by hand or formatted here, not by the report.
"""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from reports import benchmarks, stability, tradeoff
from reports.content import document
from reports.fuzzy_tables import set_rows, system_changes
from reports.motion_figures import motions, peak
from reports.ranking import leads
from reports.reference import reference
from reports.stability import cases
from reports.summary import glance, sentences
from reports.tables import (
    check_rows,
    correction_rows,
    dimensionless_rows,
    error_rows,
    estimate_rows,
    lead_rows,
    model_rows,
    numerics_rows,
    paper_rows,
    provenance_rows,
    scene_groups,
    similarity_tables,
)
from reports.tradeoff_answers import answers
from reports.verification import contest, growth, problems
from study.results.records import (
    Check,
    CorrectionRecord,
    CurveErrors,
    CurveOrders,
    Dimensionless,
    DiscretisationError,
    ElementsRecord,
    LatticeLimits,
    MeshLevel,
    PointRecord,
    Provenance,
    StiffnessSet,
    SystemEstimate,
)
from study.results.tables import BandSample, CurveSample, SensitivityEntry, SimilarityScore
from study.scene.file import read_scene, write_scene
from study.similarity.score import MEASURES
from tests.report_samples import LATTICE, known, results_of, with_model, with_record

MODELS = ["fem", "basafa", "msm-mamdani", "msm-sugeno"]
LABELS = ["Finite elements", "Basafa benchmark", "MSM Mamdani", "MSM Sugeno"]
THIN = "\u202f"
QUANTITIES = {
    "field-relative-l2-peak": 0.411,
    "field-relative-l2-final": 0.522,
    "field-l2-final-over-peak": 0.133,
    "field-best-factor-peak": 1.344,
    "field-relative-l2-peak-at-best-factor": 0.255,
}


@pytest.fixture(scope="module")
def results():
    """No two numbers alike."""
    found = results_of(MODELS)
    found = with_model(
        found,
        "fem",
        simulated_s=3.0,
        nodes=1111,
        time_step_s=2.1e-3,
        critical_time_step_s=None,
        steps=31,
        wall_s=0.41,
        largest_strain=0.051,
        time_step_errors={"tool": errors(0.011, 0.012), "far": errors(0.021, 0.016)},
        elements=elements(),
    )
    found = with_model(
        found,
        "msm-sugeno",
        simulated_s=3.5,
        nodes=2222,
        time_step_s=1.1e-3,
        critical_time_step_s=4.4e-3,
        steps=2727,
        wall_s=0.7,
        small_strain_modulus_pa=12340.0,
        largest_strain=0.061,
        time_step_errors={"tool": errors(0.0013, 0.0024), "far": errors(0.0017, 0.0019)},
        lattice=replace(LATTICE, springs=9009, inverted_cells=7),
    )
    found = with_record(found, **record_changes(found))
    shifts = {pair: k for k, pair in enumerate(pairs(found))}
    return replace(
        found,
        scores=tuple(scores()),
        **known(tuple(scores())),
        field_differences=tuple(
            row._replace(value=QUANTITIES[row.quantity] + 0.001 * shifts[row.model, row.reference])
            for row in found.field_differences
        ),
    )


def pairs(found):
    return list(dict.fromkeys((row.model, row.reference) for row in found.field_differences))


def errors(displacement, velocity):
    return CurveErrors(displacement=displacement, velocity=velocity)


def elements():
    return ElementsRecord(
        element="p2",
        elements=801,
        unknowns=7803,
        method="ritz-vectors",
        subspace_vectors=57,
        truncation_error=0.0044,
        levels=(
            MeshLevel(size=2.5, elements=101, unknowns=1202, wall_s=0.93),
            MeshLevel(size=1.7, elements=304, unknowns=3505, wall_s=1.6),
            MeshLevel(size=1.0, elements=801, unknowns=7806, wall_s=3.9),
        ),
        mesh_error=DiscretisationError(
            field_peak=0.0031,  # so that all digits of a difference are printed
            field_order=1.6,
            formal_order=3.0,
            by_probe={"tool": errors(0.041, 0.082), "far": errors(0.043, 0.036)},
            order_by_probe={
                "tool": CurveOrders(displacement=1.2, velocity=1.3),
                "far": CurveOrders(displacement=1.4, velocity=1.5),
            },
        ),
    )


def record_changes(found):
    fuzzy = replace(
        found.record.fuzzy,
        systems={
            "mamdani": estimate(11111.0, 1.1234, 22.0),
            "sugeno": estimate(12345.0, 1.2678, 310.0, (10500.0, 17600.0)),
        },
    )
    return {
        "fuzzy": fuzzy,
        "checks": (
            Check(name="mass", value=0.012, limit=0.053, meaning="of the organ"),
            Check(name="step", value=0.024, limit=0.019, meaning="of time"),
        ),
        "dimensionless": Dimensionless(
            extent_m=0.1234,
            volume_m3=2.346e-4,
            sag_rho_g_l_over_e=0.345,
            tool_pressure_over_e=0.0456,
            tool_radius_over_spacing=5.67,
            tool_radius_over_element_size=6.78,
        ),
        "lattice_limits": LatticeLimits(
            spacing_m=0.0112,
            poisson_ratio=0.45,
            relative_l2_at_quarter=0.061,
            relative_l2=0.242,
            best_factor=0.953,
            relative_l2_at_best_factor=0.234,
            relative_l2_with_volume_term=0.117,
        ),
        "study_wall_s": 45.6,
        "provenance": Provenance(
            versions={"python": "3.11.7", "numpy": "2.4.6"},
            commit="c0ffee",
            platform="An operating system",
            processor="A processor",
            seed=None,
            scene_sha256="5ce4e",
            mesh_sha256="3e54",
        ),
    }


def estimate(pa, share, error, interval=None):
    return SystemEstimate(
        estimate_pa=pa,
        relative_to_reference=share,
        quadrature_error_pa=error,
        method="made up",
        notes=(),
        interval_pa=interval,
    )


def scores():
    """A number of its own for each of model, reference, control point, curve and measure."""
    number = 1001
    for model, reference_ in (
        *((m, "fem") for m in MODELS[1:]),
        *((m, "basafa") for m in MODELS[2:]),
    ):
        for probe in ("tool", "far"):
            for curve, measures in MEASURES.items():
                for measure in measures:
                    yield SimilarityScore(
                        model, reference_, probe, curve, measure.name, number / 1e4
                    )
                    number += 7


def score(results, *key):
    (row,) = (row for row in results.scores if row[:5] == key)
    return row.score


# --- of the run ---------------------------------------------------------------------------------


def test_the_table_of_models(results):
    rows = {row[0]: row[1:] for row in model_rows(results)}
    assert rows["Finite elements"] == [
        *(f"1{THIN}111", "801", "2.10", "–", "–", "31", "0.41", "3.00", "7.3", "finished"),
    ]
    assert rows["MSM Sugeno"] == [
        *(f"2{THIN}222", f"9{THIN}009", "1.10", "4.40", "0.25", f"2{THIN}727"),
        *("0.70", "3.50", "5.0", "finished"),
    ]


def test_the_parts_of_a_point_are_its_one_spring(results):
    point = PointRecord(stiffness_n_per_m=3.0, mass_kg=4.0, damping_ratio=5.0)
    found = with_model(results, "msm-sugeno", lattice=None, point=point)
    assert {row[0]: row[2] for row in model_rows(found)}["MSM Sugeno"] == "1"


def test_the_table_of_numerical_errors(results):
    """The largest of the control points, displacement before velocity."""
    rows = {row[0]: row[1:] for row in numerics_rows(results)}
    assert rows["Finite elements"] == [
        *("2.1 %", "1.6 %", "4.3 %", "8.2 %", "0.3 %", "5.1 %", "–"),
    ]
    assert rows["MSM Sugeno"] == ["0.2 %", "0.2 %", "–", "–", "–", "6.1 %", "7"]
    swapped = {"tool": errors(0.03, 0.05), "far": errors(0.02, 0.04)}
    found = with_model(results, "msm-sugeno", time_step_errors=swapped)
    rows = {row[0]: row[1:] for row in numerics_rows(found)}
    assert rows["MSM Sugeno"][:2] == ["3.0 %", "5.0 %"]


def test_the_errors_of_a_corrected_lattice_stand_each_by_itself(results):
    """And one that is not estimated is no zero."""
    assert correction_rows(results) == []
    correction = CorrectionRecord(
        spacing_m=0.02,
        compared_spacing_m=None,
        remainder={"tool": errors(0.05, 0.06), "far": errors(0.01, 0.02)},
        remainder_errors={},
        vectors=5,
        truncation_error=1e-3,
    )
    elements = results.model("fem").elements
    found = with_model(results, "msm-sugeno", correction=correction, elements=elements)
    rows = correction_rows(found)
    assert [row[:4] for row in rows] == [
        ["MSM Sugeno", "tool", "5.0 %", "–"],
        ["MSM Sugeno", "far", "1.0 %", "–"],
    ]
    mesh = elements.mesh_error.by_probe
    assert [row[4] for row in rows] == [
        f"{100 * mesh[p].displacement:.1f} %" for p in ("tool", "far")
    ]
    assert all(row[6] == "0.1 %" for row in rows)


def test_the_table_of_the_first_page(results):
    table = glance(results)
    rows = {row[0]: dict(zip(table["header"], row, strict=True)) for row in table["rows"]}
    tissue = f"{results.scene.tissue.youngs_modulus / 1e3:.2f}"
    # By hand: the samples' curve of the reference peaks at 1 mm times the sine's largest sample.
    highest = np.sin(np.pi * np.linspace(0.0, 1.0, 20)).max()
    assert rows["Finite elements"] == {
        "model": "Finite elements",
        "modulus [kPa]": tissue,
        "÷ reference": "1.00",
        "peak at tool [mm]": f"{highest:.2f} ± 0.04",
        "field difference from FE": "± 0.3 %",
        "at best scale factor": "–",
        "real-time factor": "7.3",
        "status": "finished",
    }
    assert rows["MSM Sugeno"] == {
        "model": "MSM Sugeno",
        "modulus [kPa]": "12.34",
        "÷ reference": "1.23",
        "peak at tool [mm]": f"{0.8 * highest:.3f}",
        "field difference from FE": "41.3 %",
        "at best scale factor": "25.7 %",
        "real-time factor": "5.0",
        "status": "finished",
    }
    # A lattice whose record has no modulus is given its system's estimate.
    assert rows["MSM Mamdani"]["modulus [kPa]"] == "11.11"
    assert rows["MSM Mamdani"]["÷ reference"] == "1.11"
    assert rows["Basafa benchmark"]["modulus [kPa]"] == "–"


def test_the_table_of_estimates(results):
    assert estimate_rows(results) == [
        ["Mamdani", "11.11", "–", "0.02", "1.123"],
        ["Sugeno", "12.35", "10.50 to 17.60", "0.3", "1.268"],
    ]


def test_the_table_of_field_differences(results):
    rows = {(row[1], row[0]): row[2:] for row in error_rows(results)}
    assert rows["Basafa benchmark", "Finite elements"] == [
        *("41.1 %", "52.2 %", "13.3 %", "25.5 %", "1.344"),
    ]
    assert rows["MSM Sugeno", "Finite elements"] == [
        *("41.3 %", "52.4 %", "13.5 %", "25.7 %", "1.346"),
    ]
    assert rows["MSM Sugeno", "Basafa benchmark"] == [
        *("41.5 %", "52.6 %", "13.7 %", "25.9 %", "1.348"),
    ]


def test_the_tables_of_similarity(results):
    """Each cell by its reference, control point, model, curve and measure."""
    names = {"relative L2": "relative-l2", "ISO 18571": "iso-18571", "Fréchet": "frechet"}
    references = {"the finite-element reference": "fem", "the Basafa benchmark": "basafa"}
    models = dict(zip(LABELS, MODELS, strict=True))
    seen = 0
    for table in similarity_tables(results):
        curves = [c["name"].replace(" ", "-") for c in table["curves"] for _ in range(c["count"])]
        measures = [names.get(name, name.lower()) for name in table["measures"]]
        for group in table["groups"]:
            for label, *cells in group["rows"]:
                where = (models[label], references[table["reference"]], group["name"])
                wanted = [
                    score(results, *where, *column) for column in zip(curves, measures, strict=True)
                ]
                shown = [cell.rstrip("*") for cell in cells]
                assert shown == [
                    f"{value:.{len(cell.partition('.')[2])}f}"
                    for value, cell in zip(wanted, shown, strict=True)
                ]
                seen += len(cells)
    assert seen == len(results.scores)


def test_the_table_of_leads(results):
    """Against the finite elements by the seven measures, then against the benchmark."""
    rows = lead_rows(results)
    assert len(rows) == 14
    margin = score(results, "msm-sugeno", "fem", "tool", "displacement", "relative-l2") - score(
        results, "msm-mamdani", "fem", "tool", "displacement", "relative-l2"
    )
    error = 0.011 + 0.001 + 0.0013 + 0.041  # steps of three, mesh and subspace
    assert rows[0] == [
        *("Finite elements", "displacement", "relative L2", "MSM Sugeno", "MSM Mamdani"),
        f"{margin:.2f}",  # known to some hundredths
        *("± 0.0010", "0.0001"),
        *(f"{error:.4f}", "not resolved"),
    ]
    error = 0.012 + 0.01 + 0.0024 + 0.082
    assert rows[2][:3] == ["Finite elements", "velocity", "relative L2"]
    assert rows[2][8] == f"{error:.4f}"
    error = 0.001 + 0.001 + 0.0013  # the benchmark's and two lattices' steps
    assert rows[7] == [
        *("Basafa benchmark", "displacement", "relative L2", "MSM Sugeno", "MSM Mamdani"),
        f"{margin:.3f}",  # and here to some thousandths
        *("± 0.0010", "0.0001"),
        *(f"{error:.4f}", "yes"),
    ]
    assert [row[1:3] for row in rows[4:7]] == [
        ["phase plane", "Fréchet"],
        ["phase plane", "area"],
        ["phase plane", "PCM"],
    ]


def test_a_lead_elsewhere_has_the_errors_of_that_control_point(results):
    first = next(leads(results, "fem", "far"))
    assert first.error == pytest.approx(0.021 + 0.001 + 0.0017 + 0.043)


def test_the_table_beside_the_paper(results):
    rows = {row[0]: row[1:] for row in paper_rows(results)}
    for system, printed in (("mamdani", "0.8580"), ("sugeno", "0.8549")):
        ours = [
            row.score for row in results.scores if row[:3] == (f"msm-{system}", "basafa", "tool")
        ]
        span = f"{min(ours):.2f}" if round(min(ours), 2) == round(max(ours), 2) else "apart"
        assert rows[f"Benchmark – {system.capitalize()}"] == [printed, span]
    assert rows["Benchmark – Interval type-2"] == ["0.8598", "–"]


def test_the_table_of_checks(results):
    assert check_rows(results) == [
        ["mass", "0.012", "0.053", "of the organ", "passed"],
        ["step", "0.024", "0.019", "of time", "FAILED"],
    ]


def test_the_table_of_dimensionless_numbers(results):
    assert dimensionless_rows(results) == [
        ["largest extent", "123.4 mm"],
        ["volume of the mesh", "0.235 L"],
        ["sag under own weight, ρ g L / E", "0.345"],
        ["mean tool pressure / E", "0.0456"],
        ["tool radius / lattice spacing", "5.67"],
        ["tool radius / element size asked", "6.78"],
    ]


def test_the_limits_of_the_springs(results):
    assert document(results)["limits"] == {
        "spacing": "11.2 mm",
        "poisson_ratio": "0.45",
        "at_quarter": "6.1 %",
        "whole": "24.2 %",
        "factor": "0.953",
        "left": "23.4 %",
    }
    said = " ".join(sentences(results))
    assert "24.2 % at Poisson ratio 0.45, 23.4 % at the best scale factor, 6.1 % against" in said
    assert "11.7 % with one volume term per cell" in said


def test_the_table_of_provenance(results):
    assert provenance_rows(results) == [
        ["versions", "python 3.11.7, numpy 2.4.6"],
        ["commit", "c0ffee"],
        ["platform", "An operating system"],
        ["processor", "A processor"],
        ["seed", "–"],
        ["scene sha256", "5ce4e"],
        ["mesh sha256", "3e54"],
        ["whole study", "45.6 s"],
    ]


def test_the_tables_of_the_reference(results):
    found = reference(results)
    assert found["levels"] == [
        [f"{1e3 * (2.0**0.5 * 6.0 * 2.346e-4 / 101) ** (1 / 3):.1f}", "101", f"1{THIN}202", "0.93"],
        ["18.7", "304", f"3{THIN}505", "1.6"],
        ["13.5", "801", f"7{THIN}806", "3.9"],
    ]
    highest = np.sin(np.pi * np.linspace(0.0, 1.0, 20)).max()
    assert found["errors"] == [
        ["tool", f"{highest:.2f} ± 0.04", "4.1 %", "1.2", "8.2 %", "1.3"],
        ["far", f"{highest:.2f} ± 0.04", "4.3 %", "1.4", "3.6 %", "1.5"],
        ["whole field at the peak", "–", "0.3 %", "1.6", "–", "–"],
    ]
    assert "superposition of 57 load-dependent Ritz vectors" in found["how"]
    assert "by more than 0.4 % in relative L2" in found["how"]


def test_the_sentences_of_the_first_page(results):
    said = " ".join(sentences(results))
    assert "estimate 11.11 to 12.35 kPa, 1.11 to 1.23 times the reference modulus of 10" in said
    assert (
        "The stiffness interval of the fuzzy system Sugeno, 10.50 to 17.60 kPa, does not contain"
        in said
    )
    assert "Basafa benchmark 41.1 %, MSM Mamdani 41.2 %, MSM Sugeno 41.3 %" in said
    assert "3 meshes, is 0.3 % of the field at the peak load and at most 4.3 %" in said
    assert "8.2 % of a velocity curve (4.1 % and 8.2 % at the control point tool)" in said
    assert "Reference: its largest strain is 5.1 %, not below the limit of 5.0 %" in said


def test_the_scene_prints_each_key_beside_its_own_value(results):
    groups = {group["name"]: dict(group["rows"]) for group in scene_groups(results)}
    assert groups["time"] == {"duration": "1 s", "samples": "20"}
    assert groups["tissue"]["youngs_modulus"] == "10 kPa"
    assert groups["tool"]["force"] == "0.5 N"
    assert groups["damping"]["reference_spacing"] == "5.5 mm"


def test_curves_and_bands_draw_each_column_in_its_place(results):
    """Four numbers of a sample, none alike."""
    rows = [CurveSample("msm-sugeno", "tool", 0.1 * k, 1e-3 * k, -2e-3 * k) for k in range(5)]
    band = [
        BandSample("msm-sugeno", "tool", 0.1 * k, 3e-3 * k, 4e-3 * k, 5e-3 * k, 6e-3 * k)
        for k in range(5)
    ]
    found = replace(results, curves=tuple(rows), bands=tuple(band))
    (drawn,) = motions(found, "tool")
    steps = np.arange(5.0)
    np.testing.assert_allclose(drawn.motion, [0.1 * steps, steps, -2.0 * steps])
    lower, upper = drawn.bounds
    np.testing.assert_allclose(lower, [0.1 * steps, 3.0 * steps, 5.0 * steps])
    np.testing.assert_allclose(upper, [0.1 * steps, 4.0 * steps, 6.0 * steps])
    assert peak(found, "msm-sugeno", "tool") == 4e-3


# --- of the fuzzy systems -----------------------------------------------------------------------


def test_the_changes_between_systems(results):
    rows = (
        SensitivityEntry("reading", "R1", "R2", "mamdani", 1110.0, 2220.0, 3330.0, 256.0),
        SensitivityEntry("reading", "R1", "R2", "sugeno", 4440.0, 5550.0, 6660.0, 256.0),
        SensitivityEntry("system", "mamdani", "sugeno", "mamdani", 70.0, 8880.0, 9990.0, 128.0),
    )
    found = system_changes(replace(results, sensitivity=rows))
    assert found == [["Mamdani → Sugeno", "0.07", "8.88", "9.99"]]


def test_the_table_of_stiffness_sets(results):
    one = StiffnessSet(
        aetiology="hcv",
        stage="F2",
        severity="mild",
        placement="cut-off",
        centre=11.1,
        centre_source="castera",
        within_stage_sd=2.2,
        sd_kind="pooled",
        sd_source="sporea",
        between_study=0.333,
        between_study_kind="a",
        between_study_source="b",
        between_operator=0.044,
        between_operator_kind="c",
        between_operator_source="d",
        n=555,
        sourced="yes",
        note="",
    )
    fuzzy = replace(results.record.fuzzy, stiffness_sets=(one,))
    assert set_rows(with_record(results, fuzzy=fuzzy)) == [
        ["hcv", "F2", "11.1", "cut-off", "2.2", "pooled", "33.3 %", "4.4 %", "555", "castera"]
    ]


# --- of the program's own tables ----------------------------------------------------------------


def lines(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_the_table_of_real_time():
    given = lines(
        "nu,spacing_m,nodes,springs,step_s,step_wall_us,real_time_factor,"
        "real_time_factor_median,error\n0.45,0.012,1234,5678,0.0023,345,6.7,5.4,0.089\n"
    )
    assert benchmarks.real_time(given) == [
        ["0.45", "12 mm", f"1{THIN}234", f"5{THIN}678", "2.30", "345", "6.7", "5.4", "8.9 %"]
    ]


def test_the_table_of_large_strain():
    given = lines(
        "load_n,largest_strain_linear,largest_strain,depth_linear_m,depth_m,departure\n"
        "0.5,0.111,0.222,0.00333,0.00444,0.555\n"
    )
    assert benchmarks.large_strain(given) == [["0.5", "11.1 %", "22.2 %", "3.33", "4.44", "55.5 %"]]


def test_the_table_of_field_errors():
    given = lines(
        "body,nu,volume_term,spacing_m,error,order,reference_error\n"
        "block,0.45,False,0.02,0.411,1.2,0.0013\nblock,0.45,False,0.01,0.222,1.2,0.0013\n"
    )
    assert benchmarks.field_error(given) == {
        "spacings": ["20 mm", "10 mm"],
        "rows": [["block", "0.45", "springs", "41.1 %", "22.2 %", "1.2", "0.1 %"]],
    }


def test_the_table_of_other_engines():
    given = lines(
        "engine,version,precision,nu,nodes,relative_to_ours,field_error,from_ours,reference_error\n"
        "toy,1.2,double,0.25,1000,1.5,0.111,0.0222,0.0033\n"
        "toy,1.2,double,0.25,8000,2.5,0.055,0.0444,0.0033\n"
    )
    found = benchmarks.peers(given)
    assert found["nodes"] == [f"1{THIN}000", f"8{THIN}000"]
    assert found["rows"] == [
        ["toy", "1.2", "double", "0.25", "1.5", "2.5", "11.1 %", "5.5 %", "4.4 %"]
    ]
    assert found["reference_error"] == "0.3 % at 0.25"


def test_the_tables_of_verification_and_cost():
    given = lines(
        "problem,quantity,exact,ours,error,order,limit,passed\n"
        "Bar,deflection,1.1111,2.2222,0.033,4.44,0.055,True\n"
    )
    assert problems(given)[0]["rows"] == [
        ["deflection", "1.1111", "2.2222", "0.033", "4.44", "0.055", "passed"]
    ]
    cost = lines(
        "task,program,version,unknowns,least_s,median_s,repeats,compile_s,peak_mib,machine\n"
        "job,ours,0.1,50000,1.1,2.2,3,4.4,55,m\njob,other,0.2,60000,3.3,6.6,3,7.7,88,m\n"
        "growth: mesh,ours,0.1,6000,0.51,9,3,,321,m\n"
        "growth: assembly,ours,0.1,6000,0.62,9,3,,432,m\n"
        "growth: solution,ours,0.1,6000,0.73,9,3,,543,m\n"
    )
    assert contest(cost) == [
        ["job", "ours", "0.1", f"50{THIN}000", "1.1", "2.2", "4.4", "1.0"],
        ["job", "other", "0.2", f"60{THIN}000", "3.3", "6.6", "7.7", "3.0"],
    ]
    assert growth(cost) == [[f"6{THIN}000", "0.51", "0.62", "0.73", "320"]]


TRADEOFF = (
    "contender,configuration,status,message,any_load,pareto,pareto_any_load,field_error,"
    "field_error_bar,setup_s,wall_per_s_q1,wall_per_s,wall_per_s_q3,frame_ms_60hz,"
    "slow_frame_ms_60hz,real_time_60hz\n"
    "springs,spacing=0.02 volume_term=True,resolved,,True,True,False,0.11,0.004,0.66,0.1,0.2,0.3,"
    "{frame},{slow},True\n"
)


@pytest.mark.parametrize(("frame", "slow", "share"), [("3", "6", "36 %"), ("3", "", "18 %")])
def test_a_configuration_of_the_trade_off(frame, slow, share, tmp_path):
    """A slow frame of 6 ms takes 0.36 of the period at 60 Hz, where enough frames were timed."""
    (tmp_path / "tradeoff.csv").write_text(TRADEOFF.format(frame=frame, slow=slow))
    (one,) = tradeoff.configurations(tmp_path)
    assert (one.on_front, one.on_any_load_front, one.any_load) == (True, False, True)
    assert (one.error, one.bar, one.timing.setup) == (0.11, 0.004, 0.66)
    assert one.timing.quartiles == (0.1, 0.2, 0.3)
    name = "springs and volume term, 20 mm"
    assert answers([one])[0] == ["60 Hz", "any", name, "11.0 ± 0.4 %", share, "0.66"]
    assert answers([one])[1] == ["60 Hz", "known beforehand", "none", "–", "–", "–"]


def test_the_share_of_a_period_is_that_of_the_rate(tmp_path):
    """Half a millisecond is half of the period at 1 kHz, and a fortieth of one of 20 ms."""
    for rate, share in (("1khz", 0.5), ("50hz", 0.025)):
        text = TRADEOFF.format(frame="0.4", slow="0.5").replace("60hz", rate)
        (tmp_path / "tradeoff.csv").write_text(text)
        (one,) = tradeoff.configurations(tmp_path)
        assert tradeoff.share(one, rate) == pytest.approx(share)


def test_a_configuration_under_moved_tools_has_the_error_of_their_force(tmp_path):
    text = TRADEOFF.format(frame="3", slow="6").replace(
        "field_error_bar,", "field_error_bar,force_error,force_error_bar,"
    )
    (tmp_path / "tradeoff.csv").write_text(text.replace(",0.004,", ",0.004,0.077,0.0088,"))
    (one,) = tradeoff.configurations(tmp_path)
    assert (one.of_force, one.error, one.bar) == (True, 0.077, 0.0088)
    assert one.stated_error == "7.7 ± 0.9 %"


@pytest.mark.parametrize(
    ("scene", "mesh"),
    [
        ("liver", "elements of 24 mm"),
        ("block", "mesh 2 steps coarser"),  # which has other ratios of its levels
        (None, "mesh 2 steps coarser"),
    ],
)
def test_a_mesh_is_told_by_its_elements_where_the_scene_is_the_built_in_liver(
    scene, mesh, tmp_path
):
    text = TRADEOFF.format(frame="3", slow="6")
    text = text.replace("spacing=0.02 volume_term=True", "element=p1 level=-2")
    (tmp_path / "tradeoff.csv").write_text(text)
    if scene is not None:
        sized = read_scene(scene, ("reference.element_size=13.5 mm",))
        (tmp_path / "scene.toml").write_text(write_scene(sized))
    (one,) = tradeoff.configurations(tmp_path)
    assert (one.name, one.mark) == (f"springs alone, linear, {mesh}", f"linear, {mesh}")


def test_a_case_of_the_stability_study(tmp_path):
    (tmp_path / "stability.csv").write_text(
        "family,case,expected,outcome,predicted,measured,difference,passed,message\n"
        'critical step,9 kg: euler,"value, within 0.05",value,0.002,0.0021,0.03,True,said\n'
    )
    (one,) = cases(tmp_path)
    assert one == stability.StabilityCase(
        family="critical step",
        name="9 kg: euler",
        outcome="value",
        predicted=0.002,
        measured=0.0021,
        difference=0.03,
        tolerance=0.05,
        passed=True,
        message="said",
    )
    assert one.departure == pytest.approx(0.05)
    assert "by at most 5.0 % (9 kg: euler)" in stability.sentences([one])[1]
