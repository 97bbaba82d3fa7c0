"""Fit a controller to any mission: champions scaled to it, the best tuned and judged: fit/, champion.json."""

import csv
import io
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from fis_tools.document import plain
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.evaluation import fitting
from pipeline.evaluation.fitting import FlightTally, Variant, tally_of
from pipeline.evaluation.reachable import most_success
from pipeline.evaluation.selection import select
from pipeline.evaluation.statistics import Fraction
from pipeline.flight.control.controller import ControllerError, from_fuzzy
from pipeline.flight.state.descriptions import with_descriptions
from pipeline.flight.state.log import Scenario
from pipeline.report.fit import render_fit
from pipeline.run import artifacts, manifests, tables, writing
from pipeline.run.progress import Progress
from pipeline.run.runner import Unimproved
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment, Mission
from pipeline.training.genome import genome_of
from pipeline.training.judging import evolved
from pipeline.training.progress import TrainingProgress
from pipeline.training.similarity import Limitation, limitations

#: the table of the competition is written at most once in this many seconds: each time waits for the disk
WRITE_EVERY_S: Final = 1.0
#: controllers that plan, which take many times as long to fly, of which no more reach the last round
PLANNERS_KEPT: Final = 2


@dataclass(frozen=True)
class FitResult:
    """A result of the fit so far: a controller, its mission, and its flights from unseen starts."""

    words: str
    controller: FuzzyController
    mission: Mission
    tally: FlightTally


def run(experiment: Experiment, folder: Path) -> Unimproved | None:
    """Fit a controller to the mission, and say beforehand what limits it.

    Returns
    -------
    Unimproved, optional
        Where nothing scaled or tuned flies better than the best champion as shipped.
    """
    bases = fitting.load_bases(experiment)
    planners = fitting.load_named("fit.planners", experiment.fit.planners)
    unseen = fitting.rung_scenarios(experiment, len(experiment.fit.cases))
    flyable, limits = _limits(experiment, unseen)
    table, drawn = CompetitionTable(experiment, folder), fitting.drawn_variants(experiment, bases)
    if not drawn:
        raise ControllerError(
            "none of fit.bases can fly this mission at any size; see their decision_period_s and tour_time_s"
        )
    rivals = _halved(experiment, table, bases, drawn)
    shipped = next((rival for rival in rivals if rival[0].is_shipped), None)
    _report("as shipped", shipped and shipped[1])

    def stand(what: str, words: str, controller: FuzzyController, mission: Mission) -> FitResult:
        tally = _tally(experiment, mission, controller, unseen)
        _report(f"{what}, {words}", tally)
        return FitResult(words, controller, mission, tally)

    def fit(best: Variant) -> FitResult:
        controller = _named(experiment, best, bases[best.base])
        return stand("fitted", best.words, controller, experiment.mission)

    best, contenders = rivals[0][0], list(drawn)
    fitted = last = fit(best)
    if not _reaches_goal(experiment, last):
        near = [*(variant for variant, _ in rivals), *fitting.neighbours_of(experiment, best, bases)]
        rivals = _halved(experiment, table, bases, near, min(1, len(experiment.fit.cases) - 1))
        if rivals[0][0] != best and (nearby := fit(rivals[0][0])).tally.score > last.tally.score:
            best, fitted, last = rivals[0][0], nearby, nearby
        # what flies best alone, and all its neighbours, may fly badly under the layer
        contenders += [variant for variant in near if variant not in contenders]
    layered, refusal = None, ""
    if not _reaches_goal(experiment, last) and last.tally.exits.count > last.tally.misses.count:
        try:
            mission = fitting.with_filter(experiment)
        except SettingError as error:
            refusal = str(error)
        else:
            rival = _best_with_layer(experiment, mission, contenders, bases)
            controller = _named(experiment, rival, bases[rival.base])
            layered = stand("with safety=filter", rival.words, controller, mission)
            last = layered if layered.tally.success.count > last.tally.success.count else last
    planned, ranked = None, list[tuple[Variant, FlightTally]]()
    if not _reaches_goal(experiment, last) and (ranked := _ranked_planners(experiment, table, planners)):
        controller = _named(experiment, ranked[0][0], planners[ranked[0][0].base])
        planned = stand("planning", ranked[0][0].words, controller, experiment.mission)
        last = planned if planned.tally.score > last.tally.score else last
    tuned = None
    # plans are made of what a controller's constants say, not of its rules
    if (
        last is not planned
        and _is_tuned(experiment, last)
        and (champion := _tuned(experiment, folder, last)) is not None
    ):
        tuned = stand("tuned", last.words, champion, last.mission)
        last = tuned if tuned.tally.score > last.tally.score else last
    is_improved = not (last is fitted and best.is_shipped) and not (
        last is planned and ranked[0][0].is_shipped
    )
    result = {
        "improved": is_improved,
        "words": last.words,
        "safety": last.mission.safety.kind,
        "goal_percent": experiment.fit.goal_percent,
        "limits": [vars(limit) | {"kept": limit.is_kept, "sentence": limit.sentence} for limit in limits],
        "flyable": plain(flyable),
        "shipped": shipped and _row(shipped[0].words, shipped[1]),
        "fitted": _row(fitted.words, fitted.tally),
        "layered": layered and _row(layered.words, layered.tally),
        "layer_refused": refusal,
        "planned": planned and _row(planned.words, planned.tally),
        "tuned": tuned and _row(tuned.words, tuned.tally),
        "last": _row(last.words, last.tally),
        "rivals": [_row(variant.words, tally) for variant, tally in (*rivals, *ranked)],
    }
    _write(experiment, folder, last.controller, result)
    if is_improved:
        return None
    return Unimproved(f"not improved: {last.words} is handed back, none flies better; {last.tally.sentence}")


def _limits(experiment: Experiment, starts: list[Scenario]) -> tuple[Fraction, list[Limitation]]:
    """Say what limits any controller from some starts; return from which share a flight may succeed."""
    distances = np.array([np.linalg.norm(start.position_m) for start in starts])
    goal, confidence = experiment.fit.goal_percent, experiment.monte_carlo.confidence_percent
    flyable, reach = most_success(experiment.mission, starts, goal, confidence)
    limits = [*limitations(experiment.mission, distances), reach]
    for limit in limits:
        sys.stderr.write(f"  {'' if limit.is_kept else 'limited by the '}{limit.sentence}\n")
    return flyable, limits


def _tally(
    experiment: Experiment, mission: Mission, controller: FuzzyController, starts: list[Scenario]
) -> FlightTally:
    """Fly a controller from some starts with the settings of a fit, and tally the flights."""
    confidence_percent, workers = experiment.monte_carlo.confidence_percent, experiment.fit.workers
    return tally_of(mission, controller, starts, confidence_percent, workers)


def _row(words: str, tally: FlightTally) -> dict[str, Any]:
    """Return a tally and its name as plain data."""
    row: dict[str, Any] = plain(tally)
    return {"words": words, **row}


def _reaches_goal(experiment: Experiment, result: FitResult) -> bool:
    """Return whether the success is above the goal, at the confidence of the evaluation."""
    return result.tally.success.low >= experiment.fit.goal_percent / 100.0


def _best_with_layer(
    experiment: Experiment,
    mission: Mission,
    variants: Sequence[Variant],
    bases: Mapping[str, FuzzyController],
) -> Variant:
    """Return which variant flies best under the safety layer, by a competition of its own."""
    starts = [fitting.rung_scenarios(experiment, rung) for rung in range(len(experiment.fit.cases))]

    def judge(rung: int, variant: Variant) -> FlightTally:
        controller = variant.controller(bases[variant.base], experiment.mission)
        return _tally(experiment, mission, controller, starts[rung])

    return fitting.halve(experiment, variants, judge)[0][0]


def _ranked_planners(
    experiment: Experiment, table: "CompetitionTable", planners: Mapping[str, FuzzyController]
) -> list[tuple[Variant, FlightTally]]:
    """Return controllers that plan, with their flights in the last round but one and the last, best first."""
    variants, settings = fitting.planning_variants(experiment, planners), experiment.fit
    kept = (*settings.kept[:-1], *(min(count, PLANNERS_KEPT) for count in settings.kept[-1:]))
    experiment = replace(experiment, fit=replace(settings, kept=kept))
    return _halved(experiment, table, planners, variants, max(0, len(experiment.fit.cases) - 2))


def _report(what: str, tally: FlightTally | None) -> None:
    sys.stderr.write(f"  {what}: {tally.sentence if tally else 'none can fly this mission'}\n")


def _halved(
    experiment: Experiment,
    table: "CompetitionTable",
    bases: Mapping[str, FuzzyController],
    variants: Sequence[Variant],
    first: int = 0,
) -> list[tuple[Variant, FlightTally]]:
    """Run the halving from a rung on, or what is left of it; return the last round's variants, best first."""
    mission, settings = experiment.mission, experiment.fit
    starts = [fitting.rung_scenarios(experiment, rung) for rung in range(len(settings.cases))]
    total, done = fitting.num_flights(experiment, len(variants), first), 0
    with Progress("flight", total, 0) as progress:

        def judge(rung: int, variant: Variant) -> FlightTally:
            nonlocal done
            if (rung, variant) not in table.tallies:
                controller = variant.controller(bases[variant.base], mission)
                table.add(rung, variant, _tally(experiment, mission, controller, starts[rung]))
            done += settings.cases[rung]
            progress.show(done, f"round {rung + 1}, {variant.words}")
            return table.tallies[rung, variant]

        try:
            return fitting.halve(experiment, variants, judge, first)
        finally:
            table.write()


class CompetitionTable:
    """The table of all variants flown so far, from which a resumed run continues."""

    def __init__(self, experiment: Experiment, folder: Path) -> None:
        self.tallies: dict[tuple[int, Variant], FlightTally] = {}
        self._path, self._due = folder / artifacts.FIT_CANDIDATES, time.monotonic()
        text = artifacts.text_of(folder, artifacts.FIT_CANDIDATES) if experiment.resume else ""
        with artifacts.explained(f"{self._path} cannot be read", "delete it, then resume again", csv.Error):
            for row in csv.DictReader(io.StringIO(text)):
                key, tally = fitting.read_row(row, experiment.monte_carlo.confidence_percent)
                self.tallies[key] = tally

    def add(self, rung: int, variant: Variant, tally: FlightTally) -> None:
        """Add a variant's tally; write the table unless it was written within `WRITE_EVERY_S`."""
        self.tallies[rung, variant] = tally
        if time.monotonic() >= self._due:
            self.write()
            self._due = time.monotonic() + WRITE_EVERY_S

    def write(self) -> None:
        """Write the table whole."""
        rows = [fitting.row_of(rung, variant, tally) for (rung, variant), tally in self.tallies.items()]
        tables.write_csv(self._path, fitting.COLUMNS, rows)


def _is_tuned(experiment: Experiment, result: FitResult) -> bool:
    """Return whether to tune the best controller: never with dispersions, which training does not fly."""
    tunes = experiment.fit.tunes
    is_wanted = tunes == "always" or (tunes == "needed" and not _reaches_goal(experiment, result))
    return is_wanted and not experiment.mission.dispersions


def _tuned(experiment: Experiment, folder: Path, start: FitResult) -> FuzzyController | None:
    """Tune a controller by training; return None if no champion flies better."""
    given = start.controller
    moved = replace(experiment, mission=start.mission)
    tuning = fitting.tuning_of(moved, given, start.tally)
    genome = genome_of(from_fuzzy(given), tuning.optimizer.encoding)
    with TrainingProgress(tuning.optimizer) as progress:
        result = evolved(
            tuning,
            genome,
            checkpoint=folder / artifacts.FIT_CHECKPOINT,
            resume=experiment.resume,
            on_generation=lambda history: progress.show_generation(history[-1]),
        )
    if result.interrupted:
        raise KeyboardInterrupt
    selection = select(tuning, genome, result.history, given)
    name = f"{given.name.removesuffix(f'_{experiment.name}')}_{experiment.name}"
    return replace(selection.controller, name=name) if selection.is_improved else None


def _named(experiment: Experiment, variant: Variant, base: FuzzyController) -> FuzzyController:
    """Return a variant's controller, named after base and experiment, with its origin in its purpose."""
    controller = variant.controller(base, experiment.mission)
    if variant.is_shipped:
        return controller
    purpose = f"The rules of {variant.words}, for another mission. There: {base.purpose}"
    return replace(controller, name=f"{base.name}_{experiment.name}", purpose=purpose)


def _write(
    experiment: Experiment, folder: Path, controller: FuzzyController, result: Mapping[str, Any]
) -> None:
    """Write the controller, for flights and for people, the summary, and the page."""
    facts = {**manifests.provenance(experiment, folder), "fitted_from": str(result["words"])}
    if result["improved"]:
        controller = serialize.described(with_descriptions(serialize.unmarked(controller)), facts)
    writing.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(controller) + "\n")
    writing.write_atomically(folder / artifacts.FIT_CONTROLLER, serialize.dump_yaml(controller))
    writing.write_json(folder / artifacts.FIT, {"controller": controller.name, **result})
    command = manifests.read_if_any(folder).get("command", ())
    page = render_fit(controller.name, folder.as_posix(), result, command)
    writing.write_atomically(folder / artifacts.FIT_PAGE, page)
