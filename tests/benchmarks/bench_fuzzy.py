"""Time per evaluation of the liver's rules, ours beside other engines.

Run `pytest tests/benchmarks/bench_fuzzy.py`; engines that are not installed are left out. Not all
of them have two-sided Gaussians, so that all get plain ones at the same centres, and for type-2 the
uncertain spread that all have. The engines of a system take turns, and a ratio is the median over
those turns. ferrifuzz uses every core, the others one.
"""

import os
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import pytest
from skfuzzy.control import ControlSystemSimulation

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems import sugeno
from fuzzy.systems.compiled import compiled
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.scikit_fuzzy import to_skfuzzy
from fuzzy.systems.sets import Footprint, FuzzySet, core

ROWS = 100_000
TURNS = 7
SAMPLES = 101
SPREAD = 0.2
FOOTPRINT = Footprint(spread=SPREAD)


class Engine(NamedTuple):
    """`answers` to the first `rows` readings."""

    name: str
    rows: int
    answers: Callable[[np.ndarray], np.ndarray]


def plain(variable):
    """The variable with Gaussians at the centres of its two-sided ones."""

    def gaussian(one):
        centre = min(core(one), key=lambda end: not variable.low <= end <= variable.high)
        return FuzzySet(one.name, "gaussmf", (one.parameters[0], centre), FOOTPRINT)

    return replace(variable, sets=tuple(gaussian(one) for one in variable.sets))


LIVER = liver_system(LiverSettings(knowledge="severity"))
SYSTEM = replace(
    LIVER, inputs=tuple(plain(variable) for variable in LIVER.inputs), output=plain(LIVER.output)
)
# Where plain Gaussians fire.
X = np.random.default_rng(5).uniform(4.0, 40.0, (ROWS, 5))


def names(system, rule):
    """(input, set) of each antecedent, and the output set, by name."""
    terms = [(system.inputs[t.input], t.set) for t in rule.antecedents]
    return [(v.name, v.sets[s].name) for v, s in terms], system.output.sets[rule.consequent].name


def ours(kind, pruned=True):
    return compiled(SYSTEM, kind, InferenceOptions(samples=SAMPLES), pruned=pruned)


def scikit_fuzzy_columns(X):
    """Its batch: columns as inputs."""
    simulation = ControlSystemSimulation(to_skfuzzy(SYSTEM, SAMPLES))
    for i, variable in enumerate(SYSTEM.inputs):
        simulation.input[variable.name] = X[:, i].copy()
    simulation.compute()
    return simulation.output[SYSTEM.output.name]


def scikit_fuzzy_rows():
    simulation = ControlSystemSimulation(to_skfuzzy(SYSTEM, SAMPLES))
    simulation.cache = False  # or it would look up the answers of the turn before

    def answer(x):
        for variable, reading in zip(SYSTEM.inputs, x, strict=True):
            simulation.input[variable.name] = reading
        simulation.compute()
        return simulation.output[SYSTEM.output.name]

    return lambda X: np.array([answer(x) for x in X])


def ferrifuzz_system(kind):
    """Same sets and rules; as Sugeno with our constants, for it would take the peaks."""
    ff = pytest.importorskip("ferrifuzz")

    def mf(one):
        sd, centre = one.parameters
        if kind != "interval-type-2":
            return ff.mf.gaussian(centre, sd)
        wide, narrow = (ff.mf.gaussian(centre, sd * (1 + s)) for s in (SPREAD, -SPREAD))
        return ff.mf.it2(wide, narrow)

    method = "weighted_average" if kind == "sugeno" else "centroid"
    system = ff.FuzzySystem(resolution=SAMPLES - 1, defuzz_method=method)
    for variable in (*SYSTEM.inputs, SYSTEM.output):
        copy = ff.Variable(variable.name, variable.low, variable.high)
        for one in variable.sets:
            copy[one.name] = mf(one)
        (system.add_output if variable is SYSTEM.output else system.add_input)(copy)
    if kind == "sugeno":
        constants = sugeno.constants(SYSTEM, "matlab", SAMPLES)
        for one, value in zip(SYSTEM.output.sets, constants.tolist(), strict=True):
            system.add_consequent(SYSTEM.output.name, one.name, {}, value)
    for rule in SYSTEM.rules:
        conditions, consequent = names(SYSTEM, rule)
        system.add_rule(ff.Rule(conditions, (SYSTEM.output.name, consequent)))
    return system


def ferrifuzz_columns(kind):
    system = ferrifuzz_system(kind)

    def answers(X):
        columns = {one.name: column for one, column in zip(SYSTEM.inputs, X.T.copy(), strict=True)}
        return system.compute_batch(columns)[SYSTEM.output.name]

    return answers


def ferrifuzz_rows(kind):
    system = ferrifuzz_system(kind)
    return lambda X: np.array([system.evaluate(x)[0] for x in X.tolist()])


def pyit2fls():
    it2 = pytest.importorskip("pyit2fls")

    def sets(variable):
        universe = np.linspace(variable.low, variable.high, SAMPLES)
        shapes = [
            (*one.parameters[::-1], 2 * SPREAD * one.parameters[0], 1.0) for one in variable.sets
        ]
        return [it2.IT2FS_Gaussian_UncertStd(universe, list(shape)) for shape in shapes]

    system, output = it2.IT2FLS(), sets(SYSTEM.output)
    inputs = [sets(variable) for variable in SYSTEM.inputs]
    for variable in SYSTEM.inputs:
        system.add_input_variable(variable.name)
    system.add_output_variable("y")
    for rule in SYSTEM.rules:
        terms = [(SYSTEM.inputs[t.input].name, inputs[t.input][t.set]) for t in rule.antecedents]
        system.add_rule(terms, [("y", output[rule.consequent])])
    universe = np.linspace(SYSTEM.output.low, SYSTEM.output.high, SAMPLES)

    def answer(x):
        readings = {one.name: value for one, value in zip(SYSTEM.inputs, x, strict=True)}
        _, reduced = system.evaluate(
            readings, it2.min_t_norm, it2.max_s_norm, universe, algorithm="KM"
        )
        return it2.crisp(reduced["y"])

    return lambda X: np.array([answer(x) for x in X])


def numpy_engine(kind):
    options = InferenceOptions(samples=SAMPLES)
    return lambda X: SYSTEMS[kind].evaluate(SYSTEM, X, options).value


def engines(kind):
    """Ours first."""
    yield Engine("ours", ROWS, lambda X: ours(kind).evaluate(X).value)
    if kind != "sugeno":
        yield Engine("ours, all rules", ROWS, lambda X: ours(kind, pruned=False).evaluate(X).value)
    yield Engine("ours, numpy", 2000, numpy_engine(kind))
    if find_spec("ferrifuzz"):
        yield Engine("ferrifuzz", ROWS, ferrifuzz_columns(kind))
    if kind == "mamdani":
        yield Engine("scikit-fuzzy, columns", 2000, scikit_fuzzy_columns)
    if kind == "interval-type-2" and find_spec("pyit2fls"):
        yield Engine("PyIT2FLS", 20, pyit2fls())


def single_engines(kind):
    """One reading at a time, ours first."""
    one = ours(kind).one
    yield Engine("ours, one", 2000, lambda X: np.array([one(x).value for x in X.tolist()]))
    if find_spec("ferrifuzz"):
        yield Engine("ferrifuzz, one", 2000, ferrifuzz_rows(kind))
    if kind == "mamdani":
        yield Engine("scikit-fuzzy, one", 20, scikit_fuzzy_rows())


def timed(engine):
    """Microseconds per evaluation, and the answers."""
    rows = X[: engine.rows]
    start = time.perf_counter()
    answers = engine.answers(rows)
    return (time.perf_counter() - start) / len(rows) * 1e6, answers


def compared(kind, found):
    """Lines of the table: median time, median ratio to the first engine, distance from it."""
    wanted, *_ = (timed(engine)[1] for engine in found)  # all, so that all are warm
    turns = [[timed(engine) for engine in found] for _ in range(TURNS)]
    for i, engine in enumerate(found):
        each = np.array([turn[i][0] for turn in turns])
        ratio = np.median(each / [turn[0][0] for turn in turns])
        answers = turns[0][i][1]
        apart = np.abs(answers[: len(wanted)] - wanted[: len(answers)]).max()
        yield (
            f"{kind:16} {engine.name:22} {engine.rows:7d} {np.median(each):12.3f} {ratio:12.1f} "
            f"{apart:10.1e}"
        )


@pytest.fixture(autouse=True)
def _their_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        yield


@pytest.mark.parametrize("kind", ["mamdani", "sugeno", "interval-type-2"])
def test_ours(benchmark, kind):
    benchmark.extra_info["rows"] = ROWS
    model = ours(kind)
    assert np.isfinite(benchmark(model.evaluate, X).value).all()


@pytest.mark.parametrize("kind", ["mamdani", "sugeno", "interval-type-2"])
def test_one_call_of_ours(benchmark, kind):
    assert np.isfinite(benchmark(ours(kind).one, X[0].tolist()).value)


def test_ours_beside_the_others(capsys):
    lines = [
        f"{'system':16} {'engine':22} {'rows':>7} {'us each':>12} {'x ours':>12} {'kPa apart':>10}"
        f"   ({os.cpu_count()} cores, {SAMPLES} samples)"
    ]
    for kind in ("mamdani", "sugeno", "interval-type-2"):
        lines += compared(kind, list(engines(kind)))
        lines += compared(kind, list(single_engines(kind)))
    with capsys.disabled():
        sys.stdout.write("\n" + "\n".join(lines) + "\n")
