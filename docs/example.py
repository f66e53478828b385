"""Keep of a run of the built-in liver what the pages quote and show.

`python docs/example.py results/liver` writes the picture liver.png, and into data/ the table
liver.csv and the sensitivity of the estimates.
"""

import csv
import json
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
COLUMNS = (
    *("model", "modulus_pa", "lower_pa", "upper_pa"),
    *("field_difference", "at_best_stiffness", "own_error", "unknowns"),
)


def rows(folder: Path) -> list[list[object]]:
    """A row per model, in the order of the run: columns as in COLUMNS, None where there is none."""
    numbers = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    with (folder / "errors.csv").open(newline="", encoding="utf-8") as file:
        errors = {tuple(line[:3]): float(line[3]) for line in list(csv.reader(file))[1:]}
    found = []
    for record in numbers["models"]:
        name = record["name"]
        lower, upper = numbers["stiffness"].get(name[4:], {}).get("interval_pa", (None, None))
        found.append(
            [
                *(name, record.get("small_strain_modulus_pa"), lower, upper),
                errors.get((name, "fem", "field-relative-l2-peak")),
                errors.get((name, "fem", "field-relative-l2-peak-at-best-factor")),
                record.get("mesh_error", {}).get("field_peak"),
                record.get("unknowns"),
            ]
        )
    return found


def picture(folder: Path) -> bytes:
    """PNG of the deformed organ in each model at peak load, as page one of the report has it."""
    import typst

    from reports.field_figures import field_figures, job, views
    from reports.renders import render
    from study.results.folder import read

    seen = views(read(folder))
    if seen is None:
        raise ValueError(f"{folder}: results without fields; run the liver with renders = true")
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "page.typ"
        (page.parent / "fields.svg").write_bytes(field_figures(seen, render(job(seen)))[0])
        page.write_text('#set page(width: auto, height: auto, margin: 6pt)\n#image("fields.svg")')
        return bytes(typst.compile(str(page), format="png", ppi=100))


def main(folder: Path) -> None:
    """Write the tables and the picture of a results folder."""
    with (HERE / "data" / "liver.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([COLUMNS, *rows(folder)])
    shutil.copyfile(folder / "sensitivity.csv", HERE / "data" / "sensitivity.csv")
    (HERE / "liver.png").write_bytes(picture(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
