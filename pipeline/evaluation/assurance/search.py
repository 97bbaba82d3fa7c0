"""The search for the worst case: CMA-ES over what a case is drawn from, on a requirement's margin.

Falsification by robustness: Abbas and others, "Probabilistic temporal logic falsification of cyber-physical
systems", ACM Transactions on Embedded Computing Systems 12, 2013. A search begins with random cases and goes
on from the worst of them. Every flight counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.assurance.campaign import Flights, Outcome, joined
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.flight.log import Scenario
from pipeline.settings.dispersions import Distribution, distributions
from pipeline.settings.experiment import Assurance, Mission, MonteCarlo, Optimizer, Sun
from pipeline.training.evolution import evolve_rounds

Floats = NDArray[np.float64]

#: keeps the draws of searches apart from all others made from the same seed
SPAWN_KEY = 0x5EA
#: share of a dispersed setting's values at either end that a search leaves out: three standard deviations
TAIL = 0.00135


@dataclass(frozen=True)
class CaseSpace:
    """What a case is drawn from: direction, distance, the Sun unless that is fixed, and dispersed settings.

    Parameters
    ----------
    shell_m : (float, float)
        Least and greatest distance of a start, m.
    sun : Sun
    dispersed : tuple of Distribution
        Of settings, sorted by their keys. Of each the values from `TAIL` to one minus that can be chosen.
    turned : (float, float)
        By which share of a turn the azimuth and the Sun's angle are turned from their genes.
    """

    shell_m: tuple[float, float]
    sun: Sun
    dispersed: tuple[Distribution, ...] = ()
    turned: tuple[float, float] = (0.0, 0.0)

    @property
    def genes(self) -> tuple[str, ...]:
        """What the genes of a case are called, in their order; each is from 0 to 1."""
        angle = () if self.sun.mode == "fixed" else ("sun_angle",)
        ranges = self.sun.mode != "fixed" and self.sun.elevation_range_deg is not None
        elevation = ("sun_elevation",) if ranges else ()
        return ("height", "azimuth", "distance", *angle, *elevation, *(one.key for one in self.dispersed))

    def centred_on(self, genes: Floats) -> tuple["CaseSpace", Floats]:
        """Return the same space with the angles of some genes in the middle, and these genes there.

        A search that begins there meets no end of an angle, which has none.
        """
        moved, turned = genes.copy(), list(self.turned)
        for place, name in enumerate(("azimuth", "sun_angle")):
            if name in self.genes:
                gene = self.genes.index(name)
                turned[place] += genes[gene] - 0.5
                moved[gene] = 0.5
        return replace(self, turned=(turned[0], turned[1])), moved

    def scenario(self, genes: Floats) -> Scenario:
        """Return the case of some genes, (num_genes,); even ones are isotropic and uniform in distance."""
        told = dict(zip(self.genes, genes.tolist(), strict=True))
        height, azimuth = 2.0 * told["height"] - 1.0, 2.0 * np.pi * (told["azimuth"] + self.turned[0])
        across = np.sqrt(max(0.0, 1.0 - height * height))
        direction = np.array([across * np.cos(azimuth), across * np.sin(azimuth), height])
        distance = self.shell_m[0] + (self.shell_m[1] - self.shell_m[0]) * told["distance"]
        angle, elevation_deg = np.radians(self.sun.angle_deg), self.sun.elevation_deg
        if "sun_angle" in told:
            angle = 2.0 * np.pi * ((told["sun_angle"] + self.turned[1]) % 1.0)
        if self.sun.elevation_range_deg is not None and "sun_elevation" in told:
            low, high = self.sun.elevation_range_deg
            elevation_deg = low + told["sun_elevation"] * (high - low)
        settings = tuple(one.value(TAIL + (1.0 - 2.0 * TAIL) * told[one.key]) for one in self.dispersed)
        return Scenario(
            distance * direction,
            np.zeros(3),
            float(angle),
            float(np.radians(elevation_deg)),
            settings=settings or None,
        )


def case_space(monte_carlo: MonteCarlo, sun: Sun, mission: Mission) -> CaseSpace:
    """Return what the cases of an evaluation are drawn from."""
    shell_m = (monte_carlo.min_distance_m, monte_carlo.max_distance_m)
    return CaseSpace(shell_m, sun, distributions(mission.dispersions))


@dataclass(frozen=True)
class Search:
    """One search for the worst case of a requirement.

    Parameters
    ----------
    scenarios : tuple of Scenario
        All that were flown, in order.
    outcome : Outcome
        Of these.
    """

    scenarios: tuple[Scenario, ...]
    outcome: Outcome

    @property
    def worst(self) -> int:
        """Which flight has the least margin."""
        return int(np.argmin(self.outcome.margins))

    @property
    def first_failed(self) -> int | None:
        """How many flights it took to find one that fails; None where none did."""
        failed = np.flatnonzero(~self.outcome.is_met)
        return int(failed[0]) + 1 if failed.size else None


def search(
    requirement: Requirement,
    flights: Flights,
    space: CaseSpace,
    settings: Assurance,
    optimizer: Optimizer,
    seed: int,
    number: int,
) -> Search:
    """Search for the case that fulfils a requirement least.

    Parameters
    ----------
    requirement : Requirement
        With a formula.
    flights : Flights
    space : CaseSpace
    settings : Assurance
        How many flights, and the first spread.
    optimizer : Optimizer
        Of which nothing but the shape is used.
    seed, number : int
        The run's seed and the number of the search: together they say what is drawn.
    """
    flown: list[Scenario] = []
    outcomes: list[Outcome] = []

    def margins_of(genomes: Floats, space: CaseSpace) -> Floats:
        scenarios = [space.scenario(genes) for genes in genomes]
        outcome = flights.judge(scenarios, [requirement])[requirement.id]
        flown.extend(scenarios)
        outcomes.append(outcome)
        return outcome.margins

    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, number)))
    drawn = generator.random((settings.search_starts, len(space.genes)))
    centred, worst = space.centred_on(drawn[np.argmin(margins_of(drawn, space))])
    evolve_rounds(
        lambda _round, _champion: lambda genomes: {"fitness": margins_of(genomes, centred)},
        len(space.genes),
        _strategy(settings, optimizer),
        int(generator.integers(2**31)),
        initial=worst[np.newaxis],
    )
    return Search(tuple(flown), joined(outcomes))


def _strategy(settings: Assurance, optimizer: Optimizer) -> Optimizer:
    return replace(
        optimizer,
        algorithm="cma_es",
        population_size=settings.search_population,
        generations=settings.search_generations,
        initial_step=settings.search_step,
        stall_generations=None,
        rounds=1,
    )


@dataclass(frozen=True)
class Speed:
    """How fast searches find failures, beside flights at random.

    Parameters
    ----------
    num_found, num_searches : int
        How many searches found a failure.
    flights_per_find : float, optional
        Flights of all searches, each counted to its first failure or its end, for each failure found.
    random_flights_per_find : float, optional
        Flights at random for each failure among them.
    """

    num_found: int
    num_searches: int
    flights_per_find: float | None
    random_flights_per_find: float | None

    @property
    def ratio(self) -> float | None:
        """How many times fewer flights the searches needed."""
        if self.flights_per_find is None or self.random_flights_per_find is None:
            return None
        return self.random_flights_per_find / self.flights_per_find

    @property
    def sentence(self) -> str:
        """The comparison in words, without a full stop."""
        told = f"{self.num_found} of {self.num_searches} searches find a failure"
        if self.flights_per_find is not None:
            told += f", one in {self.flights_per_find:,.0f} flights"
        if self.random_flights_per_find is None:
            return f"{told}; at random there is none"
        told += f"; at random one in {self.random_flights_per_find:,.0f}"
        return told if self.ratio is None else f"{told}: {self.ratio:.1f} times as many"


def speed(searches: Sequence[Search], random: Outcome) -> Speed:
    """Compare searches with flights at random."""
    needed = sum(one.first_failed or len(one.scenarios) for one in searches)
    num_found = sum(one.first_failed is not None for one in searches)
    num_random = int(np.count_nonzero(~random.is_met))
    return Speed(
        num_found,
        len(searches),
        needed / num_found if num_found else None,
        len(random.is_met) / num_random if num_random else None,
    )
