"""Conversion of systems: Sugeno from Mamdani, type-1 from type-2."""

from dataclasses import replace

from fuzzy.systems.sets import TYPE_1, FuzzySet
from fuzzy.systems.sugeno import constants
from fuzzy.systems.system import FuzzySystem, Variable


def sugeno_of(system: FuzzySystem, sampling: str = "matlab", samples: int = 101) -> FuzzySystem:
    """The system with every output set replaced by the constant at its centroid.

    Its Sugeno inference equals that of the original system; a Sugeno system is returned unchanged.
    """
    if system.is_sugeno:
        return system
    centroids = constants(system, sampling, samples).tolist()
    sets = tuple(
        FuzzySet(one.name, "constant", (centroid,))
        for one, centroid in zip(system.output.sets, centroids, strict=True)
    )
    operators = replace(system.operators, aggregation="max", defuzzification="centroid")
    return replace(system, output=replace(system.output, sets=sets), operators=operators)


def type_1_of(system: FuzzySystem) -> FuzzySystem:
    """The system without footprints, which Mamdani and Sugeno inference do not use."""
    inputs = tuple(_principal(variable) for variable in system.inputs)
    return replace(system, inputs=inputs, output=_principal(system.output))


def _principal(variable: Variable) -> Variable:
    return replace(variable, sets=tuple(replace(one, footprint=TYPE_1) for one in variable.sets))
