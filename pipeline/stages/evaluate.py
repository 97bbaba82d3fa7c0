"""Fly the controller from all evaluation starts: episodes, trajectories, summary, the optimum."""

import shutil
import sys
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.controllers.source import controller_of_run, sha256_of
from pipeline.evaluation import blocks, parts, sequential
from pipeline.evaluation.beside_optimum import beside_optimum, summarise_times, times_in_words
from pipeline.evaluation.comparison import by_rules, spread
from pipeline.evaluation.monte_carlo import SUCCESS, fly_cases, fly_fleets, summarise_blocks
from pipeline.evaluation.ranks import sensitivity
from pipeline.evaluation.splitting import POPULATIONS, RareShare, rare_share
from pipeline.evaluation.statistics import Column, statistic
from pipeline.flight.control.controller import Controller
from pipeline.optimum.solved import IncomparableError, solved_for
from pipeline.run import artifacts, engine, tables, typed, writing
from pipeline.run.engine import TaskPool
from pipeline.run.progress import Progress
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Experiment
from pipeline.settings.start_table import POSITION

#: the flights of a campaign without its dispersions, until they are summarised
NOMINAL = f"{artifacts.EPISODE_PARTS}/nominal.parquet"


def run(experiment: Experiment, folder: Path) -> None:
    """Fly the run's champion, or the configured controller if nothing was trained."""
    controller = controller_of_run(experiment, folder)
    first = evaluation_scenarios(experiment, slice(1))
    fly_cases(experiment.mission, controller, first, 1)  # compiles if necessary
    started = time.perf_counter()
    with _open_pool(experiment, folder) as pool:
        episodes = _flown(experiment, controller, folder, pool)
        seconds, num_cases = time.perf_counter() - started, blocks.number_of(episodes)
        nominal = _nominal(experiment, controller, num_cases, folder, pool)
        rare = _rare(experiment, controller, pool)
    summary = {
        **_subject(experiment, controller, num_cases),
        **_results(experiment, episodes),
        **({} if nominal is None else _dispersed(experiment, episodes, nominal)),
        **({} if rare is None else {"violated_by_splitting": asdict(rare)}),
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
        f"outside {100 * summary['violated']['fraction']:.1f} %{_after_in_words(summary)}"
        f"{_fleet_in_words(experiment, summary)}\n"
    )
    sys.stderr.write(_stopped_in_words(summary))
    sys.stderr.write("" if rare is None else f"  outside: {rare.sentence}\n")
    sys.stderr.write(_beside_in_words(summary["optimum"]))
    if (folder / artifacts.TRAJECTORIES).exists():
        sys.stderr.write(f"  to see them all: {typed.campaign(folder)}\n")


def _subject(experiment: Experiment, controller: Controller, num_cases: int) -> dict[str, Any]:
    """Return the part of a summary that tells what flew."""
    cases = experiment.monte_carlo
    stop = {"quantity": cases.stop_quantity, "width": cases.stop_width, "most_cases": cases.num_cases}
    return {
        "controller": controller.name,
        "controller_sha256": sha256_of(controller),
        "sun": experiment.sun_in_words,
        "num_cases": num_cases,
        **({} if cases.only_cases is None else {"only_cases": cases.only_cases}),
        **({} if cases.stop_width is None else {"stop": stop}),
        "seed": experiment.seed,
        **({"fleet": asdict(experiment.mission.fleet)} if experiment.mission.has_fleet else {}),
        **({"tags": experiment.tags} if experiment.tags else {}),
        "confidence_percent": cases.confidence_percent,
    }


def _results(experiment: Experiment, episodes: Mapping[str, Column]) -> dict[str, Any]:
    """Return the statistics of flights, whose intervals hold however their number came about."""
    confidence, whole = experiment.monte_carlo.confidence_percent, partial(blocks.blocks_of, episodes)
    summary = summarise_blocks(whole(), confidence)
    if experiment.mission.has_fleet and np.isfinite(enough := episodes["enough_s"]).any():
        summary["enough_s"] = asdict(statistic(enough[np.isfinite(enough)], confidence, 0.0))
    if experiment.monte_carlo.stop_width is None:
        return {**summary, "percentiles": blocks.percentiles(whole, confidence)}
    return {
        **sequential.for_any_number(summary, blocks.number_of(episodes), confidence),
        "percentiles": blocks.percentiles(whole, confidence, sequential.order_ranks),
    }


def _stopped_in_words(summary: Mapping[str, Any]) -> str:
    """Return a line on whether flights stopped at the asked width; nothing if none was asked."""
    if "stop" not in summary:
        return ""
    stop = summary["stop"]
    width = summary[stop["quantity"]]["high"] - summary[stop["quantity"]]["low"]
    how = "stopped" if width <= stop["width"] else f"not stopped within {stop['most_cases']:,} cases"
    return (
        f"  {how}: the interval of {stop['quantity']} is {width:.3g} wide, and {stop['width']:g} was asked; "
        "all intervals hold for any number of flights\n"
    )


def _done_in_words(summary: Mapping[str, Any]) -> str:
    """Return the flights' success rate and delta-v in a line."""
    if "end_s" not in summary:
        return f"rate {spread(summary['inspection_rate_percent'], 2)} %"
    end, speed = summary["end_s"], summary["end_speed_m_s"]
    return f"at the end after {end['mean']:.0f} s with {speed['mean']:.3f} m/s, never above the limit " + (
        f"{100 * summary['held']['fraction']:.1f} %"
    )


def _after_in_words(summary: Mapping[str, Any]) -> str:
    """Return a line on what follows the flights, and on thrusters that fail in them; empty if unknown."""
    if "stays_orbit" not in summary:
        return ""
    stays, safe = (100 * summary[name]["fraction"] for name in ("stays_orbit", "passively_safe"))
    return f"\n  without thrust from then on {stays:.1f} % stay an orbit; {safe:.1f} % are passively safe"


def _fleet_in_words(experiment: Experiment, summary: Mapping[str, Any]) -> str:
    """Return a line on what the deputies of fleets do beside one another; empty of one deputy."""
    if not experiment.mission.has_fleet:
        return ""
    fleet, pair = experiment.mission.fleet, summary["nearest_pair_m"]
    when = f", enough seen after {summary['enough_s']['mean']:.0f} s" if "enough_s" in summary else ""
    near = f"two come within {pair['minimum']:.1f} m"
    if "coasting_pair_m" in summary:
        near += f", {summary['coasting_pair_m']['minimum']:.1f} m in an orbit if all thrusters fail at once"
    return (
        f"\n  {fleet.deputies} deputies together, who heed {fleet.sharing}; the most that one spends "
        f"{spread(summary['greatest_delta_v_m_s'], 3)} m/s{when}; {near}"
    )


def _open_pool(experiment: Experiment, folder: Path) -> AbstractContextManager[TaskPool]:
    """Open what flies the parts of a campaign; the flights of a single part are flown here."""
    cases, settings = experiment.monte_carlo, experiment.engine
    if not _is_in_parts(experiment, folder) and settings.kind != "local":
        sys.stderr.write(
            f"  {cases.num_cases:,} cases are one part, which is flown here; a lower engine.part_cases makes "
            "several\n"
        )
        settings = replace(settings, kind="local")
    return engine.open_pool(settings, cases.workers)


def _flown(
    experiment: Experiment, controller: Controller, folder: Path, pool: TaskPool
) -> Mapping[str, Column]:
    """Fly all cases and write their table; trajectories too, unless they are flown in parts, or by fleets."""
    if _is_in_parts(experiment, folder):
        (folder / artifacts.TRAJECTORIES).unlink(missing_ok=True)
        cases, stop = experiment.monte_carlo, None
        if cases.stop_width is not None:
            stop = sequential.Stop(cases.stop_quantity, cases.stop_width, cases.confidence_percent)
        names = [artifacts.EPISODES, *([artifacts.DEPUTIES] if experiment.mission.has_fleet else [])]
        written = {folder / parts.FOLDERS[name]: folder / name for name in names}
        parts.fly(experiment, controller, cases.cases, written, pool, stop)
        return tables.Columns(folder, artifacts.EPISODES)
    scenarios, workers = evaluation_scenarios(experiment), experiment.monte_carlo.workers
    if experiment.mission.has_fleet:
        (folder / artifacts.TRAJECTORIES).unlink(missing_ok=True)
        episodes, deputies = fly_fleets(experiment.mission, controller, scenarios, workers)
        tables.write_parquet(folder / artifacts.EPISODES, episodes)
        tables.write_parquet(folder / artifacts.DEPUTIES, deputies)
        return episodes
    episodes, tracks = fly_cases(experiment.mission, controller, scenarios, workers)
    tables.write_parquet(folder / artifacts.EPISODES, episodes)
    case, sample = np.indices(tracks.shape[:2], dtype=np.int32)
    positions = {name: tracks[:, :, axis].ravel() for axis, name in enumerate(POSITION)}
    columns = {"case": case.ravel(), "sample": sample.ravel(), **positions}
    tables.write_parquet(folder / artifacts.TRAJECTORIES, columns)
    return episodes


def _is_in_parts(experiment: Experiment, folder: Path) -> bool:
    """Return whether flights are to be flown in parts: more than one has, a shard's, or what goes on so."""
    cases = experiment.monte_carlo
    is_begun = experiment.resume and any((folder / parts.FOLDERS[artifacts.EPISODES]).glob("*.parquet"))
    is_cut = cases.only_cases is not None or cases.stop_width is not None
    return cases.num_cases > experiment.engine.part_cases or is_cut or is_begun


def _rare(experiment: Experiment, controller: Controller, pool: TaskPool) -> RareShare | None:
    """Return how rarely a flight leaves the limits, by splitting; None of a shard, or if it is not asked."""
    cases, mission = experiment.monte_carlo, experiment.mission
    if not cases.splitting_flights or cases.only_cases is not None:
        return None
    # searches for the worst case come with it, and take long to import
    from pipeline.evaluation.assurance.case_space import case_space  # noqa: PLC0415
    from pipeline.evaluation.assurance.rare import RARE, OutsideLimits  # noqa: PLC0415

    space, threads = case_space(experiment, is_exact=True), pool.threads(cases.workers)
    law = OutsideLimits(space, experiment.seed, mission, controller, threads)
    with Progress("population:", POPULATIONS, 0) as progress:
        seed = experiment.seed, RARE
        return rare_share(law, cases.splitting_flights, cases.confidence_percent, seed, pool, progress.show)


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


def _nominal(
    experiment: Experiment, controller: Controller, num_cases: int, folder: Path, pool: TaskPool
) -> Mapping[str, Column] | None:
    """Fly the same cases without their dispersions; return None if there are none."""
    if not experiment.mission.dispersions:
        return None
    undispersed = replace(experiment, mission=replace(experiment.mission, dispersions={}))
    cases = experiment.monte_carlo.cases[:num_cases]
    if not _is_in_parts(experiment, folder):
        scenarios = evaluation_scenarios(experiment)
        return fly_cases(undispersed.mission, controller, scenarios, experiment.monte_carlo.workers)[0]
    is_shard = experiment.monte_carlo.only_cases is not None
    name = artifacts.NOMINAL_EPISODES if is_shard else NOMINAL
    parts_folder = folder / parts.FOLDERS[artifacts.NOMINAL_EPISODES]
    parts.fly(undispersed, controller, cases, {parts_folder: folder / name}, pool)
    return tables.Columns(folder, name)


def _dispersed(
    experiment: Experiment, episodes: Mapping[str, Column], nominal: Mapping[str, Column]
) -> dict[str, Any]:
    """Return the sensitivity to each dispersion, and the results without any."""
    confidence = experiment.monte_carlo.confidence_percent
    keys = [distribution.key for distribution in distributions(experiment.mission.dispersions)]
    ranked = sensitivity(partial(blocks.blocks_of, episodes), keys, confidence)
    results = summarise_blocks(blocks.blocks_of(nominal), confidence)
    if experiment.monte_carlo.stop_width is not None:
        number = blocks.number_of(episodes)
        ranked = [sequential.correlations_for_any_number(entry, number, confidence) for entry in ranked]
        results = sequential.for_any_number(results, number, confidence)
    return {"sensitivity": ranked, "nominal": results}


def _beside_in_words(beside: Mapping[str, Any]) -> str:
    """Return a line on the ratio of fuel to the optimum; nothing if it is not compared."""
    if "not_compared" in beside:
        return ""
    times, as_seen, bound = (
        times_in_words(beside[name], 2) for name in ("times_optimum", "times_optimum_as_seen", "times_bound")
    )
    return (
        f"  flown besides, {beside['num_cases']} solved cases, {beside['num_successful']} of which succeed: "
        f"{times} times the best plans found, on average; {as_seen} times those that inspect as many points; "
        f"{bound} times what every plan burns at least\n"
    )
