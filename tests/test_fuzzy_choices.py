"""What is chosen by name: the scene, the settings and the code go by the same tables."""

import subprocess
import sys
from dataclasses import fields
from importlib import import_module
from typing import get_args, get_type_hints

import numpy as np
import pytest

from fuzzy.liver.readings import READINGS
from fuzzy.liver.settings import CHOICES as LIVER_CHOICES
from fuzzy.liver.settings import LiverSettings
from fuzzy.systems import compiled, mamdani, options
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import OUT_OF_RANGE, InferenceOptions
from fuzzy.systems.quadrature import SAMPLINGS, Sampling
from fuzzy.systems.sets import FuzzySet
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable
from study.annotation.choice import Choice
from study.scene import Fuzzy
from study.scene.file import SceneError, read_scene


def choices():
    """Choices of every field of the scene's table, by field; those of a tuple's members too."""
    hints = get_type_hints(Fuzzy, include_extras=True)
    return {name: found for name, hint in hints.items() if (found := tuple(_choices(hint)))}


def _choices(hint):
    for part in (*getattr(hint, "__metadata__", ()), *get_args(hint)):
        if isinstance(part, Choice):
            yield part
        elif part is not Ellipsis:
            yield from _choices(part)


def defaults(name):
    value = getattr(Fuzzy(), name)
    return value if isinstance(value, tuple) else (value,)


def test_every_choice_of_the_scene_names_a_table_that_holds_its_default():
    found = choices()
    for name, declared in found.items():
        for choice in declared:
            assert set(defaults(name)) <= set(choice.names()), name
    texts = {one.name for one in fields(Fuzzy) if isinstance(defaults(one.name)[0], str)}
    assert texts - set(found) == {"reading"}  # refused with the reason why data cannot carry it
    assert Fuzzy().reading in READINGS


def test_scene_and_settings_go_by_the_same_tables():
    tables = options.CHOICES | LIVER_CHOICES
    for name in tables:
        module, _, table = choices()[name][0].table.partition(":")
        assert getattr(import_module(module), table) is tables[name]


def test_scene_and_settings_have_the_same_defaults():
    scene, chosen = Fuzzy(), LiverSettings()
    for name in options.CHOICES:
        assert getattr(scene, name) == getattr(chosen.options, name)
    for name in LIVER_CHOICES:
        assert getattr(scene, name) == getattr(chosen, name)


def test_a_wrong_choice_is_answered_with_those_there_are():
    for name, table in (options.CHOICES | LIVER_CHOICES).items():
        with pytest.raises(SceneError, match=f"fuzzy.{name}: should be ") as caught:
            read_scene("paper", [f"fuzzy.{name}=nonsense"])
        for key in table:
            assert repr(key) in str(caught.value)


def test_an_entry_of_a_table_is_a_choice_everywhere(monkeypatch):
    def simpson(samples):
        weights = np.full(samples, 2.0)
        weights[1::2], weights[[0, -1]] = 4.0, 1.0
        return weights

    with pytest.raises(SceneError):
        read_scene("paper", ["fuzzy.sampling=simpson"])
    monkeypatch.setitem(SAMPLINGS, "simpson", Sampling(simpson, "Simpson's rule over {samples}"))
    assert read_scene("paper", ["fuzzy.sampling=simpson"]).fuzzy.sampling == "simpson"
    # A parabola's flank, whole: Simpson's rule is exact where the two others are not.
    smooth = Variable("y", 0, 1, (FuzzySet("s", "smf", (0.0, 2.0)),))
    x = Variable("x", 0, 1, (FuzzySet("on", "trapmf", (-2.0, -1.0, 2.0, 3.0)),))
    system = FuzzySystem((x,), smooth, (Rule((Term(0, 0),), 0),))
    for kind in ("mamdani", "sugeno", "interval-type-2"):
        by_simpson = infer(system, [[0.5]], kind, InferenceOptions("simpson", 11))
        assert by_simpson.value == pytest.approx(0.75, abs=1e-14)
        assert "Simpson's rule over 11" in by_simpson.method
        other = infer(system, [[0.5]], kind, InferenceOptions("octave", 11)).value
        assert other != pytest.approx(0.75, abs=1e-4)


def test_kernels_support_every_kind():
    assert set(compiled.ONE_ROW) == set(SYSTEMS)


def test_a_policy_does_one_thing_with_a_reading_out_of_range():
    for name, policy in OUT_OF_RANGE.items():
        assert not (policy.clamps and policy.refuses), name
        assert policy.done


def test_a_kind_is_evaluated_by_its_entry(monkeypatch):
    x = Variable("x", 0, 1, (FuzzySet("on", "trapmf", (-2.0, -1.0, 2.0, 3.0)),))
    system = FuzzySystem((x,), x, (Rule((Term(0, 0),), 0),))
    before = infer(system, [[0.5]], "mamdani").value
    planted = SYSTEMS["mamdani"]._replace(
        evaluate=lambda *asked: mamdani.evaluate(*asked)._replace(value=np.array([7.0]))
    )
    monkeypatch.setitem(SYSTEMS, "mamdani", planted)
    assert before == pytest.approx(0.5)
    assert infer(system, [[0.5]], "mamdani").value == 7.0


def test_the_tables_are_light():
    tables = {choice.table for found in choices().values() for choice in found}
    heavy = "{'numba', 'scipy', 'pint', 'vtk', 'skfem', 'matplotlib', 'skfuzzy', 'networkx'}"
    code = (
        "import sys\nfrom study.annotation.choice import Choice\n"
        f"for table in {tables!r}:\n    assert Choice(table).names()\n"
        f"print({heavy} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
