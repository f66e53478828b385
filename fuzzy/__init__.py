"""Fuzzy systems (Mamdani, Sugeno, interval type-2), and the liver stiffness that one estimates.

>>> import fuzzy, numpy as np
>>> f"{fuzzy.estimate({'hcv': 9500.0}, 'mamdani').estimate:.0f} Pa"
'9081 Pa'
>>> system = fuzzy.liver_system(fuzzy.LiverSettings())  # or fuzzy.read_rule_base(Path("my.fis"))
>>> fuzzy.infer(system, np.array([[9.5, 6.0, 20.0, 8.0, 7.0]]), "sugeno").value.round(2)
array([9.09])

`__all__` is what other programs may build on: its names and what they mean stay from one version to
the next but for what CHANGELOG announces, while the modules below may move. Each is imported when
it is first asked for, so that one estimate does not load what reads files, compiles or explains.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fuzzy.liver.assumptions import assumptions
    from fuzzy.liver.readings import READINGS
    from fuzzy.liver.settings import LiverSettings
    from fuzzy.liver.stiffness import StiffnessEstimate, estimate
    from fuzzy.liver.system import liver_system
    from fuzzy.liver.table1 import AETIOLOGIES
    from fuzzy.systems.audit import Audit, audit, audit_lines
    from fuzzy.systems.compiled import Compiled, compiled
    from fuzzy.systems.conversion import sugeno_of, type_1_of
    from fuzzy.systems.explain import Explanation, explain
    from fuzzy.systems.explanation_text import explanation_lines
    from fuzzy.systems.files import read_rule_base, write_rule_base
    from fuzzy.systems.inference import Inferred, infer
    from fuzzy.systems.kinds import SYSTEMS
    from fuzzy.systems.options import InferenceOptions
    from fuzzy.systems.scikit_fuzzy import from_skfuzzy, to_skfuzzy
    from fuzzy.systems.sets import Footprint, FuzzySet
    from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable
    from fuzzy.systems.table import evaluate_table

__all__ = [
    "AETIOLOGIES",
    "READINGS",
    "SYSTEMS",
    "Audit",
    "Compiled",
    "Explanation",
    "Footprint",
    "FuzzySet",
    "FuzzySystem",
    "InferenceOptions",
    "Inferred",
    "LiverSettings",
    "Operators",
    "Rule",
    "StiffnessEstimate",
    "Term",
    "Variable",
    "assumptions",
    "audit",
    "audit_lines",
    "compiled",
    "estimate",
    "evaluate_table",
    "explain",
    "explanation_lines",
    "from_skfuzzy",
    "infer",
    "liver_system",
    "read_rule_base",
    "sugeno_of",
    "to_skfuzzy",
    "type_1_of",
    "write_rule_base",
]

_NAMES = {
    "liver.assumptions": ("assumptions",),
    "liver.readings": ("READINGS",),
    "liver.settings": ("LiverSettings",),
    "liver.stiffness": ("StiffnessEstimate", "estimate"),
    "liver.system": ("liver_system",),
    "liver.table1": ("AETIOLOGIES",),
    "systems.audit": ("Audit", "audit", "audit_lines"),
    "systems.compiled": ("Compiled", "compiled"),
    "systems.conversion": ("sugeno_of", "type_1_of"),
    "systems.explain": ("Explanation", "explain"),
    "systems.explanation_text": ("explanation_lines",),
    "systems.files": ("read_rule_base", "write_rule_base"),
    "systems.inference": ("Inferred", "infer"),
    "systems.kinds": ("SYSTEMS",),
    "systems.options": ("InferenceOptions",),
    "systems.scikit_fuzzy": ("from_skfuzzy", "to_skfuzzy"),
    "systems.sets": ("Footprint", "FuzzySet"),
    "systems.system": ("FuzzySystem", "Operators", "Rule", "Term", "Variable"),
    "systems.table": ("evaluate_table",),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> object:
    """Import an exported name from its module; AttributeError for any other."""
    if name not in _MODULES:
        raise AttributeError(f"module 'fuzzy' has no attribute {name!r}")
    return getattr(import_module(f"fuzzy.{_MODULES[name]}"), name)
