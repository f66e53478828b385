"""Models beside measurements: registration, tables, fits, and what a planted error does."""

import csv
import json
import math
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from study.run.preparation import QUIET
from study.validation import cantilever, cube, cylinders, table
from study.validation.bodies import BEAM_DENSITY, GRAVITY, beam, cylinder
from study.validation.comparison import Comparison, own_error
from study.validation.measured import Compression, beads, beam_markers, compressions
from study.validation.predictions import KINDS
from study.validation.registration import registered
from study.validation.request import ValidationRequest, all_answered


def test_a_rigid_motion_is_taken_away_and_nothing_else(rng):
    points = rng.standard_normal((20, 3))
    turn = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    found = registered(points, points @ turn.T + [1.0, 2.0, 3.0])
    assert found.rms < 1e-14
    noise = 0.1 * rng.standard_normal((20, 3))
    left = registered(points, points @ turn.T + noise)
    assert 0.05 < left.rms < 0.1 * np.sqrt(3.0)
    assert left.rms == pytest.approx(np.linalg.norm(left.by_axis))
    # A mirrored set is no rigid motion; a stretched one leaves its stretch.
    assert registered(points, points * [-1.0, 1.0, 1.0]).rms > 0.1
    assert registered(points, 1.1 * points).rms == pytest.approx(
        0.1 * np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    )
    with pytest.raises(ValueError, match="3 or more"):
        registered(points[:2], points[:2])


def test_the_measured_figures_are_whole():
    materials = compressions()
    assert len(materials) == 13
    assert all(len(one.strain) == 13 or one.strain[-1] >= 0.3 for one in materials)
    assert all((np.diff(one.force) > 0.0).all() for one in materials)
    assert materials[0].at(0.1) == pytest.approx((11.5611, 0.3481))
    assert all(math.isnan(x) for x in materials[0].at(0.9))
    alone, weighted = beam_markers()
    assert (alone.force, weighted.force) == (0.0, 1.00062)
    assert alone.moved.shape == weighted.moved.shape == (2, 3, 3)
    known = beads()
    assert known.unloaded.shape == (343, 3)
    assert set(known.states) == {"5", "18.25"}
    # Beads stand 10 mm apart between the base and the top.
    assert 0.005 < known.unloaded[:, 2].min() < known.unloaded[:, 2].max() < 0.075


def ideal(law):
    """A material whose force follows a law of nominal stress over strain, without error."""
    strain = np.array([0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3])
    area = np.pi * 0.025**2
    return Compression("ideal", strain, area * law(strain), 1e-6 * np.ones_like(strain))


def of_ideal(monkeypatch, law, kind):
    monkeypatch.setattr(cylinders, "compressions", lambda: (ideal(law),))
    monkeypatch.setattr(cylinders, "FACES", ("sliding",))
    return list(cylinders.comparisons((kind,), 2, QUIET))


def neo_hooke(strain):
    return 20e3 / 3.0 * ((1.0 - strain) ** -2 - (1.0 - strain))


def test_an_ideal_material_is_predicted_and_its_modulus_found(monkeypatch):
    """Between sliding plates both laws are closed forms: the fit must give their modulus back."""
    for one in of_ideal(monkeypatch, neo_hooke, "neo-hookean"):
        assert one.modulus == pytest.approx(20e3, rel=2e-3)  # of Poisson's ratio 0.499, not 1/2
        assert one.difference == pytest.approx(0.0, abs=3e-3 * one.measured)
        assert one.verdict == "agrees"
    for one in of_ideal(monkeypatch, lambda strain: 20e3 * strain, "linear"):
        assert one.modulus == pytest.approx(20e3, rel=1e-5)  # of the curved side
        assert one.difference == pytest.approx(0.0, abs=1e-6 * one.measured)


def test_a_wrong_law_is_told(monkeypatch):
    last = of_ideal(monkeypatch, neo_hooke, "linear")[-1]
    assert last.difference < -0.2 * last.measured
    last = of_ideal(monkeypatch, lambda strain: 20e3 * strain, "neo-hookean")[-1]
    assert last.difference > 0.2 * last.measured
    assert last.verdict == "differs"


def test_the_cylinders_force_is_that_measured_within_its_spread():
    """Bonded neo-Hookean elements; the linear ones and springs alone are far off at 30 %."""
    found = list(cylinders.comparisons(("linear", "neo-hookean"), 1, QUIET))
    assert all_answered(found)

    def median(model, faces, quantity):
        own = [
            one.difference / one.measured
            for one in found
            if (one.model, one.faces, one.quantity) == (model, faces, quantity)
        ]
        assert len(own) == 13
        return np.median(own)

    for strain in (10, 20, 30):
        quantity = f"force at {strain} %"
        assert abs(median("neo-Hookean FE", "bonded", quantity)) < 0.03
    assert median("linear FE", "bonded", "force at 30 %") < -0.15
    assert 0.05 < median("neo-Hookean FE", "sliding", "force at 30 %") < 0.15


def test_the_cubes_beads_tell_poissons_ratio():
    """The floor of the measurement with the volume term, and clearly worse without."""
    found = list(cube.comparisons(("neo-hookean", "springs", "volume"), 1, QUIET))
    whole = {
        (one.model, one.case, one.faces): one.found
        for one in found
        if one.quantity == "rms residual of the beads"
    }
    for faces in ("bonded", "sliding"):
        for model in ("neo-Hookean FE", "springs and volume term"):
            assert whole[model, "5 %", faces] < 0.5
            assert whole[model, "18.25 %", faces] < 0.85
        assert whole["springs alone", "5 %", faces] > 0.6
        assert whole["springs alone", "18.25 %", faces] > 2.0


def test_the_beam_under_its_weight_is_that_of_the_modulus_of_the_other_load():
    found = list(cantilever.comparisons(("linear", "neo-hookean"), 1, QUIET))
    alone = {one.model: one for one in found if one.case == "weight alone" and one.measured}
    fitted = [one for one in found if one.case == "101 g" and one.measured]
    assert all(abs(one.difference) < 1e-2 for one in fitted)  # mm, by the fit
    assert 240e3 < alone["neo-Hookean FE"].modulus < 290e3
    assert abs(alone["neo-Hookean FE"].difference) < 0.3
    assert abs(alone["neo-Hookean FE"].difference) < abs(alone["linear FE"].difference)


def test_the_beams_small_sag_is_that_of_beam_theory():
    """Timoshenko: tip of a clamped beam under its weight, q L^4 / 8 E I + q L^2 / 2 k G A."""
    tip = np.array([[0.0, 0.0, 0.015]])
    modulus, (length, width) = 50e6, (0.1, 0.03)
    answer = KINDS["neo-hookean"].solve(beam(0.0, tip), 1, modulus, (1.0,))
    q = BEAM_DENSITY * GRAVITY * width**2
    shear = modulus / 2.998 * 5.0 / 6.0 * width**2
    exact = q * length**4 / (8.0 * modulus * width**4 / 12.0) + q * length**2 / (2.0 * shear)
    # A clamped end is stiffer than beam theory has it, and this beam three times as long as high.
    assert 0.88 < -answer.displacement[0, 0, 2] / exact < 0.97


def test_symmetric_parts_add_up():
    """The force on the whole cylinder is four times that on the quarter of its cross-section."""
    answer = KINDS["linear"].solve(cylinder("sliding"), 0, 1e4, (0.01,))
    assert -answer.force[0] == pytest.approx(1e4 * 0.01 * np.pi * 0.025**2, rel=1e-3)


def compared(**change):
    one = Comparison(
        problem="cube",
        case="5 %",
        faces="bonded",
        model="linear FE",
        quantity="force",
        unit="N",
        measured=10.0,
        uncertainty=0.5,
        found=11.2,
        numerical=0.3,
    )
    return replace(one, **change)


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({}, "agrees"),  # 1.2 of at most 2 * 0.5 + 0.3
        ({"found": 11.4}, "differs"),
        ({"found": 11.0, "numerical": math.nan}, "agrees"),
        ({"found": 11.2, "coverage": 1.0}, "differs"),
        ({"numerical": 1.1}, "not resolved"),
        ({"found": 12.2, "numerical": 1.1}, "differs"),
        ({"calibrated": True}, "fitted"),
        ({"found": math.nan}, None),
        ({"uncertainty": math.nan}, None),
    ],
)
def test_a_verdict_takes_expanded_uncertainty_and_numerical_error(change, verdict):
    assert compared(**change).verdict == verdict


def test_the_own_error_covers_what_a_finer_mesh_changes():
    exact, sizes = 2.0, [1.0, 0.5, 0.25, 0.125]
    values = [exact + 0.3 * h**2 for h in sizes]
    stated = own_error(values[:3], sizes[:3])
    assert abs(values[2] - exact) <= stated < 3.0 * abs(values[2] - exact)
    assert math.isnan(own_error(values[:1], sizes[:1]))
    assert math.isnan(own_error([1.0, math.nan], sizes[:2]))
    assert math.isnan(own_error([1.0, 0.0], sizes[:2]))
    assert own_error([-value for value in values[:3]], sizes[:3]) == stated
    assert own_error(values, sizes) == own_error(values[1:], sizes[1:])  # of the last three


def test_tables_hold_every_comparison(tmp_path):
    found = [compared(), compared(found=math.nan, note="unstable"), compared(found=20.0)]
    table.write(found, tmp_path / "v.csv")
    rows = list(csv.DictReader((tmp_path / "v.csv").read_text().splitlines()))
    assert [row["verdict"] for row in rows] == ["agrees", "", "differs"]
    assert rows[1]["found"] == ""
    records = json.loads(table.as_json(found))["comparisons"]
    assert records[1]["found"] is None
    text = "\n".join(table.lines(found))
    assert "unstable" in text
    assert "differs" in text
    assert "1 of 2 predictions agree" in text
    assert "cube, bonded (fitted: nothing)" in text


def test_lines_say_what_was_fitted_and_round_no_error_but_rounding_to_nothing():
    fitted = {"fitted": "modulus"}
    found = [compared(**fitted), compared(numerical=1e-9, **fitted), compared(numerical=math.nan)]
    head, _, *rows = list(table.lines(found))[:5]
    assert head == "cube, bonded (fitted: modulus)"
    cells = [re.split(r" {2,}", row.strip()) for row in rows]
    assert cells[0][2:] == ["10", "+1.2", "0.5", "0.3", "agrees"]
    assert cells[1][2:] == ["10", "+1.2", "0.5", "0", "differs"]
    assert cells[2][2:] == ["10", "+1.2", "0.5", "differs"]


def test_lines_of_many_cases_are_their_median_and_range_in_per_cent():
    found = [
        compared(case=str(k), measured=10.0, found=10.0 + k, uncertainty=0.5, numerical=0.1)
        for k in range(-1, 4)
    ]
    row = list(table.lines(found))[2]
    cells = re.split(r" {2,}", row.strip())
    assert cells[2:] == ["10 to 10 N", "+10.0 % (-10 to +30)", "5.0 %", "1 %", "3 of 5 agree"]


def test_without_an_uncertainty_no_agreement_is_counted():
    text = "\n".join(table.lines([compared(uncertainty=math.nan)]))
    assert "predictions agree" not in text
    assert "agreement is not judged: no measurement has a known uncertainty" in text


def test_names_that_are_none_are_refused():
    with pytest.raises(ValueError, match="cylinders, cantilever, cube"):
        ValidationRequest(names=("sphere",))
    with pytest.raises(ValueError, match="--models: hooke"):
        ValidationRequest(kinds=("hooke",))
    done = subprocess.run(
        [sys.executable, "-m", "study", "validate", "cone"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "cone is not one of" in done.stderr
    assert "Traceback" not in done.stderr
