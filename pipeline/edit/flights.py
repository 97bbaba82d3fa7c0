"""The cases of an experiment, flown by one version of a controller after the other, and compared."""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from fis_tools.model import FuzzyController
from pipeline.array_types import Integers
from pipeline.evaluation.assurance.campaign import Outcome, joined, judged
from pipeline.evaluation.assurance.judgement import judge
from pipeline.evaluation.assurance.requirements import CASES, Requirement, needs
from pipeline.evaluation.assurance.verdicts import Found, verdict
from pipeline.evaluation.monte_carlo import episode_columns
from pipeline.evaluation.statistics import Column, Compared, compare, succeeds
from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.control.controller import Controller, decision_stride, from_fuzzy
from pipeline.flight.goals.flights import fly_all, fly_logged
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.flight.state.log import FlightLog
from pipeline.flight.world.pack import inspection_points
from pipeline.settings.experiment import Experiment

#: cases of a first answer, and of each that follows
FIRST, NEXT = 100, 300


@dataclass(frozen=True, eq=False)
class Flown:
    """Some first cases, flown by one controller.

    Parameters
    ----------
    episodes : dict of (n,) arrays
        As an evaluation writes them.
    outcomes : dict of str to Outcome
        By the ids of requirements.
    """

    episodes: dict[str, Column]
    outcomes: dict[str, Outcome]

    def verdicts(self, requirements: Sequence[Requirement]) -> list[tuple[Requirement, str, str]]:
        """Return each requirement with its verdict in a word, and why."""
        found = []
        for one in requirements:
            outcome = self.outcomes[one.id]
            judgement = judge(outcome.margins, outcome.is_met, one.probability, one.confidence)
            judged = verdict(Found(one, judgement))
            failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} fail"
            found.append((one, judged.word, f"{failed}; {judged.why}"))
        return found


class Cases:
    """The cases of an experiment.

    Parameters
    ----------
    experiment : Experiment
    requirements : sequence of Requirement
        Those that are verified by cases are judged.
    """

    def __init__(self, experiment: Experiment, requirements: Sequence[Requirement]) -> None:
        self.mission, self._settings = experiment.mission, experiment.monte_carlo
        self._threads = experiment.monte_carlo.workers or os.cpu_count() or 1
        self.requirements = needs(requirements, CASES)
        self._formulas = {one.id: one.formula for one in self.requirements if one.formula is not None}
        self.scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)

    def fly(self, fuzzy: FuzzyController) -> Iterator[Flown]:
        """Fly the first cases, then more, then all; what is yielded holds those before it.

        Raises
        ------
        pipeline.flight.control.controller.ControllerError
            If the controller cannot fly.
        """
        controller, flown = self._ready(fuzzy), list[Flown]()
        ends = [*range(FIRST, len(self.scenarios), NEXT), len(self.scenarios)]
        with ThreadPoolExecutor(self._threads) as pool:
            for start, end in pairwise([0, *ends]):
                shares = np.array_split(np.arange(start, end), self._threads)
                flown += pool.map(partial(self._share, controller), filter(len, shares))
                yield _joined(flown)

    def _ready(self, fuzzy: FuzzyController) -> Controller:
        controller = from_fuzzy(fuzzy)
        decision_stride(controller, self.mission)
        return controller

    def _share(self, controller: Controller, cases: Integers) -> Flown:
        """Fly and judge some cases in one thread."""
        scenarios = [self.scenarios[case] for case in cases]
        shape = (len(scenarios), self.mission.num_controls + 1, NUM_TRACKED)
        tracks = np.empty(shape, dtype=np.float32)
        outcomes = fly_all(self.mission, controller, scenarios, 1, tracks)
        num_points, period = len(inspection_points(self.mission)), self.mission.control_period_s
        found = judged(tracks, num_points, self._formulas, period)
        return Flown(episode_columns(self.mission, scenarios, outcomes) | {"case": cases}, found)

    def compare(self, before: Flown, after: Flown) -> list[Compared]:
        """Compare two controllers on their common cases, see `pipeline.evaluation.statistics.compare`."""
        return compare(before.episodes, after.episodes, self._settings.confidence_percent)

    def log(self, fuzzy: FuzzyController, case: int) -> FlightLog:
        """Fly a case and log it."""
        return fly_logged(self.mission, self._ready(fuzzy), self.scenarios[case])


def _joined(parts: Sequence[Flown]) -> Flown:
    episodes = {name: np.concatenate([one.episodes[name] for one in parts]) for name in parts[0].episodes}
    outcomes = {name: joined([one.outcomes[name] for one in parts]) for name in parts[0].outcomes}
    return Flown(episodes, outcomes)


def most_changed(before: Flown, after: Flown, count: int) -> Integers:
    """Return the cases that changed most: in success, then in points, then in delta-v."""
    ends = succeeds(before.episodes) != succeeds(after.episodes)
    points = np.abs(after.episodes["inspected_count"] - before.episodes["inspected_count"])
    spent = np.abs(after.episodes["delta_v_m_s"] - before.episodes["delta_v_m_s"])
    order: Integers = np.lexsort((-spent, -points, ~ends))[:count]
    return order
