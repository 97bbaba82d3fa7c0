"""Fit a controller to any mission: champions scaled to it, the best tuned and judged: fit/, champion.json."""

import csv
import io
import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

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
from pipeline.report.played import player_of_starts
from pipeline.run import artifacts, manifests, tables, writing
from pipeline.run.progress import Progress
from pipeline.run.runner import Missed, Unimproved
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment, Mission
from pipeline.training.genome import genome_of
from pipeline.training.judging import evolved
from pipeline.training.progress import TrainingProgress
from pipeline.training.similarity import Limitation, limitations
from plain_files.document import plain
from plain_files.document.html import ScriptedPanel

#: the table of the competition is written at most once in this many seconds: each time waits for the disk
WRITE_EVERY_S: Final = 1.0
#: controllers that plan, which take many times as long to fly, of which no more reach later rounds
PLANNERS_KEPT: Final = 2
#: share of the unseen starts from which these fly; from the others only if that leaves open whether the goal
#: is reached: what succeeds in 95 % of flights then reaches the default goal in 2.8 % of fits instead of 1.6
FIRST_LOOK: Final = 0.4
#: what each result is, by its key in the summary, in the order in which it is shown
WHAT: Final = {"fitted": "fitted", "layered": "with safety=filter", "planned": "planning", "tuned": "tuned"}
Ranked = list[tuple[Variant, FlightTally]]


@dataclass(frozen=True)
class FitResult:
    """A result of the fit so far: a controller, its mission, and its flights from unseen starts."""

    words: str
    controller: FuzzyController
    mission: Mission
    tally: FlightTally
    is_shipped: bool


def run(experiment: Experiment, folder: Path) -> Unimproved | Missed | None:
    """Fit a controller to the mission, and say beforehand what limits it.

    Returns
    -------
    Unimproved or Missed, optional
        Where nothing flies better than the best champion as shipped; where the goal is missed.
    """
    fit = _Fit(experiment, folder)
    last, is_improved = fit.run()
    result = fit.summary() | {"improved": is_improved}
    starts = fitting.rung_scenarios(experiment, len(experiment.fit.cases))
    player = player_of_starts(experiment, last.mission, from_fuzzy(last.controller), starts)
    _write(experiment, folder, last.controller, result, player)
    if not _reaches_goal(experiment, last.tally):
        return _missed(result, last)
    if is_improved:
        return None
    return Unimproved(f"not improved: {last.words} is handed back, none flies better; {last.tally.sentence}")


class _Fit:
    """A fit at work: what competes, and what came of it."""

    def __init__(self, experiment: Experiment, folder: Path) -> None:
        self._experiment, self._folder = experiment, folder
        self._bases = fitting.load_bases(experiment)
        self._planners = fitting.load_named("fit.planners", experiment.fit.planners)
        self._unseen = fitting.rung_scenarios(experiment, len(experiment.fit.cases))
        self._flyable, self._limits = _limits(experiment, self._unseen)
        self._table = CompetitionTable(experiment, folder)
        self._drawn = fitting.drawn_variants(experiment, self._bases)
        if not self._drawn:
            raise ControllerError(
                "none of fit.bases can fly this mission at any size; see their decision_period_s and "
                "tour_time_s"
            )
        self._near: list[Variant] = []
        self._rivals: Ranked = []
        self._ranked: Ranked = []
        self._shipped: tuple[Variant, FlightTally] | None = None
        self._refusal = ""
        self._results: dict[str, FitResult] = {}
        self._last: FitResult | None = None

    def run(self) -> tuple[FitResult, bool]:
        """Fit; return the result, and whether it is other than a champion as shipped.

        Rules come first. As soon as their best clearly miss the goal, the layer and plans are tried; rules
        are searched further only if these miss the goal too, without clearly beating the rules.
        """
        self._compete(slice(0, max(1, len(self._experiment.fit.cases) - 1)))
        leader = self._rivals[0][1]
        is_tried = self._is_hopeless(leader)
        if is_tried:
            self._report_shipped()
            self._try_others(leader)
        last = self._last
        if last is None or not self._is_settled(leader):
            self._compete(fitting.EVERY)
            if not is_tried:
                self._report_shipped()
            last = self._try_rules()
            if not is_tried and (is_tried := self._is_hopeless(last.tally)):
                self._try_others(last.tally)
            if not self._is_settled(last.tally):
                last = self._try_neighbours()
                if not is_tried:
                    self._try_others(last.tally)
            self._try_tuning()
        last = self._last or last
        return last, not last.is_shipped

    def _is_hopeless(self, tally: FlightTally) -> bool:
        """Return whether what flies like a tally clearly misses the goal."""
        return 100.0 * tally.success.high < self._experiment.fit.goal_percent

    def _is_settled(self, rules: FlightTally) -> bool:
        """Return whether the last result reaches the goal, or clearly beats rules that fly like a tally."""
        return self._is_done or (self._last is not None and self._last.tally.success.low > rules.success.high)

    def _try_others(self, rules: FlightTally) -> None:
        """Try what helps where rules that fly like a tally miss the goal: the layer, then plans."""
        self._try_layer(rules)
        self._try_plans()

    @property
    def _is_done(self) -> bool:
        return self._last is not None and _reaches_goal(self._experiment, self._last.tally)

    def _compete(self, rungs: slice) -> None:
        """Let the rules drawn compete over some rounds."""
        self._rivals = _halved(self._experiment, self._table, self._bases, self._drawn, rungs)
        self._shipped = next((rival for rival in self._rivals if rival[0].is_shipped), None)

    def _report_shipped(self) -> None:
        _report("as shipped", self._shipped and self._shipped[1])

    def _stand(self, key: str, variant: Variant, base: FuzzyController, mission: Mission) -> FitResult:
        """Judge a variant on unseen starts, and keep it as the last result if it flies better."""
        controller = _named(self._experiment, variant, base)
        is_shipped = variant.is_shipped and mission == self._experiment.mission
        result = self._judged(key, variant.words, controller, mission, is_shipped=is_shipped)
        if key not in self._results or result.tally.score > self._results[key].tally.score:
            self._results[key] = result
        return result

    def _judged(
        self, key: str, words: str, controller: FuzzyController, mission: Mission, *, is_shipped: bool = False
    ) -> FitResult:
        """Return how a controller flies from unseen starts."""
        first = math.ceil(FIRST_LOOK * len(self._unseen)) if key == "planned" else len(self._unseen)
        tally = _tally(self._experiment, mission, controller, self._unseen[:first])
        goal, rest = self._experiment.fit.goal_percent / 100.0, self._unseen[first:]
        if rest and tally.success.low < goal <= tally.success.high:
            more = _tally(self._experiment, mission, controller, rest)
            tally = fitting.joined(tally, more, self._experiment.monte_carlo.confidence_percent)
        _report(f"{WHAT[key]}, {words}", tally)
        return FitResult(words, controller, mission, tally, is_shipped)

    def _try_rules(self) -> FitResult:
        """Judge the best rules; return the last result."""
        best = self._rivals[0][0]
        return self._keep(self._stand("fitted", best, self._bases[best.base], self._experiment.mission))

    def _try_neighbours(self) -> FitResult:
        """Let neighbours of the best rules compete with the last round's; return the last result."""
        experiment, best = self._experiment, self._rivals[0][0]
        neighbours = fitting.neighbours_of(experiment, best, self._bases)
        self._near = [*(variant for variant, _ in self._rivals), *neighbours]
        later = slice(min(1, len(experiment.fit.cases) - 1), None)
        self._rivals = _halved(experiment, self._table, self._bases, self._near, later)
        if (nearby := self._rivals[0][0]) != best:
            self._stand("fitted", nearby, self._bases[nearby.base], experiment.mission)
        return self._keep(self._results["fitted"])

    def _keep(self, result: FitResult) -> FitResult:
        """Keep a result if it flies better than the last; return the better one."""
        if self._last is None or result.tally.score > self._last.tally.score:
            self._last = result
        return self._last

    def _try_layer(self, tally: FlightTally) -> None:
        """Try the safety layer where rules fly like a tally that misses the goal mostly by exits."""
        if _reaches_goal(self._experiment, tally) or tally.exits.count <= tally.misses.count:
            return
        try:
            mission = fitting.with_filter(self._experiment)
        except SettingError as error:
            self._refusal = str(error)
            return
        # what flies best alone, and all its neighbours, may fly badly under the layer
        contenders = [*self._drawn, *(variant for variant in self._near if variant not in self._drawn)]
        rival = _best_with_layer(self._experiment, mission, contenders, self._bases)
        layered = self._stand("layered", rival, self._bases[rival.base], mission)
        if self._last is None or layered.tally.success.count > self._last.tally.success.count:
            self._last = layered

    def _try_plans(self) -> None:
        """Try what plans where the goal is missed: the best of the first round, or else of the last."""
        variants = fitting.planning_variants(self._experiment, self._planners)
        for rungs in (slice(0, 1), fitting.EVERY):
            if self._is_done or not variants:
                return
            before = self._ranked[:1]
            self._ranked = _ranked_planners(self._experiment, self._table, self._planners, variants, rungs)
            best = self._ranked[0][0]
            if not before or before[0][0] != best:
                self._keep(self._stand("planned", best, self._planners[best.base], self._experiment.mission))

    def _try_tuning(self) -> None:
        """Tune the last result where that is wanted; plans are made of constants, which are not tuned."""
        last = self._last
        if last is None or last is self._results.get("planned") or not _is_tuned(self._experiment, last):
            return
        if (champion := _tuned(self._experiment, self._folder, last)) is not None:
            self._results["tuned"] = self._judged("tuned", last.words, champion, last.mission)
            self._keep(self._results["tuned"])

    def summary(self) -> dict[str, Any]:
        """Return the results as plain data."""
        last, results = self._last, {key: self._results.get(key) for key in WHAT}
        rows = {key: result and _row(result.words, result.tally) for key, result in results.items()}
        limits = [vars(limit) | {"kept": limit.is_kept, "sentence": limit.sentence} for limit in self._limits]
        return {
            "words": last and last.words,
            "safety": last and last.mission.safety.kind,
            "goal_percent": self._experiment.fit.goal_percent,
            "limits": limits,
            "flyable": plain(self._flyable),
            "shipped": self._shipped and _row(self._shipped[0].words, self._shipped[1]),
            **rows,
            "layer_refused": self._refusal,
            "last": last and _row(last.words, last.tally),
            "rivals": [_row(variant.words, tally) for variant, tally in (*self._rivals, *self._ranked)],
        }


def _missed(result: Mapping[str, Any], last: FitResult) -> Missed:
    """Return the sentence that the goal is missed, and by what the mission is limited."""
    limits = [f"limited by the {limit['sentence']}" for limit in result["limits"] if not limit["kept"]]
    return Missed(
        f"goal missed: the best, {last.words}, is not shown to succeed in {result['goal_percent']:g} % of "
        f"flights; {last.tally.sentence}; {'; '.join(limits or ('no limit told above explains it',))}"
    )


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


def _reaches_goal(experiment: Experiment, tally: FlightTally) -> bool:
    """Return whether the success is above the goal, at the confidence of the evaluation."""
    return tally.success.low >= experiment.fit.goal_percent / 100.0


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
    experiment: Experiment,
    table: "CompetitionTable",
    planners: Mapping[str, FuzzyController],
    variants: Sequence[Variant],
    rungs: slice,
) -> Ranked:
    """Return variants of controllers that plan, with their flights in the last of some rounds, best first."""
    kept = tuple(min(count, PLANNERS_KEPT) for count in experiment.fit.kept)
    experiment = replace(experiment, fit=replace(experiment.fit, kept=kept))
    return _halved(experiment, table, planners, variants, rungs)


def _report(what: str, tally: FlightTally | None) -> None:
    sys.stderr.write(f"  {what}: {tally.sentence if tally else 'none can fly this mission'}\n")


def _halved(
    experiment: Experiment,
    table: "CompetitionTable",
    bases: Mapping[str, FuzzyController],
    variants: Sequence[Variant],
    rungs: slice,
) -> Ranked:
    """Run some rounds of the halving, or what is left of them; return the last one's variants, best first."""
    mission, settings = experiment.mission, experiment.fit
    starts = [fitting.rung_scenarios(experiment, rung) for rung in range(len(settings.cases))]
    total, done = fitting.num_flights(experiment, len(variants), rungs), 0
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
            return fitting.halve(experiment, variants, judge, rungs)
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
    is_wanted = tunes == "always" or (tunes == "needed" and not _reaches_goal(experiment, result.tally))
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
    experiment: Experiment,
    folder: Path,
    controller: FuzzyController,
    result: Mapping[str, Any],
    player: ScriptedPanel,
) -> None:
    """Write the controller, for flights and for people, the summary, and the page."""
    facts = {**manifests.provenance(experiment, folder), "fitted_from": str(result["words"])}
    if result["improved"]:
        controller = serialize.described(with_descriptions(serialize.unmarked(controller)), facts)
    writing.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(controller) + "\n")
    writing.write_atomically(folder / artifacts.FIT_CONTROLLER, serialize.dump_yaml(controller))
    writing.write_json(folder / artifacts.FIT, {"controller": controller.name, **result})
    page = render_fit(controller.name, result, player)
    writing.write_atomically(folder / artifacts.FIT_PAGE, page)
