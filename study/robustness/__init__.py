"""Robustness of the paper's ranking of fuzzy systems against what the paper leaves open.

The control mass point of the paper is moved for many draws of all unknowns. Each fuzzy system is
scored against the benchmark, and the draws are summarised: how often each system is nearest, how
scores differ, whether Table III is reproduced, and which unknown affects what.
"""
