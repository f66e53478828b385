"""What `import msm` offers, and that it costs nothing until it is used."""

import doctest
import importlib
import subprocess
import sys

import pytest

import msm


def test_the_example_of_the_package_runs_as_it_says():
    found = doctest.testmod(msm)
    assert (found.failed, found.attempted > 5) == (0, True)


@pytest.mark.parametrize("name", msm.__all__)
def test_what_the_package_names_is_there_and_says_what_it_is(name):
    assert getattr(msm, name) is not None
    assert getattr(msm, name).__doc__


def test_what_is_offered_is_what_its_modules_have():
    """Negative control: a name that is not offered is an error, as in any module."""
    assert msm.run is importlib.import_module("msm.model").run
    assert msm.piecewise is importlib.import_module("msm.laws").piecewise
    with pytest.raises(AttributeError, match="no attribute 'largest_frequency'"):
        _ = msm.largest_frequency


@pytest.mark.parametrize(
    ("statement", "compiles"),
    [
        ("import msm.calibration", False),
        ("from study.scene.file import read_scene; read_scene('liver')", False),
        ("import msm; msm.run", True),
    ],
)
def test_numba_is_imported_by_what_needs_it_only(statement, compiles):
    asked = f"import sys; {statement}; print('numba' in sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, check=True, text=True
    )
    assert found.stdout == f"{compiles}\n"


def test_a_point_is_run_without_finite_elements():
    asked = (
        "import sys; from study.run.study import run_study;"
        "from study.scene.file import read_scene;"
        "run_study(read_scene('paper', ['fuzzy.sensitivity_readings=0']));"
        "print(sorted({'skfem', 'vtk', 'matplotlib', 'pyamg', 'meshio'} & set(sys.modules)))"
    )
    found = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, check=True, text=True
    )
    assert found.stdout == "[]\n"
