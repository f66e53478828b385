"""Contradictions between keys of a scene that are each valid."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from msm.calibration import SPRING_POISSON_RATIO
from study.annotation.choice import Choice
from study.problem.features import FEATURES, refuse_beside_one_load
from study.problem.rigid import SLIDING
from study.scene import graded
from study.scene.law import SpringLaw
from study.scene.schema import Inclusion, Lattice, Require, Scene, Tool, Waypoint
from study.scene.unused import LIVER_ONLY, SHAPED, has_effect

if TYPE_CHECKING:
    from study.models.model import ModelKind

MODELS = Choice("study.models.table:MODELS")
SHORTEST_DIRECTION = 1e-6
"""Length below which a vector has no direction; the square of 1e-200 would be zero."""
Table = dict[str, Any]
"""A parsed table of TOML, not yet checked."""
# What a scene without a mesh cannot use.
MESH_ONLY = (
    ("organ", "volume"),
    ("organ", "size"),
    ("support",),
    ("further_supports",),
    ("lattice",),
    ("reference",),
    ("superposition",),
    ("corrected",),
    ("region",),
    ("control_points",),
    ("renders",),
    ("tool", "place"),
    ("tool", "direction"),
    ("tool", "radius"),
    ("tool", "shape"),
    ("tool", "displacement"),
    ("tool", "path"),
    ("tool", "clearance"),
    ("tool", "contact"),
    ("tool", "friction"),
    ("gravity",),
    ("weight",),
    ("tissue", "poisson_ratio"),
    ("tissue", "density"),
    ("tissue", "inclusion"),
    ("tissue", "stiffness_map"),
)


def contradictions(scene: Scene, table: Table) -> Iterator[str]:
    """Contradictions between keys that are each valid, a line each with the remedy."""
    yield from _model_contradictions(scene)
    if len(set(scene.fuzzy.systems)) < len(scene.fuzzy.systems):
        yield "fuzzy.systems: a system is named twice"
    if len(set(scene.fuzzy.surface)) < len(scene.fuzzy.surface):
        yield "fuzzy.surface: names one reading twice; name two different ones"
    if scene.fuzzy.sampling == "exact" and "samples" in table.get("fuzzy", {}):
        yield "fuzzy.samples: has no effect with exact sampling; remove it"
    yield from _unknown_reading(scene)
    if scene.reference.method != "modal" and "modes" in table.get("reference", {}):
        yield "reference.modes: only the method modal takes it; remove it"
    yield from _lattice_contradictions(scene, table)
    yield from _damping_contradictions(scene, table)
    yield from _mesh_contradictions(scene, table)
    yield from _rule_base_contradictions(scene, table)
    for name in scene.control_points:
        if not name.strip() or not name.isprintable():
            yield f"control_points: {name!r} is no name; give one of printable characters"
    for name, place in [*_named_points(scene), *_places_of_weights(scene)]:
        if not _one_way(place):
            yield f"{name}: give either side and at, or fraction, or point"
    for number, tool in enumerate(scene.tools, 1):
        name = "tool" if number == 1 else f"tool.{number}"
        yield from _tool_contradictions(scene, name, tool)
    yield from _idle_contradictions(scene)
    yield from _gravity_contradictions(table)
    yield from _support_contradictions(scene)
    yield from _inclusion_contradictions(scene)
    yield from _feature_contradictions(scene)
    yield from _contact_contradictions(scene)
    if scene.require is not None:
        yield from _require_contradictions(scene, scene.require)
    if scene.is_point:
        yield from _point_contradictions(scene, table)
    elif scene.organ.mass is not None:
        yield "organ.mass: only a point has a mass of its own; use tissue.density"


def _unknown_reading(scene: Scene) -> Iterator[str]:
    """A reading of Table I that there is not, or not with the sets of this placement."""
    from fuzzy.liver.settings import LiverSettings

    try:
        LiverSettings(reading=scene.fuzzy.reading, placement=scene.fuzzy.placement)
    except ValueError as error:
        yield f"fuzzy.{error}"


def _rule_base_contradictions(scene: Scene, table: Table) -> Iterator[str]:
    """A fuzzy system of one's own has its own sets and rules, and its own readings."""
    if scene.fuzzy.rule_base is None:
        for key in ("inputs", "unit"):
            if _has(table, ("fuzzy", key)):
                yield f"fuzzy.{key}: has no effect without fuzzy.rule_base; remove it"
        return
    if not scene.fuzzy.inputs:
        yield "fuzzy.inputs: empty; give the readings of fuzzy.rule_base by the names of its inputs"
    for key in LIVER_ONLY:
        if _has(table, ("fuzzy", key)):
            yield f"fuzzy.{key}: shapes the liver's rules, not fuzzy.rule_base; remove it"


def _mesh_contradictions(scene: Scene, table: Table) -> Iterator[str]:
    organ = scene.organ
    for key in ("unit", "axes", "pieces", "suit"):
        if organ.mesh is None and _has(table, ("organ", key)):
            yield f"organ.{key}: has no effect without organ.mesh; remove it"
    for key in organ.suit:
        if not has_effect(scene, key):
            yield f"organ.suit: {key} has no effect in this scene; leave it out"
    for key in ("shape", *SHAPED):
        if organ.mesh is not None and _has(table, ("organ", key)):
            yield f"organ.{key}: has no effect beside organ.mesh; remove one of them"
    for key, shape in SHAPED.items():
        shown = organ.mesh is None and not scene.is_point and _has(table, ("organ", key))
        if shown and organ.shape != shape:
            yield f"organ.{key}: is of the {shape}, not of the {organ.shape}; remove it"
    if organ.axes is not None:
        yield from _axes_problems(organ.axes, "organ.axes")


def _axes_problems(axes: str, key: str) -> Iterator[str]:
    from study.mesh.axes import letters_of

    try:
        letters_of(axes)
    except ValueError as error:
        yield str(error).replace("organ.axes", key)


def _model_contradictions(scene: Scene) -> Iterator[str]:
    if not scene.models:
        yield f"models: empty; name at least one of {', '.join(MODELS.names())}"
    if len(set(scene.models)) < len(scene.models):
        yield "models: a model is named twice"
    if "msm" in scene.models and not scene.fuzzy.systems:
        yield "fuzzy.systems: empty; name a system or leave msm out of models"
    if "reading" in scene.models and not any(asdict(scene.patient).values()):
        yield "models: reading needs a reading; give one in [patient] or leave it out"


def _lattice_contradictions(scene: Scene, table: Table) -> Iterator[str]:
    lattice, nu = scene.lattice, scene.tissue.poisson_ratio
    if lattice.springs == "tetrahedra":
        yield from _mesh_springs_contradictions(lattice, table)
    if lattice.precision == "single":
        yield from _precision_contradictions(lattice)
    yield from graded.contradictions(scene)
    if lattice.law is not None:
        yield from _law_contradictions(scene, lattice.law)
    if lattice.volume_term and nu < SPRING_POISSON_RATIO:
        yield (
            f"lattice.volume_term: needs tissue.poisson_ratio of {SPRING_POISSON_RATIO} or more, "
            f"not {nu:g}; leave it out or raise the ratio"
        )
    # The one by default suits every lattice, and the table of all takes a while to load.
    if _has(table, ("lattice", "integrator")) and lattice.integrator != type(lattice).integrator:
        yield from _integrator_contradictions(scene)
    if lattice.time_step is not None and lattice.step_rate is not None:
        yield "lattice.time_step: contradicts lattice.step_rate; give one of them"
    elif lattice.time_step is not None and not scene.is_point:
        yield from _undivided_samples(scene, lattice.time_step)


def _precision_contradictions(lattice: Lattice) -> Iterator[str]:
    from msm.integrators import INTEGRATORS

    if lattice.springs == "tetrahedra":
        yield (
            "lattice.precision: springs on tetrahedra are stepped in double precision only; leave "
            "it out or set lattice.springs to lattice"
        )
    able = [name for name, method in INTEGRATORS.items() if method.on_grid is not None]
    if lattice.integrator not in able:
        yield (
            f"lattice.precision: {lattice.integrator} steps in double precision only; leave it out "
            f"or set lattice.integrator to {', '.join(able[:-1])} or {able[-1]}"
        )


def _undivided_samples(scene: Scene, seconds: float) -> Iterator[str]:
    from msm.timestep import Fixed, prescribed_steps

    intervals = scene.time.samples - 1
    try:
        prescribed_steps(Fixed(seconds), scene.time.duration / intervals, intervals)
    except ValueError as error:
        message = str(error).removeprefix("step.seconds: ")
        yield f"lattice.time_step: {message.replace('give a rate', 'give lattice.step_rate')}"


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
    unfit = scene.damping.stiffness > 0.0 and not method.stiffness_damping
    if unfit and _has_law(scene):
        yield (
            f"damping.stiffness: {name} has only the mass part of Rayleigh damping; set it to 0, "
            "or lattice.integrator to symplectic-euler"
        )


def _mesh_springs_contradictions(lattice: Lattice, table: Table) -> Iterator[str]:
    if lattice.volume_term:
        yield (
            "lattice.volume_term: springs on tetrahedra have none; leave it out or set "
            "lattice.springs to lattice"
        )
    for key in ("flexion", "body_diagonals"):
        if _has(table, ("lattice", key)):
            yield f"lattice.{key}: has no effect on springs along a mesh; remove it"


def _law_contradictions(scene: Scene, law: SpringLaw) -> Iterator[str]:
    if not _has_law(scene):
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


def _damping_contradictions(scene: Scene, table: Table) -> Iterator[str]:
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


def _tool_contradictions(scene: Scene, name: str, tool: Tool) -> Iterator[str]:
    if not _one_way(tool.place):
        yield f"{name}.place: give either side and at, or fraction, or point"
    if tool.direction is not None and math.hypot(*tool.direction) < SHORTEST_DIRECTION:
        yield f"{name}.direction: a zero vector has no direction"
    yield from _drive_contradictions(name, tool)
    if tool.path and tool.is_moved:
        return
    history, time = tool.history, scene.time
    if history.kind == "ramp-hold-release" and history.ramp == 0.0 and history.hold == 0.0:
        yield f"{name}.history: ramp and hold are both zero; nothing is ever loaded"
    if history.kind == "sinusoid" and 8 * history.frequency * time.duration > time.samples:
        needed = math.ceil(8 * history.frequency * time.duration)
        yield f"time.samples: a sinusoid needs 8 samples a period; give {needed} or more"
    yield from _unseen_load(scene, tool)


def _drive_contradictions(name: str, tool: Tool) -> Iterator[str]:
    """A blunt tool has a force, a rigid one is moved in one way."""
    if not tool.is_moved:
        if tool.displacement:
            yield f"{name}.displacement: moves a rigid tool; set {name}.shape to one, or remove it"
        if tool.contact != SLIDING or tool.friction or tool.clearance:
            yield f"{name}.contact: a blunt tool is a pressure; set {name}.shape or remove it"
        if any(point.travel is not None for point in tool.path):
            yield (
                f"{name}.path: a blunt tool stays on the surface; give each point an offset in x, "
                f"y and z, of which what is across the push counts, or set {name}.shape"
            )
        else:
            yield from _path_contradictions(name, tool.path)
        return
    if (tool.displacement is None) == (not tool.path):
        yield f"{name}.displacement: give either it or {name}.path, which moves the tool"
    if tool.contact != SLIDING and tool.friction:
        yield f"{name}.friction: a bonded tool does not slide; remove it"
    if tool.contact != SLIDING and tool.clearance:
        yield f"{name}.clearance: a bonded tool touches from the start; remove it"
    yield from _path_contradictions(name, tool.path)


def _path_contradictions(name: str, path: tuple[Waypoint, ...]) -> Iterator[str]:
    if not path:
        return
    times = [point.time for point in path]
    if len(path) < 2 or times[0] != 0.0 or sorted(set(times)) != times:
        yield f"{name}.path: give two points or more at rising times from 0 s"
    if any((point.travel is None) == (point.offset is None) for point in path):
        yield f"{name}.path: give each point either travel or offset"
    elif path[0].travel or any(path[0].offset or ()):
        yield f"{name}.path: starts elsewhere than at its place; begin with 0 mm"


def _idle_contradictions(scene: Scene) -> Iterator[str]:
    """Nothing but rigid tools that all stay within their clearance: results would be rounding."""
    if scene.weight or scene.gravity.acceleration:
        return
    if all(0.0 < abs(one.displacement or 0.0) <= one.clearance for one in scene.tools):
        far, moved = (1e3 * x for x in (scene.tool.clearance, abs(scene.tool.displacement or 0.0)))
        yield (
            f"tool.clearance: {far:.4g} mm is no less than the {moved:.4g} mm that the tool moves, "
            "and nothing else loads the organ; reduce it or enlarge tool.displacement"
        )


def _gravity_contradictions(table: Table) -> Iterator[str]:
    """A table of gravity that has none, but for one that says so."""
    if _has(table, ("gravity",)) and not _has(table, ("gravity", "acceleration")):
        yield 'gravity.acceleration: give it, for example "9.81 m/s^2"; without it there is none'


def _support_contradictions(scene: Scene) -> Iterator[str]:
    """A support is at a side or at a place."""
    for number, support in enumerate(scene.supports, 1):
        name = "support" if number == 1 else f"support.{number}"
        if support.place is not None and not _one_way(support.place):
            yield f"{name}.place: give either side and at, or fraction, or point"
        if support.place is not None and support.radius is None:
            yield f"{name}.radius: give how far it goes from {name}.place"
        if support.place is None and support.radius is not None:
            yield f"{name}.radius: goes with {name}.place; give one, or {name}.depth instead"
    if scene.lattice.integrator == "xpbd" and "fixed-surfaces" in scene.features:
        yield (
            "lattice.integrator: xpbd holds by foundations alone; choose another, or make each "
            "support.kind foundation"
        )


def _inclusion_contradictions(scene: Scene) -> Iterator[str]:
    """An inclusion has one shape, and a place that does not move to the surface."""
    for number, one in enumerate(scene.tissue.inclusion, 1):
        name = f"tissue.inclusion.{number}"
        shapes = [key for key in ("radius", "semi_axes", "mesh") if getattr(one, key) is not None]
        if len(shapes) != 1:
            yield f"{name}: give one of radius, semi_axes and mesh" + (
                f", not {' and '.join(shapes)}" if shapes else ""
            )
        if one.mesh is None:
            yield from _place_of_inclusion(name, one)
            continue
        if one.place is not None:
            yield f"{name}.place: a mesh lies where it lies; remove it"
        if one.unit is None:
            yield f"{name}.unit: give the length unit of its mesh: m, dm, cm, mm, um or in"
        if one.axes is not None and one.mesh is not None:
            yield from _axes_problems(one.axes, f"{name}.axes")


def _place_of_inclusion(name: str, one: Inclusion) -> Iterator[str]:
    if one.place is None or not _one_way(one.place) or one.place.side is not None:
        yield f"{name}.place: give fraction or point of its centre"
    for key in ("unit", "axes"):
        if getattr(one, key) is not None:
            yield f"{name}.{key}: has no effect without {name}.mesh; remove it"


def _feature_contradictions(scene: Scene) -> Iterator[str]:
    """Models that cannot follow what the scene asks."""
    for feature in scene.features:
        able = [name for name in MODELS.names() if feature in _kind(name).supported_features]
        for name in scene.models:
            if name not in able:
                yield (
                    f"models: {name} cannot follow {FEATURES[feature]}; leave it out"
                    + (f"; {', '.join(able)} can" if able else "")
                )


def _contact_contradictions(scene: Scene) -> Iterator[str]:
    """The reference follows moved tools in a subspace of its own."""
    if "fem" not in scene.models or "moved-tools" not in scene.features:
        return
    if scene.reference.method != "ritz-vectors":
        yield (
            f"reference.method: {scene.reference.method} cannot follow tools that are moved; leave "
            "it out"
        )


def _require_contradictions(scene: Scene, required: Require) -> Iterator[str]:
    """Wants that contradict each other, or that a single point has no part in."""
    wanted = set(required.quantities)
    if not wanted & {"rest", "history", "peak-force"}:
        yield (
            "require.quantities: name rest, history or both, or peak-force; field says where, not "
            "what"
        )
    if "rest" in wanted:
        try:
            refuse_beside_one_load(scene.features, "require.quantities: rest")
        except ValueError as error:
            yield str(error)
    if "peak-force" in wanted and "moved-tools" not in scene.features:
        yield "require.quantities: peak-force is that of tools that are moved; remove it"
    if len(wanted) < len(required.quantities):
        yield "require.quantities: a quantity is named twice"
    if len(set(required.at)) < len(required.at):
        yield "require.at: a control point is named twice"
    if required.rate is not None and not wanted & {"history", "peak-force"}:
        yield "require.rate: nothing moves at rest; add history to require.quantities or remove it"
    for name in required.at:
        if scene.control_points and name not in scene.control_points:
            yield (
                f"require.at: {name!r} is no control point; there are "
                f"{', '.join(scene.control_points)}"
            )
    if scene.is_point and "field" in wanted:
        yield "require.quantities: a single point has no field; remove it"


def _unseen_load(scene: Scene, tool: Tool) -> Iterator[str]:
    """A load that comes and goes between samples would leave no trace of itself."""
    history, time = tool.history, scene.time
    if history.kind != "ramp-hold-release":
        return
    loaded = min(history.ramp + history.hold + history.release, time.duration)
    if 8 * time.duration > (time.samples - 1) * loaded > 0.0:
        needed = math.ceil(8 * time.duration / loaded) + 1
        yield f"time.samples: a load of {loaded:g} s needs 8 samples in it; give {needed} or more"


def _kind(name: str) -> ModelKind:
    """The kind of a model; found as Choice finds its table, for models are made of scenes."""
    found: ModelKind = resolve_name("study.models.table:kind")(name)
    return found


def _has_law(scene: Scene) -> bool:
    """Whether a model has the law and damping of the scene's lattice."""
    return any(_kind(name).follows_law for name in scene.models)


def _point_contradictions(scene: Scene, table: Table) -> Iterator[str]:
    for name in scene.models:
        if _kind(name).on_point is None:
            yield f"models: {name} needs an organ with a mesh; a point has none"
    if scene.organ.mass is None and scene.damping.ratio * scene.basafa.gamma_0 == 0.0:
        yield (
            "organ.mass: cannot follow from eq. (2) without damping; give it, or set "
            "damping.ratio and basafa.gamma_0 above zero"
        )
    if scene.damping.kind == "rayleigh":
        yield "damping.kind: a single point has the damping of eqs. (2) and (9) only; remove it"
    for key in MESH_ONLY:
        if _has(table, key):
            yield f"{'.'.join(key)}: has no effect on a single point; remove it"


def _named_points(scene: Scene) -> list[tuple[str, Any]]:
    return [(f"control_points.{name}", place) for name, place in scene.control_points.items()]


def _places_of_weights(scene: Scene) -> list[tuple[str, Any]]:
    return [(f"weight.{n}.place", one.place) for n, one in enumerate(scene.weight, 1)]


def _one_way(place: Any) -> bool:
    ways = [place.side is not None, place.fraction is not None, place.point is not None]
    return sum(ways) == 1 and (place.side is None) == (place.at is None)


def _has(table: Table, keys: Sequence[str]) -> bool:
    for key in keys:
        if not isinstance(table, dict) or key not in table:
            return False
        table = table[key]
    return True
