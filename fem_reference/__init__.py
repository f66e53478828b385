"""Linear-elastic finite-element reference: quadratic tetrahedra on scikit-fem, implicit steps."""
