"""How far the paper's ranking of fuzzy systems depends on what the paper leaves open.

The control mass point of the paper is moved for many draws of all that is unknown of it, each fuzzy
system is scored against the benchmark, and the draws are summed up: how often each system is
nearest, how far scores lie apart, whether Table III comes out, and which unknown moves what.
"""
