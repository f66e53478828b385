"""Contact of a lattice with rigid tools by impulses at the end of each time step, compiled.

After a step without contact, a surface point inside a tool has a gap g < 0. Impulses P >= 0 along
the tool normals n close every such gap. They satisfy the complementarity conditions

    g + dt n . W dv >= 0,   dv = M^-1 W^T n P,   P (g + dt n . W dv) = 0

where W interpolates surface points from the nodes and M is the lumped mass with nodal damping. This
is the forward increment Lagrange multiplier method (Carpenter, Taylor and Katona 1991, Int. J.
Numer. Meth. Engng 32:103). It needs no contact stiffness and does not change the critical time
step. The tangential impulse is the one that makes the point stick to the tool, limited by the
Coulomb coefficient times P. A point of a bonded tool sticks along all axes. Projected Gauss-Seidel
sweeps, started from the impulses of the previous step, find the impulses (after Moreau 1988). Each
step removes OVERLAP_RECOVERY of any remaining or initial overlap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel, kernel
from msm.kinematics import dot
from study.problem.rigid import PLATE, SPHERE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

OVERLAP_RECOVERY = 0.2
"""Share of an overlap that one step removes; removing all of it would eject the point."""
SWEEPS = 100
TOLERANCE = 1e-4
"""Change of an impulse in a sweep, relative to the largest impulse, at convergence."""
ACTIVATION_GAP = 0.05
"""Gap, in lattice spacings, below which a point is active: its neighbours may push it in."""
NOT_OPPOSITE, BEYOND = np.inf, -np.inf
"""Gaps of a point that is not opposite the tool, and of one beside or behind it."""
TRAVELLED, DEEPEST = range(2)


class Contact(NamedTuple):
    """Pairs of a surface point and a tool, with their state and the work arrays of a step.

    Points: `tool` (p,) and position `rest` [m] (p, 3); their interpolation weights on the nodes in
    compressed rows `row` (p + 1,), `node`, `weight`, and `weight_sum`, the largest sum of absolute
    weights of a row; `bonded` (p,): whether the tool is bonded to the point, and `anchor` [m]
    (p, 3), the displacement of the point at the start. Nodes (n,): `place` in the arrays of the
    motion; `mass`, `gamma_0`, `gamma_1` as in `Network`. Tools: `shape`, `radius` [m], `tip` [m],
    `axis`, `friction`. `activation_gap` [m]: gap below which a point is active.

    State: `body_force` [N] (p, 3) on the body; `previous_gap` [m] (p,); `totals` [m] (2,), an upper
    bound of the distance that any point and any tool have travelled, and the deepest overlap;
    `wake_travel` [m] (p,), the total travel below which a point cannot touch; `tool_force` [N]
    (tools, 3) on the tools.

    Work arrays: numbers of the `active` points, their `normal`, velocity without contact
    `free_velocity` [m/s] and `impulse` [N s] (p, 3); `bias` [m/s] (p,), the normal velocity added
    to close the gap; `inverse_effective_mass` [1/kg] (p,); per node the `inverse_mass` [1/kg] (n,)
    and `velocity_change` [m/s] (n, 3).
    """

    tool: Ints
    rest: Floats
    row: Ints
    node: Ints
    weight: Floats
    bonded: NDArray[np.bool_]
    anchor: Floats
    weight_sum: float
    place: Ints
    mass: Floats
    gamma_0: Floats
    gamma_1: Floats
    shape: Ints
    radius: Floats
    tip: Floats
    axis: Floats
    friction: Floats
    activation_gap: float
    body_force: Floats
    previous_gap: Floats
    wake_travel: Floats
    totals: Floats
    tool_force: Floats
    active: Ints
    normal: Floats
    free_velocity: Floats
    impulse: Floats
    bias: Floats
    inverse_effective_mass: Floats
    inverse_mass: Floats
    velocity_change: Floats


@dataclass(frozen=True, eq=False)
class ContactState:
    """The arrays of `Contact` that change from step to step."""

    body_force: Floats
    previous_gap: Floats
    wake_travel: Floats
    totals: Floats
    tool_force: Floats

    def copy(self) -> ContactState:
        """An independent copy."""
        return ContactState(*(array.copy() for array in vars(self).values()))

    def restore(self, saved: ContactState) -> None:
        """Overwrite the arrays in place with those of a saved state."""
        for name, array in vars(saved).items():
            getattr(self, name)[...] = array


def contact_state(contact: Contact | None) -> ContactState:
    """The state arrays of a contact, shared with it; empty ones without a contact."""
    if contact is None:
        scalars, vectors = np.zeros(0), np.zeros((0, 3))
        return ContactState(vectors, scalars, scalars, np.zeros(2), vectors)
    return ContactState(
        contact.body_force,
        contact.previous_gap,
        contact.wake_travel,
        contact.totals,
        contact.tool_force,
    )


@kernel()
def resolve_contact(
    contact: Contact | None, tip_motion: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """Correct displacement u and velocity v (3, m) at the end of a step of dt [s] for contact.

    `tip_motion` [m] (6 tools,): displacement of each tip at the end, then at the start of the step.
    """
    if contact is None:
        return
    speed, step = largest_speed(contact, v), largest_tool_travel(tip_motion)
    travelled = contact.totals[TRAVELLED] + contact.weight_sum * dt * speed + step
    count = activate_points(contact, tip_motion, travelled, dt, u, v)
    change = 0.0
    if count:
        solve_impulses(contact, tip_motion, count, dt)
        change = update_nodes(contact, count, dt, u, v)
    contact.totals[TRAVELLED] = travelled + contact.weight_sum * dt * change
    set_tool_forces(contact, count)


@inner_kernel()
def largest_speed(contact: Contact, v: Floats) -> float:
    """Largest speed [m/s] of any node."""
    squared = 0.0
    for i in range(contact.place.shape[0]):
        p = contact.place[i]
        squared = max(squared, v[0, p] ** 2 + v[1, p] ** 2 + v[2, p] ** 2)
    return np.sqrt(squared)  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def largest_tool_travel(tip_motion: Floats) -> float:
    """Largest distance [m] that any tool moves in the step."""
    squared = 0.0
    for k in range(0, tip_motion.shape[0], 6):
        moved = 0.0
        for d in range(3):
            moved += (tip_motion[k + d] - tip_motion[k + 3 + d]) ** 2
        squared = max(squared, moved)
    return np.sqrt(squared)  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def interpolated(contact: Contact, p: int, a: Floats, d: int) -> float:
    """Component d of a nodal field (3, m), interpolated at a point."""
    total = 0.0
    for e in range(contact.row[p], contact.row[p + 1]):
        total += contact.weight[e] * a[d, contact.place[contact.node[e]]]
    return total


@inner_kernel()
def activate_points(
    contact: Contact, tip_motion: Floats, travelled: float, dt: float, u: Floats, v: Floats
) -> int:
    """Set up the work arrays of the points that may touch in the step; return their number."""
    count = 0
    for p in range(contact.tool.shape[0]):
        if contact.wake_travel[p] > travelled:
            continue
        t = 6 * contact.tool[p]
        x = interpolated(contact, p, u, 0) - tip_motion[t]
        y = interpolated(contact, p, u, 1) - tip_motion[t + 1]
        z = interpolated(contact, p, u, 2) - tip_motion[t + 2]
        if contact.bonded[p]:
            activate_bonded(contact, p, count, dt, (x, y, z))
        elif not activate_near(contact, p, count, travelled, dt, (x, y, z), v):
            contact.body_force[p, :] = 0.0
            continue
        contact.active[count] = p
        set_effective_mass(contact, p, count, dt, u)
        for d in range(3):
            contact.impulse[count, d] = dt * contact.body_force[p, d]
        count += 1
    return count


@inner_kernel()
def activate_bonded(contact: Contact, p: int, a: int, dt: float, offset: Any) -> None:
    """Set up a bonded point at `offset` [m] from its rest position in the frame of its tool."""
    for d in range(3):
        contact.free_velocity[a, d] = (offset[d] - contact.anchor[p, d]) / dt


@inner_kernel()
def activate_near(
    contact: Contact, p: int, a: int, travelled: float, dt: float, offset: Any, v: Floats
) -> bool:
    """Set up a point whose gap is below `activation_gap`; False for one further away.

    `offset` [m] as in `activate_bonded`.
    """
    gap, distance, normal = gap_and_normal(contact, p, offset)
    contact.wake_travel[p] = travelled + abs(distance)
    before = contact.previous_gap[p]
    if gap >= contact.activation_gap or gap == BEYOND:
        contact.previous_gap[p] = gap
        return False
    if gap < 0.0 and before == BEYOND:
        contact.wake_travel[p] = travelled
        return False
    contact.wake_travel[p] = travelled
    normal_velocity = 0.0
    for d in range(3):
        contact.normal[a, d] = normal[d]
        contact.free_velocity[a, d] = interpolated(contact, p, v, d)
        normal_velocity += normal[d] * contact.free_velocity[a, d]
    contact.bias[a] = (gap - min(0.0, before) * (1.0 - OVERLAP_RECOVERY)) / dt - normal_velocity
    contact.previous_gap[p] = gap
    return True


@inner_kernel()
def gap_and_normal(contact: Contact, p: int, offset: Any) -> Any:
    """Gap [m] of a point, a lower bound of its distance [m] from the tool, and the tool's normal.

    The gap is NOT_OPPOSITE in front of the rim of a punch, and BEYOND beside the punch.
    """
    t = contact.tool[p]
    axis, radius = contact.axis[t], contact.radius[t]
    x = contact.rest[p, 0] + offset[0] - contact.tip[t, 0]
    y = contact.rest[p, 1] + offset[1] - contact.tip[t, 1]
    z = contact.rest[p, 2] + offset[2] - contact.tip[t, 2]
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
        return (NOT_OPPOSITE if along >= 0.0 else BEYOND), apart, normal
    return along, along, normal


@inner_kernel()
def set_effective_mass(contact: Contact, p: int, a: int, dt: float, u: Floats) -> None:
    """Set the inverse masses of a point and of its nodes, and clear the velocity changes."""
    inverse = 0.0
    for e in range(contact.row[p], contact.row[p + 1]):
        i = contact.node[e]
        at = contact.place[i]
        displacement = np.sqrt(u[0, at] ** 2 + u[1, at] ** 2 + u[2, at] ** 2)
        damping = contact.gamma_0[i] + contact.gamma_1[i] * displacement
        contact.inverse_mass[i] = 1.0 / (contact.mass[i] + dt * damping)
        inverse += contact.weight[e] ** 2 * contact.inverse_mass[i]
        for d in range(3):
            contact.velocity_change[i, d] = 0.0
    contact.inverse_effective_mass[a] = inverse


@kernel()
def solve_impulses(contact: Contact, tip_motion: Floats, count: int, dt: float) -> None:
    """Find the impulses of the active points and the velocity changes of the nodes.

    Projected Gauss-Seidel, in alternating directions through the points.
    """
    for a in range(count):
        first = contact.impulse[a]
        apply_impulse(contact, a, (first[0], first[1], first[2]))
    for sweep in range(SWEEPS):
        change, largest = 0.0, 0.0
        for k in range(count):
            a = k if sweep % 2 == 0 else count - 1 - k
            changed, size = solve_point(contact, tip_motion, a, dt)
            change, largest = max(change, changed), max(largest, size)
        if change <= TOLERANCE**2 * largest:
            break


@inner_kernel()
def apply_impulse(contact: Contact, a: int, impulse: Any) -> None:
    """Add the velocity changes of the nodes under an impulse [N s] on a point."""
    p = contact.active[a]
    for e in range(contact.row[p], contact.row[p + 1]):
        i = contact.node[e]
        share = contact.weight[e] * contact.inverse_mass[i]
        for d in range(3):
            contact.velocity_change[i, d] += share * impulse[d]


@inner_kernel()
def velocity_gain(contact: Contact, a: int, d: int) -> float:
    """Component d of the velocity change [m/s] of a point so far."""
    p, total = contact.active[a], 0.0
    for e in range(contact.row[p], contact.row[p + 1]):
        total += contact.weight[e] * contact.velocity_change[contact.node[e], d]
    return total


@inner_kernel()
def solve_point(contact: Contact, tip_motion: Floats, a: int, dt: float) -> Any:
    """Solve for the impulse of one point with all others fixed.

    Returns the squares of the change and of the magnitude of the impulse.
    """
    p, inverse, now = contact.active[a], contact.inverse_effective_mass[a], contact.impulse[a]
    t = contact.tool[p]
    x = contact.free_velocity[a, 0] + velocity_gain(contact, a, 0)
    y = contact.free_velocity[a, 1] + velocity_gain(contact, a, 1)
    z = contact.free_velocity[a, 2] + velocity_gain(contact, a, 2)
    if contact.bonded[p]:
        new = now[0] - x / inverse, now[1] - y / inverse, now[2] - z / inverse
    else:
        n, mu = contact.normal[a], contact.friction[t]
        normal_impulse = now[0] * n[0] + now[1] * n[1] + now[2] * n[2]
        normal_velocity = x * n[0] + y * n[1] + z * n[2]
        new_normal = max(0.0, normal_impulse - (normal_velocity + contact.bias[a]) / inverse)
        new = new_normal * n[0], new_normal * n[1], new_normal * n[2]
        if mu > 0.0:
            slip = (
                x - (tip_motion[6 * t] - tip_motion[6 * t + 3]) / dt,
                y - (tip_motion[6 * t + 1] - tip_motion[6 * t + 4]) / dt,
                z - (tip_motion[6 * t + 2] - tip_motion[6 * t + 5]) / dt,
            )
            new = with_friction(n, mu * new_normal, inverse, now, normal_impulse, new, slip)
    change = (new[0] - now[0], new[1] - now[1], new[2] - now[2])
    apply_impulse(contact, a, change)
    now[0], now[1], now[2] = new
    return dot(change, change), dot(new, new)


@inner_kernel()
def with_friction(
    n: Any, largest: float, inverse: float, now: Any, normal_impulse: float, new: Any, slip: Any
) -> Any:
    """The normal impulse plus the tangential one that stops the slip, limited to `largest`."""
    slip_normal = dot(slip, n)
    x = now[0] - normal_impulse * n[0] - (slip[0] - slip_normal * n[0]) / inverse
    y = now[1] - normal_impulse * n[1] - (slip[1] - slip_normal * n[1]) / inverse
    z = now[2] - normal_impulse * n[2] - (slip[2] - slip_normal * n[2]) / inverse
    size = np.sqrt(x * x + y * y + z * z)
    share = 1.0 if size <= largest else largest / size
    return new[0] + share * x, new[1] + share * y, new[2] + share * z


@inner_kernel()
def update_nodes(contact: Contact, count: int, dt: float, u: Floats, v: Floats) -> float:
    """Apply the velocity changes to the nodes and record overlaps; the largest change [m/s]."""
    for a in range(count):
        p, overlap = contact.active[a], 0.0
        for d in range(3):
            gain = velocity_gain(contact, a, d)
            if contact.bonded[p]:
                overlap += (dt * (contact.free_velocity[a, d] + gain)) ** 2
            else:
                overlap -= dt * gain * contact.normal[a, d]
            contact.body_force[p, d] = contact.impulse[a, d] / dt
        if contact.bonded[p]:
            overlap = np.sqrt(overlap)
        else:
            contact.previous_gap[p] -= overlap
            overlap = -contact.previous_gap[p]
        contact.totals[DEEPEST] = max(contact.totals[DEEPEST], overlap)
    largest = 0.0
    for a in range(count):
        p = contact.active[a]
        for e in range(contact.row[p], contact.row[p + 1]):
            i = contact.node[e]
            for d in range(3):
                gain = contact.velocity_change[i, d]
                v[d, contact.place[i]] += gain
                u[d, contact.place[i]] += dt * gain
                largest = max(largest, abs(gain))
                contact.velocity_change[i, d] = 0.0
    return np.sqrt(3.0) * largest  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def set_tool_forces(contact: Contact, count: int) -> None:
    """Set the force [N] of the body on each tool."""
    contact.tool_force[:] = 0.0
    for a in range(count):
        p = contact.active[a]
        for d in range(3):
            contact.tool_force[contact.tool[p], d] -= contact.body_force[p, d]
