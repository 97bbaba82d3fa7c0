"""Fly from random starts of a proof's set, and count the states outside its tube."""

import argparse
import resource
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.fly import simulation
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.run import artifacts, tables
from pipeline.scenarios import evaluation_scenarios

#: flights side by side
BATCH = 2000
#: rounding of tracks, which are kept in single precision, m and m/s
ROUNDING = np.array([2e-5, 5e-6])


def outside(boxes: Floats, position: Floats, velocity: Floats) -> int:
    """Count the states along an axis that are in none of its boxes, sorted by position."""
    inside = np.zeros(len(position), dtype=np.bool_)
    last = np.searchsorted(boxes[:, 0], position + ROUNDING[0], side="right") - 1
    for before in (0, 1):
        low, high, least, greatest, shear = boxes[np.maximum(last - before, 0)].T
        leaning = velocity + shear * position
        fits = (low - ROUNDING[0] <= position) & (position <= high + ROUNDING[0])
        inside |= fits & (least - ROUNDING[1] <= leaning) & (leaning <= greatest + ROUNDING[1])
    return int(np.sum(~inside))


def main(arguments: Sequence[str]) -> int:
    """Fly and print what was counted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks tube", description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a run of +experiment=prove")
    parser.add_argument("overrides", nargs="+", help="its problem and controller, problem=... controller=...")
    parser.add_argument("--cases", type=int, default=100_000, help="flights")
    options = parser.parse_args(arguments)
    began, table = time.perf_counter(), tables.read_parquet(options.run, artifacts.TUBE)
    rows = np.stack(list(table.values()), axis=1)
    rows = rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]
    periods, axes = int(rows[-1, 0]), np.unique(rows[:, 1]).astype(np.int64).tolist()
    index = 3 * rows[:, 0] + rows[:, 1]
    given = (*options.overrides, f"duration_s={periods}.0", f"monte_carlo.num_cases={options.cases}")
    experiment = compose_experiment(["+experiment=evaluate", *given]).experiment
    mission, controller = experiment.mission, load(experiment.controller, experiment.mission)
    starts = evaluation_scenarios(experiment)
    states = stray = 0
    for first in range(0, len(starts), BATCH):
        part = starts[first : first + BATCH]
        tracks = np.empty((len(part), periods + 1, NUM_TRACKED), dtype=np.float32)
        simulation.fly_all(mission, controller, part, tracks=tracks)
        for step in range(periods + 1):
            now = tracks[:, step].astype(np.float64)
            for axis in axes:
                chosen = slice(*np.searchsorted(index, [3 * step + axis, 3 * step + axis + 1]))
                stray += outside(rows[chosen, 2:7], now[:, axis], now[:, axis + 3])
                states += len(part)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(
        f"{len(starts)} flights, {states} states along an axis, {stray} outside the tube; "
        f"{time.perf_counter() - began:.0f} s, {most} MB"
    )
    return int(stray > 0)
