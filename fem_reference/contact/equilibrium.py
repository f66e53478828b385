"""Equilibrium of a body at large strain in contact with rigid tools.

    inertia M u + f(u, p) = load + G^T force,   0 <= gaps(u) _|_ force >= 0,   G = d gaps / du

with the mixed elements of `fem_reference.mixed_strain`. The method is a modified Newton method: the
factors of one tangent serve for as long as the iteration converges quickly with them. In each
iteration the contact forces follow from the compliance of the body at the contacts by a primal-dual
active set, or with friction by nonlinear Gauss-Seidel (`fem_reference.contact.law`). There is no
penalty stiffness: the penetration, the slip of what sticks and the residual forces of a state that
is returned are below their tolerances.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_array, csr_array

from fem_reference.contact.kinematics import Configuration, FiniteContact, PreviousState
from fem_reference.mixed_strain import MixedSolid
from study.numerics.continuation import NO_EQUILIBRIUM
from study.numerics.factors import symmetric_factors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

TOLERANCE = 1e-5
"""Residual forces relative to contact forces and loads."""
LEAST = 1e-5
"""Least scale of the residual forces, over the shear modulus times the body's size squared."""
CLOSED = 1e-7
"""Largest gap of a vertex with a contact force, relative to the body's size."""
SLOW = 0.5
"""Ratio of the errors of two iterations above which the tangent is factorised again."""
SAME = 1e-6
"""Relative difference of inertias that is rounding of the time step."""
MOST_FACTORISATIONS = 6
"""Factorisations for one state; a shorter increment succeeds sooner than more of them would."""
SHORTEST_STEP = 1 / 64
SLACK = 1e-3
"""Gap, relative to the body's size, below which a vertex is a candidate for the active set."""


class NoEquilibriumError(ValueError):
    """No equilibrium was found."""


class ContactState(NamedTuple):
    """Displacements [m] and pressures [Pa] w (n + pressures,), and contact forces [N] (c,)."""

    w: Floats
    force: Floats


class Increment(NamedTuple):
    """The equilibrium problem at a time [s] under a `load` [N] (n,).

    `inertia` [1/s^2]: factor of the mass, 0 in statics; `previous`: the last equilibrium, without
    one the given shape at time zero.
    """

    time: float
    inertia: float
    load: Floats
    previous: PreviousState | None = None


@dataclass(frozen=True, eq=False)
class ContactBody:
    """A body that tools may touch.

    `mass` [kg] (n, n); `free` (n + pressures,): unknowns that are not fixed; `origin` [m] (n,):
    displacement from the stress-free to the given shape, from which the gaps are measured.
    """

    solid: MixedSolid
    contact: FiniteContact
    mass: csc_array
    free: Bools
    origin: Floats

    def given(self, w: Floats) -> Floats:
        """Displacement [m] (n,) from the given shape."""
        return np.asarray(w[: self.solid.size] - self.origin)

    def residual(self, state: ContactState, increment: Increment, G: csr_array) -> Floats:
        """Residual forces [N], then volumes [m^3], shape of w; G (c, n): derivative of the gaps."""
        n = self.solid.size
        found = -self.solid.gradient(state.w)
        found[:n] += increment.load + G.T @ state.force
        found[:n] -= increment.inertia * (self.mass @ state.w[:n])
        found[~self.free] = 0.0
        return found

    def configuration(self, w: Floats, increment: Increment) -> Configuration:
        """Positions of body and tools at the time of an increment."""
        return self.contact.at(self.given(w), increment.time, increment.previous)

    def tangent(
        self, state: ContactState, increment: Increment, configuration: Configuration
    ) -> csc_array:
        """Derivative of the residual at constant contact forces, negated, of the free unknowns."""
        curvature = configuration.curvature(state.force)
        own = csc_array(increment.inertia * self.mass - curvature)
        pressures = csc_array((self.solid.pressures, self.solid.pressures))
        whole = self.solid.tangent(state.w) + block_diag([own, pressures], format="csc")
        return csc_array(whole) if self.free.all() else csc_array(whole[self.free][:, self.free])


class FactorisedTangent:
    """Factors of a tangent; responses to unit contact forces are computed when first needed.

    NoEquilibriumError for a singular matrix.
    """

    def __init__(self, matrix: csc_array, free: Bools, G: csr_array, inertia: float) -> None:
        self.free, self.G, self.inertia = free, G, inertia
        self.factors: Any = symmetric_factors(matrix)
        if self.factors is None:
            raise NoEquilibriumError("the tangent is singular: the support does not hold the body")
        self._columns: dict[int, Floats] = {}

    def solve(self, right: Floats) -> Floats:
        """Linear response, shape of w, to forces [N] and volumes [m^3]."""
        found = np.zeros_like(right)
        found[self.free] = self.factors.solve(right[self.free])
        return found

    def responses(self, chosen: Ints) -> Floats:
        """Linear responses (n + pressures, k) to unit forces of the chosen constraints (k,)."""
        new = np.array([j for j in chosen if j not in self._columns], dtype=np.int64)
        if len(new):
            right = np.zeros((len(self.free), len(new)))
            right[: self.G.shape[1]] = self.G[new].toarray().T
            self._columns |= dict(zip(new.tolist(), self.solve(right).T, strict=True))
        found = np.empty((len(self.free), len(chosen)))
        for k, j in enumerate(chosen.tolist()):
            found[:, k] = self._columns[j]
        return found


class EquilibriumSolver:
    """Finds equilibria of a body one after another, reusing the factors of a tangent.

    `iterations` and `factorisations`: numbers so far.
    """

    def __init__(self, body: ContactBody) -> None:
        self.body = body
        self.iterations = self.factorisations = 0
        self._tangent: FactorisedTangent | None = None
        solid = body.solid
        self._force_per_unknown = np.where(
            np.arange(len(body.free)) < solid.size, 1.0, solid.typical_shear / solid.length
        )
        self._least_force = LEAST * solid.typical_shear * solid.length**2

    def solve(self, guess: ContactState, increment: Increment, scale: float = 0.0) -> ContactState:
        """The equilibrium of an increment, sought from a guess; `scale` [N]: size of the loads.

        NoEquilibriumError if none is found.
        """
        state, last, begun = self._released(guess, increment), np.inf, self.factorisations
        while self.factorisations - begun <= MOST_FACTORISATIONS:
            configuration = self.body.configuration(state.w, increment)
            residual = self.body.residual(state, increment, configuration.derivative)
            error = self._error(residual, state, configuration, scale)
            if not np.isfinite(error):
                break
            if error <= 1.0:
                return state
            kept = self._kept_tangent(increment) if error <= SLOW * last else None
            tangent = kept or self._factorise(state, increment, configuration)
            last = error
            try:
                state = self._iterate(tangent, state, residual, configuration)
            except NoEquilibriumError:
                if kept is None:
                    break
                last = 0.0  # factorises the tangent of this state
            self.iterations += 1
        self._tangent = None
        raise NoEquilibriumError(NO_EQUILIBRIUM)

    def _released(self, guess: ContactState, increment: Increment) -> ContactState:
        """The guess without the forces of vertices that are no longer opposite a tool."""
        contact, gaps = self.body.contact, self.body.configuration(guess.w, increment).gaps
        beside = np.isinf(gaps)[contact.normal_rows]
        return guess._replace(force=np.where(beside, 0.0, guess.force))

    def compatible_velocity(
        self, state: ContactState, v: Floats, increment: Increment, earlier: float
    ) -> Floats:
        """The velocity [m/s] (n,) nearest to v that keeps closed gaps closed, and sticking points.

        Nearest in the norm of the last tangent. The velocity of the tools is their travel since the
        `earlier` time [s], shortly before that of the increment.
        """
        chosen, tangent = np.flatnonzero(self.body.contact.closed(state.force)), self._tangent
        if tangent is None or not len(chosen):
            return v
        now, then = (
            self.body.configuration(state.w, increment._replace(time=time))
            for time in (increment.time, earlier)
        )
        closing = (now.gaps[chosen] - then.gaps[chosen]) / (increment.time - earlier)
        G = now.derivative[chosen]
        columns = tangent.responses(chosen)[: len(v)]
        impulse = np.linalg.lstsq(G @ columns, -(closing + G @ v))[0]
        return np.asarray(v + columns @ impulse)

    def _kept_tangent(self, increment: Increment) -> FactorisedTangent | None:
        """The last tangent if it is of the same inertia."""
        kept = self._tangent
        if kept is None or not math.isclose(kept.inertia, increment.inertia, rel_tol=SAME):
            return None
        return kept

    def _factorise(
        self, state: ContactState, increment: Increment, configuration: Configuration
    ) -> FactorisedTangent:
        self.factorisations += 1
        matrix, G = self.body.tangent(state, increment, configuration), configuration.derivative
        self._tangent = FactorisedTangent(matrix, self.body.free, G, increment.inertia)
        return self._tangent

    def _error(
        self, residual: Floats, state: ContactState, configuration: Configuration, scale: float
    ) -> float:
        """The larger of the residual and the violation of the contact law over their tolerances."""
        nodal = configuration.derivative.T @ state.force
        scale = max(scale, float(np.linalg.norm(nodal)), self._least_force)
        unbalanced = float(np.linalg.norm(self._force_per_unknown * residual)) / (TOLERANCE * scale)
        length = self.body.solid.length
        stiffness = self.body.solid.typical_shear * length
        violation = self.body.contact.law_residual(configuration.gaps, state.force, stiffness)
        return max(unbalanced, violation / (CLOSED * length))

    def _iterate(
        self,
        tangent: FactorisedTangent,
        state: ContactState,
        residual: Floats,
        configuration: Configuration,
    ) -> ContactState:
        """The next iterate, whose forces meet the law of contact linearised about the state."""
        n, contact = self.body.solid.size, self.body.contact
        step = tangent.solve(residual)
        gaps = configuration.gaps + configuration.derivative @ step[:n]
        near = (state.force > 0.0) | (gaps < SLACK * self.body.solid.length)
        chosen = np.flatnonzero(contact.bonded | near[contact.normal_rows])
        columns = tangent.responses(chosen)
        compliance = tangent.G[chosen] @ columns[:n]
        compliance = 0.5 * (compliance + compliance.T)
        old = state.force[chosen]
        try:
            change = contact.contact_forces(compliance, gaps[chosen], chosen, old) - old
        except (np.linalg.LinAlgError, RuntimeError) as error:
            raise NoEquilibriumError("no contact forces found") from error
        step = step + columns @ change
        length = self._step_length(state.w, step)
        force = state.force.copy()
        force[chosen] += length * change
        return ContactState(state.w + length * step, force)

    def _step_length(self, w: Floats, step: Floats) -> float:
        """Largest fraction 1, 1/2, 1/4, ... of a step that inverts no element."""
        length = 1.0
        while self.body.solid.volume_ratio(w + length * step).min() <= 0.0:
            length *= 0.5
            if length < SHORTEST_STEP:
                raise NoEquilibriumError("every step inverts an element")
        return length
