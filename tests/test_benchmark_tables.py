"""Tables of benchmarks: committed ones are read and written as they are, runs resume."""

from functools import partial
from typing import NamedTuple

import pytest

from tests.benchmarks import (
    bench_fem,
    bench_lattice,
    bench_peers,
    corrected_gravity,
    corrected_places,
    error_bar,
    error_bar_livers,
    field_error,
    graded_cells,
    graded_places,
    graded_rest,
    large_strain,
    lattice_growth,
    multirate,
    planned_places,
    planned_tools,
    travelling,
)
from tests.benchmarks.tables import complete, read, write

COMMITTED = (
    (bench_fem.TABLE, bench_fem.Row, 4),
    (bench_lattice.TABLE, bench_lattice.Row, 6),
    (bench_lattice.KERNELS, bench_lattice.Kernel, 6),
    (bench_peers.TABLE, bench_peers.Row, 4),
    (corrected_gravity.TABLE, corrected_gravity.Row, 4),
    (corrected_places.TABLE, corrected_places.Row, 4),
    (corrected_places.COSTS, corrected_places.Cost, 4),
    (error_bar.TABLE, error_bar.Row, 4),
    (error_bar_livers.TABLE, error_bar_livers.Row, 4),
    (field_error.TABLE, field_error.Row, 8),
    (graded_cells.OWN, graded_cells.Row, 4),
    (graded_places.TABLE, graded_places.Row, 4),
    (graded_rest.TABLE, graded_rest.Row, 4),
    (large_strain.TABLE, large_strain.Row, 6),
    (large_strain.ELEMENTS_TABLE, large_strain.Compared, 6),
    (lattice_growth.DATA / "lattice_growth.csv", lattice_growth.Step, 4),
    (lattice_growth.DATA / "run_growth.csv", lattice_growth.Whole, 4),
    (multirate.TABLE, multirate.Row, 4),
    (planned_places.TABLE, planned_places.Row, 4),
    (planned_tools.TABLE, planned_tools.Row, 4),
    (travelling.STATIONS, travelling.Off, 4),
    (travelling.PLACES, travelling.Row, 4),
    (travelling.GRADED, travelling.Graded, 4),
    (travelling.COSTS, travelling.Cost, 4),
)


@pytest.mark.parametrize(
    ("path", "row", "digits"), COMMITTED, ids=[path.stem for path, _, _ in COMMITTED]
)
def test_a_committed_table_read_and_written_is_itself(tmp_path, path, row, digits):
    """Its fields are those of its rows, in their order and with their types."""
    again = tmp_path / path.name
    assert write(again, read(path, row), digits)
    assert again.read_text() == path.read_text()


class Row(NamedTuple):
    scene: str
    value: float


def test_a_stopped_benchmark_resumes_with_what_is_missing(tmp_path):
    computed, path = [], tmp_path / "table.csv"

    def rows(name):
        if name == "second" and "second" not in computed:
            computed.append(name)
            raise KeyboardInterrupt
        computed.append(name)
        yield Row(name, 0.5)

    tasks = {name: partial(rows, name) for name in ("first", "second")}
    with pytest.raises(KeyboardInterrupt):
        complete(path, Row, tasks, lambda one: one.scene)
    assert read(path, Row) == [Row("first", 0.5)]
    found = complete(path, Row, tasks, lambda one: one.scene)
    assert computed == ["first", "second", "second"]
    assert found == read(path, Row) == [Row("first", 0.5), Row("second", 0.5)]
