"""The cases that are flown for every touch of a controller, and judged."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from fis_tools.model import FuzzyController
from fis_tools.processors import num_processors
from pipeline.array_types import Integers
from pipeline.evaluation.assurance.campaign import FormulaResult, concatenate, evaluate_formulas
from pipeline.evaluation.assurance.judgements import judge
from pipeline.evaluation.assurance.quantities import facts_of_flown
from pipeline.evaluation.assurance.requirements import CASES, Requirement, verified_by_method
from pipeline.evaluation.assurance.verdicts import Evidence, verdict
from pipeline.evaluation.monte_carlo import episode_columns, fly_tracked
from pipeline.evaluation.paired_runs import Compared, compare
from pipeline.evaluation.statistics import Column, succeeds
from pipeline.flight.control.controller import RuleController, from_fuzzy
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.lesser_controllers import rules_alone
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.threads import in_threads

#: cases of a first answer, and of each that follows
FIRST, NEXT = 100, 300


@dataclass(frozen=True, eq=False)
class Flown:
    """The first n cases, flown and judged with one controller.

    Parameters
    ----------
    episodes : dict of (n,) arrays
        As an evaluation writes them.
    outcomes : dict of str to FormulaResult
        By the ids of requirements.
    """

    episodes: dict[str, Column]
    outcomes: dict[str, FormulaResult]

    def verdicts(self, requirements: Sequence[Requirement]) -> list[tuple[Requirement, str, str]]:
        """Return each requirement with its verdict in a word, and why."""
        judged = []
        for requirement in requirements:
            outcome = self.outcomes[requirement.id]
            claim = requirement.probability, requirement.confidence
            judgement = judge(outcome.margins, outcome.is_met, *claim, outcome.num_occurred)
            result = verdict(Evidence(requirement, judgement))
            failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} fail"
            judged.append((requirement, result.word, f"{failed}; {result.why}"))
        return judged

    def failing(self, requirement: Requirement, count: int) -> Integers:
        """Return up to `count` cases that fail a requirement, the worst first."""
        outcome = self.outcomes[requirement.id]
        order = np.argsort(outcome.margins, kind="stable")
        return order[~outcome.is_met[order]][:count]


class EditorCases:
    """The cases of an experiment.

    Parameters
    ----------
    experiment : Experiment
    requirements : sequence of Requirement
        Those that are verified by cases are judged.
    """

    def __init__(self, experiment: Experiment, requirements: Sequence[Requirement]) -> None:
        self.mission, self._settings = experiment.mission, experiment.monte_carlo
        self._threads = experiment.monte_carlo.workers or num_processors()
        self.requirements = verified_by_method(requirements, CASES)
        self._formulas = {
            requirement.id: requirement.formula
            for requirement in self.requirements
            if requirement.formula is not None
        }
        self.scenarios = evaluation_scenarios(experiment)

    def fly(self, fuzzy: FuzzyController) -> Iterator[Flown]:
        """Fly the first cases, then more, then all; each result includes the cases flown before it.

        A controller with foresight flies by its rules alone: its plans take longer than a touch may.

        Raises
        ------
        pipeline.flight.control.controller.ControllerError
            If the controller cannot fly.
        """
        controller = self.ready(fuzzy)
        if foresees(controller):
            controller = rules_alone(controller)
        flown: list[Flown] = []
        ends = [*range(FIRST, len(self.scenarios), NEXT), len(self.scenarios)]
        for start, end in pairwise([0, *ends]):
            shares = np.array_split(np.arange(start, end), self._threads)
            flown += in_threads(partial(self._share, controller), filter(len, shares), workers=self._threads)
            yield _joined(flown)

    def ready(self, fuzzy: FuzzyController) -> RuleController:
        """Return an edited fuzzy controller as a controller that flies.

        Raises
        ------
        pipeline.flight.control.controller.ControllerError
            If it cannot fly.
        """
        controller = from_fuzzy(fuzzy)
        law_of(controller, self.mission)
        return controller

    def _share(self, controller: RuleController, cases: Integers) -> Flown:
        """Fly and judge cases in one thread."""
        scenarios = [self.scenarios[case] for case in cases]
        outcomes, tracks = fly_tracked(self.mission, controller, scenarios, workers=1)
        facts = facts_of_flown(self.mission, scenarios, outcomes.inspectable_count)
        evaluated = evaluate_formulas(tracks, facts, self._formulas, self.mission.control_period_s)
        return Flown(episode_columns(self.mission, scenarios, outcomes) | {"case": cases}, evaluated)

    def compare(self, before: Flown, after: Flown) -> list[Compared]:
        """Compare two controllers on their common cases, see `pipeline.evaluation.paired_runs.compare`."""
        return compare(before.episodes, after.episodes, self._settings.confidence_percent)

    def log(self, fuzzy: FuzzyController, case: int) -> FlightLog:
        """Fly a case and log it."""
        return fly_logged(self.mission, self.ready(fuzzy), self.scenarios[case])


def _joined(parts: Sequence[Flown]) -> Flown:
    episodes = {name: np.concatenate([part.episodes[name] for part in parts]) for name in parts[0].episodes}
    outcomes = {name: concatenate([part.outcomes[name] for part in parts]) for name in parts[0].outcomes}
    return Flown(episodes, outcomes)


def most_changed(before: Flown, after: Flown, count: int) -> Integers:
    """Return the cases that changed most: in success, then in points, then in delta-v."""
    ends = succeeds(before.episodes) != succeeds(after.episodes)
    points = np.abs(after.episodes["inspected_count"] - before.episodes["inspected_count"])
    spent = np.abs(after.episodes["delta_v_m_s"] - before.episodes["delta_v_m_s"])
    return np.lexsort((-spent, -points, ~ends))[:count]
