"""The study: scenes, organs, curves and their similarity, results; `study.run` wires the models."""
