"""Fly the controller from all evaluation starts: episodes, trajectories, summary."""

import shlex
import sys
import time
from pathlib import Path

import numpy as np

from pipeline import artifacts, tables
from pipeline.champion import controller_of_run
from pipeline.compile_notice import announce_compilation
from pipeline.monte_carlo import fly_cases, summarise
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings import Experiment


def run(experiment: Experiment, folder: Path) -> None:
    """Fly the run's champion, or the configured controller where nothing was trained."""
    controller = controller_of_run(experiment, folder)
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    announce_compilation()
    fly_cases(experiment.mission, controller, scenarios[:1], 1)  # compiles where that has not been done
    started = time.perf_counter()
    episodes, tracks = fly_cases(experiment.mission, controller, scenarios, experiment.monte_carlo.workers)
    seconds = time.perf_counter() - started
    tables.write_parquet(folder / artifacts.EPISODES, episodes)
    num_cases, num_samples = tracks.shape[:2]
    tables.write_parquet(
        folder / artifacts.TRAJECTORIES,
        {
            "case": np.repeat(np.arange(num_cases, dtype=np.int32), num_samples),
            "sample": np.tile(np.arange(num_samples, dtype=np.int32), num_cases),
            **{f"position_{axis}_m": tracks[:, :, i].ravel() for i, axis in enumerate("xyz")},
        },
    )
    confidence = experiment.monte_carlo.confidence_percent
    summary = {
        "controller": controller.name,
        "sun": experiment.sun.mode,
        "num_cases": num_cases,
        "seed": experiment.seed,
        "confidence_percent": confidence,
        **summarise(episodes, confidence),
    }
    artifacts.write_json(folder / artifacts.SUMMARY, summary)
    delta_v, rate = summary["delta_v_m_s"], summary["inspection_rate_percent"]
    sys.stderr.write(
        f"  {num_cases} cases in {seconds:.2f} s, Sun {experiment.sun.mode}: "
        f"delta-v {delta_v['mean']:.3f} +- {delta_v['standard_deviation']:.3f} m/s, "
        f"rate {rate['mean']:.2f} +- {rate['standard_deviation']:.2f} %, "
        f"success {100 * summary['success']['fraction']:.1f} %, "
        f"outside {100 * summary['violated']['fraction']:.1f} %\n"
        f"  to see them all: python -m telemetry campaign {shlex.quote(str(folder))}\n"
    )
