"""Blank cells of a table of readings: what one patient's missing reading means, row by row."""

import csv

import numpy as np
import pytest

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import PA_PER_KPA, estimate
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.files import write_rule_base
from study.estimation.answer import answer
from study.estimation.request import EstimationRequest

PATIENTS = (
    {"hcv": 9.5, "hbv": 7.0},
    {"hcv": 9.5},
    {"hcv": 6.0, "hbv": 5.0, "ald": 8.0, "cld": 12.0, "nafld": 7.5},
    {"hbv": 8.0, "hcv": 5.5},
    {"nafld": 20.0, "cld": 11.0, "ald": 4.1},
)


@pytest.fixture
def table(tmp_path):
    """Writes readings as a table with a column more; blank where there is none."""

    def write(patients=PATIENTS, delimiter=","):
        path = tmp_path / "in.csv"
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, ("id", *AETIOLOGIES), restval="", delimiter=delimiter)
            writer.writeheader()
            writer.writerows({"id": i, **one} for i, one in enumerate(patients))
        return path

    return write


def asked(path, system, absent, **more):
    more.setdefault("out", path.parent / "out.csv")
    return answer(
        EstimationRequest(inputs=path, systems=(system,), settings={"absent": absent}, **more)
    )


def estimates(path):
    with path.open(newline="") as file:
        return [float(row["estimate"]) for row in csv.DictReader(file)]


@pytest.mark.parametrize("absent", ["normal", "silent"])
@pytest.mark.parametrize("system", ["mamdani", "sugeno", "interval-type-2"])
def test_every_row_is_answered_as_the_patient_alone(table, system, absent):
    path = table()
    said = asked(path, system, absent)
    settings = LiverSettings(absent=absent)
    alone = [
        estimate({k: PA_PER_KPA * v for k, v in one.items()}, system, settings).estimate
        for one in PATIENTS
    ]
    found = PA_PER_KPA * np.array(estimates(path.parent / "out.csv"))
    assert found == pytest.approx(alone, rel=1e-12)
    done = {"normal": "normal liver's", "silent": "rules on a disease without one are left out"}[
        absent
    ]
    assert len(said.notes) == len(AETIOLOGIES)
    assert all(done in note for note in said.notes)
    assert said.notes[0].startswith("hcv: no reading (line 6); ")
    assert said.notes[2].startswith("ald: no reading (line 2 and 2 more); ")


def test_both_meanings_differ(table):
    path = table()
    found = []
    for absent in ("normal", "silent"):
        asked(path, "sugeno", absent)
        found.append(estimates(path.parent / "out.csv"))
    assert found[0][2] == pytest.approx(found[1][2], rel=1e-12)  # the patient with all readings
    assert abs(found[0][0] - found[1][0]) > 0.1


def test_lines_of_a_group_are_those_of_the_table(table):
    path = table([{"hcv": 9.5}, PATIENTS[2], {"hcv": 80.0}, {"hbv": 9.0}, {"hcv": 90.0}])
    said = asked(path, "sugeno", "silent")
    outside = [note for note in said.notes if "is outside" in note]
    assert len(outside) == 1
    assert outside[0].startswith("hcv: reading 80 kPa (line 4 and 1 more) is outside")


def test_a_row_that_no_rule_can_answer_is_refused_with_its_line(table):
    path = table([PATIENTS[2], {"hcv": 9.5}])
    with pytest.raises(ValueError, match=r"in\.csv:3: reading .* has no rule on hcv alone"):
        answer(
            EstimationRequest(
                inputs=path,
                out=path.parent / "out.csv",
                systems=("sugeno",),
                settings={"knowledge": "severity", "absent": "silent", "reading": "R4-drop"},
            )
        )


def test_a_row_with_blanks_is_explained_by_its_own_system(table):
    path = table()
    for absent in ("normal", "silent"):
        said = asked(path, "mamdani", absent, out=None, explain=True, row=2)
        alone = answer(
            EstimationRequest(
                readings={"hcv": 9.5},
                systems=("mamdani",),
                settings={"absent": absent},
                explain=True,
            )
        )
        assert said.lines == alone.lines[1:]


def test_a_user_rule_base_accepts_no_blanks(table, tmp_path):
    write_rule_base(liver_system(LiverSettings()), tmp_path / "own.json")
    request = EstimationRequest(
        inputs=table(),
        out=tmp_path / "out.csv",
        systems=("sugeno",),
        rule_base=tmp_path / "own.json",
    )
    with pytest.raises(ValueError, match=r"in\.csv:2: ald: the cell is empty; give a number"):
        answer(request)


def test_a_row_without_any_reading_is_a_normal_liver(table):
    path = table([{"hcv": 9.5}, {}])
    asked(path, "mamdani", "normal")
    normal = estimate({}, "mamdani", LiverSettings(absent="normal")).estimate / PA_PER_KPA
    assert estimates(path.parent / "out.csv")[1] == pytest.approx(normal, rel=1e-12)


def test_blanks_and_decimal_commas_go_together(tmp_path):
    path = tmp_path / "in.csv"
    path.write_bytes("\ufeffhcv;hbv;ald;cld;nafld\r\n9,5;7;;;\r\n;;;;\r\n".encode())
    asked(path, "mamdani", "normal")
    header, row = (tmp_path / "out.csv").read_text().splitlines()
    assert header == "hcv;hbv;ald;cld;nafld;estimate"
    settings = LiverSettings(absent="normal")
    alone = estimate({"hcv": 9500.0, "hbv": 7000.0}, "mamdani", settings).estimate / PA_PER_KPA
    assert float(row.split(";")[-1].replace(",", ".")) == pytest.approx(alone, rel=1e-12)


def test_a_row_of_blanks_between_others_is_not_lost(table):
    """It is a patient without any reading, whose answer must not become that of the next."""
    path = table([{"hcv": 9.5}, {}, {"hcv": 20.0}])
    text = path.read_text().replace("1,,,,,", ",,,,,")
    path.write_text(text)
    asked(path, "mamdani", "normal")
    found = estimates(path.parent / "out.csv")
    assert len(found) == 3
    assert found[0] < found[2]
    with pytest.raises(ValueError, match=r"in\.csv:3: .*no aetiology"):
        asked(path, "mamdani", "silent")


def test_a_column_that_is_missing_is_asked_for_with_blank_cells(tmp_path):
    (tmp_path / "in.csv").write_text("hcv,nafld\n9.5,7\n")
    with pytest.raises(ValueError, match=r"no column 'hbv' .* blank cells where there is no read"):
        asked(tmp_path / "in.csv", "sugeno", "normal")
