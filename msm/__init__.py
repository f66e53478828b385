"""Mass-spring models: the fuzzy-tuned lattice, the Basafa benchmark, the single control point."""
