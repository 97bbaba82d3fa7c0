"""Tables: what is written is read back, and what cannot be read is told."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.run import tables
from pipeline.run.artifacts import ArtifactError


def test_columns_come_back_as_they_were(tmp_path: Path) -> None:
    columns = {
        "count": np.arange(3),
        "single": np.array([0.1, np.nan, -0.0], dtype=np.float32),
        "exact": np.array([0.1, np.nextafter(1.0, 2.0), 5e-324]),
        "is_so": np.array([True, False, True]),
        "word": ["a", "ü", ""],
    }
    tables.write_parquet(tmp_path / "sub" / "table.parquet", columns)
    found = tables.read_parquet(tmp_path, "sub/table.parquet")
    assert list(found) == list(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(found[name], values)
        assert name == "word" or found[name].dtype == np.asarray(values).dtype


def test_a_matrix_becomes_a_list_a_row(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).random((3, 4))
    tables.write_parquet(tmp_path / "table.parquet", {"genome": rows})
    np.testing.assert_array_equal(np.stack(tables.read_parquet(tmp_path, "table.parquet")["genome"]), rows)


@pytest.mark.parametrize("kept", [0, 10, -20])
def test_a_cut_table_is_refused(kept: int, tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    tables.write_parquet(path, {"count": np.arange(100)})
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(
        ArtifactError, match=r"table.parquet cannot be read .*; repeat the stage that writes it"
    ):
        tables.read_parquet(tmp_path, "table.parquet")


def test_a_missing_table_is_told_with_the_stage_that_writes_it(tmp_path: Path) -> None:
    with pytest.raises(
        ArtifactError, match=r"has no evaluate/episodes.parquet; the stage evaluate writes it"
    ):
        tables.read_parquet(tmp_path, "evaluate/episodes.parquet")


def test_numbers_in_csv_read_back_to_the_same_bits(tmp_path: Path) -> None:
    numbers = [0.1 + 0.2, 1e-310, 1.7976931348623157e308, -0.0, np.float64(1.0) / 3.0]
    tables.write_csv(tmp_path / "table.csv", ["name", "value"], [[f"n{i}", x] for i, x in enumerate(numbers)])
    lines = (tmp_path / "table.csv").read_bytes().decode().split("\n")
    assert lines[0] == "name,value"
    assert lines[-1] == ""
    assert [float(line.split(",")[1]).hex() for line in lines[1:-1]] == [float(x).hex() for x in numbers]


@pytest.mark.parametrize("cuts", [(4,), (1, 2, 3), (10, 20, 23), (7, 14)])
def test_a_table_in_parts_becomes_the_bytes_of_one_written_whole(cuts, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "GROUP_ROWS", 5)
    columns = {"case": np.arange(23), "cost": np.linspace(0.0, 1.0, 23), "at": np.ones((23, 3))}
    tables.write_parquet(tmp_path / "whole", columns)
    bounds = [0, *cuts, 23]
    parts = [tmp_path / f"part-{first}" for first in bounds[:-1]]
    for part, first, last in zip(parts, bounds, bounds[1:], strict=False):
        tables.write_parquet(part, {name: column[first:last] for name, column in columns.items()})
    tables.join_parquet(tmp_path / "joined", parts)
    assert (tmp_path / "joined").read_bytes() == (tmp_path / "whole").read_bytes()
    assert pq.read_metadata(tmp_path / "joined").num_row_groups == 5
