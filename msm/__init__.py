"""Mass-spring models: the fuzzy-tuned lattice, the Basafa benchmark, the single control point."""

from pathlib import Path

from msm.compiled import drop_outdated

drop_outdated(Path(__file__).parent)  # before any kernel is loaded
