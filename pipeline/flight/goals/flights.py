"""Flights, judged by what their mission is for."""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import LANES
from fis_tools.engines.packing import Packed
from pipeline.flight.cases.dispersions import groups_of, mission_of_case
from pipeline.flight.cases.starts import Cases
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly import simulation
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.flight.fly.population import fly_population
from pipeline.flight.goals.reach import ReachOutcomes, ended, judged
from pipeline.flight.state.arrays import NUM_TRACKED, Law, World
from pipeline.flight.state.log import FlightLog, Outcomes, Scenario, combined
from pipeline.settings.experiment import Mission

#: numbers of tracks that are in memory at once
MOST_TRACKED = 20_000_000


def fly_all(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
) -> Outcomes:
    """Fly one controller from many starts; see `pipeline.flight.fly.simulation.fly_all`.

    In a mission of fleets, a fleet from the starts of each case; see `pipeline.flight.fly.fleets`.
    """
    if mission.has_fleet:
        return fly_all_fleets(mission, controller, scenarios, workers, tracks)
    if mission.problem.kind == "inspection":
        return simulation.fly_all(mission, controller, scenarios, workers, tracks)
    parts = []
    length = max(1, MOST_TRACKED // ((mission.num_controls + 1) * NUM_TRACKED))
    for first in range(0, len(scenarios), length):
        part = slice(first, min(first + length, len(scenarios)))
        whole = _room(part.stop - part.start, mission)
        flown = simulation.fly_all(mission, controller, scenarios[part], workers, whole)
        parts.append(_judged_by_case(mission, scenarios[part], flown, whole))
        if tracks is not None:
            tracks[part] = whole[..., : tracks.shape[-1]]
    return combined(parts)


def _judged_by_case(
    mission: Mission, scenarios: list[Scenario], flown: Outcomes, tracks: NDArray[np.float32]
) -> ReachOutcomes:
    """Judge flights by their tracks, each by the goal and the limits that its case has drawn."""
    groups = groups_of(mission, scenarios, ("problem.",))
    if len(groups) == 1:
        return judged(groups[0][0], flown, tracks)
    parts = []
    for of_group, rows in groups:
        parts.append(judged(of_group, flown.each(partial(np.take, indices=rows, axis=0)), tracks[rows]))
    order = np.argsort([row for _, rows in groups for row in rows])
    return combined(parts).each(partial(np.take, indices=order, axis=0))


def fly_genomes(
    mission: Mission,
    world: World,
    law: Law,
    numbers: Packed,
    cases: Cases,
    workers: int | None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly a population from every start, (n, m); see `pipeline.flight.fly.population.fly_population`."""
    if mission.problem.kind == "inspection":
        return fly_population(world, law, numbers, cases, workers, lanes=lanes)
    rows = []
    for row in range(len(numbers.values)):
        tracks, genome = _room(len(cases), mission), slice(row, row + 1)
        genome_numbers = replace(numbers, values=numbers.values[genome], rules=numbers.rules[genome])
        flown = fly_population(world, law, genome_numbers, cases, workers, tracks, lanes=lanes)
        rows.append(judged(mission, flown.each(lambda values: values[0]), tracks))
    return combined(rows, np.stack)


def _room(count: int, mission: Mission) -> NDArray[np.float32]:
    """Return an array for the tracks of some flights, (count, K+1, NUM_TRACKED)."""
    return np.empty((count, mission.num_controls + 1, NUM_TRACKED), dtype=np.float32)


def achieved(mission: Mission, log: FlightLog) -> tuple[int, float]:
    """Return a logged flight's result: points inspected (or 1 for a goal reached), and its delta-v, m/s."""
    if mission.problem.kind == "reach":
        last, fault = ended(mission, log)
        return int(not fault), float(np.float32(log.delta_v_m_s[last]))
    return int(log.is_inspected[-1].sum()), float(log.delta_v_m_s[-1])


def fly_logged(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    """Fly one episode and log it; a goal that is reached counts as the one point."""
    log = simulation.fly_logged(mission, controller, scenario)
    if mission.problem.kind == "reach":
        last, fault = ended(mission_of_case(mission, scenario), log)
        log.is_inspected[last:] = not fault
    return log
