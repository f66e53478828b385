"""One file and one line add a model, an integrator, a law, a measure, a scene or a stability case.

Each is written as a user would, into a file of its own, and entered into its table. Then one scene
names them all, and every study takes them up. A column of the results is one field of its row, and
a section of the report one entry of its document.
"""

import importlib
import sys
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np
import pytest
import typst

from msm.integrators import INTEGRATORS
from msm.laws import LAWS
from reports import report
from reports.content import document
from reports.report import make_report
from study.known import suite
from study.known.request import tried
from study.known.stability.cases import user_scene
from study.models.table import MODELS
from study.results import Results, ResultsError, manifest, tables
from study.results.folder import write
from study.run.study import run_study
from study.scene.file import read_scene, write_scene
from study.similarity.score import MEASURES
from study.sweep.runner import Backend
from study.sweep.store import Store
from study.system.progress import Silent
from study.tradeoff import study as tradeoff
from study.tradeoff.contenders import configurations
from study.tradeoff.problem import sampled
from tests.conftest import SMALL
from tests.report_samples import without_arrays

MODEL = '''
"""A body without inertia: at every moment it is at rest under the load of that moment."""

from dataclasses import dataclass, replace

import numpy as np

from study.models.errors import estimated_run
from study.models.model import ModelKind, Simulation, Stepper
from study.models.table import model
from study.problem.trajectory import Trajectory


@dataclass(frozen=True)
class QuasiStatic:
    scene: object
    name: str = "toy"
    label: str = "Toy without inertia"

    def varied(self, **settings):
        return replace(self, **settings)

    def prepare(self, problem):
        return Prepared(self, problem, model(self.scene, "tissue").prepare(problem))


@dataclass(frozen=True)
class Prepared:
    model: QuasiStatic
    problem: object
    lattice: object
    critical_time_step: float = float("inf")

    def describe(self):
        return [f"{self.model.name}: no inertia"]

    def at(self, points):
        seen = replace(self.problem.observation, volume_points=points)
        return replace(self.lattice, problem=replace(self.problem, observation=seen)).rest()

    def simulate(self, longest=None):
        seen = self.problem.observation
        share = self.problem.factor(seen.times)
        moved = share[:, None, None] * self.at(seen.probes)
        frames = share[list(seen.frames), None, None]
        fields = (frames * self.at(points) for points in (seen.volume_points, seen.surface_points))
        velocity = np.gradient(moved, seen.times, axis=0)
        return Simulation(Trajectory(moved, velocity, *fields), float(seen.times[1]))

    def run(self, watch):
        return estimated_run(self.model, self, self.problem, watch)

    def rest(self):
        return self.at(self.problem.observation.volume_points)

    def stepper(self):
        rest = self.rest()
        return Stepper(lambda: self.problem.factor(np.zeros(1)) * rest, lambda: rest, 1 / 60, 3)


KIND = ModelKind(models=lambda scene, estimates: [QuasiStatic(scene)])
'''
INTEGRATOR = '''
"""Symplectic Euler that takes each step in two halves."""

import numpy as np

from msm.explicit import symplectic_euler
from msm.integrators import UNBOUNDED, Integrator


def advance(law, net, factors, dt, u, v):
    for row in factors:
        symplectic_euler(law, net, np.stack([row, row]), dt / 2, u, v)


TOY = Integrator(1, (1.0,), advance, 4.0, UNBOUNDED)
'''
LAW = '''
"""A spring that stiffens with the square of its strain."""

from typing import NamedTuple

from msm.laws import ForceLaw


class Cubic(NamedTuple):
    k: float
    a: float


def tension(law, strain):
    return law.k * (strain + law.a * strain**3)


def stiffness(law, strain):
    return law.k * (1.0 + 3.0 * law.a * strain**2)


def make(k: float, a: float) -> Cubic:
    if a < 0.0:
        raise ValueError("a: must not be negative")
    return Cubic(k, a)


TOY = ForceLaw(Cubic, tension, stiffness, lambda law: float("inf"), make)
'''
MEASURE = '''
"""How near the peaks are."""

import numpy as np

from study.similarity.score import Measure


def score(candidate, reference):
    return max(0.0, 1.0 - abs(np.abs(candidate).max() / np.abs(reference).max() - 1.0))


TOY = Measure("toy-peak", "max(0, 1 - |max|c| / max|r| - 1|)", score)
'''
FAMILY = '''
"""Cubes of numbers, one of which is expected wrong."""

from study.known.case import Family
from study.known.finding import value

FAMILY = Family("toy", __name__, quick=True)


def cases():
    yield FAMILY.case("cube of 2", "cube", {"x": 2.0, "expected": 8.0}, 1e-12)
    yield FAMILY.case("wrong cube", "cube", {"x": 2.0, "expected": 9.0}, 1e-12)
    yield FAMILY.case("no cube", "cube", {"x": -1.0, "expected": 0.0}, "must be positive")


def cube(x, expected):
    if x < 0.0:
        raise ValueError("x: must be positive")
    return value(expected, x**3)
'''
SCENE = (
    *SMALL,
    'models=["fem", "msm", "toy"]',
    'fuzzy.systems=["sugeno"]',
    "fuzzy.sensitivity_readings=0",
    "lattice.integrator=toy",
    'lattice.law={kind = "toy", a = 40.0}',
    "renders=false",
)


@pytest.fixture(scope="module")
def toys(tmp_path_factory):
    """The five files, each entered by one line into its table."""
    folder = tmp_path_factory.mktemp("toys")
    sources = {"model": MODEL, "integrator": INTEGRATOR, "law": LAW, "measure": MEASURE}
    sources |= {"family": FAMILY}
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        modules = {}
        for name, text in sources.items():
            (folder / f"toy_{name}.py").write_text(text)
            modules[name] = importlib.import_module(f"toy_{name}")
        patch.setitem(MODELS, "toy", "toy_model:KIND")
        patch.setitem(INTEGRATORS, "toy", modules["integrator"].TOY)
        patch.setitem(LAWS, "toy", modules["law"].TOY)
        measures = (*MEASURES["displacement"], modules["measure"].TOY)
        patch.setitem(MEASURES, "displacement", measures)
        patch.setattr(suite, "FAMILIES", (*suite.FAMILIES, "toy_family"))
        yield
    for name in sources:
        del sys.modules[f"toy_{name}"]


@pytest.fixture(scope="module")
def scene(toys, tmp_path_factory):  # noqa: ARG001 - with the tables as they are then
    """A scene in a file of its own, read by its path."""
    path = tmp_path_factory.mktemp("scene") / "toy.toml"
    named = replace(read_scene("block", SCENE), title="A scene of toys")
    path.write_text(write_scene(named))
    return read_scene(str(path))


@pytest.fixture(scope="module")
def folder(scene, tmp_path_factory):
    found = tmp_path_factory.mktemp("results")
    write(run_study(scene), found)
    return found


def test_a_toy_model_and_measure_are_in_the_tables(folder):
    curves, scores = ((folder / f"{n}.csv").read_text() for n in ("curves", "similarity"))
    assert "\ntoy,tool," in curves
    assert "\ntoy,fem,tool,displacement,toy-peak," in scores
    assert "\nmsm-sugeno,fem,tool,displacement,toy-peak," in scores


def test_they_are_in_the_pdf(folder):
    make_report(folder)
    assert Results.load(folder).record.title == "A scene of toys"
    assert (folder / "report.pdf").stat().st_size > 10_000
    text = str(document(Results.load(folder)))
    assert "Toy without inertia" in text
    assert "toy-peak" in text


def test_a_toy_integrator_and_law_move_the_lattice(folder):
    found = Results.load(folder).model("msm-sugeno")
    assert found.lattice.integrator == "toy"
    assert found.status == "finished"
    assert found.time_step_error.displacement < 0.01
    plain = run_study(read_scene("block", [s for s in SCENE if "toy" not in s or "models" in s]))
    stiffened = np.abs(Results.load(folder).curve("msm-sugeno", "tool").displacement).max()
    assert 1.0 < np.abs(plain.curve("msm-sugeno", "tool").displacement).max() / stiffened < 1.5


@pytest.mark.usefixtures("toys")
def test_a_toy_law_says_what_is_wrong_with_its_numbers():
    for law, said in (
        ('{kind = "toy", a = -1.0}', "must not be negative"),
        ('{kind = "toy", b = 1.0}', "unknown key"),
        ('{kind = "toy"}', "missing"),
    ):
        with pytest.raises(ValueError, match=said):
            read_scene("block", [*SCENE, f"lattice.law={law}"])


def test_the_toy_model_is_timed_by_the_tradeoff(scene, tmp_path):
    given = sampled(scene)
    chosen = configurations(given, ["toy"])
    assert [one.contender for one in chosen] == ["toy"]
    assert "toy" in {one.contender for one in configurations(given)}
    found = tradeoff.study(given, chosen, Store(tmp_path / "runs"), Backend(), 1, Silent())
    (entry,) = found.entries
    assert entry.errors.status == "resolved"
    assert entry.cost.timing.step[1] > 0.0


def test_the_toy_model_is_tried_by_the_stability_study(scene):
    cases = [case for case in user_scene.cases(scene) if case.name.startswith("toy")]
    assert len(cases) == len(user_scene.LOADS)
    finding = user_scene.moves(**cases[0].arguments)
    assert finding.ending == "value"
    assert finding.difference <= cases[0].tolerance


def test_the_toy_family_is_run_with_those_of_the_program(scene):
    cases = [case for case in suite.stability_cases(scene, quick=True) if case.family == "toy"]
    assert [case.name for case in cases] == ["cube of 2", "wrong cube", "no cube"]
    assert [tried(case, Silent()).passed for case in cases] == [True, False, True]


class Wider(NamedTuple):
    """A difference of the field, with a column that the program does not know."""

    model: str
    reference: str
    quantity: str
    value: float
    toy_m: float | None


@pytest.mark.usefixtures("toys")
def test_a_column_of_the_results_is_one_field_of_its_row(folder, tmp_path):
    results = Results.load(folder)
    (known,) = (table for table in tables.TABLES if table.file == "errors.csv")
    others = tuple(table for table in tables.TABLES if table is not known)
    rows = [Wider(*row, None if k % 2 else 0.5) for k, row in enumerate(results.field_differences)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("study.results.folder.TABLES", (*others, known._replace(kind=Wider)))
        write(replace(results, field_differences=tuple(rows)), tmp_path)
        assert (
            (tmp_path / "errors.csv").read_text().startswith("model,reference,quantity,value,toy_m")
        )
        assert Results.load(tmp_path).field_differences == tuple(rows)
    with pytest.raises(ResultsError, match=r"errors\.csv, line 1: columns .*toy_m, not"):
        Results.load(tmp_path)


@pytest.mark.parametrize("table", tables.TABLES, ids=lambda table: table.file)
def test_every_table_is_summed_up_and_held_by_the_results(table):
    assert table.file in manifest.DATA
    assert (table.file in manifest.ALWAYS) is not table.of_tools
    assert table.attribute in {field.name for field in fields(Results)}


def test_a_section_of_the_report_is_an_entry_and_a_block(monkeypatch):
    results, content, template = without_arrays(), report.document, report.template

    def longer(name=report.TEMPLATE):
        block = b"\n= Toys\n#items(data.toys)\n" if name == report.TEMPLATE else b""
        return template(name) + block

    monkeypatch.setattr(report, "template", longer)
    with pytest.raises(typst.TypstError, match="toys"):
        report.pdf(results)
    monkeypatch.setattr(report, "document", lambda results: content(results) | {"toys": ["one"]})
    assert report.pdf(results).startswith(b"%PDF")
