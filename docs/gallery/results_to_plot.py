"""A scene through its models, to a results folder, to a plot in three lines."""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

from study.results import Results
from study.results.folder import write
from study.run.study import run_study
from study.scene.file import read_scene

with TemporaryDirectory() as name:
    folder = Path(name)
    write(run_study(read_scene("paper")), folder)  # or: liver-study run paper --out FOLDER

    results = Results.load(folder)
    for model in results.record.models:
        motion = results.curve(model.name, "control-point")
        plt.plot(motion.time, 1e3 * motion.displacement, label=model.label)
    plt.xlabel("time [s]")
    plt.ylabel("displacement [mm]")
    plt.legend()
    plt.savefig(folder / "curves.svg")

score = next(
    row
    for row in results.scores
    if (row.model, row.curve, row.measure) == ("msm-sugeno", "displacement", "iso-18571")
)
answer = score.score
print(f"{score.model} against {score.reference}: {answer:.4f} by {score.measure}")
