"""Keep of a run of the built-in liver what the pages quote and show.

`python docs/example.py results/liver` writes the picture liver.png, and into data/ the table
liver.csv and the sensitivity of the estimates.
"""

import csv
import shutil
import sys
import tempfile
from pathlib import Path

import typst

from reports.cut_figure import cut_figure
from study.results import Results

HERE = Path(__file__).parent
COLUMNS = (
    *("model", "modulus_pa", "lower_pa", "upper_pa"),
    *("field_difference", "at_best_stiffness", "own_error", "unknowns"),
)


def rows(results: Results) -> list[list[object]]:
    """A row per model, in the order of the run: columns as in COLUMNS, None where there is none."""
    shares = {
        (one.model, one.reference, one.quantity): one.value for one in results.field_differences
    }
    found = []
    for model in results.record.models:
        estimate = results.record.fuzzy.systems.get(model.system or "")
        lower, upper = (estimate and estimate.interval_pa) or (None, None)
        found.append(
            [
                *(model.name, model.small_strain_modulus_pa, lower, upper),
                shares.get((model.name, "fem", "field-relative-l2-peak")),
                shares.get((model.name, "fem", "field-relative-l2-peak-at-best-factor")),
                model.mesh_error and model.mesh_error.field_peak,
                model.elements and model.elements.unknowns,
            ]
        )
    return found


def picture(results: Results) -> bytes:
    """PNG of the cut through the tool's axis at peak load, as the report has it."""
    drawn = cut_figure(results)
    if drawn is None:
        raise ValueError("results without fields: run the liver with renders = true")
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "page.typ"
        (page.parent / "cut.svg").write_bytes(drawn)
        page.write_text('#set page(width: auto, height: auto, margin: 6pt)\n#image("cut.svg")')
        return bytes(typst.compile(str(page), format="png", ppi=100))


def main(folder: Path) -> None:
    """Write the tables and the picture of a results folder."""
    results = Results.load(folder)
    with (HERE / "data" / "liver.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([COLUMNS, *rows(results)])
    shutil.copyfile(folder / "sensitivity.csv", HERE / "data" / "sensitivity.csv")
    (HERE / "liver.png").write_bytes(picture(results))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
