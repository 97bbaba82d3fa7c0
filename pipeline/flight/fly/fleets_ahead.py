"""Fleets that look ahead: their plans divided, or their tours chosen together, before and during the flight.

Flights ahead are those of the whole fleet, as its deputies know the mission. Where flights deviate from their
plans, the deputies plan again from what they know by then, each telling the others all of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import LANES
from pipeline.array_types import Floats, Integers
from pipeline.flight.cases.navigation import as_believed
from pipeline.flight.control.controller import Controller, RuleController
from pipeline.flight.control.law import ahead_stride
from pipeline.flight.fly.answers import answers_in_turn
from pipeline.flight.fly.divided import Team, driven, openings_of, team_of
from pipeline.flight.fly.fleet_controllers import check_controller
from pipeline.flight.fly.fleets import (
    NO_MESSAGES,
    WHOLE,
    Chosen,
    FleetOutcomes,
    FlightPart,
    Messages,
    fly_chosen,
)
from pipeline.flight.fly.lesser_controllers import finishing
from pipeline.flight.fly.outlooks import Deputies, at_start, by_then, num_missed, room_for_known
from pipeline.flight.fly.rehearsals import rehearsed_costs
from pipeline.flight.fly.replanning import (
    COASTING,
    ENDS,
    FINISHING,
    RULES,
    PlannedDecision,
    foresees,
    left_to_fire,
    recorded_decision,
)
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import constant
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads


def fly_all_fleets(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
    lanes: int = LANES,
    messages: Messages = NO_MESSAGES,
) -> FleetOutcomes:
    """Fly a fleet from the starts of each case, `Scenario.fleet`; arrays of shape (m,).

    Parameters
    ----------
    tracks : (m, D, K+1, 3 or 15) float32, optional
        Filled with the deputies' tracks, see `pipeline.flight.fly.population.fly_population`.
    messages : Messages, optional
        Filled with what they tell one another.

    Raises
    ------
    ControllerError
        If the controller plans ahead as if alone.
    FlightError
        If a flight's numbers are not finite.
    """
    check_controller(mission, controller)
    chosen = looked_ahead(mission, controller, scenarios, workers, lanes)
    return fly_chosen(mission, chosen, scenarios, workers, lanes, tracks, messages)


def looked_ahead(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None = None,
    lanes: int = LANES,
    *,
    records: bool = False,
) -> Chosen:
    """Let fleets look ahead, if their controller does; decisions on plans are recorded of a single one.

    Tours are flown ahead as the deputies believe starts and mission to be, and chosen by `answers_in_turn`.
    """
    deputies = mission.fleet.deputies
    alike = np.zeros((len(scenarios), deputies), dtype=np.int64)
    if isinstance(controller, RuleController) and foresees(controller):
        return _Planning(mission, controller, scenarios, workers, lanes, records=records).chosen()
    images = tour_images(controller)
    if not images:
        return Chosen((controller,), alike)
    known, believed = _as_believed(mission, scenarios)

    def fly(fleets: Integers, tours: Integers) -> Floats:
        """Return the costs of some fleets by the tours of their deputies, m/s."""
        starts = [believed[fleet] for fleet in fleets.tolist()]
        ends = fly_chosen(known, Chosen(images, tours), starts, workers, lanes, safe_in=mission)
        return rehearsed_costs(controller, ends)

    answers = answers_in_turn(len(scenarios), deputies, len(images), fly)
    return Chosen(images, answers.followed, tour_costs=answers.costs)


def _as_believed(mission: Mission, scenarios: list[Scenario]) -> tuple[Mission, list[Scenario]]:
    """Return the mission and the starts of fleets as deputies believe them to be: all messages arrive."""
    known, each = as_believed(mission, each_of(scenarios))
    fleet = replace(mission.fleet, lost_percent=0.0)
    return replace(known, fleet=fleet), fleets_of(each, fleet.deputies)


def each_of(scenarios: list[Scenario]) -> list[Scenario]:
    """Return the starts of all deputies of fleets, one after the other."""
    return [start for scenario in scenarios for start in scenario.fleet]


def fleets_of(each: Sequence[Scenario], deputies: int) -> list[Scenario]:
    """Return fleets from the starts of their deputies, one after the other."""
    firsts = range(0, len(each), deputies)
    return [replace(each[first], others=tuple(each[first + 1 : first + deputies])) for first in firsts]


#: how fleets' flights ahead go on, of `ENDS`
WAYS = COASTING, FINISHING, RULES


class _Planning:
    """Plans of m fleets: divided at the start, and again where their flights deviate from them.

    Each fleet's plans are flown ahead, with coasting after them and with the rules after them, beside the
    rules alone from then on; the cheapest is followed.
    """

    def __init__(
        self,
        mission: Mission,
        controller: RuleController,
        scenarios: list[Scenario],
        workers: int | None,
        lanes: int,
        *,
        records: bool,
    ) -> None:
        self._records, self._decisions = records, list[tuple[PlannedDecision, ...]]()
        self._mission, self._controller, self._flown = mission, controller, finishing(controller)
        self._scenarios, self._workers, self._lanes = scenarios, workers, lanes
        self._alike = np.zeros((len(scenarios), mission.fleet.deputies), dtype=np.int64)
        self._known, self._believed = _as_believed(mission, scenarios)
        # of exact missions fleets know everything, also which messages are lost
        self._is_exact = self._known.of_each == mission.of_each
        if self._is_exact:
            self._known = mission
        self._period = 0 if self._is_exact else ahead_stride(controller, mission, "foresight_period_s")

    def chosen(self) -> Chosen:
        """Return what the fleets follow."""
        mission, controller = self._mission, self._controller
        known, believed = self._known.of_each, each_of(self._believed)
        period = self._period
        deputies = first = at_start(mission.of_each, known, controller, believed, period, self._lanes)
        openings = deputies.coasting()
        for sample in range(0, mission.num_controls, period) if period else [0]:
            if sample > 0:
                rows = self._flown_to(sample, openings)
                deputies = by_then(first, believed, rows, sample, period)
            self._plan(deputies, openings)
        return self._following(openings)._replace(decisions=tuple(self._decisions))

    @property
    def _keeps_reserve(self) -> bool:
        """Whether plans will be made again, and miss fewer points than the rules accept before they coast."""
        planned, accepted = (
            self._controller.constants[constant(name)] for name in ("foresight_points", "coast_below_points")
        )
        return self._period > 0 and planned > 0.0 and num_missed(planned) < num_missed(accepted)

    def _following(self, openings: Floats, fleets: Integers | slice = slice(None)) -> Chosen:
        """Return some fleets as they follow openings, (m D, K, 4)."""
        return Chosen((self._flown,), self._alike[fleets], np.ascontiguousarray(openings))

    def _flown_to(self, sample: int, openings: Floats) -> Floats:
        """Return what all deputies know at a sample, having flown with openings; see `by_then`."""
        mission, rows = self._mission, room_for_known(self._mission.of_each, len(openings))
        so_far = self._following(openings[:, :sample])
        part = FlightPart(last=sample)
        fly_chosen(mission, so_far, self._scenarios, self._workers, self._lanes, part=part, known=rows)
        return rows

    def _plan(self, deputies: Deputies, openings: Floats) -> None:
        """Let fleets plan from a sample on; openings, (m D, K, 4), change where last plans are not held."""
        sample, rows = deputies.sample, np.arange(len(openings)).reshape(-1, self._mission.fleet.deputies)

        def plan(of_fleet: Integers) -> tuple[Team, Floats]:
            """Return the deputies of a fleet, and the genes of their plans."""
            each, last = deputies.only(of_fleet), None
            if sample > 0:
                forces = openings[of_fleet, sample:, :3]
                last = np.array([left_to_fire(its, each.num_pushes, each.step) for its in forces])
            team = team_of(self._mission, each, last)
            return team, team.divided()

        teams = in_threads(plan, rows, workers=self._workers)
        anew = np.array([fleet for fleet, (team, _) in enumerate(teams) if not team.is_held], dtype=np.int64)
        if len(anew):
            of_anew, pooled = rows[anew].ravel(), [teams[fleet][0].deputies for fleet in anew]
            planned = [openings_of(each, teams[fleet][1]) for each, fleet in zip(pooled, anew, strict=True)]
            coasting = np.concatenate(planned)
            ways = np.array([coasting, driven(coasting, sample), np.zeros_like(coasting)])
            ways[:, :, :sample] = openings[of_anew, :sample]
            ends = self._ends(anew, pooled, ways)
            chosen = np.repeat(np.nanargmin(ends, axis=0), rows.shape[1])
            openings[of_anew] = ways[chosen, np.arange(len(of_anew))]
        if self._records:
            self._decide(*teams[0], openings, ends[:, 0] if len(anew) else None)

    def _ends(self, fleets: Integers, deputies: Sequence[Deputies], ways: Floats) -> Floats:
        """Return what flights ahead of m fleets cost, (len(WAYS), m), m/s; NaN of those that are not flown.

        Where plans keep a reserve, rules, which keep none, compete only where coasting after the plans misses
        points or leaves the limits.
        """
        count = self._mission.fleet.deputies

        def fly(way: int, which: Integers) -> FleetOutcomes:
            """Fly some of these fleets ahead."""
            of_each = (which[:, np.newaxis] * count + np.arange(count)).ravel()
            return self._ahead(fleets[which], [deputies[fleet] for fleet in which], ways[way, of_each])

        ends, coasted = np.full((len(WAYS), len(fleets)), np.nan), fly(COASTING, np.arange(len(fleets)))
        ends[COASTING] = self._costs(coasted)
        is_short = ends[COASTING] > coasted.delta_v_m_s
        compared = np.flatnonzero(is_short | (not self._keeps_reserve))
        for way in (FINISHING, RULES) if len(compared) else ():
            ends[way, compared] = self._costs(fly(way, compared))
        return ends

    def _ahead(self, fleets: Integers, deputies: Sequence[Deputies], openings: Floats) -> FleetOutcomes:
        """Fly some fleets ahead, with openings from the sample of their deputies on."""
        known, part = self._known, WHOLE
        starts = [self._believed[fleet] for fleet in fleets]
        sample, left = deputies[0].sample, [each.left for each in deputies if each.left is not None]
        if sample > 0:
            fleet = replace(known.fleet, delay_periods=0)
            known = replace(known, attitude=replace(known.attitude, mode="ideal"), fleet=fleet)
            starts = [fleet for each in deputies for fleet in fleets_of(each.believed, len(each.believed))]
            part = FlightPart(first=sample, wanted=np.concatenate(left))
        chosen = self._following(openings, fleets)
        return fly_chosen(known, chosen, starts, self._workers, self._lanes, safe_in=self._mission, part=part)

    def _costs(self, ends: FleetOutcomes) -> Floats:
        """Return what flights ahead cost, (m,), m/s."""
        return rehearsed_costs(self._controller, ends)

    def _decide(self, team: Team, genes: Floats, openings: Floats, ends: Floats | None) -> None:
        """Record what the only fleet decides, whose flights ahead end so if it plans anew; see `WAYS`."""
        deputies, only = team.deputies, np.zeros(1, dtype=np.int64)
        costs, coasting = np.full(len(ENDS), np.nan), openings.copy()
        coasting[:, deputies.sample :] = deputies.coasting()[:, deputies.sample :]
        if ends is not None:
            costs[list(WAYS)] = ends
        else:  # the plans of before are flown on
            is_driven = (openings[:, deputies.sample :, 3] == 0.0).any()
            end = self._costs(self._ahead(only, [deputies], openings))
            costs[FINISHING if is_driven else COASTING] = end[0]
        idle = self._ahead(only, [deputies], coasting)
        missed, price = int(idle.inspectable_count[0] - idle.inspected_count[0]), team.price(genes)
        self._decisions.append(
            tuple(
                recorded_decision(deputies, team.num_priced, missed, [each], [price], costs) for each in genes
            )
        )
