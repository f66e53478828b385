"""The report says of the ranking study what its tables hold, each column in its place."""

import pytest

from reports import ranking_study as told
from reports.reference_spacing import reference_spacing
from study.results.tables import write_table
from study.robustness import rows
from study.similarity.batch import COLUMNS
from tests.report_samples import results_of

FIRST, SECOND = COLUMNS[0], COLUMNS[4]
SYSTEMS = ("mamdani", "sugeno", "interval-type-2")


@pytest.fixture
def folder(tmp_path):
    """Tables in which no two numbers of a row are the same."""
    nearest = [
        rows.Nearest(
            *column, system, share + off, share + off - 0.02, share + off + 0.03, 0.07, 640
        )
        for column, off in ((FIRST, 0.0), (SECOND, 0.04))
        for system, share in zip(SYSTEMS, (0.11, 0.52, 0.23), strict=True)
    ]
    differences = [
        rows.Difference(
            *FIRST, "mamdani", "interval-type-2", -0.5, -0.25, 0.125, 0.3, 0.6, -0.0018, 0.71, 0.42
        )
    ]
    three = [rows.TableThree(*FIRST, 0.0123, 7, 2, 3, 5, 4, 6720)]
    indices = [
        rows.Index(*FIRST, output, name, 0.1, 0.0, 0.2, total, total - 0.1, total + 0.2)
        for output, scale in (("mamdani - interval-type-2", 1.0), ("sugeno", 0.1))
        for name, total in (("mass", 0.3 * scale), ("rest_length", 0.8 * scale))
    ]
    spacing = [
        rows.AtSpacing(h, 4e3, system, 9e3, *FIRST, score)
        for h, best in ((0.002, "sugeno"), (0.004, "mamdani"))
        for system, score in ((s, 0.9 if s == best else 0.4) for s in SYSTEMS)
    ]
    for name, kind, found in (
        (told.NEAREST, rows.Nearest, nearest),
        (told.DIFFERENCES, rows.Difference, differences),
        (told.TABLE_THREE, rows.TableThree, three),
        (told.INDICES, rows.Index, indices),
        (told.SPACING, rows.AtSpacing, spacing),
    ):
        write_table(tmp_path / f"{name}.csv", kind, found)
    return tmp_path


def test_every_column_of_the_tables_is_in_its_place(folder):
    found = told.ranking_study(folder)
    assert found["nearest"][0] == [
        "displacement, relative L2",
        "11.0 % (9.0–14.0)",
        "52.0 % (50.0–55.0)",
        "23.0 % (21.0–26.0)",
        "7.0 %",
    ]
    assert found["differences"] == [
        [
            "displacement, relative L2",
            "Mamdani − Interval type-2",
            *("−0.5000", "−0.2500", "0.1250", "0.3000", "0.6000", "−0.0018"),
            *("71.0 %", "42.0 %"),
        ]
    ]
    assert found["table_iii"] == [["displacement, relative L2", "0.0123", "2", "3", "5", "4"]]


def test_the_sentences_name_the_numbers_of_the_tables(folder):
    winners, apart, reproduced, movers, spacing = told.sentences(folder)
    assert "640 samples" in winners
    assert "23.0 % (displacement, relative L2) to 27.0 % (phase plane, Fréchet)" in winners
    assert "most often nearest is Sugeno, in 52.0 % to 56.0 %" in winners
    assert "differ by 0.0018. In 71.0 % to 71.0 %" in apart
    assert "2 of 6\u202f720 reproduce" in reproduced or "2 of 6 720 reproduce" in reproduced
    assert "smallest difference is 0.012" in reproduced
    assert "rest length 0.80 (0.70–1.00), mass 0.30 (0.20–0.50)" in movers
    assert "Sugeno from 2.0 to 2.0 mm" in spacing
    assert "Mamdani from 4.0 to 4.0 mm" in spacing


def test_the_findings_state_which_system_is_nearest_at_which_reference_spacing(folder):
    results = results_of()
    found = reference_spacing(results, folder)
    own = 1e3 * results.scene.damping.reference_spacing
    assert f"sets h₀ to {own:.1f} mm" in found
    assert "Sugeno is nearest by 1 of 1 measures at h₀ of 2.0 to 2.0 mm, Mamdani" in found
    assert "margins of the paper's ranking are 0.0018 and 0.0031" in found
    assert reference_spacing(results_of(["fem"]), folder) is None
    (folder / f"{told.SPACING}.csv").unlink()
    assert reference_spacing(results, folder) is None
