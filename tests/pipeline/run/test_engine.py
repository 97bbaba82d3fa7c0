"""Engines: the same results whoever does the parts, whatever dies, and only peers of this machine."""

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts, tables
from pipeline.run.engine import each
from pipeline.run.processes import EngineError, address_of
from pipeline.settings.experiment import Engine


def draw_or_die(folder: str, number: int, dies: bool) -> float:
    """Draw a number; a part that is to die kills its process the first time."""
    mark = Path(folder, str(number))
    if dies and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return float(np.random.default_rng(number).normal())


@pytest.mark.slow
def test_parts_of_processes_that_die_are_done_again(tmp_path):
    parts = [(str(tmp_path), number, number % 5 == 0) for number in range(20)]
    expected = [draw_or_die(str(tmp_path), number, False) for _, number, _ in parts]
    engine = Engine(kind="dask", processes=2)
    assert [found for _, found in sorted(each(engine, draw_or_die, parts))] == expected
    assert len(list(tmp_path.iterdir())) == 4  # so many died
    assert [found for _, found in each(Engine(), draw_or_die, parts)] == expected


@pytest.mark.parametrize(
    ("scheduler", "address"),
    [
        ("127.0.0.1:8786", "tcp://127.0.0.1:8786"),
        ("tcp://localhost:1", "tcp://localhost:1"),
        ("file.json", "tcp://127.0.0.1:5"),
        ("by_tls/file.json", "tls://10.0.0.7:5"),
        ("tcp://10.0.0.7:8786", None),
        ("tls://10.0.0.7:8786", None),
        ("tls://127.0.0.1:8786", None),
        ("cluster:8786", None),
        ("none.json", None),
    ],
)
def test_only_schedulers_of_this_machine_or_with_a_certificate_are_joined(
    scheduler, address, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("file.json").write_text(json.dumps({"address": "tcp://127.0.0.1:5"}))
    Path("by_tls").mkdir()
    Path("by_tls/file.json").write_text(json.dumps({"address": "tls://10.0.0.7:5"}))
    Path("by_tls/tls.pem").touch()
    if address:
        assert address_of(scheduler)[0] == address
    else:
        with pytest.raises(EngineError):
            address_of(scheduler)


def test_a_campaign_in_parts_is_the_same_and_goes_on(tmp_path, monkeypatch):
    words = ["+experiment=evaluate", "controller=coast", "monte_carlo.num_cases=20", "stages=[evaluate]"]
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    assert main([*words, f"hydra.run.dir={whole}"]) == 0
    written, write = [], tables.write_parquet

    def write_two(path, columns):
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(path)
        write(path, columns)

    monkeypatch.setattr(tables, "write_parquet", write_two)
    in_parts = [*words, "engine.part_cases=6", f"hydra.run.dir={parted}"]
    assert main(in_parts) == 130
    before = [path.stat().st_mtime_ns for path in written]
    monkeypatch.undo()
    kept = []
    monkeypatch.setattr(
        tables, "join_parquet",
        lambda path, parts, join=tables.join_parquet: (
            kept.extend(part.stat().st_mtime_ns for part in parts), join(path, parts),
        ),
    )  # fmt: skip
    assert main([f"resume={parted}"]) == 0
    assert kept[:2] == before
    assert len(kept) == 4
    assert (whole / artifacts.EPISODES).read_bytes() == (parted / artifacts.EPISODES).read_bytes()
    assert not (parted / artifacts.TRAJECTORIES).exists()
    assert not (parted / artifacts.EPISODE_PARTS).exists()
