"""The three kinds of inference that one rule base serves."""

from collections.abc import Callable
from typing import NamedTuple

from fuzzy.systems import interval_type2, mamdani, sugeno
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import Output
from fuzzy.systems.sets import Array, lower_membership, membership, upper_membership
from fuzzy.systems.system import FuzzySystem, Membership


class Inference(NamedTuple):
    """One kind of inference on a fuzzy system.

    `evaluate` computes the output for readings X (N, inputs) without clamping; `method` describes
    it in a sentence; `bounds` are its lower and upper membership functions, equal for type-1.
    """

    evaluate: Callable[[FuzzySystem, Array, InferenceOptions], Output]
    method: Callable[[FuzzySystem, InferenceOptions], str]
    bounds: tuple[Membership, Membership] = (membership, membership)


SYSTEMS: dict[str, Inference] = {
    "mamdani": Inference(mamdani.evaluate, mamdani.method),
    "sugeno": Inference(sugeno.evaluate, sugeno.method),
    "interval-type-2": Inference(
        interval_type2.evaluate, interval_type2.method, (lower_membership, upper_membership)
    ),
}


def check_kind(system: FuzzySystem, kind: str) -> None:
    """ValueError if the kind is unknown or the system does not support it."""
    if kind not in SYSTEMS:
        raise ValueError(f"system {kind!r}: use one of {', '.join(SYSTEMS)}")
    if system.is_sugeno and kind != "sugeno":
        raise ValueError(
            f"{system.name}: its consequents are constants, so it can only be evaluated as sugeno: "
            f"name no other system, or give its output membership functions for {kind}"
        )
    if kind == "interval-type-2":
        mamdani.require_centroid_of_union(system, kind)


def is_compiled(system: FuzzySystem, kind: str) -> bool:
    """Whether compiled kernels support the operators of the system, regardless of the sampling."""
    if kind == "sugeno":
        return system.operators.defuzzification != "wtsum"
    return system.operators.is_centroid_of_union
