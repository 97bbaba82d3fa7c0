"""Many flights and their margins, and the search for the worst case.

The search is by CMA-ES over a case's random variables, minimising a requirement's margin. Falsification by
robustness: Abbas and others, "Probabilistic temporal logic falsification of cyber-physical systems", ACM
Transactions on Embedded Computing Systems 12, 2013. A search begins with random cases and continues from the
worst of them. Every flight counts.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.assurance.case_space import CaseSpace
from pipeline.evaluation.assurance.formula import Formula, quantities_of, render, unit_of
from pipeline.evaluation.assurance.quantities import UNITS, TrackFacts, facts_of_flown, of_tracks
from pipeline.evaluation.assurance.requirements import Requirement, RequirementError, check_formulas
from pipeline.evaluation.assurance.robustness import Samples, deciding_units, holds, premises, robustness
from pipeline.evaluation.monte_carlo import fly_tracked, fly_tracked_fleets
from pipeline.evaluation.sequential import Stop
from pipeline.flight.control.controller import Controller
from pipeline.flight.state.log import Scenario
from pipeline.run.engine import HERE, TaskPool
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.training import CmaEs, Optimizer
from pipeline.training.evolution.generations import Evaluate
from pipeline.training.evolution.rounds import evolve_rounds

#: flights whose tracks are in memory at once, 22 kB per hour of flight
PART = 1000
#: the column of which cases meet a requirement, for a `Stop`
MET = "met"
#: flights too few to be worth sharing out
FEW = 64


class FormulaResult(NamedTuple):
    """The result of a formula in n cases.

    Attributes
    ----------
    margins : (n,)
        Robustness.
    is_met : (n,)
        Whether the formula holds.
    units : (n,)
        Of the margins; empty where all have the unit of the formula.
    premises : mapping
        Of the formula's implications: in which cases each premise occurs, (n,), by its text.
    """

    margins: Floats
    is_met: NDArray[np.bool_]
    units: NDArray[np.str_] = np.empty(0, dtype=np.str_)
    premises: Mapping[str, NDArray[np.bool_]] = MappingProxyType({})

    @property
    def worst(self) -> tuple[float, str]:
        """The least margin and its unit, empty where it is that of the formula."""
        case = int(np.argmin(self.margins))
        return float(self.margins[case]), str(self.units[case]) if len(self.units) else ""

    def first(self, number: int) -> "FormulaResult":
        """Return the result in the first cases."""
        occurred = {text: occurs[:number] for text, occurs in self.premises.items()}
        return FormulaResult(
            self.margins[:number], self.is_met[:number], self.units[:number], MappingProxyType(occurred)
        )

    @property
    def num_occurred(self) -> dict[str, int]:
        """Number of cases in which each premise occurs."""
        return {text: int(np.count_nonzero(occurs)) for text, occurs in self.premises.items()}


class Campaign:
    """Flights of one controller in one mission, evaluated by formulas; each part of them is flown once.

    Parameters
    ----------
    mission : Mission
    controller : Controller
    workers : int, optional
        Worker threads; one per processor unless given.
    """

    def __init__(self, mission: Mission, controller: Controller, workers: int | None = None) -> None:
        self._mission, self._controller, self._workers = mission, controller, workers

    def judge(
        self,
        scenarios: Sequence[Scenario],
        requirements: Sequence[Requirement],
        pool: TaskPool = HERE,
        part_cases: int = PART,
        stops: Mapping[str, Stop] = MappingProxyType({}),
        show: Callable[[int], None] = lambda _: None,
    ) -> dict[str, FormulaResult]:
        """Fly scenarios; return the result of each requirement that has a formula, by its id.

        Parameters
        ----------
        scenarios : sequence of Scenario
            Parts of it are handed on as its slices: what draws its items does so where they are flown.
        requirements : sequence of Requirement
        pool : TaskPool
            Where parts of the flights are flown.
        part_cases : int
            Flights of a part; at most `PART` are.
        stops : mapping of str to Stop
            By the ids of requirements, of whose share that meets them the interval is watched: flights end
            once all are narrow enough.
        show : callable
            Is called with the number of cases that are flown, after each part.

        Raises
        ------
        RequirementError
            If flights of this mission do not determine a formula.
        """
        check_formulas(requirements, self._mission)
        formulas = {
            requirement.id: requirement.formula
            for requirement in requirements
            if requirement.formula is not None
        }
        size = min(PART, part_cases)
        starts = range(0, len(scenarios), size)
        tasks = [(self, scenarios[first : first + size], formulas) for first in starts]
        parts, ends = dict[int, dict[str, FormulaResult]](), dict[str, int]()
        with closing(pool.run(judge_part, tasks)) as results:
            for index, part in results:
                parts[starts[index]] = part
                show(min(size * len(parts), len(scenarios)))
                for name in stops.keys() - ends.keys():
                    if end := stops[name].take(starts[index], {MET: part[name].is_met}):
                        ends[name] = end
                if stops and len(ends) == len(stops):
                    break
        # parts may have come in any order, and after the last that counts
        past = max(ends.values()) if stops and len(ends) == len(stops) else len(scenarios)
        flown = [parts[first] for first in starts if first < past]
        return {name: concatenate([part[name] for part in flown]).first(past) for name in formulas}

    @property
    def control_period_s(self) -> float:
        """Time between the samples of tracks."""
        return self._mission.control_period_s

    def tracks(self, scenarios: list[Scenario]) -> tuple[NDArray[np.float32], TrackFacts]:
        """Return the tracks of flights, (n, K+1, 15), or of fleets, (n, D, K+1, 15), and the rest."""
        # a few fly side by side in one thread: shared out, they would leave vectors half empty
        workers = 1 if len(scenarios) < FEW else self._workers
        fly = fly_tracked_fleets if self._mission.has_fleet else fly_tracked
        outcomes, tracks = fly(self._mission, self._controller, scenarios, workers)
        return tracks, facts_of_flown(self._mission, scenarios, outcomes.inspectable_count)


def judge_part(
    campaign: Campaign, scenarios: Sequence[Scenario], formulas: Mapping[str, Formula]
) -> dict[str, FormulaResult]:
    """Fly some scenarios; return the results of formulas, by name."""
    tracks, facts = campaign.tracks(list(scenarios))
    return evaluate_formulas(tracks, facts, formulas, campaign.control_period_s)


def evaluate_formulas(
    tracks: NDArray[np.floating], facts: TrackFacts, formulas: Mapping[str, Formula], period_s: float
) -> dict[str, FormulaResult]:
    """Return the results of formulas, by name, on flights with these tracks, (n, K+1, 15).

    A fleet, of tracks (n, D, K+1, 15), meets a formula if each of its deputies does; its margin is the least.
    """
    results = evaluate_each(tracks, facts, formulas, period_s)
    if tracks.ndim == 4:
        return {name: _of_all(result, tracks.shape[1]) for name, result in results.items()}
    return results


def evaluate_each(
    tracks: NDArray[np.floating], facts: TrackFacts, formulas: Mapping[str, Formula], period_s: float
) -> dict[str, FormulaResult]:
    """Return the results of formulas, by name, of fleets those of one deputy after the other, (n D,)."""
    names = dict.fromkeys(name for formula in formulas.values() for name in quantities_of(formula))
    quantities = of_tracks(tracks, facts, names)
    results = {name: _evaluate(formula, quantities, period_s) for name, formula in formulas.items()}
    duration_s = (tracks.shape[-2] - 1) * period_s
    for name, result in results.items():
        if not np.all(np.isfinite(result.margins)):
            raise RequirementError(
                f"{name}: its formula says nothing about a flight of {duration_s:g} s; "
                "let its windows begin before the end of the flight and hold a sample"
            )
    return results


def _of_all(result: FormulaResult, deputies: int) -> FormulaResult:
    """Return the result of fleets from those of their deputies, one after the other."""
    margins = result.margins.reshape(-1, deputies)
    worst = np.arange(len(margins)), margins.argmin(axis=1)
    return FormulaResult(
        margins[worst],
        np.asarray(result.is_met.reshape(-1, deputies).all(axis=1)),
        result.units.reshape(-1, deputies)[worst] if len(result.units) else result.units,
        {
            text: np.asarray(occurs.reshape(-1, deputies).any(axis=1))
            for text, occurs in result.premises.items()
        },
    )


def _evaluate(formula: Formula, quantities: Samples, period_s: float) -> FormulaResult:
    """Return a formula's margins, truth and premises on flights."""
    margins = robustness(formula, quantities, period_s)
    is_mixed = unit_of(formula) is None
    units = deciding_units(formula, quantities, margins) if is_mixed else np.empty(0, dtype=np.str_)
    occurred = premises(formula, quantities, period_s)
    # copies: what is sliced would keep all samples of the flights in memory
    return FormulaResult(
        np.array(margins),
        np.array(holds(formula, quantities, period_s)),
        np.array(units),
        {render(premise, UNITS): np.array(occurs) for premise, occurs in occurred.items()},
    )


def concatenate(parts: Sequence[FormulaResult]) -> FormulaResult:
    """Concatenate results of the same formula."""
    return FormulaResult(
        np.concatenate([part.margins for part in parts]),
        np.concatenate([part.is_met for part in parts]),
        np.concatenate([part.units for part in parts]),
        {text: np.concatenate([part.premises[text] for part in parts]) for text in parts[0].premises},
    )


#: separates the random numbers of searches from those of flights with the same seed
SPAWN_KEY = 0x5EA


@dataclass(frozen=True)
class WorstCaseSearch:
    """One search for the worst case of a requirement.

    Parameters
    ----------
    scenarios : tuple of Scenario
        All flown scenarios, in order.
    outcome : FormulaResult
        Their results.
    """

    scenarios: tuple[Scenario, ...]
    outcome: FormulaResult

    @property
    def worst(self) -> int:
        """Index of the flight with the least margin."""
        return int(np.argmin(self.outcome.margins))

    @property
    def first_failed(self) -> int | None:
        """Number of flights until the first failure; None without any."""
        failed = np.flatnonzero(~self.outcome.is_met)
        return int(failed[0]) + 1 if failed.size else None


def search(
    requirement: Requirement, campaign: Campaign, space: CaseSpace, experiment: Experiment, number: int
) -> WorstCaseSearch:
    """Search for the case with the least margin of a requirement.

    Parameters
    ----------
    requirement : Requirement
        With a formula.
    campaign : Campaign
    space : CaseSpace
    experiment : Experiment
        Its assurance says how many flights, and the initial spread; its optimizer is copied, with the
        search's own algorithm, sizes and step.
    number : int
        Of the search: with the experiment's seed it determines the random numbers.
    """
    settings = experiment.assurance
    flown: list[Scenario] = []
    outcomes: list[FormulaResult] = []

    def margins_of(genomes: Floats, space: CaseSpace) -> Floats:
        scenarios = [space.scenario(genes) for genes in genomes]
        outcome = campaign.judge(scenarios, [requirement])[requirement.id]
        flown.extend(scenarios)
        outcomes.append(outcome)
        return outcome.margins

    generator = np.random.default_rng(np.random.SeedSequence(experiment.seed, spawn_key=(SPAWN_KEY, number)))
    drawn = generator.random((settings.search_starts, len(space.genes)))
    centred, worst = space.centred_on(drawn[np.argmin(margins_of(drawn, space))])

    def fitness(_round: int, _champion: Floats | None) -> Evaluate:
        return lambda genomes: {"fitness": margins_of(genomes, centred)}

    common = {each.name: getattr(experiment.optimizer, each.name) for each in fields(Optimizer)}
    strategy = CmaEs(
        **common
        | {
            "algorithm": "cma_es",
            "population_size": settings.search_population,
            "generations": settings.search_generations,
            "initial_step": settings.search_step,
            "stall_generations": None,
            "rounds": 1,
        }
    )
    evolution_seed = int(generator.integers(2**31))
    evolve_rounds(fitness, len(space.genes), strategy, evolution_seed, initial=worst[np.newaxis])
    return WorstCaseSearch(tuple(flown), concatenate(outcomes))


@dataclass(frozen=True)
class SearchEfficiency:
    """How fast searches find failures, compared with random flights.

    Parameters
    ----------
    num_found, num_searches : int
        Number of searches that found a failure, and number of searches.
    flights_per_find : float, optional
        Flights of all searches, each counted to its first failure or its end, per failure found.
    random_flights_per_find : float, optional
        Random flights per failure among them.
    """

    num_found: int
    num_searches: int
    flights_per_find: float | None
    random_flights_per_find: float | None

    @property
    def ratio(self) -> float | None:
        """Factor by which the searches needed fewer flights."""
        if self.flights_per_find is None or self.random_flights_per_find is None:
            return None
        return self.random_flights_per_find / self.flights_per_find

    @property
    def sentence(self) -> str:
        """The comparison in words, without a full stop."""
        text = f"{self.num_found} of {self.num_searches} searches find a failure"
        if self.flights_per_find is not None:
            text += f", one flight in {self.flights_per_find:,.0f}"
        if self.random_flights_per_find is None:
            return f"{text}; at random there is none"
        text += f"; at random one in {self.random_flights_per_find:,.0f}"
        return text if self.ratio is None else f"{text}: {self.ratio:.1f} times as many"


def search_efficiency(searches: Sequence[WorstCaseSearch], random: FormulaResult) -> SearchEfficiency:
    """Compare how many flights searches needed for each failure found, with random flights.

    Searches that found none count with all their flights; `first_failed` counts from 1.
    """
    needed = sum(search.first_failed or len(search.scenarios) for search in searches)
    num_found = sum(search.first_failed is not None for search in searches)
    num_random = int(np.count_nonzero(~random.is_met))
    per_find = needed / num_found if num_found else None
    per_random_find = len(random.is_met) / num_random if num_random else None
    return SearchEfficiency(num_found, len(searches), per_find, per_random_find)
