"""How rare an event is, by splitting: cases that come near it are continued by others that come nearer.

The event is that a margin is below zero. Between the law of all cases and the event stand levels of the
margin, each rarer by about the same factor: subset simulation (S.-K. Au and J. Beck, Probabilistic
Engineering Mechanics 16, 2001). Scouts find levels, and how far cases are moved between them
(`pipeline.evaluation.population`). The levels of the scout with the fewest are kept, as those of another may
crowd where it found no way on.

From what all scouts saw below each level a law is made by which cases are drawn there more often
(`pipeline.evaluation.mixture`), and from what these show a better one: importance sampling. By the last,
several populations draw their cases, each with the weight that makes up for it, and pass by chains what
levels are left: none, if the genes decide on the event, and most, if the numbers do.

As levels and the law are fixed beforehand, the product of the shares that pass is an unbiased estimate,
whatever the moves do (F. Cérou, P. Del Moral, T. Furon and A. Guyader, Sequential Monte Carlo for rare event
estimation, Statistics and Computing 22, 2012). So the populations are independent estimates with the same
mean, and Student's interval of it tells how far they agree. It misleads where their law is far from normal: a
way into the event that no scout found is drawn so rarely that most of them are too small, and their spread
with them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.mixture import UNIFORM, KernelMixture, Kernels, fitted
from pipeline.evaluation.population import CaseLaw, Numbers, Population
from pipeline.evaluation.statistics import students_half_width
from pipeline.run.engine import HERE, TaskPool

#: of the cases, the share that passes a level
PASSED: Final = 0.1
#: levels beyond which an event is given up: it is rarer than 1e-9, or cannot be approached
MOST_LEVELS: Final = 10
#: scouts, of all flights the share of the cases of each, and how many there are at least
SCOUTS, SCOUTED, LEAST_SCOUTED = 4, 0.01, 50
#: how often the law that cases are drawn by is made anew, and the share of all flights each time
REVISIONS, REVISED = 2, 0.15
#: of the draws by it that are not uniform, the share about the deepest level that so many of them reach
DEEPEST, REACHED = 0.6, 0.01
#: kernels of a level
MOST_KERNELS: Final = 800
#: populations that estimate
POPULATIONS: Final = 12
#: the first scale of moves, and how it follows the share of moves that are taken, which is to be the last
FIRST_SCALE, GAIN, TAKEN = 0.8, 1.5, 0.5


@dataclass(frozen=True)
class Plan:
    """The levels that cases pass, and how far they are moved.

    Parameters
    ----------
    levels : tuple of float
        Descending; the last is 0, unless the event is given up.
    scales : tuple of float
        Of the moves below each level but the last.
    """

    levels: tuple[float, ...]
    scales: tuple[float, ...]


@dataclass(frozen=True)
class Scouted:
    """What a scout found.

    Parameters
    ----------
    plan : Plan
    genes : ndarray, shape (n, num_genes)
        Of cases below its levels.
    margins : ndarray, shape (n,)
        Of these.
    num_flights : int
    """

    plan: Plan
    genes: Floats
    margins: Floats
    num_flights: int


@dataclass(frozen=True)
class RareShare:
    """The share of cases in which an event occurs.

    Parameters
    ----------
    share : float, optional
        None if the event was given up.
    low, high : float
        Student's interval of the populations' mean, within 0 and 1; 0 and None if none saw the event.
    confidence_percent : float
    num_flights : int
    levels : tuple of float
        Of the margin.
    populations : tuple of float
        The estimate of each.
    """

    share: float | None
    low: float
    high: float | None
    confidence_percent: float
    num_flights: int
    levels: tuple[float, ...]
    populations: tuple[float, ...]

    @property
    def sentence(self) -> str:
        """The estimate in words, without a full stop."""
        if self.share is None:
            return f"splitting gave up after {len(self.levels)} levels and {self.num_flights:,} flights"
        if self.high is None:
            return f"no population of splitting saw the event, in {self.num_flights:,} flights"
        ends = f"{self.low:.3g} to {self.high:.3g} ({self.confidence_percent:g} %)"
        return f"{self.share:.3g} by splitting, {ends}, in {self.num_flights:,} flights"


def _next_level(margins: Floats) -> float | None:
    """Return a level below which about `PASSED` of some margins are, at least 0; None if none parts them."""
    ordered = np.sort(margins)
    level = float(ordered[min(math.ceil(PASSED * len(ordered)), len(ordered) - 1)])
    if level <= 0.0:
        return 0.0
    # equal margins, such as counts, are on one side of a level
    above = ordered[ordered > ordered[0]]
    return level if ordered[0] < level else max(float(above[0]), 0.0) if len(above) else None


def scouted(law: CaseLaw, size: int, seed: tuple[int, ...]) -> Scouted:
    """Return the levels and moves that a population of some size finds on its way to the event."""
    population, scale = Population(law, size, seed), FIRST_SCALE
    levels: list[float] = []
    scales: list[float] = []
    seen: list[tuple[Floats, Floats]] = []
    while len(levels) < MOST_LEVELS and 0.0 not in levels:
        level = _next_level(population.margins)
        if level is None or (levels and level >= levels[-1]):
            break
        levels.append(level)
        population.pass_below(level)
        population.refill(level, scale)
        seen.append(population.each())
        if level > 0.0:
            scales.append(scale)
            scale = min(max(scale * math.exp(GAIN * (population.taken - TAKEN)), 0.01), 1.0)
    genes, margins = map(np.concatenate, zip(*seen, strict=True)) if seen else (np.empty(0), np.empty(0))
    return Scouted(Plan(tuple(levels), tuple(scales)), genes, margins, population.num_flights)


@dataclass(frozen=True)
class _SharedLaw:
    """A law whose cases are flown in parts, wherever a pool works; a part is the same by itself.

    Parameters
    ----------
    law : CaseLaw
    pool : TaskPool
    """

    law: CaseLaw
    pool: TaskPool

    @property
    def is_periodic(self) -> NDArray[np.bool_]:
        """Those of the law."""
        return self.law.is_periodic

    def margins(self, genes: Floats, numbers: Numbers) -> Floats:
        """Return the margins of cases, (n,), of genes (n, num_genes) and numbers (n,)."""
        parts = zip(np.array_split(genes, POPULATIONS), np.array_split(numbers, POPULATIONS), strict=True)
        return np.concatenate(_in_order(self.pool, _margins, [(self.law, *part) for part in parts]))


def _margins(law: CaseLaw, genes: Floats, numbers: Numbers) -> Floats:
    """Return the margins of cases: a task."""
    return law.margins(genes, numbers)


@dataclass(frozen=True)
class _Course:
    """What draws cases of a population, and where chains take over.

    Parameters
    ----------
    proposal : KernelMixture
    begin : int
        The level, by its place, that is passed by weights.
    """

    proposal: KernelMixture
    begin: int


def _mixture(groups: Sequence[Kernels | None], deepest: int, law: CaseLaw) -> KernelMixture:
    """Return a proposal of kernels about cases below each level up to the deepest, which has the most."""
    levels = [level for level in range(deepest + 1) if groups[level] is not None]
    shares = {
        level: 1.0 - DEEPEST if level != deepest else DEEPEST * max(1, len(levels) - 1) for level in levels
    }
    scale = (1.0 - UNIFORM) / sum(shares.values()) if shares else 0.0
    kernels = [group for level in levels if (group := groups[level]) is not None]
    return KernelMixture(kernels, [scale * shares[level] for level in levels], law.is_periodic)


def _course(law: CaseLaw, plan: Plan, scouts: Sequence[Scouted], size: int, seed: tuple[int, ...]) -> _Course:
    """Return what populations draw by: made from what scouts saw, and revised by what its own draws show."""
    generator = np.random.default_rng(np.random.SeedSequence(seed[0], spawn_key=seed[1:]))
    groups = []
    for level in plan.levels:
        genes = np.concatenate([scout.genes[scout.margins < level] for scout in scouts])
        groups.append(fitted(generator.permutation(genes)[:MOST_KERNELS], law.is_periodic))
    course = _Course(_mixture(groups, len(groups) - 1, law), len(groups) - 1)
    drawn: list[Population] = []
    for number in range(1, REVISIONS + 1):
        drawn.append(Population(law, size, (*seed[:-1], seed[-1] + number), course.proposal))
        least = REACHED * size * len(drawn)
        reached = [sum(int((each.margins < level).sum()) for each in drawn) for level in plan.levels]
        deepest = max((level for level, count in enumerate(reached) if count >= least), default=0)
        below = [each.weighted(plan.levels[deepest]) for each in drawn]
        genes, weights = map(np.concatenate, zip(*below, strict=True))
        if len(genes):
            chosen = np.unique(generator.choice(len(genes), MOST_KERNELS, p=weights / weights.sum()))
            groups[deepest] = fitted(generator.permutation(genes[chosen]), law.is_periodic)
        course = _Course(_mixture(groups, deepest, law), deepest)
    return course


def passed(law: CaseLaw, plan: Plan, course: _Course, size: int, seed: tuple[int, ...]) -> tuple[float, int]:
    """Return the share of cases in which the event occurs, by one population, and its flights."""
    population = Population(law, size, seed, course.proposal)
    share = population.begin_below(plan.levels[course.begin])
    for index in range(course.begin + 1, len(plan.levels)):
        if share == 0.0:
            break
        population.refill(plan.levels[index - 1], plan.scales[index - 1])
        share *= population.pass_below(plan.levels[index])
    return share, population.num_flights


def rare_share(
    law: CaseLaw,
    num_flights: int,
    confidence_percent: float,
    seed: tuple[int, ...],
    pool: TaskPool = HERE,
    on_done: Callable[[int], Any] = lambda _: None,
) -> RareShare:
    """Return the share of cases in which the event occurs, by about so many flights.

    Parameters
    ----------
    law : CaseLaw
    num_flights : int
    confidence_percent : float
    seed : tuple of int
        Of all random numbers.
    pool : TaskPool
        Where all cases are flown.
    on_done : callable
        Is told of how many populations are done.
    """
    size = max(LEAST_SCOUTED, round(SCOUTED * num_flights))
    scouts = _in_order(pool, scouted, [(law, size, (*seed, number)) for number in range(SCOUTS)])
    flown = sum(scout.num_flights for scout in scouts)
    plans = [scout.plan for scout in scouts if 0.0 in scout.plan.levels]
    if not plans:
        return RareShare(None, 0.0, None, confidence_percent, flown, scouts[0].plan.levels, ())
    plan = min(plans, key=lambda each: len(each.levels))
    size = max(10, round(REVISED * num_flights))
    course = _course(_SharedLaw(law, pool), plan, scouts, size, (*seed, SCOUTS))
    flown += REVISIONS * size
    # as many cases as at first are flown once, and all but those that pass once more below each level
    rounds = 1.0 + (1.0 - PASSED) * (len(plan.scales) - course.begin)
    size = max(10, int((num_flights - flown) / (POPULATIONS * rounds)))
    first = SCOUTS + REVISIONS + 1
    tasks = [(law, plan, course, size, (*seed, number)) for number in range(first, first + POPULATIONS)]
    results = _in_order(pool, passed, tasks, on_done)
    shares = np.array([share for share, _ in results])
    flown += sum(flights for _, flights in results)
    mean, low, high = float(shares.mean()), 0.0, None
    if mean > 0.0:
        reach = students_half_width(shares, confidence_percent)
        low, high = max(0.0, mean - reach), min(1.0, mean + reach)
    return RareShare(mean, low, high, confidence_percent, flown, plan.levels, tuple(shares.tolist()))


def _in_order(
    pool: TaskPool,
    function: Callable[..., Any],
    tasks: Sequence[tuple[Any, ...]],
    on_done: Callable[[int], Any] = lambda _: None,
) -> list[Any]:
    """Return the results of tasks in their order."""
    results: dict[int, Any] = {}
    for index, result in pool.run(function, tasks):
        results[index] = result
        on_done(len(results))
    return [results[index] for index in range(len(tasks))]
