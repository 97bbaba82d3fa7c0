"""Fly the controller from all evaluation starts: episodes, trajectories, summary, the optimum."""

import json
import shlex
import shutil
import sys
import time
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.plain_text import parse_json
from pipeline.controllers.source import controller_of_run, sha256_of
from pipeline.evaluation import blocks
from pipeline.evaluation.beside_optimum import beside_optimum, summarise_times, times_in_words
from pipeline.evaluation.comparison import by_rules, spread
from pipeline.evaluation.monte_carlo import SUCCESS, episode_columns, fly_cases, summarise_blocks
from pipeline.evaluation.statistics import Column, sensitivity
from pipeline.flight.control.controller import Controller
from pipeline.flight.goals.flights import fly_all
from pipeline.optimum.solved import IncomparableError, solved_for
from pipeline.run import artifacts, engine, maker, manifests, tables, writing
from pipeline.run.engine import TaskPool
from pipeline.run.progress import Progress
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Experiment
from pipeline.settings.start_table import POSITION

#: the note in the file of a part that tells who made it, as JSON
MAKER = "maker"
#: the flights of a campaign without its dispersions, until they are summarised
NOMINAL = f"{artifacts.EPISODE_PARTS}/nominal.parquet"


def run(experiment: Experiment, folder: Path) -> None:
    """Fly the run's champion, or the configured controller if nothing was trained."""
    controller = controller_of_run(experiment, folder)
    first = evaluation_scenarios(experiment, slice(1))
    fly_cases(experiment.mission, controller, first, 1)  # compiles if necessary
    started, confidence = time.perf_counter(), experiment.monte_carlo.confidence_percent
    with _open_pool(experiment) as pool:
        episodes = _flown(experiment, controller, folder, pool)
        seconds, num_cases = time.perf_counter() - started, len(episodes["case"])
        dispersed = _dispersed(experiment, controller, episodes, folder, pool)
    summary = {
        "controller": controller.name,
        "controller_sha256": sha256_of(controller),
        "sun": experiment.sun_in_words,
        "num_cases": num_cases,
        "seed": experiment.seed,
        "confidence_percent": confidence,
        **summarise_blocks(parts_of(episodes), confidence),
        "percentiles": blocks.percentiles(partial(parts_of, episodes), confidence),
        **dispersed,
        "optimum": _beside_optimum(experiment, controller, folder),
    }
    writing.write_json(folder / artifacts.SUMMARY, summary)
    # not before: what is killed until then goes on from its parts
    shutil.rmtree(folder / artifacts.EPISODE_PARTS, ignore_errors=True)
    sys.stderr.write(
        f"  {num_cases} cases in {seconds:.2f} s, Sun {experiment.sun_in_words}: "
        f"delta-v {spread(summary['delta_v_m_s'], 3)} m/s{by_rules(summary)}, "
        f"{_done_in_words(summary)}, "
        f"success {100 * summary[SUCCESS]['fraction']:.1f} %, "
        f"outside {100 * summary['violated']['fraction']:.1f} %\n"
    )
    sys.stderr.write(_beside_in_words(summary["optimum"]))
    if (folder / artifacts.TRAJECTORIES).exists():
        sys.stderr.write(f"  to see them all: python -m telemetry campaign {shlex.quote(str(folder))}\n")


def parts_of(episodes: Mapping[str, Column]) -> Iterable[Mapping[str, Column]]:
    """Return flights in blocks, of a table or in memory."""
    return episodes.blocks() if isinstance(episodes, tables.Columns) else blocks.cut(episodes)


def _done_in_words(summary: Mapping[str, Any]) -> str:
    """Return the flights' success rate and delta-v in a line."""
    if "end_s" not in summary:
        return f"rate {spread(summary['inspection_rate_percent'], 2)} %"
    end, speed = summary["end_s"], summary["end_speed_m_s"]
    return f"at the end after {end['mean']:.0f} s with {speed['mean']:.3f} m/s, never above the limit " + (
        f"{100 * summary['held']['fraction']:.1f} %"
    )


def _open_pool(experiment: Experiment) -> AbstractContextManager[TaskPool]:
    """Open what flies the parts of a campaign; the flights of a single part are flown here."""
    cases, settings = experiment.monte_carlo, experiment.engine
    if not _is_in_parts(experiment) and settings.kind != "local":
        sys.stderr.write(
            f"  {cases.num_cases:,} cases are one part, which is flown here; a lower engine.part_cases makes "
            "several\n"
        )
        settings = replace(settings, kind="local")
    return engine.open_pool(settings, cases.workers)


def _flown(
    experiment: Experiment, controller: Controller, folder: Path, pool: TaskPool
) -> Mapping[str, Column]:
    """Fly all cases and write their table; trajectories too, unless they are flown in parts."""
    if _is_in_parts(experiment):
        (folder / artifacts.TRAJECTORIES).unlink(missing_ok=True)
        paths = _fly_parts(experiment, controller, folder / artifacts.EPISODE_PARTS / "cases", pool)
        tables.join_parquet(folder / artifacts.EPISODES, paths)
        return tables.Columns(folder, artifacts.EPISODES)
    scenarios, workers = evaluation_scenarios(experiment), experiment.monte_carlo.workers
    episodes, tracks = fly_cases(experiment.mission, controller, scenarios, workers)
    tables.write_parquet(folder / artifacts.EPISODES, episodes)
    case, sample = np.indices(tracks.shape[:2], dtype=np.int32)
    positions = {name: tracks[:, :, axis].ravel() for axis, name in enumerate(POSITION)}
    columns = {"case": case.ravel(), "sample": sample.ravel(), **positions}
    tables.write_parquet(folder / artifacts.TRAJECTORIES, columns)
    return episodes


def _is_in_parts(experiment: Experiment) -> bool:
    """Return whether there are more cases than fit in one part."""
    return experiment.monte_carlo.num_cases > experiment.engine.part_cases


def _fly_parts(
    experiment: Experiment, controller: Controller, parts_folder: Path, pool: TaskPool
) -> list[Path]:
    """Fly a campaign, each part into a file; a resumed one flies only the missing parts. Return the files."""
    cases, length = experiment.monte_carlo, experiment.engine.part_cases
    if not experiment.resume:
        shutil.rmtree(parts_folder, ignore_errors=True)
    bounds = [(first, min(first + length, cases.num_cases)) for first in range(0, cases.num_cases, length)]
    # a resumed run may be cut into other parts
    paths = [parts_folder / f"{first:09d}-{last:09d}.parquet" for first, last in bounds]
    left = [part for part, path in enumerate(paths) if not _is_kept(path)]
    tasks = [(experiment, controller, bounds[part], pool.threads(cases.workers)) for part in left]
    with Progress("part:", len(paths), len(paths) - len(left)) as progress:
        results = enumerate(pool.run(_fly_and_sign, tasks), len(paths) - len(left) + 1)
        for done, (index, (columns, made_by)) in results:
            tables.write_parquet(paths[left[index]], columns, {MAKER: json.dumps(made_by)})
            progress.show(done)
    return paths


def _is_kept(path: Path) -> bool:
    """Return whether a part is there and tells who made it, who is then named in the manifest."""
    if not path.exists():
        return False
    try:
        made_by = parse_json(tables.notes_of(path)[MAKER])
    except (KeyError, ValueError, RecursionError):
        return False
    if (
        not manifests.fits(made_by, manifests.MAKER_SHAPE)
        or not made_by.keys() >= manifests.MAKER_SHAPE.keys()
    ):
        return False
    maker.collect(made_by)
    return True


def _fly_and_sign(*task: Any) -> tuple[dict[str, Column], dict[str, Any]]:
    """Return what `fly_part` does, and who did it."""
    return fly_part(*task), maker.present_maker()


def fly_part(
    experiment: Experiment, controller: Controller, bounds: tuple[int, int], workers: int | None
) -> dict[str, Column]:
    """Fly the cases from the first bound up to the second; return the columns of their table."""
    scenarios = evaluation_scenarios(experiment, slice(*bounds))
    outcomes = fly_all(experiment.mission, controller, scenarios, workers)
    return episode_columns(experiment.mission, scenarios, outcomes) | {"case": np.arange(*bounds)}


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
    times = summarise_times(columns, experiment.monte_carlo.confidence_percent)
    return {"reference": experiment.optimum.reference, "points_asked": points, **times}


def _dispersed(
    experiment: Experiment, controller: Controller, episodes: Mapping[str, Any], folder: Path, pool: TaskPool
) -> dict[str, Any]:
    """Return the sensitivity to each dispersion, and the results without any; {} if there are none."""
    mission, confidence = experiment.mission, experiment.monte_carlo.confidence_percent
    if not mission.dispersions:
        return {}
    keys = [distribution.key for distribution in distributions(mission.dispersions)]
    undispersed = replace(experiment, mission=replace(mission, dispersions={}))
    nominal: Mapping[str, Column]
    if _is_in_parts(experiment):
        paths = _fly_parts(undispersed, controller, folder / artifacts.EPISODE_PARTS / "nominal", pool)
        tables.join_parquet(folder / NOMINAL, paths)
        nominal = tables.Columns(folder, NOMINAL)
    else:
        scenarios, workers = evaluation_scenarios(experiment), experiment.monte_carlo.workers
        nominal, _ = fly_cases(undispersed.mission, controller, scenarios, workers)
    ranked = sensitivity(episodes, keys, confidence)
    return {"sensitivity": ranked, "nominal": summarise_blocks(parts_of(nominal), confidence)}


def _beside_in_words(beside: Mapping[str, Any]) -> str:
    """Return a line on the ratio of fuel to the optimum; nothing if it is not compared."""
    if "not_compared" in beside:
        return ""
    as_seen, bound = (times_in_words(beside[name], 2) for name in ("times_optimum_as_seen", "times_bound"))
    return (
        f"  {times_in_words(beside['times_optimum'], 2)} times the best plans found, on average over "
        f"{beside['num_cases']} solved cases, {beside['num_successful']} of them successful; {as_seen} times "
        f"those that inspect as many points; {bound} times what every plan burns at least\n"
    )
