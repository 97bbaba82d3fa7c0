"""What a training hands back: the controller that it was given, or the best champion of its generations.

They fly from validation starts, which no generation has flown. Those whose intervals of success lie apart are
ranked by success, unless they lie at or above the goal that the settings may have; the others by cost. What
is best of many may owe that to the starts that chose it. It then flies from further ones, and is left out if
it fails there more often than the given controller. So a search that went astray never replaces a controller
that flies.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import takewhile
from typing import Any, Final

import numpy as np

from fis_tools.model import FuzzyController
from pipeline.array_types import Booleans, Floats
from pipeline.evaluation.statistics import Fraction, fraction
from pipeline.flight.state.log import Outcomes, Scenario, inspectable_rate
from pipeline.run.engine import HERE, TaskPool
from pipeline.scenarios import training_scenarios, validation_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.training.evolution.front import Front
from pipeline.training.evolution.state import Generation
from pipeline.training.fitness import costs, objectives
from pipeline.training.genome import Genome
from pipeline.training.judging import flights_from, fly_fuzzy, named_after

#: starts on which the last champion is compared with the given controller where no validation starts are set
GUARD_CASES: Final = 400
#: candidates that fly from all validation starts; more of them first fly from a share of the starts
FINALISTS: Final = 16
FIRST_SHARE: Final = 4
#: further starts for each validation start: from them the best must not fail more often than the given
FURTHER: Final = 4
#: chance by which a candidate that does not fail more often is left out
RISK: Final = 0.05
#: relative gain in cost below which a candidate is the given controller over again, rounded
SAME: Final = 1e-9
#: of the given controller, as it is or as genes, which clips numbers outside their bounds
GIVEN, START = "given", "start"
#: of the best of a generation, and of the controllers of a front
CHAMPION, MEMBER = "champion", "front"

COLUMNS: Final = (
    *("candidate", "round", "generation", "training_fitness", "num_cases", "cost_m_s", "delta_v_m_s"),
    *("success_fraction", "success_low", "success_high"),
)


@dataclass(frozen=True, eq=False)  # arrays have no equality
class Candidate:
    """A controller that a training may hand back.

    Parameters
    ----------
    name : str
        `GIVEN`, `START`, `CHAMPION` or `MEMBER`.
    genome : (num_genes,) array, optional
        None for the given controller itself.
    generation : Generation, optional
        Of a champion.
    training_fitness : float, optional
        Of what was trained.
    """

    name: str
    genome: Floats | None = None
    generation: Generation | None = None
    training_fitness: float | None = None

    @property
    def is_trained(self) -> bool:
        """Whether the training made it."""
        return self.name in (CHAMPION, MEMBER)


@dataclass(frozen=True, eq=False)  # arrays have no equality
class SelectionJudgement:
    """A candidate's flights from validation starts.

    Parameters
    ----------
    candidate : Candidate
    num_cases : int
    cost : float
        Mean, with the prices of the last round, m/s.
    delta_v : float
        Mean, m/s.
    success : Fraction
        Successes inside the limits.
    spent : float
        Of the cost, the first objective of a front, m/s.
    rate_percent, outside_percent : float
        Mean inspection rate, and flights that leave the limits.
    """

    candidate: Candidate
    num_cases: int
    cost: float
    delta_v: float
    success: Fraction
    spent: float
    rate_percent: float
    outside_percent: float

    @property
    def sentence(self) -> str:
        """Success and cost in words."""
        rate = self.success
        return (
            f"{100 * rate.fraction:.1f} % succeed ({100 * rate.low:.1f} to {100 * rate.high:.1f}), delta-v "
            f"{self.delta_v:.3f} m/s, cost {self.cost:.3f} m/s"
        )

    @property
    def where(self) -> str:
        """Where the candidate comes from, in words: the given controller, or a round and generation."""
        generation = self.candidate.generation
        if self.candidate.name == MEMBER:
            return "of the front"
        if generation is None:
            return "the given controller" + (" within the bounds" if self.candidate.name == START else "")
        return f"round {generation.round + 1}, generation {generation.generation}"

    def summary(self) -> dict[str, Any]:
        """Return the judgement as plain data."""
        generation = self.candidate.generation
        at = {} if generation is None else {"round": generation.round, "generation": generation.generation}
        numbers = {"cost_m_s": self.cost, "delta_v_m_s": self.delta_v, "success": asdict(self.success)}
        return {"candidate": self.candidate.name, **at, **numbers}

    def row(self) -> list[Any]:
        """Return the row of `COLUMNS`; empty where there is no generation."""
        generation, rate = self.candidate.generation, self.success
        fitness = self.candidate.training_fitness
        at: list[Any] = ["", ""] if generation is None else [generation.round, generation.generation]
        at.append("" if fitness is None else fitness)
        numbers = [self.num_cases, self.cost, self.delta_v, rate.fraction, rate.low, rate.high]
        return [self.candidate.name, *at, *numbers]


@dataclass(frozen=True)
class Selection:
    """The controller that a training hands back.

    Parameters
    ----------
    controller : FuzzyController
    chosen : Judgement
    best_champion : Judgement
        The best that the training made, whether or not it was chosen.
    given : Judgement, optional
        None if there was nothing to compare with.
    judged : tuple of Judgement
        All candidates: those that flew from all starts first.
    best_fails_more : bool
        Whether the best champion fails more often than the given controller from further starts.
    """

    controller: FuzzyController
    chosen: SelectionJudgement
    best_champion: SelectionJudgement
    given: SelectionJudgement | None
    judged: tuple[SelectionJudgement, ...]
    best_fails_more: bool

    @property
    def is_improved(self) -> bool:
        """Whether a champion is handed back, not the given controller."""
        return self.chosen is not self.given


def select(
    experiment: Experiment,
    genome: Genome,
    history: Sequence[Generation],
    given: FuzzyController | None = None,
    pool: TaskPool = HERE,
    front: Front | None = None,
) -> Selection:
    """Return the controller that a training hands back.

    Parameters
    ----------
    experiment : Experiment
        With validation starts all generations' champions are candidates; without, the last one alone.
    genome : Genome
    history : sequence of Generation
    given : FuzzyController, optional
        The controller that was trained.
    pool : TaskPool
        Where controllers that rehearse are flown.
    front : Front, optional
        Its controllers are the candidates, in place of the champions, and all fly from all starts.
    """
    settings = experiment.optimizer
    trained = _members(front) if front else _distinct(history if settings.validation_cases else history[-1:])
    candidates = [Candidate(START, genome.encode()), *trained]
    if given is not None:
        candidates.insert(0, Candidate(GIVEN))
    num_cases = settings.validation_cases or GUARD_CASES
    scenarios = validation_scenarios(experiment, num_cases)
    if experiment.starts.rows is not None:
        scenarios = training_scenarios(experiment)

    def judge(some: Sequence[Candidate], starts: list[Scenario]) -> list[SelectionJudgement]:
        return _judged(experiment, genome, some, starts, history[-1].round, given, pool)

    first: list[SelectionJudgement] = []
    if len(candidates) > FINALISTS and front is None:
        first = judge(candidates, scenarios[: -(-len(scenarios) // FIRST_SHARE)])
        # the given controller and the last champion always fly from all starts
        finalists = [*ranked(first, settings.success_goal_percent)[:FINALISTS], first[0], first[-1]]
        candidates = [judgement.candidate for judgement in first if judgement in finalists]
    final = judge(candidates, scenarios)
    order = ranked(final, settings.success_goal_percent)
    of_given = next((judgement for judgement in final if judgement.candidate.name == GIVEN), None)
    chosen, refused = order[0], list[SelectionJudgement]()
    if of_given is not None and _is_no_better(chosen, of_given):
        chosen = of_given
    if given is not None and chosen is not of_given and experiment.starts.rows is None:
        fails_more = _failing_more_than(given, experiment, genome, num_cases, pool)
        refused = list(takewhile(lambda best: best is not of_given and fails_more(best.candidate), order))
        chosen = order[len(refused)]
    controller = given
    if chosen.candidate.genome is not None:
        controller = named_after(experiment, genome, chosen.candidate.genome)
    assert controller is not None  # noqa: S101 - only the given one has no genome
    best_champion = next(judgement for judgement in order if judgement.candidate.is_trained)
    earlier = [judgement for judgement in first if judgement.candidate not in candidates]
    return Selection(
        controller, chosen, best_champion, of_given, (*final, *earlier), best_champion in refused
    )


def ranked(
    judged: Sequence[SelectionJudgement], goal_percent: float | None = None
) -> list[SelectionJudgement]:
    """Return candidates from best to worst.

    First those whose interval of success reaches the goal, or overlaps that of the highest success, by cost;
    then the others, by success. Of equals the first given comes first.
    """
    least = max((judgement.success for judgement in judged), key=lambda success: success.fraction).low
    if goal_percent is not None:
        least = min(least, goal_percent / 100.0)

    def key(judgement: SelectionJudgement) -> tuple[bool, float, float]:
        is_behind = judgement.success.high < least
        return is_behind, -judgement.success.fraction if is_behind else 0.0, judgement.cost

    return sorted(judged, key=key)


def _is_no_better(chosen: SelectionJudgement, given: SelectionJudgement) -> bool:
    """Return whether a candidate flies like the given controller, to rounding."""
    return chosen.success.count <= given.success.count and given.cost <= chosen.cost + SAME * abs(chosen.cost)


def _failing_more_than(
    given: FuzzyController, experiment: Experiment, genome: Genome, num_cases: int, pool: TaskPool
) -> Callable[[Candidate], bool]:
    """Return the test of whether a candidate fails more often than the given controller, from further starts.

    These have chosen nothing. It is the exact sign test of the starts in which one of the two alone succeeds
    (McNemar, Psychometrika, 1947).
    """
    mission, threads = experiment.mission, pool.threads(experiment.optimizer.workers)
    starts = validation_scenarios(experiment, FURTHER * num_cases, first=num_cases)
    fly = flights_from(experiment, genome, starts, pool)
    (outcomes,) = pool.map(fly_fuzzy, [(mission, given, starts, threads)])
    given_succeeds = _is_success(experiment, outcomes)

    from scipy.stats import binomtest  # noqa: PLC0415 - slower to import than a thousand flights

    def fails_more(candidate: Candidate) -> bool:
        assert candidate.genome is not None  # noqa: S101 - only the given one has no genome
        succeeds = _is_success(experiment, fly(candidate.genome[np.newaxis]))[0]
        only_given = int(np.count_nonzero(given_succeeds & ~succeeds))
        only_one = int(np.count_nonzero(given_succeeds ^ succeeds))
        return bool(only_one) and binomtest(only_given, only_one, alternative="greater").pvalue < RISK

    return fails_more


def _is_success(experiment: Experiment, outcomes: Outcomes) -> Booleans:
    """Return whether flights succeed inside the limits, shaped like the outcomes."""
    return outcomes.is_success(experiment.mission.inspection_threshold_percent) & ~outcomes.is_violated


def _members(front: Front) -> Iterator[Candidate]:
    for genes, fitness in zip(front.genomes, front.fitness.tolist(), strict=True):
        yield Candidate(MEMBER, genes, training_fitness=fitness)


def _distinct(history: Sequence[Generation]) -> Iterator[Candidate]:
    """Yield the champions of generations, each genome once, where it came last."""
    last = {generation.champion.tobytes(): generation for generation in history}
    for generation in history:
        if last[generation.champion.tobytes()] is generation:
            yield Candidate(CHAMPION, generation.champion, generation, generation.best)


def _judged(
    experiment: Experiment,
    genome: Genome,
    candidates: Sequence[Candidate],
    scenarios: list[Scenario],
    round_index: int,
    given: FuzzyController | None,
    pool: TaskPool,
) -> list[SelectionJudgement]:
    """Fly candidates from some starts and judge them with the prices of a round."""
    mission, workers = experiment.mission, experiment.optimizer.workers
    as_genes = [candidate for candidate in candidates if candidate.genome is not None]
    flown = flights_from(experiment, genome, scenarios, pool)(
        np.array([candidate.genome for candidate in as_genes])
    )
    judged = _judgements(experiment, as_genes, flown, round_index)
    if given is None or len(as_genes) == len(candidates):
        return judged
    (outcomes,) = pool.map(fly_fuzzy, [(mission, given, scenarios, pool.threads(workers))])
    in_one_row = outcomes.each(lambda values: values[np.newaxis])
    return _judgements(experiment, candidates[:1], in_one_row, round_index) + judged


def _judgements(
    experiment: Experiment, candidates: Sequence[Candidate], outcomes: Outcomes, round_index: int
) -> list[SelectionJudgement]:
    """Return the judgement of each candidate, whose outcomes are a row each."""
    mission, penalty = experiment.mission, experiment.optimizer.penalty_of_round(round_index)
    success = _is_success(experiment, outcomes)
    rates = (fraction(row, experiment.monte_carlo.confidence_percent) for row in success)
    inspected = inspectable_rate(outcomes.inspected_count, outcomes.inspectable_count)
    means = (
        costs(outcomes, penalty, mission).mean(axis=-1),
        outcomes.delta_v_m_s.mean(axis=-1),
        objectives(outcomes, penalty, mission)["spent"],
        inspected.mean(axis=-1),
        100.0 * outcomes.is_violated.mean(axis=-1),
    )
    rows = zip(candidates, rates, *(values.tolist() for values in means), strict=True)
    return [
        SelectionJudgement(candidate, success.shape[-1], cost, delta_v, rate, spent, inspected, outside)
        for candidate, rate, cost, delta_v, spent, inspected, outside in rows
    ]
