"""Fly the controller from all evaluation starts: episodes, trajectories, summary; and beside the optimum."""

import shlex
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.controllers.of_run import controller_of_run
from pipeline.evaluation.monte_carlo import fly_cases, summarise
from pipeline.flight.controller import Controller
from pipeline.flight.starts import evaluation_scenarios
from pipeline.optimum.account import beside_optimum, summarise_times
from pipeline.optimum.solved import IncomparableError, solved_for
from pipeline.run import artifacts, tables
from pipeline.settings.experiment import Experiment


def run(experiment: Experiment, folder: Path) -> None:
    """Fly the run's champion, or the configured controller where nothing was trained."""
    controller = controller_of_run(experiment, folder)
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
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
        "sun": experiment.sun_in_words,
        "num_cases": num_cases,
        "seed": experiment.seed,
        "confidence_percent": confidence,
        **summarise(episodes, confidence),
        "optimum": _beside_optimum(experiment, controller, folder),
    }
    artifacts.write_json(folder / artifacts.SUMMARY, summary)
    delta_v, rate = summary["delta_v_m_s"], summary["inspection_rate_percent"]
    sys.stderr.write(
        f"  {num_cases} cases in {seconds:.2f} s, Sun {experiment.sun_in_words}: "
        f"delta-v {delta_v['mean']:.3f} +- {delta_v['standard_deviation']:.3f} m/s, "
        f"rate {rate['mean']:.2f} +- {rate['standard_deviation']:.2f} %, "
        f"success {100 * summary['success']['fraction']:.1f} %, "
        f"outside {100 * summary['violated']['fraction']:.1f} %\n"
        f"{_inspectable_line(summary)}"
        f"{_safety_line(experiment, summary)}"
        f"{_told(summary['optimum'])}"
        f"  to see them all: python -m telemetry campaign {shlex.quote(str(folder))}\n"
    )


def _beside_optimum(experiment: Experiment, controller: Controller, folder: Path) -> dict[str, Any]:
    """Fly the cases with known minimum-fuel plans; return the comparison, or why there is none."""
    path = folder / artifacts.BESIDE_OPTIMUM
    try:
        solved = solved_for(experiment)
    except IncomparableError as reason:
        path.unlink(missing_ok=True)
        return {"not_compared": str(reason)}
    episodes, _ = fly_cases(experiment.mission, controller, solved.scenarios, experiment.monte_carlo.workers)
    columns = beside_optimum(episodes, solved.cases, solved.harder)
    tables.write_parquet(path, columns)
    points = int(solved.summary["points_asked"])
    return {"reference": experiment.optimum.reference, "points_asked": points, **summarise_times(columns)}


def _told(beside: dict[str, Any]) -> str:
    """Say in a line how many times the optimum was burnt; nothing where it was not compared."""
    if "not_compared" in beside:
        return ""
    times = beside["times_optimum"]
    return (
        f"  {times['mean']:.2f} times the optimum in the mean of {beside['num_cases']} solved cases "
        f"({times['min']:.2f} to {times['max']:.2f}), {beside['num_successful']} of them successful; "
        f"{beside['times_optimum_as_seen']['mean']:.2f} times the plans that inspect as many points\n"
    )


def _inspectable_line(summary: Mapping[str, Any]) -> str:
    """Say what the rate is of the points that can be inspected, where some cannot be."""
    rate = summary["inspectable_rate_percent"]
    if rate["mean"] == summary["inspection_rate_percent"]["mean"]:
        return ""
    return (
        f"  of the {summary['inspectable_count']['mean']:.1f} points a flight that can be inspected, for the "
        f"Sun shines on them, {rate['mean']:.2f} +- {rate['standard_deviation']:.2f} %; success refers to "
        "these\n"
    )


def _safety_line(experiment: Experiment, summary: Mapping[str, Any]) -> str:
    """Say what the safety layer did, where it is on."""
    if experiment.mission.safety.kind == "none":
        return ""
    acted = summary["safety_acted"]
    return (
        f"  safety layer: acted in {acted['count']} of {summary['num_cases']} flights, in "
        f"{summary['safety_periods']['mean']:.2f} periods a flight, changed the force by "
        f"{summary['safety_delta_v_m_s']['mean']:.4f} m/s a flight\n"
    )
