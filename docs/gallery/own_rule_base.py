"""A rule base of one's own, as MATLAB writes it: read, asked, and given to scikit-fuzzy."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import fuzzy

STIFFNESS = """
[System]
Name='liver'
Type='mamdani'
Version=2.0
NumInputs=1
NumOutputs=1
NumRules=2
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'

[Input1]
Name='reading'
Range=[2 20]
NumMFs=2
MF1='soft':'trapmf',[2 2 5 12]
MF2='stiff':'trapmf',[5 12 20 20]

[Output1]
Name='modulus'
Range=[0 20]
NumMFs=2
MF1='low':'trimf',[0 5 10]
MF2='high':'trimf',[8 14 20]

[Rules]
1, 1 (1) : 1
2, 2 (1) : 1
"""

with TemporaryDirectory() as folder:
    file = Path(folder) / "stiffness.fis"
    file.write_text(STIFFNESS)
    system = fuzzy.read_rule_base(file)

readings = np.array([[4.0], [8.0], [15.0]])
moduli = fuzzy.infer(system, readings, "mamdani").value
for (reading,), modulus in zip(readings, moduli, strict=True):
    print(f"a reading of {reading:4.1f} kPa gives {modulus:5.2f} kPa")

from skfuzzy.control import ControlSystemSimulation  # noqa: E402 - where it is used

theirs = ControlSystemSimulation(fuzzy.to_skfuzzy(system))
theirs.input["reading"] = 8.0
theirs.compute()
answer = theirs.output["modulus"]
print(f"scikit-fuzzy, for 8 kPa: {answer:.2f} kPa")
