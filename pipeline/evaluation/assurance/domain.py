"""The operational domain of some flights, and how often other flights leave it."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import cpu_count

import numpy as np

from fis_tools.analysis.domain import Box, Departure, box_of, departures
from pipeline.array_types import Floats
from pipeline.evaluation.assurance.claims import share_bounds
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.settings.experiment import Mission


@dataclass(frozen=True)
class Domain:
    """The inputs that some flights met, and how other flights compare.

    Parameters
    ----------
    boxes : tuple of Box
        One for each system that decided anything.
    num_made_from, num_tried, num_left : int
        Flights that define it; others that test it; and how many of these left it.
    high : float
        Upper bound, with `confidence`, of the share of such flights that leave it.
    confidence : float
    """

    boxes: tuple[Box, ...]
    num_made_from: int
    num_tried: int
    num_left: int
    high: float
    confidence: float


def domain_of(
    mission: Mission,
    controller: Controller,
    scenarios: Sequence[Scenario],
    confidence: float,
    workers: int | None = None,
) -> Domain:
    """Fly scenarios, logged: the first half defines the domain, the second tests it.

    Parameters
    ----------
    mission : Mission
    controller : Controller
        With fuzzy systems.
    scenarios : sequence of Scenario
        At least two.
    confidence : float
    workers : int, optional
    """
    half = len(scenarios) // 2
    with ThreadPoolExecutor(workers or cpu_count() or 1) as pool:
        flown = list(
            pool.map(lambda one: sensed(fly_logged(mission, controller, one), controller), scenarios)
        )
    boxes = []
    for place, system in enumerate(controller.systems):
        rows = np.concatenate([inputs[place] for inputs in flown[:half]])
        if len(rows):
            boxes.append(box_of(system, rows))
    places = [[system.name for system in controller.systems].index(box.system) for box in boxes]
    num_left = sum(
        any(bool((box.beyond(inputs[place]) > 0.0).any()) for box, place in zip(boxes, places, strict=True))
        for inputs in flown[half:]
    )
    num_tried = len(scenarios) - half
    _, high = share_bounds(num_left, num_tried, confidence)
    return Domain(tuple(boxes), half, num_tried, num_left, high, confidence)


def sensed(log: FlightLog, controller: Controller) -> list[Floats]:
    """Return the inputs of each system where inference decided, (n, num_inputs)."""
    return [
        log.fis_input[log.is_decided, place, : len(system.inputs)].copy()
        for place, system in enumerate(controller.systems)
    ]


def left_on(domain: Domain, log: FlightLog, controller: Controller, period_s: float) -> tuple[Departure, ...]:
    """Return when a flight left a domain."""
    times = np.flatnonzero(log.is_decided).astype(np.float64) * period_s
    inputs = dict(zip((one.name for one in controller.systems), sensed(log, controller), strict=True))
    found = [one for box in domain.boxes for one in departures(box, times, inputs[box.system])]
    return tuple(sorted(found, key=lambda one: one.first_s))
