"""Fuzzy systems in files: MATLAB's `.fis` or JSON, by suffix."""

from pathlib import Path

from fuzzy.systems.fis_file import read_fis, write_fis
from fuzzy.systems.json_file import read_json, write_json
from fuzzy.systems.system import FuzzySystem


def read_rule_base(path: Path) -> FuzzySystem:
    """Read the fuzzy system of a `.fis` or `.json` file.

    ValueError naming file, line or place, and remedy.
    """
    return read_fis(path) if _is_fis(path) else read_json(path)


def write_rule_base(system: FuzzySystem, path: Path) -> None:
    """Write the system in the format of the suffix; ValueError if a `.fis` file cannot hold it."""
    if _is_fis(path):
        write_fis(system, path)
    else:
        write_json(system, path)


def _is_fis(path: Path) -> bool:
    suffix = path.suffix.lower()
    if suffix not in (".fis", ".json"):
        raise ValueError(f"{path}: a rule base is a .fis or a .json file; name one of these")
    return suffix == ".fis"
