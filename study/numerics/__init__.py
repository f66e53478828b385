"""Numerical methods that elements and lattices share: paths of equilibria, symmetric factors."""
