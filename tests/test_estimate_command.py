"""`liver-study estimate` and `rules`, as a person with a rule base of their own uses them."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems.conversion import type_1_of
from fuzzy.systems.files import read_rule_base, write_rule_base
from fuzzy.systems.inference import infer
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import Footprint, FuzzySet
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable
from study.estimation.answer import answer
from study.estimation.request import EstimationRequest

ROOT = Path(__file__).resolve().parent.parent


def tipper(footprint=0.0):
    """MATLAB's tipper, whose answers its documentation prints."""
    shift = Footprint(mean=footprint)
    service = Variable(
        "service",
        0,
        10,
        tuple(
            FuzzySet(name, "gaussmf", (1.5, c), shift)
            for name, c in (("poor", 0.0), ("good", 5.0), ("excellent", 10.0))
        ),
    )
    food = Variable(
        "food",
        0,
        10,
        (
            FuzzySet("rancid", "trapmf", (-2.0, 0.0, 1.0, 3.0), shift),
            FuzzySet("delicious", "trapmf", (7.0, 9.0, 10.0, 12.0), shift),
        ),
    )
    tip = Variable(
        "tip",
        0,
        30,
        tuple(
            FuzzySet(name, "trimf", (a, a + 5, a + 10), shift)
            for name, a in (("cheap", 0.0), ("average", 10.0), ("generous", 20.0))
        ),
    )
    rules = (
        Rule((Term(0, 0), Term(1, 0)), 0, "or"),
        Rule((Term(0, 1),), 1),
        Rule((Term(0, 2), Term(1, 1)), 2, "or"),
    )
    return FuzzySystem((service, food), tip, rules, name="tipper")


TABLE = "guest,food,service\nann,1,2\nbob,5,4\ncem,8,7\n"
PRINTED = ["7.0169", "14.4585", "20.3414"]


@pytest.fixture
def folder(tmp_path):
    write_rule_base(tipper(), tmp_path / "tipper.fis")
    write_rule_base(tipper(0.5), tmp_path / "tipper.json")
    (tmp_path / "in.csv").write_text(TABLE)
    return tmp_path


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_table_by_a_rule_base_of_ones_own(typed, folder):
    done = typed(
        *("estimate", "--rule-base", "tipper.fis", "--inputs", "in.csv"),
        *("--system", "mamdani", "--out", "out.csv"),
    )
    assert done.returncode == 0, done.stderr
    found = rows(folder / "out.csv")
    assert [row["guest"] for row in found] == ["ann", "bob", "cem"]
    assert [f"{float(row['estimate']):.4f}" for row in found] == PRINTED
    assert "lower" not in found[0]


@pytest.mark.parametrize(
    ("flags", "kind", "options"),
    [
        ([], "interval-type-2", {}),
        (["--reducer", "nie-tan"], "interval-type-2", {"reducer": "nie-tan"}),
        (["--sampling", "exact"], "mamdani", {"sampling": "exact"}),
        (["--sugeno-aggregation", "max"], "sugeno", {"sugeno_aggregation": "max"}),
    ],
)
def test_a_table_is_evaluated_as_the_flags_say(typed, folder, flags, kind, options):
    done = typed(
        *("estimate", "--rule-base", "tipper.json", "--inputs", "in.csv"),
        *("--system", kind, "--out", "out.csv", *flags),
    )
    assert done.returncode == 0, done.stderr
    X = np.array([[2.0, 1.0], [4.0, 5.0], [7.0, 8.0]])
    expected = infer(tipper(0.5), X, kind, InferenceOptions(**options))
    found = rows(folder / "out.csv")
    assert [float(row["estimate"]) for row in found] == expected.value.tolist()
    if kind == "interval-type-2":
        bounds = [[float(row["lower"]), float(row["upper"])] for row in found]
        assert bounds == expected.interval.tolist()


def test_a_reading_out_of_range_is_noted_with_its_line(typed, folder):
    (folder / "in.csv").write_text("food,service\n1,2\n11,2\n")
    arguments = (
        "estimate",
        "--rule-base",
        "tipper.fis",
        "--inputs",
        "in.csv",
        "--system",
        "sugeno",
    )
    done = typed(*arguments, "--out", "out.csv")
    assert "food: reading 11 (line 3) is outside 0-10; clamped to it" in done.stderr
    refused = typed(*arguments, "--out", "no.csv", "--out-of-range", "raise")
    assert refused.returncode == 2
    assert "line 3" in refused.stderr
    assert not (folder / "no.csv").exists()


def test_readings_are_those_of_a_rule_bases_inputs_by_name(typed, tmp_path):
    """MATLAB's tipper with other names: its printed answer for a service of 4 and a food of 5."""
    service, food = tipper().inputs
    named = replace(
        tipper(), inputs=(replace(service, name="hcv"), replace(food, name="ald")), name="own"
    )
    write_rule_base(named, tmp_path / "own.fis")
    given = ("estimate", "--rule-base", "own.fis", "--hcv", "4", "--ald", "5")
    first, *_ = typed(*given).stdout.splitlines()
    assert first.split() == ["mamdani", PRINTED[1]]
    found = json.loads(typed(*given, "--json", "--system", "interval-type-2").stdout)
    one = found["interval-type-2"]
    assert f"{one['estimate']:.4f}" == PRINTED[1]
    low, high = one["interval"]
    assert low <= one["estimate"] <= high
    for flags, said in (
        (given[:-2], "no reading of ald; give --ald; the inputs of own.fis are hcv, ald"),
        ((*given, "--hbv", "3"), "--hbv: the inputs of own.fis are hcv, ald; leave it out"),
        (given[:3], "--inputs FILE.csv; the inputs of own.fis are hcv, ald"),
        ((*given, "--figures", "drawn"), "--figures: only of the liver's rules"),
        ((*given, "--absent", "normal"), "--absent: shapes the liver's rules only"),
    ):
        refused = typed(*flags)
        assert refused.returncode == 2
        assert said in refused.stderr


@pytest.mark.usefixtures("folder")
def test_a_flag_of_the_liver_is_refused_beside_a_rule_base(typed):
    done = typed(
        *("estimate", "--rule-base", "tipper.fis", "--inputs", "in.csv", "--system", "mamdani"),
        *("--out", "out.csv", "--reading", "R2"),
    )
    assert done.returncode == 2
    assert "--reading: shapes the liver's rules only" in done.stderr


def test_explain_names_rules_sets_and_switch_points(typed):
    done = typed("estimate", "--hcv", "9.5", "--explain", "--knowledge", "severity")
    assert done.returncode == 0, done.stderr
    assert "if hcv is F4 then severe" in done.stdout
    assert "bounds switch at" in done.stdout
    assert "share" in done.stdout


@pytest.mark.usefixtures("folder")
def test_a_row_of_a_table_is_explained(typed):
    arguments = ("estimate", "--rule-base", "tipper.fis", "--inputs", "in.csv", "--explain")
    done = typed(*arguments, "--system", "mamdani", "--row", "3")
    assert done.returncode == 0, done.stderr
    assert "mamdani: 20.34" in done.stdout
    assert typed(*arguments, "--system", "mamdani", "--row", "4").returncode == 2


def test_rules_are_audited(typed):
    done = typed("rules", "--knowledge", "severity")
    assert done.returncode == 0, done.stderr
    assert "12 of 247 rules repeat an earlier rule" in done.stdout
    assert "236 of 247 rules change no answer" in done.stdout


def test_the_liver_is_written_as_sugeno_too(typed, tmp_path):
    done = typed(*("rules", "--knowledge", "severity", "--out", "liver.fis", "--sugeno"))
    assert done.returncode == 0, done.stderr
    assert "without footprints" in done.stdout
    assert read_rule_base(tmp_path / "liver.fis").is_sugeno


def test_a_table_with_a_reading_that_no_liver_has_is_refused(typed, tmp_path):
    (tmp_path / "in.csv").write_text("hcv,hbv,ald,cld,nafld\n9,4,4,4,4\n9500,4,4,4,4\n")
    arguments = ("estimate", "--inputs", "in.csv", "--system", "mamdani", "--out", "out.csv")
    done = typed(*arguments)
    assert done.returncode == 2
    assert "in.csv:3: hcv: 9500 cannot be; give 0.5 to 150 kPa" in done.stderr
    assert not (tmp_path / "out.csv").exists()


def test_a_missing_column_is_not_looked_for_under_another_disease(typed, tmp_path):
    (tmp_path / "in.csv").write_text("hcv [kPa],hbv,ald,cld,nafld\n9,4,4,4,4\n")
    arguments = ("estimate", "--inputs", "in.csv", "--system", "mamdani", "--out", "out.csv")
    done = typed(*arguments)
    assert done.returncode == 2
    assert "no column 'hcv'" in done.stderr
    assert "did you mean 'hbv'" not in done.stderr


@pytest.mark.parametrize("suffix", ["fis", "json"])
def test_the_liver_is_written_and_read_back(typed, tmp_path, suffix):
    done = typed("rules", "--knowledge", "severity", "--out", f"liver.{suffix}")
    assert done.returncode == 0, done.stderr
    liver, back = (
        liver_system(LiverSettings(knowledge="severity")),
        read_rule_base(tmp_path / f"liver.{suffix}"),
    )
    if suffix == "json":
        assert back == liver
    else:
        assert back == type_1_of(liver)


def test_figures_are_drawn_over_any_two_readings(typed, tmp_path):
    done = typed(
        *("estimate", "--hcv", "9.5", "--figures", "out", "--surface", "ald", "nafld"),
        *("--system", "mamdani"),
    )
    assert done.returncode == 0, done.stderr
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"sets.svg", "surfaces.svg", "rules-mamdani.svg"}


def test_a_request_without_readings_is_refused_with_what_to_give():
    with pytest.raises(ValueError, match=r"no reading is given: .* --hcv 9\.5, .* --absent normal"):
        answer(EstimationRequest())
