"""A first controller for any mission: champions scaled to it compete by successive halving.

Each base flies as shipped, and at sizes and tempos drawn around those that the mission's lengths suggest. All
fly from a few starts, the better ones from more, until the best is left (K. Jamieson and A. Talwalkar,
Non-stochastic best arm identification and hyperparameter optimization, AISTATS 2016).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from fis_tools.model import FuzzyController
from pipeline.controllers import source
from pipeline.evaluation.statistics import Fraction, by_rules, fraction, normal_quantile, percent_ahead
from pipeline.flight.cases.dispersions import thresholds_of
from pipeline.flight.control.controller import ControllerError, from_fuzzy
from pipeline.flight.control.law import law_of
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.state.log import Scenario, inspectable_rate
from pipeline.flight.state.signals import CONSTANTS
from pipeline.flight.world.chief import turn_of
from pipeline.scenarios import fitting_scenarios
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment, Mission
from pipeline.training.genome import bounds_key
from pipeline.training.similarity import HOME, Similarity, longest_time, radius_of, sizes_worth_trying

#: tempos that are drawn, the orbit's own more often than others
TEMPOS: Final = (0.7, 1.0, 1.0, 1.0, 1.6, 2.5, 4.0)
#: of three controllers drawn, one decides in every control period
CLOCKS: Final = (False, False, True)
#: factors, least and greatest, from the best to its neighbours
NEAR_SIZES: Final = (0.8, 1.25)
NEAR_TEMPOS: Final = (0.85, 1.15)
#: tempo of what plans, in a flight of fewer turns than those at home, over how many times fewer
QUICK: Final = 1.7
#: part of the spawn key of the draws of sizes and tempos
DRAWS: Final = 1 << 24
#: what an exit costs beyond the success that it is none of, what sight of all points is worth below this
#: share, and a factor e in delta-v: so that controllers that fail alike are told apart
EXIT, SIGHT, ENOUGH, SPENT = 0.3, 0.4, 0.97, 0.03
#: prices of the optimizer that follow what a flight spends
PRICES: Final = ("outside_m_s", "short_point_m_s", "missed_point_m_s")


@dataclass(frozen=True)
class Variant:
    """A competitor: a champion as shipped, or scaled to a size.

    Parameters
    ----------
    base : str
        Its name.
    size, tempo : float
        See `Similarity`.
    decides_always : bool
    is_shipped : bool
        Whether it flies with its own numbers.
    """

    base: str
    size: float = 1.0
    tempo: float = 1.0
    decides_always: bool = False
    is_shipped: bool = False

    def controller(self, base: FuzzyController, mission: Mission) -> FuzzyController:
        """Return the variant's controller for a mission."""
        if self.is_shipped:
            return base
        return Similarity(mission, self.size, self.tempo, self.decides_always).controller(base)

    @property
    def words(self) -> str:
        """The variant in words, for tables and the terminal."""
        if self.is_shipped:
            return f"{self.base} as shipped"
        clock = ", deciding in every control period" if self.decides_always else ""
        return f"{self.base} at {self.size:.3g} times its size and {self.tempo:.3g} times its tempo{clock}"


@dataclass(frozen=True)
class FlightTally:
    """How many flights succeeded, missed points or left the limits, and their delta-v.

    Parameters
    ----------
    num_cases : int
    success, exits, misses : Fraction
        Inside the limits with enough points seen; outside the limits; inside, with too few points.
    seen : float
        Mean share of the points that can be inspected.
    delta_v : float
        Mean, m/s.
    ahead_percent : float
        Share of the fuel that was chosen ahead, by foresight or rehearsals; rules fire the rest.
    """

    num_cases: int
    success: Fraction
    exits: Fraction
    misses: Fraction
    seen: float
    delta_v: float
    ahead_percent: float = 0.0

    @property
    def score(self) -> float:
        """The score by which halving ranks variants, mostly success; see the module's constants."""
        value = self.success.fraction - EXIT * self.exits.fraction + SIGHT * min(self.seen, ENOUGH)
        return value - SPENT * math.log(max(self.delta_v, 1e-6))

    @property
    def sentence(self) -> str:
        """The tally in words."""
        rate = self.success
        return (
            f"{100 * rate.fraction:.1f} % of {self.num_cases} flights succeed ({100 * rate.low:.1f} to "
            f"{100 * rate.high:.1f}), {self.exits.count} left the limits, {self.misses.count} missed points, "
            f"delta-v {self.delta_v:.3f} m/s{by_rules(self.ahead_percent)}"
        )


def tally_of(
    mission: Mission,
    controller: FuzzyController,
    scenarios: list[Scenario],
    confidence_percent: float,
    workers: int | None,
) -> FlightTally:
    """Fly a controller from some starts and tally the flights.

    Raises
    ------
    ControllerError
        If it cannot fly this mission.
    """
    outcomes = fly_all(mission, from_fuzzy(controller), scenarios, workers)
    is_out = outcomes.is_violated
    is_seen = outcomes.is_success(thresholds_of(mission, scenarios))
    shares = inspectable_rate(outcomes.inspected_count, outcomes.inspectable_count) / 100.0
    ends = (is_seen & ~is_out, is_out, ~is_seen & ~is_out)
    success, exits, misses = (fraction(end, confidence_percent) for end in ends)
    means = float(shares.mean()), float(outcomes.delta_v_m_s.mean())
    ahead = percent_ahead(outcomes.delta_v_m_s, outcomes.ahead_delta_v_m_s)
    return FlightTally(len(scenarios), success, exits, misses, *means, ahead)


def joined(first: FlightTally, second: FlightTally, confidence_percent: float) -> FlightTally:
    """Return the tally of the flights of both."""
    num_cases = first.num_cases + second.num_cases
    shares = np.array([first.num_cases, second.num_cases]) / num_cases
    success, exits, misses = (
        fraction(
            np.arange(num_cases) < getattr(first, end).count + getattr(second, end).count, confidence_percent
        )
        for end in ("success", "exits", "misses")
    )
    seen, delta_v = (
        float(shares @ [getattr(first, name), getattr(second, name)]) for name in ("seen", "delta_v")
    )
    spent = shares * [first.delta_v, second.delta_v]
    ahead = float(spent @ [first.ahead_percent, second.ahead_percent] / max(spent.sum(), 1e-12))
    return FlightTally(num_cases, success, exits, misses, seen, delta_v, ahead)


def drawn_variants(experiment: Experiment, bases: Mapping[str, FuzzyController]) -> list[Variant]:
    """Return the competitors: each base as shipped, and scaled to sizes drawn log-uniformly.

    Those that cannot fly the mission, such as for decisions between control periods, are left out.
    """
    mission, draws = experiment.mission, experiment.fit.draws
    low, high = sizes_worth_trying(mission)
    variants = []
    for number, name in enumerate(bases):
        generator = np.random.default_rng(np.random.SeedSequence(experiment.seed, spawn_key=(DRAWS, number)))
        variants.append(Variant(name, is_shipped=True))
        for draw in range(draws):
            size = low * (high / low) ** ((draw + generator.uniform()) / draws)
            tempo, clock = float(generator.choice(TEMPOS)), bool(generator.choice(CLOCKS))
            variants.append(Variant(name, float(f"{size:.3g}"), tempo, clock))
    return [
        variant for variant in variants if _flies(variant.controller(bases[variant.base], mission), mission)
    ]


def neighbours_of(
    experiment: Experiment, best: Variant, bases: Mapping[str, FuzzyController]
) -> list[Variant]:
    """Return variants near one, drawn log-uniformly within `NEAR_SIZES` and `NEAR_TEMPOS` of its own.

    Sizes and tempos drawn over a whole range may straddle what flies best.
    """
    mission, count, drawn = experiment.mission, experiment.fit.neighbours, []
    generator = np.random.default_rng(np.random.SeedSequence(experiment.seed, spawn_key=(DRAWS, len(bases))))
    for draw in range(count):
        low, high = NEAR_SIZES
        size = best.size * low * (high / low) ** ((draw + generator.uniform()) / count)
        tempo = best.tempo * math.exp(generator.uniform(*np.log(NEAR_TEMPOS)))
        clock = bool(generator.choice(CLOCKS))
        drawn.append(Variant(best.base, float(f"{size:.3g}"), float(f"{tempo:.3g}"), clock))
    return [variant for variant in drawn if _flies(variant.controller(bases[best.base], mission), mission)]


def planning_variants(experiment: Experiment, planners: Mapping[str, FuzzyController]) -> list[Variant]:
    """Return variants of controllers that plan: as shipped, and for a chief's size and a flight's length.

    A plan is made by the mission's own geometry, so that its size matters less than that of rules.
    """
    mission, sizes = experiment.mission, [radius_of(HOME), radius_of(experiment.mission)]
    size = float(f"{sizes[1] / sizes[0]:.3g}")
    turns = [turn_of(each) for each in (HOME, mission)]
    fewer = turns[0] / turns[1]
    tempos = (1.0, float(f"{QUICK * fewer:.3g}")) if fewer > 1.0 else (1.0,)
    variants = []
    for name in planners:
        variants.append(Variant(name, is_shipped=True))
        variants += [Variant(name, size, tempo, clock) for tempo in tempos for clock in (False, True)]
    return [each for each in variants if _flies(each.controller(planners[each.base], mission), mission)]


def _flies(controller: FuzzyController, mission: Mission) -> bool:
    """Return whether a controller can fly a mission."""
    try:
        law_of(from_fuzzy(controller), mission)
    except ControllerError:
        return False
    return True


#: all rungs of a halving
EVERY: Final = slice(None)
#: returns how a variant flies in a rung
Judge = Callable[[int, Variant], FlightTally]


def halve(
    experiment: Experiment, variants: Sequence[Variant], judge: Judge, rungs: slice = EVERY
) -> list[tuple[Variant, FlightTally]]:
    """Return the variants of the last of some rungs, best first, of those that begin at the first of them.

    The best of those as shipped flies in every rung, so that scaling replaces none that flies better.
    """
    left, judged = list(variants), list[tuple[Variant, FlightTally]]()
    for rung, (_, kept) in [*enumerate(rungs_of(experiment))][rungs]:
        judged = [(variant, judge(rung, variant)) for variant in left]
        judged.sort(key=lambda pair: -pair[1].score)
        order = [variant for variant, _ in judged]
        shipped = [variant for variant in order if variant.is_shipped][:1]
        left = order[:kept] + [variant for variant in shipped if variant not in order[:kept]]
    return judged


def num_flights(experiment: Experiment, num_variants: int, rungs: slice = EVERY) -> int:
    """Return how many flights some rungs of a halving take, at most."""
    total = 0
    for cases, kept in rungs_of(experiment)[rungs]:
        total += num_variants * cases
        num_variants = min(num_variants, kept + 1)
    return total


def rungs_of(experiment: Experiment) -> list[tuple[int, int]]:
    """Return, for each rung of the halving, the flights of a variant and how many variants are kept."""
    settings = experiment.fit
    return list(zip(settings.cases, (*settings.kept, 1), strict=True))


def rung_scenarios(experiment: Experiment, rung: int) -> list[Scenario]:
    """Return the starts of a rung; those after the last rung are of the validation."""
    cases = (*experiment.fit.cases, experiment.fit.num_cases)
    return fitting_scenarios(experiment, rung, cases[rung], is_unseen=rung == len(cases) - 1)


def check_goal(experiment: Experiment) -> None:
    """Check that a fit's goal is shown if all flights that judge its result succeed.

    Raises
    ------
    SettingError
        If not even these would show it: before the fit, which takes minutes.
    """
    goal, confidence = experiment.fit.goal_percent, experiment.monte_carlo.confidence_percent
    if experiment.monte_carlo.table is None:
        key, number = "fit.num_cases", experiment.fit.num_cases
    else:
        key, number = "monte_carlo.table", len(rung_scenarios(experiment, len(experiment.fit.cases)))
    best = 100.0 * fraction(np.ones(number, dtype=np.bool_), confidence).low
    if best >= goal:
        return
    cure = "lower the goal" if goal == 100.0 else f"give {_fewest(goal, confidence):,} or lower the goal"
    raise SettingError(
        f"fit.goal_percent is {goal:g}, which {number:,} flights ({key}) cannot show: if all succeed, the "
        f"success is at least {best:.1f} % at {confidence:g} % confidence; {cure}"
    )


def _fewest(goal_percent: float, confidence_percent: float) -> int:
    """Return the least number of flights that show a goal below 100 % if all succeed."""
    share, square = goal_percent / 100.0, normal_quantile(confidence_percent) ** 2
    # of n successes out of n the interval begins at n/(n + z^2)
    number = max(1, math.ceil(square * share / (1.0 - share)))
    while fraction(np.ones(number, dtype=np.bool_), confidence_percent).low < share:
        number += 1
    return number


def tuning_of(experiment: Experiment, controller: FuzzyController, tally: FlightTally) -> Experiment:
    """Return the experiment with which a controller is tuned.

    Its constants move between half and twice their values, and prices, which are of a mission in which a
    flight spends 1 m/s, follow what its flights spend.
    """
    settings = experiment.optimizer
    numbers = {name: float(text) for name, text in controller.attributes if name in CONSTANTS}
    bounds: dict[str, Any] = {}
    for field in fields(settings.encoding):
        values = [abs(numbers[name]) for name in numbers if bounds_key(name) == field.name and numbers[name]]
        if values and field.name in ("tour_m", "ring_lead_rad"):
            bounds[field.name] = (-1.5 * max(values), 1.5 * max(values))
        elif values:
            longest = longest_time(experiment.mission, field.name)
            bounds[field.name] = (0.5 * min(values), min(2.0 * max(values), longest))
        elif any(bounds_key(name) == field.name for name in CONSTANTS):
            bounds[field.name] = None
    prices: dict[str, Any] = {name: getattr(settings.penalty, name) * tally.delta_v for name in PRICES}
    encoding, penalty = replace(settings.encoding, **bounds), replace(settings.penalty, **prices)
    return replace(experiment, optimizer=replace(settings, encoding=encoding, penalty=penalty))


def with_filter(experiment: Experiment) -> Mission:
    """Return the mission with the safety layer on.

    Raises
    ------
    SettingError
        If its margins do not fit the limits.
    """
    mission = experiment.mission
    return replace(mission, safety=replace(mission.safety, kind="filter"))


COLUMNS: Final = (
    *("rung", "base", "size", "tempo", "decides_always", "is_shipped", "num_cases", "successes", "exits"),
    *("misses", "seen", "delta_v_m_s", "ahead_percent", "score"),
)


def row_of(rung: int, variant: Variant, tally: FlightTally) -> list[Any]:
    """Return the row of `COLUMNS` of a variant in a rung."""
    flags = str(variant.decides_always).lower(), str(variant.is_shipped).lower()
    counts = tally.success.count, tally.exits.count, tally.misses.count
    means = tally.seen, tally.delta_v, tally.ahead_percent, tally.score
    return [rung, variant.base, variant.size, variant.tempo, *flags, tally.num_cases, *counts, *means]


def read_row(row: Mapping[str, str], confidence_percent: float) -> tuple[tuple[int, Variant], FlightTally]:
    """Return the rung, variant and tally that `row_of` wrote into a row.

    Raises
    ------
    KeyError, ValueError
        If it is something else.
    """
    variant = Variant(
        row["base"],
        float(row["size"]),
        float(row["tempo"]),
        row["decides_always"] == "true",
        row["is_shipped"] == "true",
    )
    num_cases = int(row["num_cases"])
    success, exits, misses = (
        fraction(np.arange(num_cases) < int(row[name]), confidence_percent)
        for name in ("successes", "exits", "misses")
    )
    means = [float(row[name]) for name in ("seen", "delta_v_m_s", "ahead_percent")]
    tally = FlightTally(num_cases, success, exits, misses, *means)
    return (int(row["rung"]), variant), tally


def load_bases(experiment: Experiment) -> dict[str, FuzzyController]:
    """Return the controllers that compete, by name: of `fit.bases`, and the configured one if it has rules.

    Raises
    ------
    ControllerError
        If one of `fit.bases` has no rules.
    """
    bases = load_named("fit.bases", experiment.fit.bases)
    configured = source.load(experiment.controller, HOME).fuzzy
    if configured is not None and configured.name not in bases:
        bases[configured.name] = configured
    return bases


def load_named(key: str, names: Sequence[str]) -> dict[str, FuzzyController]:
    """Return the controllers that a key names.

    Raises
    ------
    ControllerError
        If one has no rules.
    """
    loaded = {}
    for name in names:
        controller = source.named(name, HOME).fuzzy
        if controller is None:
            raise ControllerError(f"{key} has {name}, which has no rules to scale; name fuzzy controllers")
        loaded[name] = controller
    return loaded
