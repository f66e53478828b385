"""Rigid tools that meet a lattice, compiled: what is touched is stopped, by impulses, in each step.

After a free step the surface points that entered a tool would have a gap g < 0. Impulses P >= 0
along the normals n of the tools, found together for all of them, leave no gap below zero:

    g + dt n . W dv >= 0,   dv = M^-1 W^T n P,   P (g + dt n . W dv) = 0

W interpolates points of the surface from the nodes, M is the lumped mass with nodal damping. That
is the method of forward increment Lagrange multipliers (Carpenter, Taylor and Katona 1991, Int. J.
Numer. Meth. Engng 32:103): it needs no contact stiffness and leaves the critical step as it is.
Friction bounds the tangential impulse, which would stop the point on the tool, by Coulomb's
coefficient times P; points held by a bonded tool are stopped along all axes. The impulses are found
by projected Gauss-Seidel sweeps from those of the step before (after Moreau 1988). An overlap that
is left, or was there at the start, is taken back at RECOVERY of itself a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel
from msm.kinematics import dot
from study.problem.rigid import PLATE, SPHERE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RECOVERY = 0.2
"""Of an overlap, how much a step takes back: a whole one would throw what it pushes out."""
SWEEPS = 100
SOLVED = 1e-4
"""Change of an impulse in a sweep, relative to the largest, at which they are found."""
CLOSE = 0.05
"""Gap, in spacings, below which a point takes part in a step: its neighbours may push it in."""
NOTHING, NO_POINT = np.inf, -np.inf
"""As gaps: the point is not opposite the tool; or beside or behind it, where none is entered."""
TRAVELLED, DEEPEST = range(2)


class Contact(NamedTuple):
    """Points of the surface by the tool that they may meet, and how they stand to it.

    Points: `tool` (p,), `rest` [m] (p, 3); their weights on nodes, compressed rows `row` (p + 1,),
    `node` and `weight`; `held`: whether a bonded tool has them, at `anchor` [m] (p, 3), their
    displacement at the start. `spread`: largest sum of a row's absolute weights. Nodes: `place`
    (n,) in the arrays of the motion, `mass`, `gamma_0`, `gamma_1` as in `Network`. Tools: `shape`,
    `radius` [m], `tip` [m], `axis`, `friction`. `close` [m]: gap at which a point takes part.

    What changes: `push` [N] (p, 3) on the body, `before` [m] (p,) the gap of the last step, `due`
    [m] (p,) how far all must have travelled before a point can touch, `sums` [m] (2,): how far that
    is now, the deepest overlap; `force` [N] (tools, 3) on the tools.

    Of a step: points that take part `active` (p,), their `normal`, velocity `free` [m/s] and
    impulse [N s] (p, 3), the velocity `short` [m/s] (p,) that they lack along the normal, `give`
    [1/kg] (p,); of nodes 1 / mass `ease` [1/kg] (n,) and what they gain `added` [m/s] (n, 3).
    """

    tool: Ints
    rest: Floats
    row: Ints
    node: Ints
    weight: Floats
    held: NDArray[np.bool_]
    anchor: Floats
    spread: float
    place: Ints
    mass: Floats
    gamma_0: Floats
    gamma_1: Floats
    shape: Ints
    radius: Floats
    tip: Floats
    axis: Floats
    friction: Floats
    close: float
    push: Floats
    before: Floats
    due: Floats
    sums: Floats
    force: Floats
    active: Ints
    normal: Floats
    free: Floats
    impulse: Floats
    short: Floats
    give: Floats
    ease: Floats
    added: Floats


@dataclass(frozen=True, eq=False)
class Standing:
    """What changes of a contact, as there."""

    push: Floats
    before: Floats
    due: Floats
    sums: Floats
    force: Floats

    def kept(self) -> Standing:
        """A copy that does not change."""
        return Standing(*(part.copy() for part in vars(self).values()))

    def put_back(self, kept: Standing) -> None:
        """Set it to a copy."""
        for name, then in vars(kept).items():
            getattr(self, name)[...] = then


def standing(contact: Contact | None) -> Standing:
    """What changes of a contact; nothing without one."""
    if contact is None:
        none, nobody = np.zeros(0), np.zeros((0, 3))
        return Standing(nobody, none, none, np.zeros(2), nobody)
    return Standing(contact.push, contact.before, contact.due, contact.sums, contact.force)


@inner_kernel()
def meet_tools(contact: Contact | None, moves: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Correct the motion, (3, m), at the end of a step of dt [s] in which the tools moved.

    `moves` [m] (6 tools,): displacement of each tip at the end and at the start of the step.
    """
    if contact is None:
        return
    speed, step = largest_speed(contact, v), largest_move(moves)
    reached = contact.sums[TRAVELLED] + contact.spread * dt * speed + step
    count = find_close(contact, moves, reached, dt, u, v)
    change = 0.0
    if count:
        solve(contact, moves, count, dt)
        change = take_over(contact, count, dt, u, v)
    contact.sums[TRAVELLED] = reached + contact.spread * dt * change
    set_forces(contact, count)


@inner_kernel()
def largest_speed(contact: Contact, v: Floats) -> float:
    """Of any node [m/s]."""
    squared = 0.0
    for i in range(contact.place.shape[0]):
        p = contact.place[i]
        squared = max(squared, v[0, p] ** 2 + v[1, p] ** 2 + v[2, p] ** 2)
    return np.sqrt(squared)  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def largest_move(moves: Floats) -> float:
    """Of any tool in the step [m]."""
    squared = 0.0
    for k in range(0, moves.shape[0], 6):
        moved = 0.0
        for d in range(3):
            moved += (moves[k + d] - moves[k + 3 + d]) ** 2
        squared = max(squared, moved)
    return np.sqrt(squared)  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def at_point(contact: Contact, p: int, a: Floats, d: int) -> float:
    """Component d of a motion (3, m) at a point."""
    found = 0.0
    for e in range(contact.row[p], contact.row[p + 1]):
        found += contact.weight[e] * a[d, contact.place[contact.node[e]]]
    return found


@inner_kernel()
def find_close(
    contact: Contact, moves: Floats, reached: float, dt: float, u: Floats, v: Floats
) -> int:
    """Set up the points that take part in the step; how many they are."""
    count = 0
    for p in range(contact.tool.shape[0]):
        if contact.due[p] > reached:
            continue
        t = 6 * contact.tool[p]
        x = at_point(contact, p, u, 0) - moves[t]
        y = at_point(contact, p, u, 1) - moves[t + 1]
        z = at_point(contact, p, u, 2) - moves[t + 2]
        if contact.held[p]:
            hold(contact, p, count, dt, (x, y, z))
        elif not touches(contact, p, count, reached, dt, (x, y, z), v):
            contact.push[p, :] = 0.0
            continue
        contact.active[count] = p
        set_give(contact, p, count, dt, u)
        for d in range(3):
            contact.impulse[count, d] = dt * contact.push[p, d]
        count += 1
    return count


@inner_kernel()
def hold(contact: Contact, p: int, a: int, dt: float, away: Any) -> None:
    """Set up a point that is to stay on its tool, `away` [m] from its rest on it."""
    for d in range(3):
        contact.free[a, d] = (away[d] - contact.anchor[p, d]) / dt


@inner_kernel()
def touches(
    contact: Contact, p: int, a: int, reached: float, dt: float, away: Any, v: Floats
) -> bool:
    """Set up a point if it touches its tool or nearly so, `away` [m] as in `hold`; else False."""
    gap, apart, normal = stands(contact, p, away)
    contact.due[p] = reached + abs(apart)
    before = contact.before[p]
    if gap >= contact.close or gap == NO_POINT:
        contact.before[p] = gap
        return False
    if gap < 0.0 and before == NO_POINT:
        contact.due[p] = reached
        return False
    contact.due[p] = reached
    moving = 0.0
    for d in range(3):
        contact.normal[a, d] = normal[d]
        contact.free[a, d] = at_point(contact, p, v, d)
        moving += normal[d] * contact.free[a, d]
    contact.short[a] = (gap - min(0.0, before) * (1.0 - RECOVERY)) / dt - moving
    contact.before[p] = gap
    return True


@inner_kernel()
def stands(contact: Contact, p: int, away: Any) -> Any:
    """Gap of a point from its tool, a distance [m] it is off at least, and the tool's normal.

    The gap is infinite where nothing is opposite, negative so beside a punch.
    """
    t = contact.tool[p]
    axis, radius = contact.axis[t], contact.radius[t]
    x = contact.rest[p, 0] + away[0] - contact.tip[t, 0]
    y = contact.rest[p, 1] + away[1] - contact.tip[t, 1]
    z = contact.rest[p, 2] + away[2] - contact.tip[t, 2]
    if contact.shape[t] == SPHERE:
        x, y, z = x + radius * axis[0], y + radius * axis[1], z + radius * axis[2]
        size = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        return size - radius, size - radius, (x / size, y / size, z / size)
    along = x * axis[0] + y * axis[1] + z * axis[2]
    normal = (axis[0], axis[1], axis[2])
    if contact.shape[t] == PLATE:
        return along, along, normal
    across = np.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
    if across > radius:
        apart = np.sqrt(max(along, 0.0) ** 2 + (across - radius) ** 2)
        return (NOTHING if along >= 0.0 else NO_POINT), apart, normal
    return along, along, normal


@inner_kernel()
def set_give(contact: Contact, p: int, a: int, dt: float, u: Floats) -> None:
    """Set what velocity a point and its nodes gain by an impulse, and clear what they gained."""
    give = 0.0
    for e in range(contact.row[p], contact.row[p + 1]):
        i = contact.node[e]
        at = contact.place[i]
        away = np.sqrt(u[0, at] ** 2 + u[1, at] ** 2 + u[2, at] ** 2)
        damping = contact.gamma_0[i] + contact.gamma_1[i] * away
        contact.ease[i] = 1.0 / (contact.mass[i] + dt * damping)
        give += contact.weight[e] ** 2 * contact.ease[i]
        for d in range(3):
            contact.added[i, d] = 0.0
    contact.give[a] = give


@inner_kernel()
def solve(contact: Contact, moves: Floats, count: int, dt: float) -> None:
    """Find the impulses of the points that take part, and the velocities they add to nodes."""
    for a in range(count):
        first = contact.impulse[a]
        strike(contact, a, (first[0], first[1], first[2]))
    for sweep in range(SWEEPS):
        change, largest = 0.0, 0.0
        for k in range(count):
            a = k if sweep % 2 == 0 else count - 1 - k
            changed, size = relax(contact, moves, a, dt)
            change, largest = max(change, changed), max(largest, size)
        if change <= SOLVED**2 * largest:
            break


@inner_kernel()
def strike(contact: Contact, a: int, impulse: Any) -> None:
    """Add the velocities that an impulse [N s] on a point gives to its nodes."""
    p = contact.active[a]
    for e in range(contact.row[p], contact.row[p + 1]):
        i = contact.node[e]
        share = contact.weight[e] * contact.ease[i]
        for d in range(3):
            contact.added[i, d] += share * impulse[d]


@inner_kernel()
def gained(contact: Contact, a: int, d: int) -> float:
    """Velocity along d that a point has gained so far."""
    p, found = contact.active[a], 0.0
    for e in range(contact.row[p], contact.row[p + 1]):
        found += contact.weight[e] * contact.added[contact.node[e], d]
    return found


@inner_kernel()
def relax(contact: Contact, moves: Floats, a: int, dt: float) -> Any:
    """Stop one point as if it were the only one; squares of the impulse's change and size."""
    p, give, now = contact.active[a], contact.give[a], contact.impulse[a]
    t = contact.tool[p]
    x = contact.free[a, 0] + gained(contact, a, 0)
    y = contact.free[a, 1] + gained(contact, a, 1)
    z = contact.free[a, 2] + gained(contact, a, 2)
    if contact.held[p]:
        new = now[0] - x / give, now[1] - y / give, now[2] - z / give
    else:
        n, mu = contact.normal[a], contact.friction[t]
        pressed = now[0] * n[0] + now[1] * n[1] + now[2] * n[2]
        moving = x * n[0] + y * n[1] + z * n[2]
        stopped = max(0.0, pressed - (moving + contact.short[a]) / give)
        new = stopped * n[0], stopped * n[1], stopped * n[2]
        if mu > 0.0:
            for_t = (
                x - (moves[6 * t] - moves[6 * t + 3]) / dt,
                y - (moves[6 * t + 1] - moves[6 * t + 4]) / dt,
                z - (moves[6 * t + 2] - moves[6 * t + 5]) / dt,
            )
            new = dragged(n, mu * stopped, give, now, pressed, new, for_t)
    change = (new[0] - now[0], new[1] - now[1], new[2] - now[2])
    strike(contact, a, change)
    now[0], now[1], now[2] = new
    return dot(change, change), dot(new, new)


@inner_kernel()
def dragged(n: Any, most: float, give: float, now: Any, pressed: float, new: Any, slip: Any) -> Any:
    """The impulse `new` along n with the tangential one that stops the slip, but at `most`."""
    across = dot(slip, n)
    x = now[0] - pressed * n[0] - (slip[0] - across * n[0]) / give
    y = now[1] - pressed * n[1] - (slip[1] - across * n[1]) / give
    z = now[2] - pressed * n[2] - (slip[2] - across * n[2]) / give
    size = np.sqrt(x * x + y * y + z * z)
    share = 1.0 if size <= most else most / size
    return new[0] + share * x, new[1] + share * y, new[2] + share * z


@inner_kernel()
def take_over(contact: Contact, count: int, dt: float, u: Floats, v: Floats) -> float:
    """Give the nodes what they gained; the largest of it [m/s]. Overlaps left are noted."""
    for a in range(count):
        p, left = contact.active[a], 0.0
        for d in range(3):
            gain = gained(contact, a, d)
            if contact.held[p]:
                left += (dt * (contact.free[a, d] + gain)) ** 2
            else:
                left -= dt * gain * contact.normal[a, d]
            contact.push[p, d] = contact.impulse[a, d] / dt
        if contact.held[p]:
            left = np.sqrt(left)
        else:
            contact.before[p] -= left
            left = -contact.before[p]
        contact.sums[DEEPEST] = max(contact.sums[DEEPEST], left)
    largest = 0.0
    for a in range(count):
        p = contact.active[a]
        for e in range(contact.row[p], contact.row[p + 1]):
            i = contact.node[e]
            for d in range(3):
                gain = contact.added[i, d]
                v[d, contact.place[i]] += gain
                u[d, contact.place[i]] += dt * gain
                largest = max(largest, abs(gain))
                contact.added[i, d] = 0.0
    return np.sqrt(3.0) * largest  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def set_forces(contact: Contact, count: int) -> None:
    """Set what the body does to each tool [N]."""
    contact.force[:] = 0.0
    for a in range(count):
        p = contact.active[a]
        for d in range(3):
            contact.force[contact.tool[p], d] -= contact.push[p, d]
