"""Read scenes from TOML, check them, report every problem at once, and write them back."""

from __future__ import annotations

import dataclasses
import difflib
import shlex
import tomllib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args, get_origin, get_type_hints

from study.annotation.quantity import Quantity
from study.scene import Scene, SpringLaw
from study.scene.consistency import MESH_ONLY, Table, contradictions
from study.scene.error import SceneError
from study.scene.schema import SuitedKey
from study.scene.text import key_lines, parsed, read_text
from study.scene.unused import SHAPED, has_effect, unused

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

BUILT_IN = ("liver", "press", "block", "paper")
FILES = (("organ", "mesh"), ("fuzzy", "rule_base"))
"""Tables and their keys that name a file."""
SUITED: tuple[str, ...] = get_args(SuitedKey)
SEVERAL = {"support": "further_supports", "tool": "further_tools"}
"""Tables that a file may have several of, [[support]], and where those after the first stand."""
NUMBERED = {others: (name, 2) for name, others in SEVERAL.items()} | {
    name: (name, 1) for name in ("weight", "tissue.inclusion")
}
"""Lists of tables as they are read, and as they are written with the number of the first."""
LISTED = {*SEVERAL, "weight", "tissue.inclusion"}
"""Keys of lists of tables, of which each may be named by its number."""


def read_scene(name: str, overrides: Sequence[str] = ()) -> Scene:
    """Scene of a built-in name or a TOML path, with `table.key=value` overrides applied in order.

    Raises SceneError naming file, key, value and remedy.
    """
    _refuse_mesh(name)
    text, base = _load(name)
    table, lines = parsed(text, name), {} if name in BUILT_IN else key_lines(text)
    _refuse_internal_names(table, name, lines)
    _resolve_files(table, base)
    _split_lists(table)
    applied = [_apply(table, override) for override in overrides]
    given = set(applied)
    lines |= dict.fromkeys(given, 0)  # on no line
    _replace_organ(table, given)
    _resolve_files(table, Path.cwd())
    scene = _with_remarks_on_repeated_keys(validate(table, name, lines), applied)
    names = set(map(_as_written, _names(table)))
    if name in BUILT_IN:  # its own keys are for whatever the overrides make of it
        names = {key for key in names if any(f"{key}.".startswith(f"{one}.") for one in given)}
        return _suiting_the_rest(_with_remarks_on_idle_keys(scene, names), given)
    return _with_remarks_on_idle_keys(scene, names)


def _refuse_internal_names(table: Table, source: str, lines: Mapping[str, int]) -> None:
    """SceneError for the tables after the first by the name that they have in a Scene only."""
    found = [
        _placed(f"{others}: unknown key; write several as [[{name}]]", lines)
        for name, others in SEVERAL.items()
        if others in table
    ]
    if found:
        raise SceneError(_summary(source, found))


def _split_lists(table: Table) -> None:
    """[[tool]] as the first tool and the further ones, and so with supports."""
    for name, others in SEVERAL.items():
        found = table.get(name)
        if isinstance(found, list) and found and others not in table:
            table[name], *further = found
            if further:
                table[others] = further


def _join_lists(table: Table) -> None:
    """[[tool]] of the first tool and the further ones, if there are any, and so with supports."""
    for name, others in SEVERAL.items():
        further = table.pop(others, [])
        if further:
            table[name] = [table[name], *further]


def _replace_organ(table: Table, given: Collection[str]) -> None:
    """Drop what belongs to the organ of the file, where the overrides `given` put another one."""
    organ = table.get("organ")
    if not isinstance(organ, dict):
        return
    gone: set[str] = set()
    if "organ.mesh" in given:
        gone = {"shape", *SHAPED}
    elif "organ.shape" in given:
        others = (key for key, shape in SHAPED.items() if shape != organ["shape"])
        gone = {"mesh", "unit", "axes", "pieces", "suit", *others}
    for key in gone:
        if f"organ.{key}" not in given:
            organ.pop(key, None)


def _suiting_the_rest(scene: Scene, given: Collection[str]) -> Scene:
    """A built-in scene is made for its own organ: what is not overridden follows another one."""
    whole = {key.partition(".")[0] for key in given if "." not in key}
    if scene.organ.mesh is None or scene.organ.suit or "organ.suit" in given:
        return scene
    keys = (key for key in SUITED if key not in given and key.partition(".")[0] not in whole)
    suit = tuple(key for key in keys if has_effect(scene, key))
    return replace(scene, organ=replace(scene.organ, suit=cast(tuple[SuitedKey, ...], suit)))


def _with_remarks_on_repeated_keys(scene: Scene, applied: Sequence[str]) -> Scene:
    """The scene with a remark on each key that several overrides set; the last of them counts."""
    said = [
        f"{key}: set {n} times; the last counts" for key, n in Counter(applied).items() if n > 1
    ]
    return replace(scene, remarks=(*scene.remarks, *said))


def _with_remarks_on_idle_keys(scene: Scene, given: Collection[str]) -> Scene:
    """The scene with a remark on each of the `given` keys that has no effect in it.

    They are no error: a file may be run with other tools or supports by an override.
    """
    idle = [_as_written(".".join(map(str, keys))) for keys in unused(scene) if _is_set(scene, keys)]
    said = [f"{key}: has no effect in this scene" for key in idle if key in given]
    if scene.require is not None and "models" in given:
        said.append("models: has no effect beside require, whose plan chooses the model")
    return replace(scene, remarks=(*scene.remarks, *said))


def _names(table: Table, prefix: str = "") -> Iterator[str]:
    """Full names of all tables and keys of a table; entries of a list by their numbers from 0."""
    for key, value in table.items():
        name = f"{prefix}{key}"
        yield name
        entries = dict(enumerate(value)) if isinstance(value, list) else value
        if isinstance(entries, dict):
            yield from _names(entries, f"{name}.")


def _is_set(scene: Scene, keys: Sequence[str | int]) -> bool:
    """Whether a key of a table has another value than its default."""
    *tables, name = keys
    item: Any = scene
    for key in tables:
        item = item[key] if isinstance(key, int) else getattr(item, key)
    defaults = {f.name: f.default for f in dataclasses.fields(item)}
    return bool(tables) and getattr(item, str(name)) != defaults[str(name)]


def validate(table: Table, source: str, lines: Mapping[str, int] | None = None) -> Scene:
    """Scene of a parsed TOML table; SceneError lists all problems, `source` names the file.

    `lines`: numbers of the lines that give keys, which a message then names; 0 for no line.
    """
    from pydantic import TypeAdapter, ValidationError

    _split_lists(table)
    _match_case(table, ())
    try:
        scene = TypeAdapter(Scene).validate_python(table)
    except ValidationError as error:
        found = (_line(problem) for problem in error.errors(include_url=False))
        problems = sorted({_as_written(line) for line in found})
    else:
        problems = list(contradictions(scene, table))
    if problems:
        raise SceneError(_summary(source, [_placed(one, lines or {}) for one in problems]))
    return scene


def _match_case(table: Table, location: Sequence[str]) -> None:
    """Name the keys of a table as its fields are named, where they differ by case alone."""
    fields = set(_fields(location))
    for key in [key for key in table if key not in fields and key.lower() in fields]:
        if key.lower() not in table:
            table[key.lower()] = table.pop(key)
    for key, value in table.items():
        if isinstance(value, dict):
            _match_case(value, (*location, key))


def _as_written(problem: str) -> str:
    """A problem with a table of several, by the number that it has in the file, from 1."""
    for name, first in NUMBERED.items():
        prefix = f"{name}."
        if problem.startswith(prefix):
            number, separator, rest = problem.removeprefix(prefix).partition(".")
            if number.isdigit():
                written, count = first
                return f"{written}.{int(number) + count}{separator}{rest}"
    return problem


def _placed(problem: str, lines: Mapping[str, int]) -> str:
    """A problem with the line of its key, or of the nearest table or key round it."""
    key = problem.partition(":")[0]
    while key and key not in lines:
        key = key.rpartition(".")[0]
    return f"{problem} [line {lines[key]}]" if lines.get(key) else problem


def built_in_title(name: str) -> str:
    """Title of a built-in scene."""
    return str(parsed(_load(name)[0], name)["title"])


def write_scene(scene: Scene) -> str:
    """TOML text of the whole scene with its units; `read_scene` gives the same scene back."""
    import tomli_w

    return tomli_w.dumps(resolved(scene))


def resolved(scene: Scene) -> Table:
    """Plain table of every value in use, quantities as text with unit."""
    table = _plain(scene)
    for key in unused(scene):
        _remove(table, key)
    if scene.is_point:
        for key in MESH_ONLY:
            _remove(table, key)
    _join_lists(table)
    return table


def _refuse_mesh(name: str) -> None:
    """A mesh is no scene, but may be the organ of one."""
    ending = Path(name).suffix.lower()
    if not ending or ending == ".toml":
        return
    from study.mesh.load import ENDINGS

    if ending in ENDINGS:
        raise SceneError(
            f"{name}: is a mesh by its ending, and no scene; give it as the organ of one, for "
            f"example liver --set organ.mesh={shlex.quote(name)}"
        )


def _load(name: str) -> tuple[str, Path]:
    """Text of a scene, and the folder that a mesh is looked for in."""
    if name in BUILT_IN:
        file = resources.files("study.scene.built_in").joinpath(f"{name}.toml")
        return file.read_text(encoding="utf-8"), Path()
    path = Path(name)
    if not _is_file(path):
        near = difflib.get_close_matches(name, BUILT_IN, n=1)
        hint = f", did you mean {near[0]!r}?" if near else ""
        raise SceneError(
            f"{name}: neither a file nor a built-in scene ({', '.join(BUILT_IN)}){hint}"
        )
    return read_text(path), path.parent


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _resolve_files(table: Table, base: Path) -> None:
    """Make the paths of files relative to the scene file that names them."""
    for name, key in FILES:
        _resolve(table.get(name), key, base)
    tissue = table.get("tissue")
    if isinstance(tissue, dict):
        inclusions = tissue.get("inclusion")
        for one in inclusions if isinstance(inclusions, list) else []:
            _resolve(one, "mesh", base)
        _resolve(tissue.get("stiffness_map"), "file", base)


def _resolve(table: Any, key: str, base: Path) -> None:
    if isinstance(table, dict) and isinstance(table.get(key), str):
        table[key] = str((base / table[key]).absolute())


def _apply(table: Table, override: str) -> str:
    """Set what an override sets; its key."""
    path, separator, text = override.partition("=")
    keys = _matched([key.strip() for key in path.split(".")])
    if not separator or not all(keys):
        raise SceneError(f"--set {override}: write table.key=value, for example tool.force=1 N")
    for name, others in SEVERAL.items():
        if keys[0] == others:
            raise SceneError(
                f"--set {override}: unknown key; write several as {name}=[{{...}}, {{...}}], or "
                f"{name}.2.key=value for the second"
            )
    for depth, name in enumerate(keys[1:-1], 1):
        if name.isdigit() and ".".join(keys[:depth]) in LISTED:
            rest = ".".join(keys[depth + 1 :]) + separator + text
            return _apply_to_one(table, keys[:depth], int(name), rest)
    for depth, key in enumerate(keys[:-1]):
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise SceneError(f"--set {override}: {'.'.join(keys[: depth + 1])} is not a table")
    table[keys[-1]] = _value(text.strip())
    return ".".join(keys)


def _apply_to_one(table: Table, keys: Sequence[str], number: int, override: str) -> str:
    """Set what an override sets of one of several tables; its key."""
    name = ".".join(keys)
    found: Any = table
    for key in keys:
        found = found.get(key, {}) if isinstance(found, dict) else {}
    if name in SEVERAL:
        found = [table.setdefault(name, {}), *table.get(SEVERAL[name], [])]
    listed = found if isinstance(found, list) else []
    if not 1 <= number <= len(listed) or not isinstance(listed[number - 1], dict):
        raise SceneError(
            f"--set {name}.{number}: there is no such {keys[-1]}; the scene has {len(listed)}"
        )
    return f"{name}.{number}.{_apply(listed[number - 1], override)}"


def _matched(keys: Sequence[str]) -> list[str]:
    """Keys of a path as the fields are named from which they differ by case alone."""
    found: list[str] = []
    for key in keys:
        fields = _fields(found)
        found.append(key.lower() if key not in fields and key.lower() in fields else key)
    return found


def _value(text: str) -> object:
    """A TOML value if it is one, else the text itself, so that quotes may be left out."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def _line(problem: ErrorDetails) -> str:
    location = [str(part) for part in problem["loc"] if not str(part).startswith("function-")]
    key = ".".join(location)
    if problem["type"] in {"unexpected_keyword_argument", "extra_forbidden"}:
        near = difflib.get_close_matches(location[-1], _fields(location[:-1]), n=1)
        meant = " or ".join(map(repr, near or _elsewhere(location[-1])))
        return f"{key}: unknown key" + (f", did you mean {meant}?" if meant else "; remove it")
    message = problem["msg"].removeprefix("Value error, ").replace("Input should be", "should be")
    message = message.replace("a valid tuple", "a list").replace("a valid dictionary", "a table")
    match problem["type"]:
        case "missing":
            return f"{key}: missing; give it"
        case "too_long":
            limits = problem["ctx"]
            message = f"should have {limits['max_length']} entries, not {limits['actual_length']}"
        case "dataclass_type":
            message = "should be a table"
        case "tuple_type":
            tables = isinstance(problem["input"], dict)
            message = "should be a list, in square brackets, with text in quotes"
            message = f"write each as [[{key}]], in double brackets" if tables else message
    return f"{key}: {message} (got {_short(problem['input'])})"


def _short(value: object) -> str:
    text = repr(value) if not isinstance(value, int) or abs(value) < 10**18 else "a huge integer"
    return text if len(text) <= 60 else text[:57] + "..."


def _fields(location: Sequence[str]) -> list[str]:
    """Field names of the table at a location of the scene."""
    kind: Any = Scene
    for key in location:
        if key.isdigit():  # of one of a list of tables
            continue
        kind = _held(get_type_hints(kind).get(key)) if dataclasses.is_dataclass(kind) else None
        if get_origin(kind) is dict:
            return _place_fields()
        if kind is None:
            return _place_fields() if location[0] == "control_points" else []
    return [f.name for f in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []


def _held(hint: Any) -> Any:
    """The dataclass of a table that may be left out, or of each of a list, else the annotation."""
    tables = [option for option in get_args(hint) if dataclasses.is_dataclass(option)]
    return tables[0] if tables else hint


def _elsewhere(key: str) -> list[str]:
    """Full names of the keys of this name in the tables of a scene."""
    own = [f.name for f in dataclasses.fields(Scene) if f.name not in SEVERAL.values()]
    tables = {name: _fields([name]) for name in own}
    return [f"{table}.{key}" for table, keys in tables.items() if key in keys]


def _place_fields() -> list[str]:
    from study.scene import Place

    return [f.name for f in dataclasses.fields(Place)]


def _summary(source: str, lines: Sequence[str]) -> str:
    if len(lines) == 1:
        return f"{source}: {lines[0]}"
    return "\n  ".join([f"{source}: {len(lines)} problems", *lines])


def _remove(table: Any, keys: Sequence[str | int]) -> None:
    for key in keys[:-1]:
        table = table[key]
    table.pop(keys[-1], None)


def _plain(item: Any) -> Table:
    """Table of a dataclass without its empty entries."""
    hints = get_type_hints(type(item), include_extras=True)
    values = {f.name: getattr(item, f.name) for f in dataclasses.fields(item)}
    return {
        name: _plain_value(value, hints[name])
        for name, value in values.items()
        if value is not None
    }


def _plain_value(value: Any, hint: Any) -> Any:
    if isinstance(value, SpringLaw):
        return value.table()
    if dataclasses.is_dataclass(value):
        return _plain(value)
    if isinstance(value, dict):
        return {key: _plain_value(entry, None) for key, entry in value.items()}
    if isinstance(value, tuple):
        parts = _annotations(hint)
        return [_plain_value(v, parts) for v in value]
    quantity = next((part for part in _metadata(hint) if isinstance(part, Quantity)), None)
    if quantity is not None and quantity.unit:
        return quantity.text(value)
    return value


def _annotations(hint: Any) -> Any:
    """Annotation of a tuple's entries, through an optional."""
    for option in (hint, *get_args(hint)):
        if get_origin(option) is tuple:
            return get_args(option)[0]
    return None


def _metadata(hint: Any) -> tuple[Any, ...]:
    for option in (hint, *get_args(hint)):
        if get_origin(option) is Annotated:
            return tuple(option.__metadata__)
    return ()
