"""Foresight: a few pushes planned together by geometry, each plan flown ahead before it is fired.

The rules stay in charge of what is fired. A plan is flown ahead to the end as the deputy knows the mission,
with coasting after its last push and with the rules after it, beside the rules alone; where coasting after it
misses points or leaves the limits, harder searches and what the controller rehearses compete with it. The
flight that ends cheapest is followed, see `rehearsed_costs`. Where flights deviate from their plans, pushes
are planned again from what the deputy knows by then, with the last plan among the candidates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fis_tools.compiled.decorator import plain
from fis_tools.engines.kernel import LANES
from pipeline.array_types import Booleans, Floats, Integers
from pipeline.flight.cases.navigation import as_believed
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller, RuleController
from pipeline.flight.control.law import ahead_stride
from pipeline.flight.fly.aboard import is_held
from pipeline.flight.fly.lesser_controllers import finishing, rehearsing, rehearsing_once
from pipeline.flight.fly.outlooks import Deputies, at_start, later
from pipeline.flight.fly.prices import price_pushes
from pipeline.flight.fly.pushes import Effort, PushSearch, search_pushes
from pipeline.flight.fly.rehearsals import rehearse_tours, rehearsed_costs, rehearsed_openings
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import constant
from pipeline.settings.experiment import Mission

#: of a search by the number of pushes: the first ones of a flight, and when it plans again
FIRST = {2: Effort(32, 74), 3: Effort(64, 234)}
AGAIN = {2: (Effort(16, 14),), 3: (Effort(64, 40),)}
#: on board, where neither harder searches nor rehearsals compete with a first plan, it is the cheapest of as
#: many searches for each such time before it begins, s
FIRST_ON_BOARD_S = 30.0
#: on board each search has as many plans side by side, so that they have the same room
AGAIN_ON_BOARD = {2: (Effort(32, 29),), 3: AGAIN[3]}
#: further searches, of `MOST_PUSHES`, one after the other, where these see too little
HARDER = {2: (Effort(32, 187),) * 2, 3: (Effort(64, 234),) * 2}
MOST_PUSHES = 3
#: how flights that are flown ahead go on, and what competes with plans
ENDS = ("coasting after the plan", "the rules after the plan", "the rules alone", "rehearsed by the rules")
COASTING, FINISHING, RULES, REHEARSED = range(len(ENDS))
#: plans that are recorded: the one chosen, and the cheapest others that clearly differ
NUM_RECORDED = 5


def foresees(controller: Controller) -> bool:
    """Return whether a controller plans its pushes by geometry."""
    return bool(controller.constants[constant("foresight_pushes")] > 0.0)


def first_searches(controller: Controller) -> tuple[Effort, ...]:
    """Return the efforts of the searches whose cheapest plan is a flight's first."""
    num_pushes, count = (
        round(controller.constants[constant(name)]) for name in ("foresight_pushes", "foresight_searches")
    )
    is_bare, seconds = (
        controller.constants[constant(name)] for name in ("foresight_bare", "decision_period_s")
    )
    rounds = max(1, int(seconds / FIRST_ON_BOARD_S)) if is_bare else 1
    return (FIRST[num_pushes],) * (count or rounds * num_pushes)


@dataclass(frozen=True)
class PlannedDecision:
    """A choice between plans at a sample: the candidates with their costs, and the chosen one.

    Parameters
    ----------
    sample : int
    num_priced : int
        Plans that were priced.
    missed : int
        Points that coasting from here would miss.
    plans : (NUM_RECORDED, MOST_PUSHES, 4)
        The cheapest plans that clearly differ, first the chosen one: of each push its sample, and its force
        along Hill axes, N; a sample of -1 is none.
    prices : (NUM_RECORDED,)
        m/s; NaN of none.
    ends : (len(ENDS),)
        What the flights cost that were flown ahead, m/s; NaN of those that were not.
    """

    sample: int
    num_priced: int
    missed: int
    plans: Floats
    prices: Floats
    ends: Floats


@dataclass(frozen=True)
class Foreseen:
    """The forces planned by foresight for flights from m starts.

    Parameters
    ----------
    openings : (m, K, 4)
        As `fly_population` takes them.
    is_rehearsed : (m,)
        Flights that go by what the controller rehearses instead.
    decisions : list of PlannedDecision
        Of the only flight, if they are recorded.
    """

    openings: Floats
    is_rehearsed: Booleans
    decisions: list[PlannedDecision] = field(default_factory=list)


def foresee(
    mission: Mission,
    controller: RuleController,
    scenarios: list[Scenario],
    lanes: int = LANES,
    *,
    records: bool = False,
) -> Foreseen:
    """Plan the pushes of flights from some starts, each on its own; decisions are recorded of a single one.

    Flights that stay as the deputies believe them to be are planned once.
    """
    known, believed = as_believed(mission, scenarios)
    period = ahead_stride(controller, mission, "foresight_period_s")
    samples = range(0, mission.num_controls, period) if period and known != mission else [0]
    # on board a plan begins where the deputy estimates to be, also the first one
    is_known_first = controller.constants[constant("foresight_bare")] == 0.0 or known == mission
    if controller.constants[constant("foresight_bare")] > 0.0:
        known = replace(known, attitude=replace(mission.attitude, mode="ideal"))
    deputies = first = at_start(mission, known, controller, believed, period, lanes)
    foreseen = Foreseen(deputies.coasting(), np.zeros(len(scenarios), dtype=np.bool_))
    flights, starts, cases = np.arange(len(scenarios)), scenarios, None
    for sample in samples:
        before = foreseen.openings[flights]
        if sample > 0 or not is_known_first:
            if cases is None:  # rehearsals compete at the start alone
                flights = np.flatnonzero(~foreseen.is_rehearsed)
                if not len(flights):
                    break
                before, starts = foreseen.openings[flights], [scenarios[flight] for flight in flights]
                first, cases = first.only(flights), cases_of(mission, starts)
            deputies = later(first, starts, cases, before, sample, period)
        choice = _Choice(deputies, before, records=records)
        foreseen.openings[flights] = choice.openings
        foreseen.is_rehearsed[flights] = choice.is_rehearsed
        if records:
            foreseen.decisions.append(choice.decision())
    return foreseen


class _Choice:
    """What m deputies choose at a sample; `before` are their openings so far, (m, K, 4).

    Where it `records`, all plans are priced to the end, for the ones that come next to the cheapest.
    """

    def __init__(self, deputies: Deputies, before: Floats, *, records: bool) -> None:
        count, num_pushes = len(deputies.believed), deputies.num_pushes
        self._deputies, self._before, self._records = deputies, before, records
        self._outlooks = deputies.outlooks()
        self._searches: list[PushSearch] = []
        self._num_priced = np.zeros(count, dtype=np.int64)
        self.ends = np.full((len(ENDS), count), np.nan)
        is_first = deputies.sample == 0
        again = AGAIN_ON_BOARD if deputies.is_bare else AGAIN
        efforts = first_searches(deputies.controller) if is_first else again[num_pushes]
        kept_plans = [None if is_first else self._held(flight, num_pushes) for flight in range(count)]
        self._searches = [
            self._search(flight, num_pushes, efforts) if plan is None else plan
            for flight, plan in enumerate(kept_plans)
        ]
        self.openings, is_short = before.copy(), np.zeros(count, dtype=np.bool_)
        anew = np.array([flight for flight, plan in enumerate(kept_plans) if plan is None], dtype=np.int64)
        if len(anew):
            searches = [self._searches[flight] for flight in anew]
            if deputies.is_bare and deputies.is_certain:
                _, self.openings[anew] = self._planned(anew, searches)
            else:
                self.openings[anew], self.ends[:2, anew], is_short[anew] = self._ahead(anew, searches)
        if deputies.is_bare:
            return
        if is_first:
            rehearsed_flights = deputies.fly(rehearsing(deputies.controller))
            self.ends[RULES] = rehearsed_costs(deputies.controller, rehearsed_flights)
            is_short |= self.ends[RULES] < self._cheapest_plan
        short = np.flatnonzero(is_short)
        for attempt, effort in enumerate(HARDER[num_pushes] if len(short) else ()):
            self._try_harder(short, (effort,) if is_first else efforts, attempt)
        # rehearsals do not look beyond what the mission itself asks for
        if is_first and len(short) and deputies.after_s == deputies.mission.after_s:
            self.ends[REHEARSED, short] = _rehearsed(deputies.only(short))

    @property
    def _cheapest_plan(self) -> Floats:
        """Cost of each flight by its best plan, (m,), m/s."""
        return np.asarray(self.ends[:2].min(axis=0))

    @property
    def is_rehearsed(self) -> Booleans:
        """Whether the rules, alone or with the best rehearsal, are cheaper than the best plan, (m,).

        False where they were not flown ahead.
        """
        return np.asarray(np.fmin(self.ends[RULES], self.ends[REHEARSED]) < self._cheapest_plan)

    def decision(self) -> PlannedDecision:
        """Return the decision of the only deputy, for its log."""
        deputies, search = self._deputies, self._searches[0]
        coasted = deputies.fly(finishing(deputies.controller), deputies.coasting())
        if np.isnan(self.ends).all():  # the plan of before is flown on
            end = FINISHING if (self.openings[0, deputies.sample :, 3] == 0.0).any() else COASTING
            flown = deputies.fly(finishing(deputies.controller), self.openings)
            self.ends[end] = rehearsed_costs(deputies.controller, flown)
        seconds = deputies.step * deputies.mission.control_period_s
        distinct = search.distinct(NUM_RECORDED, deputies.world.delta_v_per_force, seconds)
        missed = int(coasted.inspectable_count[0] - coasted.inspected_count[0])
        return recorded_decision(deputies, int(self._num_priced[0]), missed, *distinct, self.ends[:, 0])

    def _held(self, flight: int, num_pushes: int) -> PushSearch | None:
        """Return the rest of the last plan as a search's result, if it is still nearly good enough."""
        outlook, needed = self._outlooks[flight]
        last = self._last(flight, num_pushes)
        if last is None:
            return None
        genes, costs = last[np.newaxis, :, np.newaxis], np.empty((1, 1))
        price_pushes(genes[0], num_pushes, needed, outlook, costs[0])
        is_good = plain(is_held)(last, num_pushes, costs[0, 0], outlook.delta_v_per_force)
        return PushSearch(genes, costs) if is_good else None

    def _search(
        self, flight: int, num_pushes: int, efforts: Sequence[Effort], attempt: int = 0
    ) -> PushSearch:
        """Search several times for the cheapest plan of a flight; return the best result."""
        deputies, (outlook, needed) = self._deputies, self._outlooks[flight]
        last, reach = self._last(flight, num_pushes), deputies.constant("foresight_reach_m_s")
        start = deputies.believed[flight]
        numbers = [*start.position_m, *start.velocity_m_s]
        if not deputies.is_bare:  # on board the Sun is known by its direction
            numbers += [start.sun_angle_rad, start.sun_elevation_rad]
        words = np.array(numbers).view(np.uint32).tolist()
        searches = []
        for number, effort in enumerate(efforts):
            key = deputies.sample, attempt, number
            generator = np.random.default_rng(np.random.SeedSequence(words, spawn_key=key))
            search = search_pushes(
                *(outlook, num_pushes, needed, reach, effort, generator, last),
                is_exact=self._records,
                is_bare=deputies.is_bare,
            )
            searches.append(search)
        self._num_priced[flight] += sum(search.costs.size for search in searches)
        return min(searches, key=lambda search: search.cost)

    def _try_harder(self, short: Integers, efforts: Sequence[Effort], attempt: int) -> None:
        """Search again for some flights with the most pushes allowed, and keep the cheaper plans."""
        searches = [
            self._search(flight, MOST_PUSHES, efforts, attempt=attempt + 1) for flight in short.tolist()
        ]
        openings, ends, _ = self._ahead(short, searches)
        for row, flight in enumerate(short.tolist()):
            if ends[:, row].min() < self._cheapest_plan[flight]:
                self.openings[flight], self.ends[:2, flight] = openings[row], ends[:, row]
                self._searches[flight] = searches[row]

    def _ahead(self, flights: Integers, searches: Sequence[PushSearch]) -> tuple[Floats, Floats, Booleans]:
        """Fly the best plans of some flights ahead, with coasting and with the rules after them.

        Returns
        -------
        openings : (m, K, 4)
            Of the cheaper of both.
        ends : (2, m)
            What both cost, m/s.
        is_short : (m,)
            Where coasting after a plan misses more points than it may, or leaves the limits.
        """
        deputies = self._deputies.only(flights)
        controller = finishing(deputies.controller)
        coasting, driven = self._planned(flights, searches)
        flown = [deputies.fly(controller, openings) for openings in (coasting, driven)]
        ends = np.array([rehearsed_costs(deputies.controller, end) for end in flown])
        is_driven = ends[FINISHING] < ends[COASTING]
        openings = np.where(is_driven[:, np.newaxis, np.newaxis], driven, coasting)
        return openings, ends, ends[COASTING] > flown[COASTING].delta_v_m_s

    def _planned(self, flights: Integers, searches: Sequence[PushSearch]) -> tuple[Floats, Floats]:
        """Return the openings by the best plans of some flights, (m, K, 4): coasting, or with rules after."""
        deputies = self._deputies.only(flights)
        sample, coasting = deputies.sample, deputies.coasting()
        coasting[:, :sample] = self._before[flights, :sample]
        for openings, search in zip(coasting, searches, strict=True):
            for begin, *force in pushes_of(search.best, deputies):
                for axis, part in enumerate(force):
                    count = max(1, int(np.ceil(abs(part) / deputies.most_force - 1e-9)))
                    openings[int(begin) : int(begin) + count, axis] += part / count
        driven = coasting.copy()
        for openings in driven:
            fired = np.flatnonzero(np.any(openings[sample:, :3] != 0.0, axis=1))
            openings[sample + (fired[-1] + 1 if len(fired) else 0) :, 3] = 0.0
        return coasting, driven

    def _last(self, flight: int, num_pushes: int) -> Floats | None:
        """Return the genes of what the last plan would still fire; None at the start."""
        deputies = self._deputies
        if deputies.sample == 0:
            return None
        return left_to_fire(self._before[flight, deputies.sample :, :3], num_pushes, deputies.step)


def left_to_fire(forces: Floats, num_pushes: int, step: int) -> Floats:
    """Return the genes of a plan that fires these forces, (n, 3), N, from now on, (4 num_pushes - 1,).

    Pushes beyond one now and the next ones later are left out; those in a row are parts of one. Plans are
    priced every `step` control periods.
    """
    genes, push = np.zeros(4 * num_pushes - 1), 0
    for index in np.flatnonzero(np.any(forces != 0.0, axis=1)).tolist():
        is_part = index > 0 and bool(np.any(forces[index - 1]))
        push += index > 0 and not is_part
        if push == num_pushes:
            break
        genes[3 * push : 3 * push + 3] += forces[index]
        if push > 0 and not is_part:
            genes[3 * num_pushes + push - 1] = index / step + 0.01
    return genes


def recorded_decision(
    deputies: Deputies,
    num_priced: int,
    missed: int,
    genes: Sequence[Floats] | Floats,
    prices: Sequence[float] | Floats,
    ends: Floats,
) -> PlannedDecision:
    """Return a decision of deputies between plans, given by their genes and prices, the chosen one first."""
    plans, all_prices = np.zeros((NUM_RECORDED, MOST_PUSHES, 4)), np.full(NUM_RECORDED, np.nan)
    plans[..., 0] = -1.0
    for row, (of_plan, price) in enumerate(zip(genes, prices, strict=True)):
        pushes = pushes_of(of_plan, deputies)
        plans[row, : len(pushes)], all_prices[row] = pushes, price
    return PlannedDecision(deputies.sample, num_priced, missed, plans, all_prices, ends)


def pushes_of(genes: Floats, deputies: Deputies) -> Floats:
    """Return a plan's pushes, (n, 4): their samples, and forces, N, Hill axes."""
    num_pushes = (len(genes) + 1) // 4
    begins = np.r_[0.0, np.floor(genes[3 * num_pushes :])]
    forces = genes[: 3 * num_pushes].reshape(num_pushes, 3)
    forces = np.where(np.abs(forces) >= deputies.least_force, forces, 0.0)
    return np.column_stack([deputies.sample + deputies.step * begins, forces])


def _rehearsed(deputies: Deputies) -> Floats:
    """Return the cost of the best flight rehearsed at the start, (m,), m/s; infinity without rehearsals."""
    mission, believed = deputies.mission, list(deputies.believed)
    controller = rehearsing_once(deputies.controller)
    if tour_images(controller):
        rehearsals = rehearse_tours(mission, controller, believed, 1, deputies.lanes)
        return np.asarray(rehearsals.costs[:, 0].min(axis=1))
    openings, costs = rehearsed_openings(mission, controller, believed, 1)
    return np.full(len(believed), np.inf) if openings is None else np.asarray(costs.min(axis=1))


def foresight_fields(decisions: Sequence[PlannedDecision]) -> dict[str, Floats]:
    """Return decisions as fields of a flight's log, by name."""
    return {
        "foresight_at": np.array(
            [[each.sample, each.num_priced, each.missed] for each in decisions], dtype=np.float64
        ),
        "foresight_plans": np.array([each.plans for each in decisions]),
        "foresight_prices_m_s": np.array([each.prices for each in decisions]),
        "foresight_ends_m_s": np.array([each.ends for each in decisions]),
    }
