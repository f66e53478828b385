"""A scene's own fuzzy system: its readings go in by name, its answer comes out in its unit."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from fuzzy.systems.conversion import sugeno_of
from fuzzy.systems.files import write_rule_base
from fuzzy.systems.inference import infer
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import FuzzySet
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable
from reports.report import make_report
from study.results import ResultsError
from study.results.folder import read, write
from study.run.study import run_study
from study.scene.file import SceneError, read_scene

SYSTEM = FuzzySystem(
    inputs=(
        Variable(
            "speed",
            0.5,
            4.0,
            (FuzzySet("slow", "gaussmf", (0.7, 1.0)), FuzzySet("fast", "gaussmf", (0.7, 3.0))),
        ),
        Variable("age", 0.0, 100.0, (FuzzySet("old", "smf", (40.0, 80.0)),)),
    ),
    output=Variable(
        "stiffness",
        0.0,
        40.0,
        (FuzzySet("soft", "gaussmf", (3.0, 5.0)), FuzzySet("stiff", "gaussmf", (5.0, 25.0))),
    ),
    rules=(
        Rule((Term(0, 0),), 0),
        Rule((Term(0, 1),), 1),
        Rule((Term(0, 1), Term(1, 0)), 1, weight=0.5),
    ),
    name="speeds",
)
READINGS = {"speed": 1.7, "age": 70.0}


@pytest.fixture(params=[".fis", ".json"])
def file(request, tmp_path):
    path = tmp_path / f"own{request.param}"
    write_rule_base(SYSTEM, path)
    return path


def scene_of(file, *changes, inputs="{speed = 1.7, age = 70}"):
    """The paper's point with estimates by the system in a file."""
    path = file.parent / "own.toml"
    path.write_text(
        'models = ["basafa", "msm"]\n'
        '[organ]\nshape = "point"\n'
        '[tool]\nforce = "2 mN"\nhistory = {kind = "step"}\n'
        f'[fuzzy]\nrule_base = "{file.name}"\ninputs = {inputs}\nsystems = ["mamdani"]\n'
        '[time]\nduration = "3 s"\nsamples = 101\n'
    )
    return read_scene(str(path), changes)


def test_an_estimate_is_the_system_s_own_answer(file):
    results = run_study(scene_of(file))
    row = np.array([[READINGS[one.name] for one in SYSTEM.inputs]])
    answer = float(infer(SYSTEM, row, "mamdani").value[0])
    found = results.record.fuzzy.systems["mamdani"]
    assert found.estimate_pa == pytest.approx(1e3 * answer, rel=1e-9)
    fine = float(infer(SYSTEM, row, "mamdani", InferenceOptions(samples=100_001)).value[0])
    assert found.quadrature_error_pa == pytest.approx(1e3 * abs(answer - fine), rel=0.15)
    assert results.model("msm-mamdani").small_strain_modulus_pa == found.estimate_pa
    assert results.record.fuzzy.rule_count == 3
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    assert results.record.provenance.rule_base_sha256 == digest
    other = run_study(scene_of(file, inputs="{speed = 2.4, age = 70}"))
    assert other.record.fuzzy.systems["mamdani"].estimate_pa > found.estimate_pa + 1e3


def test_results_of_it_are_read_back_and_reported(file, tmp_path):
    results = run_study(scene_of(file))
    (tmp_path / "out").mkdir()
    write(results, tmp_path / "out")
    assert read(tmp_path / "out").scene.fuzzy.rule_base == str(file)
    make_report(tmp_path / "out")
    (tmp_path / "mixed").mkdir()
    fuzzy = replace(results.scene.fuzzy, rule_base=None, inputs={})
    liver = replace(results, scene=replace(results.scene, fuzzy=fuzzy))
    write(liver, tmp_path / "mixed")
    with pytest.raises(ResultsError):  # the liver's sets are not there
        read(tmp_path / "mixed")


@pytest.mark.parametrize(
    ("inputs", "changes", "told"),
    [
        ("{speed = 1.7}", (), r"fuzzy\.inputs: age missing; .* takes speed, age"),
        ("{speed = 1.7, ages = 7}", (), r"fuzzy\.inputs: age missing and ages unknown"),
        ("{}", (), r"fuzzy\.inputs: empty"),
        ("{speed = 1.7, age = 70}", ("fuzzy.unit=Pa",), "fuzzy.rule_base"),
        ("{speed = 1.7, age = 70}", ("fuzzy.knowledge=freed",), r"fuzzy\.knowledge: shapes"),
        ("{speed = 1.7, age = 70}", ("fuzzy.rule_base=none.fis",), "is no file"),
    ],
)
def test_what_does_not_fit_is_refused(inputs, changes, told, tmp_path):
    file = tmp_path / "own.json"
    write_rule_base(SYSTEM, file)
    if changes == ("fuzzy.unit=Pa",):  # 13 Pa would pass for a very soft gel
        changes = ("fuzzy.unit=Pa", "fuzzy.inputs={speed = 0.5, age = 0}")
    with pytest.raises(ValueError, match=told):
        run_study(scene_of(file, *changes, inputs=inputs))


def test_a_sugeno_system_asks_for_that_system_alone(tmp_path):
    write_rule_base(sugeno_of(SYSTEM), tmp_path / "own.fis")
    with pytest.raises(ValueError, match=r"^fuzzy\.systems: .* evaluated as sugeno: name no other"):
        run_study(scene_of(tmp_path / "own.fis"))


def test_readings_without_a_system_are_refused():
    with pytest.raises(SceneError, match=r"fuzzy\.inputs: has no effect without fuzzy\.rule_base"):
        read_scene("paper", ("fuzzy.inputs={speed = 1.7}",))
