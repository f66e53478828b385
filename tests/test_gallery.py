"""Each script of the gallery runs as it stands, and ends with the number that it shows."""

import runpy
from pathlib import Path

import pytest

GALLERY = Path(__file__).resolve().parent.parent / "docs" / "gallery"
ANSWERS = {
    "finite_elements": (0.90348123, 1e-6),
    "fuzzy_estimate": (9081.2318, 1e-6),
    "lattice_under_load": (2.45627097, 1e-6),
    "own_rule_base": (9.48762299, 1e-6),
    "results_to_plot": (0.42909696, 1e-6),
    "tradeoff_of_two": (0.04481327, 1e-6),
}
"""What each answers, and how closely."""


def test_every_script_is_held():
    assert {path.stem for path in GALLERY.glob("*.py")} == set(ANSWERS)


# scikit-fuzzy calls numpy in a way that is to go.
@pytest.mark.filterwarnings("ignore:Passing more than 2 positional:DeprecationWarning")
@pytest.mark.parametrize("name", ANSWERS)
def test_a_script_gives_its_answer(name, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    value, tolerance = ANSWERS[name]
    found = runpy.run_path(str(GALLERY / f"{name}.py"))["answer"]
    assert found == pytest.approx(value, rel=tolerance)
