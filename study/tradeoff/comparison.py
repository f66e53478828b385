"""What configurations are compared with: the scene's reference, or the finest lattice of a family.

Under moved tools the reference is the scene's finite elements, if the scene names them and they
finish with a known error. Otherwise each lattice is compared with a finer one of the same springs,
which gives its discretisation error alone; that error is also reported beside the reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.models.lattice import LatticeModel
from study.models.spacing_error import CHANGE, COARSER, force_differences
from study.run.scene_problem import SceneProblem
from study.scene import Scene
from study.similarity.fields import relative_l2, relative_l2_of_curves
from study.sweep.canonical import restored
from study.sweep.runner import Outcome
from study.tradeoff.contenders import Configuration, contender, fraction
from study.tradeoff.errors import Errors, errors
from study.tradeoff.observation import Observed
from study.tradeoff.reference import ReferenceSolution, SolvedReference

FINEST = 0.5
"""Spacing of the lattice that others are compared with, over that of the scene's own lattice."""
Family = tuple[str, bool]
"""Lattices of the same springs: the kind of their model, and whether they have a volume term."""


@dataclass(frozen=True)
class Comparison:
    """The reference, None if there is none to compare with, and the finest lattices.

    `solved`: the record of the reference; `why`: the reason why a requested reference is missing.
    """

    given: SceneProblem
    reference: ReferenceSolution | None
    solved: SolvedReference | None
    finest: Mapping[Family, ReferenceSolution]
    why: str = ""

    def truth(self, one: Configuration) -> ReferenceSolution:
        """The reference solution for a configuration."""
        return self.finest[family(one)] if self.reference is None else self.reference

    def errors(self, one: Configuration, outcome: Outcome) -> Errors:
        """Errors of the run of a configuration."""
        found = errors(outcome, self.truth(one), self.given)
        if family(one) not in self.finest or is_finest(self.given.scene, one):
            return found
        apart = errors(outcome, self.finest[family(one)], self.given)
        return replace(found, discretisation=apart.force)

    @property
    def words(self) -> str:
        """The reference of the errors, in words."""
        if self.reference is not None:
            return "the scene's finite elements" if self.finest else "the converged reference"
        finest = 1e3 * FINEST * self.given.scene.lattice.spacing
        return f"the finest lattice of the same springs, {finest:.3g} mm: discretisation alone"


def family(one: Configuration) -> Family:
    """The family of a lattice."""
    return contender(one.contender).model, bool(one.settings.get("volume_term", False))


def is_lattice(scene: Scene, one: Configuration) -> bool:
    """Whether it has a spacing that can be refined."""
    return isinstance(one.model(scene), LatticeModel)


def refuse_unlike(scene: Scene, chosen: Iterable[Configuration]) -> None:
    """Raise ValueError for a configuration that is no lattice and so has no finer one."""
    for one in chosen:
        if not is_lattice(scene, one):
            raise ValueError(
                f"contender {one.contender}: under tools that are moved it is compared with finite "
                'elements only; add "fem" to models'
            )


def is_finest(scene: Scene, one: Configuration) -> bool:
    """Whether it is what others of its family are compared with."""
    return one == _lattice(scene, family(one), FINEST)


def lattices(scene: Scene, chosen: Iterable[Configuration]) -> dict[Family, list[Configuration]]:
    """The finest lattice of each family among those chosen, and the one that gives its error."""
    like = (one for one in chosen if is_lattice(scene, one))
    families = dict.fromkeys(family(one) for one in like)
    return {
        one: [_lattice(scene, one, times) for times in (FINEST, COARSER * FINEST)]
        for one in families
    }


def _lattice(scene: Scene, springs: Family, times: float) -> Configuration:
    """A lattice of a family, with the contenders' settings, so that its run is one of theirs."""
    model, volume_term = springs
    spacing, step = times * scene.lattice.spacing, {"step_fraction": fraction(scene)}
    if model != "tissue":
        return Configuration(model, {"spacing": spacing, **step})
    name = "volume-springs" if volume_term else "springs"
    return Configuration(name, {"spacing": spacing, "volume_term": volume_term, **step})


def truth_of(outcomes: Sequence[Outcome], given: SceneProblem) -> ReferenceSolution:
    """The finest lattice of a family as reference solution, from both runs of `lattices`.

    Its own errors are Richardson's estimates from the changes due to halving the spacing, without
    the safety factor of a run's: with it, errors of lattices of a few spacings would be below them.
    ValueError where one of the two did not finish.
    """
    finest, coarser = (_whole(one, given) for one in outcomes)
    if finest is None or coarser is None:
        raise ValueError(
            "a lattice that others are to be compared with did not reach the end "
            f"({_causes(outcomes)}); reduce the displacement of the tools or lattice.step_fraction"
        )
    volumes = given.problem.volume_rule.weights
    curves = relative_l2_of_curves(coarser.curves - finest.curves, finest.curves)
    over_time, peak = CHANGE * force_differences(given.problem, coarser.force, finest.force)
    return replace(
        finest,
        field_error=CHANGE * relative_l2(coarser.field, finest.field, volumes),
        curve_errors=CHANGE * curves,
        force_errors=over_time,
        peak_errors=np.maximum(over_time, peak),  # single numbers may coincide
    )


def _causes(outcomes: Sequence[Outcome]) -> str:
    lost = [one for one in outcomes if one.value is None or one.value["field"] is None]
    return ", ".join(one.message or "diverged" for one in lost)


def _whole(outcome: Outcome, given: SceneProblem) -> ReferenceSolution | None:
    """The result of a run, as if it were exact; None if it did not finish."""
    found = None if outcome.value is None else restored(Observed, outcome.value)
    if found is None or found.field is None or found.curves is None or found.inverted_cells:
        return None
    samples, probes = len(given.problem.observation.times), len(given.problem.probes)
    tools = len(given.problem.rigid_tools)
    return ReferenceSolution(
        np.reshape(found.field, (-1, 3)),
        np.reshape(found.curves, (samples, probes, 3)),
        0.0,
        np.zeros(probes),
        np.reshape(found.force or [], (samples, tools, 3)),
        np.zeros(tools),
        np.zeros(tools),
    )
