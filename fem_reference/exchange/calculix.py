"""CalculiX input decks (Dhondt, CalculiX CrunchiX manual 2.20): static and dynamic.

The foundation couples its nodes. Per direction its matrix S is springs of -S_ij between nodes i
and j (SPRING2) and of the row's sum to the ground (SPRING1): exact, also where a constant is
negative. Its Rayleigh damping has them in it, as the reference's has.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.exchange.nodal import DIRECTIONS, NodalProblem
from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]

ELEMENT_NAME = {4: "C3D4", 10: "C3D10"}
FIELD = 20
SET_NAME = "SPRINGS"
WEIGHTS, HISTORIES = "weights.inp", "histories.inp"
MODEL = ("*INCLUDE, INPUT=mesh.inp", "*INCLUDE, INPUT=foundation.inp")


@dataclass(frozen=True)
class Transient:
    """Steps of a motion from rest by HHT with `alpha`, and its Rayleigh damping.

    `factors` (count + 1,) or (count + 1, loads) at 0, `step` [s], 2 `step`, ...; the first is zero,
    for CalculiX takes the first acceleration under load otherwise than HHT. All nodes are printed
    after every `kept` steps and after the last.
    """

    step: float
    factors: Floats
    damping: RayleighDamping
    alpha: float
    kept: int

    @property
    def count(self) -> int:
        """Number of steps."""
        return len(self.factors) - 1

    def factor(self, times: Floats) -> Floats:
        """Factor of each load at times [s], as CalculiX interpolates it; of one load (t,)."""
        each = [np.interp(times, self.times, column) for column in self.columns]
        return each[0] if len(each) == 1 else np.column_stack(each)

    @property
    def times(self) -> Floats:
        """At which the factors are [s]."""
        return np.asarray(self.step * np.arange(len(self.factors)), dtype=np.float64)

    @property
    def columns(self) -> list[Floats]:
        """Factors of each load."""
        return list(self.factors.reshape(len(self.factors), -1).T)

    def prints(self, step: int) -> bool:
        """Whether all nodes are printed after a step."""
        return step > 0 and (step % self.kept == 0 or step == self.count)


def files(problem: NodalProblem, motion: Transient | None = None) -> dict[str, str]:
    """Text of the decks and of their parts by file name; dynamic.inp only if there is a motion.

    Of loads that meet at a node, as those of a tool that travels do, CalculiX would give all forces
    there the history of one: each node has a history of its own instead, of its force [N].
    """
    loads = (problem.full_load,) if problem.is_merged else problem.loads
    parts = dict(zip(load_files(problem), loads, strict=True))
    if problem.weight_forces is not None:
        parts[WEIGHTS] = problem.weight_forces
    named = {
        "mesh.inp": _lines(_mesh(problem, motion)),
        "foundation.inp": _lines(_foundation(problem)),
        "static.inp": _lines(_static(problem, parts)),
    } | {name: _lines(_load(forces)) for name, forces in parts.items()}
    if motion is not None:
        named["dynamic.inp"] = _lines(_dynamic(problem, motion))
        if problem.is_merged:
            named[HISTORIES] = _lines(_histories(problem, motion))
    return named


def load_files(problem: NodalProblem) -> list[str]:
    """Name of the file of each load that has a history, of all where these meet."""
    if problem.is_merged:
        return ["load.inp"]
    return ["load.inp", *(f"load.{n}.inp" for n in range(2, len(problem.loads) + 1))]


def _lines(lines: Iterable[str]) -> str:
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    """As many digits as CalculiX reads: it takes 20 characters."""
    text = f"{value:.13e}"
    return text if len(text) <= FIELD else f"{value:.12e}"


def _mesh(problem: NodalProblem, motion: Transient | None) -> Iterator[str]:
    yield "*NODE, NSET=ALL"
    for number, (x, y, z) in enumerate(problem.nodes, 1):
        yield f"{number}, {_number(x)}, {_number(y)}, {_number(z)}"
    yield f"*ELEMENT, TYPE={ELEMENT_NAME[problem.elements.shape[1]]}, ELSET=BODY"
    for number, nodes in enumerate(problem.elements + 1, 1):
        yield ", ".join(map(str, (number, *nodes)))
    tissue = problem.tissue
    yield from ("*MATERIAL, NAME=TISSUE", "*ELASTIC")
    yield f"{_number(tissue.youngs_modulus)}, {_number(tissue.poisson_ratio)}"
    yield from ("*DENSITY", _number(tissue.density))
    if motion is not None:
        mass, stiffness = _number(motion.damping.mass), _number(motion.damping.stiffness)
        yield f"*DAMPING, ALPHA={mass}, BETA={stiffness}"
    yield "*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE"


def _foundation(problem: NodalProblem) -> Iterator[str]:
    number = len(problem.elements)
    for index, ((constant, ends, direction), members) in enumerate(_sets(problem).items(), 1):
        yield f"*ELEMENT, TYPE=SPRING{ends}, ELSET={SET_NAME}{index}"
        for nodes in members:
            number += 1
            yield ", ".join(map(str, (number, *nodes)))
        yield f"*SPRING, ELSET={SET_NAME}{index}"
        yield ", ".join([str(direction)] * ends)
        yield constant


def _sets(problem: NodalProblem) -> dict[tuple[str, int, int], list[tuple[int, ...]]]:
    """Springs by what one set has in common: constant, number of nodes, direction."""
    found: dict[tuple[str, int, int], list[tuple[int, ...]]] = {}
    for nodes, constant in springs(problem):
        for direction in range(1, DIRECTIONS + 1):
            found.setdefault((_number(constant), len(nodes), direction), []).append(nodes)
    return found


def springs(problem: NodalProblem) -> Iterator[tuple[tuple[int, ...], float]]:
    """Nodes, from 1, and constant [N/m] of each spring of the foundation in one direction."""
    S = problem.support.tocoo()
    for i, j, value in zip(S.coords[0], S.coords[1], S.data, strict=True):
        if i < j and value != 0.0:
            yield (int(i) + 1, int(j) + 1), -float(value)
    for i, total in enumerate(problem.support.sum(axis=1)):
        if total != 0.0:
            yield (i + 1,), float(total)


def _load(forces: Floats) -> Iterator[str]:
    for node, direction in np.argwhere(forces != 0.0):
        yield f"{node + 1}, {direction + 1}, {_number(forces[node, direction])}"


def _static(problem: NodalProblem, parts: Iterable[str]) -> Iterator[str]:
    """All in one step, in which forces on a node add up."""
    yield from MODEL
    yield from ("*STEP", "*STATIC")
    for part in parts:
        yield from ("*CLOAD", f"*INCLUDE, INPUT={part}")
    if problem.gravity is not None:
        size = float(np.linalg.norm(problem.gravity))
        direction = ", ".join(_number(part) for part in problem.gravity / size)
        yield from ("*DLOAD", f"BODY, GRAV, {_number(size)}, {direction}")
    yield from ("*NODE PRINT, NSET=ALL", "U", "*END STEP")


def _dynamic(problem: NodalProblem, motion: Transient) -> Iterator[str]:
    """From rest under gravity, which leaves a linear motion as it is and is not in it."""
    yield from MODEL
    times = motion.times
    histories = ["HISTORY", *(f"HISTORY{n}" for n in range(2, len(problem.loads) + 1))]
    if problem.is_merged:
        yield f"*INCLUDE, INPUT={HISTORIES}"
    else:
        for name, factors in zip(histories, motion.columns, strict=True):
            yield from _amplitude(name, times, factors)
    yield f"*STEP, INC={len(motion.factors)}"
    yield f"*DYNAMIC, DIRECT, ALPHA={motion.alpha:g}"
    yield f"{_number(motion.step)}, {_number(times[-1])}"
    if problem.is_merged:
        for node, direction in _loaded(problem):
            yield f"*CLOAD, AMPLITUDE={_own_history(node, direction)}"
            yield f"{node + 1}, {direction + 1}, 1."
    else:
        for name, part in zip(histories, load_files(problem), strict=True):
            yield from (f"*CLOAD, AMPLITUDE={name}", f"*INCLUDE, INPUT={part}")
    yield from (f"*NODE PRINT, NSET=ALL, FREQUENCY={motion.kept}", "U", "*END STEP")


def _amplitude(name: str, times: Floats, values: Floats) -> Iterator[str]:
    yield f"*AMPLITUDE, NAME={name}"
    for time, value in zip(times, values, strict=True):
        yield f"{_number(time)}, {_number(value)}"


def _histories(problem: NodalProblem, motion: Transient) -> Iterator[str]:
    """Force [N] at each node, direction by direction, over time."""
    times = motion.times
    loads, factors = np.array(problem.loads), np.column_stack(motion.columns)
    for node, direction in _loaded(problem):
        own = factors @ loads[:, node, direction]
        yield from _amplitude(_own_history(node, direction), times, own)


def _loaded(problem: NodalProblem) -> list[tuple[int, int]]:
    """Nodes, from 0, and directions in which any load acts there."""
    return [(int(n), int(d)) for n, d in np.argwhere(np.any(np.array(problem.loads) != 0, axis=0))]


def _own_history(node: int, direction: int) -> str:
    return f"N{node + 1}D{direction + 1}"
