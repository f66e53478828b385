"""Read scenes from TOML, check them, report every problem at once, and write them back."""

from __future__ import annotations

import dataclasses
import difflib
import math
import tomllib
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin, get_type_hints

from msm.calibration import SPRING_POISSON_RATIO
from study.quantity import Quantity
from study.scene import Lattice, Scene, SpringLaw

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

BUILT_IN = ("liver", "block", "paper")
MAX_BYTES = 65_536
MAX_LINE = 1_000
_ON_POINT = ("basafa", "msm")
_OWN_LAW = {"msm", "tissue"}  # lattices whose law and damping are those of the scene
# What a scene without a mesh cannot use.
_MESH_ONLY = (
    ("organ", "volume"),
    ("organ", "size"),
    ("support",),
    ("lattice",),
    ("reference",),
    ("superposition",),
    ("control_points",),
    ("renders",),
    ("tool", "place"),
    ("tool", "direction"),
    ("tool", "radius"),
    ("tissue", "poisson_ratio"),
    ("tissue", "density"),
)


class SceneError(ValueError):
    """A scene that cannot be used; the message lists every problem with its key and remedy."""


def read_scene(name: str, overrides: Sequence[str] = ()) -> Scene:
    """Scene of a built-in name or a TOML path, with `table.key=value` overrides applied.

    Raises SceneError naming file, key, value and remedy.
    """
    table, base = _load(name)
    _resolve_mesh(table, base)
    for override in overrides:
        _apply(table, override)
    _resolve_mesh(table, Path.cwd())
    return validate(table, name)


def validate(table: dict[str, Any], source: str) -> Scene:
    """Scene of a parsed TOML table; SceneError lists all problems, `source` names the file."""
    from pydantic import TypeAdapter, ValidationError

    try:
        scene = TypeAdapter(Scene).validate_python(table)
    except ValidationError as error:
        lines = sorted({_line(problem) for problem in error.errors(include_url=False)})
        raise SceneError(_summary(source, lines)) from None
    problems = list(_contradictions(scene, table))
    if problems:
        raise SceneError(_summary(source, problems))
    return scene


def built_in_title(name: str) -> str:
    """Title of a built-in scene."""
    return str(_load(name)[0]["title"])


def write_scene(scene: Scene) -> str:
    """TOML text of the whole scene with its units; `read_scene` gives the same scene back."""
    import tomli_w

    return tomli_w.dumps(resolved(scene))


def resolved(scene: Scene) -> dict[str, Any]:
    """Plain table of every value in use, quantities as text with unit."""
    table = _plain(scene)
    for key in _unused(scene):
        _remove(table, key)
    if scene.organ.shape == "point" and scene.organ.mesh is None:
        for key in _MESH_ONLY:
            _remove(table, key)
    return table


def _unused(scene: Scene) -> Iterator[tuple[str, ...]]:
    """Keys that mean nothing for the shape, history, springs and damping in use."""
    if scene.organ.mesh is not None:
        yield "organ", "shape"
    if scene.organ.mesh is not None or scene.organ.shape != "block":
        yield "organ", "size"
    if scene.organ.mesh is not None or scene.organ.shape != "liver":
        yield "organ", "volume"
    for key, kind in (
        ("ramp", "ramp-hold-release"),
        ("hold", "ramp-hold-release"),
        ("release", "ramp-hold-release"),
        ("frequency", "sinusoid"),
    ):
        if scene.tool.history.kind != kind:
            yield "tool", "history", key
    if scene.lattice.springs == "tetrahedra":
        for key in ("spacing", "flexion", "body_diagonals"):
            yield "lattice", key
    for key in ("mass", "stiffness") if scene.damping.kind == "eq-2" else ("ratio",):
        yield "damping", key
    if scene.reference.method != "modal":
        yield "reference", "modes"
    if "superposition" not in scene.models:
        yield ("superposition",)


def _load(name: str) -> tuple[dict[str, Any], Path]:
    if name in BUILT_IN:
        file = resources.files("study.scene.built_in").joinpath(f"{name}.toml")
        return tomllib.loads(file.read_text(encoding="utf-8")), Path()
    path = Path(name)
    if not path.is_file():
        near = difflib.get_close_matches(name, BUILT_IN, n=1)
        hint = f", did you mean {near[0]!r}?" if near else ""
        raise SceneError(
            f"{name}: neither a file nor a built-in scene ({', '.join(BUILT_IN)}){hint}"
        )
    return _parse(path), path.parent


def _parse(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    # The parser takes seconds over absurd keys and nestings that a scene never has.
    if len(data) > MAX_BYTES:
        raise SceneError(f"{path}: larger than {MAX_BYTES} bytes; a scene is a short text file")
    for number, line in enumerate(data.splitlines(), 1):
        if len(line) > MAX_LINE:
            raise SceneError(f"{path}, line {number}: longer than {MAX_LINE} bytes")
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # bad UTF-8, bad TOML, absurd numbers or nesting
        raise SceneError(f"{path}: not valid TOML: {error}") from None


def _resolve_mesh(table: dict[str, Any], base: Path) -> None:
    """Make a mesh path relative to the scene file that names it."""
    organ = table.get("organ")
    if isinstance(organ, dict) and isinstance(organ.get("mesh"), str):
        organ["mesh"] = str((base / organ["mesh"]).absolute())


def _apply(table: dict[str, Any], override: str) -> None:
    path, separator, text = override.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not separator or not all(keys):
        raise SceneError(f"--set {override}: write table.key=value, for example tool.force=1 N")
    for depth, key in enumerate(keys[:-1]):
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise SceneError(f"--set {override}: {'.'.join(keys[: depth + 1])} is not a table")
    table[keys[-1]] = _value(text.strip())


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
        return f"{key}: unknown key" + (f", did you mean {near[0]!r}?" if near else "; remove it")
    message = problem["msg"].removeprefix("Value error, ").replace("Input should be", "should be")
    if problem["type"] == "dataclass_type":
        message = "should be a table"
    return f"{key}: {message} (got {_short(problem['input'])})"


def _short(value: object) -> str:
    text = repr(value) if not isinstance(value, int) or abs(value) < 10**18 else "a huge integer"
    return text if len(text) <= 60 else text[:57] + "..."


def _fields(location: Sequence[str]) -> list[str]:
    """Field names of the table at a location of the scene."""
    kind: Any = Scene
    for key in location:
        kind = get_type_hints(kind).get(key) if dataclasses.is_dataclass(kind) else None
        if get_origin(kind) is dict:
            return _place_fields()
        if kind is None:
            return _place_fields() if location[0] == "control_points" else []
    return [f.name for f in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []


def _place_fields() -> list[str]:
    from study.scene import Place

    return [f.name for f in dataclasses.fields(Place)]


def _summary(source: str, lines: Sequence[str]) -> str:
    return "\n  ".join([f"{source}: {len(lines)} problem(s)", *lines])


def _contradictions(scene: Scene, table: dict[str, Any]) -> Iterator[str]:
    """What is wrong between keys that are each right."""
    if not scene.models:
        yield "models: empty; name at least one of fem, basafa, msm"
    if len(set(scene.models)) < len(scene.models):
        yield "models: a model is named twice"
    if "msm" in scene.models and not scene.fuzzy.systems:
        yield "fuzzy.systems: empty; name a system or leave msm out of models"
    if len(set(scene.fuzzy.systems)) < len(scene.fuzzy.systems):
        yield "fuzzy.systems: a system is named twice"
    if len(set(scene.fuzzy.surface)) < len(scene.fuzzy.surface):
        yield "fuzzy.surface: names one reading twice; name two different ones"
    if scene.fuzzy.sampling == "exact" and "samples" in table.get("fuzzy", {}):
        yield "fuzzy.samples: has no effect with exact sampling; remove it"
    if scene.reference.method != "modal" and "modes" in table.get("reference", {}):
        yield "reference.modes: only the method modal takes it; remove it"
    yield from _lattice_contradictions(scene, table)
    yield from _damping_contradictions(scene, table)
    if scene.organ.mesh is None and scene.organ.unit is not None:
        yield "organ.unit: has no effect without organ.mesh; remove it"
    for name, place in [("tool.place", scene.tool.place), *_named_points(scene)]:
        if not _one_way(place):
            yield f"{name}: give either side and at, or fraction, or point"
    yield from _tool_contradictions(scene)
    yield from _unseen_load(scene)
    if scene.organ.shape == "point" and scene.organ.mesh is None:
        yield from _point_contradictions(scene, table)
    elif scene.organ.mass is not None:
        yield "organ.mass: only a point has a mass of its own; use tissue.density"


def _lattice_contradictions(scene: Scene, table: dict[str, Any]) -> Iterator[str]:
    lattice, nu = scene.lattice, scene.tissue.poisson_ratio
    if lattice.springs == "tetrahedra":
        yield from _mesh_springs_contradictions(lattice, table)
    if lattice.law is not None:
        yield from _law_contradictions(scene, lattice.law)
    if lattice.volume_term and nu < SPRING_POISSON_RATIO:
        yield (
            f"lattice.volume_term: needs tissue.poisson_ratio of {SPRING_POISSON_RATIO} or more, "
            f"not {nu:g}; leave it out or raise the ratio"
        )
    if _has(table, ("lattice", "integrator")):
        yield from _integrator_contradictions(scene)
    if lattice.time_step is not None and lattice.step_rate is not None:
        yield "lattice.time_step: contradicts lattice.step_rate; give one of them"


def _integrator_contradictions(scene: Scene) -> Iterator[str]:
    from msm.integrators import INTEGRATORS

    lattice = scene.lattice
    name, method = lattice.integrator, INTEGRATORS[lattice.integrator]
    if method.implicit_volume and not lattice.volume_term:
        yield f"lattice.integrator: {name} needs lattice.volume_term; set it to true"
    if method.linear_only and "basafa" in scene.models:
        yield (
            f"lattice.integrator: {name} takes linear springs only; leave basafa out of models or "
            "choose another integrator"
        )
    if method.linear_only and lattice.law is not None and not lattice.law.is_linear:
        yield (
            f"lattice.law: {name} takes linear springs only; remove it or change lattice.integrator"
        )
    own_law = _OWN_LAW & set(scene.models)
    if scene.damping.stiffness > 0.0 and own_law and not method.stiffness_damping:
        yield (
            f"damping.stiffness: {name} has only the mass part of Rayleigh damping; set it to 0, "
            "or lattice.integrator to symplectic-euler"
        )


def _mesh_springs_contradictions(lattice: Lattice, table: dict[str, Any]) -> Iterator[str]:
    if lattice.volume_term:
        yield (
            "lattice.volume_term: springs on tetrahedra have none; leave it out or set "
            "lattice.springs to lattice"
        )
    for key in ("flexion", "body_diagonals"):
        if _has(table, ("lattice", key)):
            yield f"lattice.{key}: has no effect on springs along a mesh; remove it"


def _law_contradictions(scene: Scene, law: SpringLaw) -> Iterator[str]:
    if not _OWN_LAW & set(scene.models):
        yield (
            "lattice.law: only springs tuned by an estimate, or of the tissue, follow it; add msm "
            "or tissue to models, or remove it"
        )
    if scene.lattice.volume_term and not _is_unity_at_rest(law):
        yield (
            "lattice.law: with lattice.volume_term the springs must start as linear ones, with a "
            "relative tension equal to their strain on both sides of 0, or they lack the shear "
            "modulus that the term completes; change the law or leave the term out"
        )


def _is_unity_at_rest(law: SpringLaw) -> bool:
    """Whether springs of the law start as linear ones, to either side."""
    from msm.laws import stiffness_at_rest

    return all(math.isclose(slope, 1.0) for slope in stiffness_at_rest(law.make(1.0)))


def _damping_contradictions(scene: Scene, table: dict[str, Any]) -> Iterator[str]:
    damping = scene.damping
    given = [key for key in ("mass", "stiffness") if _has(table, ("damping", key))]
    if damping.kind == "eq-2":
        for key in given:
            yield (
                f"damping.{key}: has no effect on the damping of eq. (2); set damping.kind to "
                "rayleigh or remove it"
            )
        return
    if not given:
        yield "damping.kind: rayleigh needs damping.mass, damping.stiffness or both; give them"


def _tool_contradictions(scene: Scene) -> Iterator[str]:
    if scene.tool.direction is not None and not any(scene.tool.direction):
        yield "tool.direction: a zero vector has no direction"
    if (
        scene.tool.history.kind == "ramp-hold-release"
        and scene.tool.history.ramp == 0.0
        and scene.tool.history.hold == 0.0
    ):
        yield "tool.history: ramp and hold are both zero; nothing is ever loaded"
    history, time = scene.tool.history, scene.time
    if history.kind == "sinusoid" and 8 * history.frequency * time.duration > time.samples:
        needed = math.ceil(8 * history.frequency * time.duration)
        yield f"time.samples: a sinusoid needs 8 samples a period, here {needed}"


def _unseen_load(scene: Scene) -> Iterator[str]:
    """A load that comes and goes between samples would leave no trace of itself."""
    history, time = scene.tool.history, scene.time
    if history.kind != "ramp-hold-release":
        return
    loaded = min(history.ramp + history.hold + history.release, time.duration)
    if 8 * time.duration > (time.samples - 1) * loaded > 0.0:
        needed = math.ceil(8 * time.duration / loaded) + 1
        yield f"time.samples: a load of {loaded:g} s needs 8 samples in it, here {needed}"


def _point_contradictions(scene: Scene, table: dict[str, Any]) -> Iterator[str]:
    for name in scene.models:
        if name not in _ON_POINT:
            yield f"models: {name} needs an organ with a mesh; a point has none"
    if scene.organ.mass is None and scene.damping.ratio * scene.basafa.gamma_0 == 0.0:
        yield (
            "organ.mass: cannot follow from eq. (2) without damping; give it, or set "
            "damping.ratio and basafa.gamma_0 above zero"
        )
    if scene.damping.kind == "rayleigh":
        yield "damping.kind: a single point has the damping of eqs. (2) and (9) only; remove it"
    for key in _MESH_ONLY:
        if _has(table, key):
            yield f"{'.'.join(key)}: has no effect on a single point; remove it"


def _named_points(scene: Scene) -> list[tuple[str, Any]]:
    return [(f"control_points.{name}", place) for name, place in scene.control_points.items()]


def _one_way(place: Any) -> bool:
    ways = [place.side is not None, place.fraction is not None, place.point is not None]
    return sum(ways) == 1 and (place.side is None) == (place.at is None)


def _has(table: dict[str, Any], keys: Sequence[str]) -> bool:
    for key in keys:
        if not isinstance(table, dict) or key not in table:
            return False
        table = table[key]
    return True


def _remove(table: dict[str, Any], keys: Sequence[str]) -> None:
    for key in keys[:-1]:
        table = table[key]
    table.pop(keys[-1], None)


def _plain(item: Any) -> dict[str, Any]:
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
