"""Parts of a campaign certify their rows, and are joined in any cut."""

import hashlib
import json
import struct

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.evaluation import parts
from pipeline.run import artifacts, maker, tables

CERTIFIED = (parts.MAKERS, parts.ROWS, parts.STATISTICS)
NAMES = ("delta_v_m_s", "inspection_rate_percent", "mean_distance_m")


def flown(first: int, past: int) -> dict[str, np.ndarray]:
    generator = np.random.default_rng(first)
    numbers = {name: generator.random(past - first) for name in NAMES}
    return {
        "case": np.arange(first, past),
        **numbers,
        "success": generator.random(past - first) < 0.5,
        "violated": np.zeros(past - first, np.bool_),
    }


def written(folder, first, past):
    columns = flown(first, past)
    path = parts.path_of(folder, first, past)
    tables.write_parquet(path, columns, parts.certified(columns, [maker.present_maker()]))
    return path


def test_the_hash_of_rows_is_that_of_their_bytes():
    columns = {"case": np.array([3, 4]), "success": np.array([True, False])}
    content = b"case <i8 2\n" + struct.pack("<2q", 3, 4) + b"success |b1 2\n\x01\x00"
    assert parts.rows_hash(columns) == hashlib.sha256(content).hexdigest()


def test_means_and_deviations_follow_from_the_statistics_of_parts():
    whole = {name: np.concatenate([flown(0, 9)[name], flown(9, 20)[name]]) for name in flown(0, 1)}
    sums = [parts.sufficient(flown(*bounds)) for bounds in ((0, 9), (9, 20))]
    number = sum(of["count"] for of in sums)
    for name in NAMES:
        total, squares = np.sum([of["sums"][name] for of in sums], axis=0)
        assert total / number == pytest.approx(whole[name].mean())
        assert (squares - total**2 / number) / (number - 1) == pytest.approx(whole[name].var(ddof=1))
    assert sum(of["true"]["success"] for of in sums) == whole["success"].sum()


@pytest.mark.parametrize("what", [*CERTIFIED, "rows", "cases", "file", "none"])
def test_a_part_that_tells_other_than_it_holds_is_missing(tmp_path, what, capsys):
    path = written(tmp_path, 3, 7)
    table, notes = pq.read_table(path), dict(pq.read_metadata(path).metadata)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    if what in CERTIFIED:
        other = {parts.MAKERS: [{}], parts.ROWS: "0" * 64, parts.STATISTICS: {}}[what]
        notes[what.encode()] = json.dumps(other).encode()
    elif what == "rows":
        columns["delta_v_m_s"] = columns["delta_v_m_s"] * (1.0 + 2e-16)
    elif what == "cases":
        path = path.rename(parts.path_of(tmp_path, 4, 8))
    elif what == "none":
        notes = {}
    schema = pa.table(columns).schema.with_metadata(notes)
    pq.write_table(pa.table(columns, schema=schema), path)
    if what == "file":
        content = bytearray(path.read_bytes())
        content[40] ^= 0xFF
        path.write_bytes(content)
    assert list(parts.kept(tmp_path, range(10))) == []
    assert f"{path.name} is not used, its cases are flown again: " in capsys.readouterr().err
    if what != "file":
        with pytest.raises(artifacts.ArtifactError, match=r"certifies nothing .*; remove it and go on"):
            parts.join(tmp_path / "joined", [parts.CasePart(path, *map(int, path.stem.split("-")))])
        assert not (tmp_path / "joined").exists()


def test_the_kept_parts_of_any_cut_leave_the_rest_to_fly(tmp_path):
    for bounds in ((2, 4), (3, 6), (7, 8), (9, 12)):
        written(tmp_path, *bounds)
    (tmp_path / "another.parquet").touch()
    there = list(parts.kept(tmp_path, range(1, 11)))
    # the second overlaps the first, the last leaves the range
    assert [(part.first, part.past) for part in there] == [(2, 4), (7, 8)]
    assert parts.missing(there, range(1, 11), 2) == [(1, 2), (4, 6), (6, 7), (8, 10), (10, 11)]
    assert parts.missing([], range(3), 5) == [(0, 3)]


def test_the_first_cases_of_parts_are_joined_as_if_written_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "GROUP_ROWS", 4)
    bounds = ((0, 3), (3, 9), (9, 11))
    whole = [parts.CasePart(written(tmp_path, *each), *each) for each in bounds]
    parts.join(tmp_path / "joined", whole, 10)
    columns = [flown(*each) for each in bounds]
    tables.write_parquet(
        tmp_path / "at once", {name: np.concatenate([of[name] for of in columns])[:10] for name in columns[0]}
    )
    assert (tmp_path / "joined").read_bytes() == (tmp_path / "at once").read_bytes()
