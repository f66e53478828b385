"""What `import fuzzy` gives."""

import ast
import doctest
import subprocess
import sys
from pathlib import Path

import pytest

import fuzzy

SOURCE = ast.parse(Path(fuzzy.__file__).read_text(encoding="utf-8"))


def test_the_example_runs():
    failed, attempted = doctest.testmod(fuzzy)
    assert (failed, attempted) == (0, 4)


def test_every_exported_name_is_there_and_is_what_types_are_checked_by():
    guarded = next(node for node in SOURCE.body if isinstance(node, ast.If))
    checked = {
        alias.name: node.module
        for node in guarded.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(checked) == sorted(fuzzy.__all__)
    for name, module in checked.items():
        __import__(module)
        assert getattr(fuzzy, name) is getattr(sys.modules[module], name)


def test_an_unknown_name_is_refused_as_by_any_module():
    with pytest.raises(AttributeError, match="module 'fuzzy' has no attribute 'estimates'"):
        fuzzy.estimates  # noqa: B018 # the look-up is what is tested


def test_the_face_loads_nothing_by_itself():
    code = "import sys, fuzzy\nprint(sorted({m.split('.')[0] for m in sys.modules} & {names}))"
    names = {"numpy", "numba", "scipy", "skfuzzy", "matplotlib"}
    done = subprocess.run(
        [sys.executable, "-c", code.replace("{names}", repr(names))],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "[]\n"
