"""Many flights at once: every controller of a population from every start, on all processors."""

import os
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import FEW_LANES, LANES
from fis_tools.engines.packing import Packed
from pipeline.array_types import Floats
from pipeline.flight.cases.starts import Cases
from pipeline.flight.fly.many import Flights, Results, fly_many
from pipeline.flight.fly.workspace import (
    Parts,
    counted_points,
    inspectable_points,
    make_state,
    make_workspace,
    parts_in_use,
)
from pipeline.flight.period.look.optics import note_inspectable
from pipeline.flight.state.arrays import NUM_OUTCOMES, Law, State, Workspace, World
from pipeline.flight.state.log import Outcomes, no_log
from pipeline.threads import in_threads

NO_TRACKS = np.empty((0, 0, 3), dtype=np.float32)


class FlightError(ValueError):
    """A flight whose state became infinite or not a number; its results mean nothing."""


def lanes_for(num_starts: int) -> int:
    """Return the flights to fly side by side when few starts are flown often, such as by many controllers.

    A half-empty vector takes as long as a full one; but each width is compiled separately.
    """
    return FEW_LANES if num_starts <= FEW_LANES else LANES


def flights_of(
    world: World,
    law: Law,
    numbers: Packed,
    cases: Cases,
    openings: Floats | None = None,
    note: Callable[..., None] = note_inspectable,
) -> tuple[Parts, Flights, NDArray[np.uint8]]:
    """Return what is to fly from some starts, and `inspectable_points` as noted by a function."""
    inspectable = inspectable_points(world, cases.starts, note)
    counted = counted_points(world, cases.starts, inspectable)
    opened = np.zeros((0, 3)) if openings is None else openings
    flights = Flights(world, law, numbers.values, numbers.rules, cases.starts, counted, opened)
    return parts_in_use(world, law, cases), flights, inspectable


def fly_population(
    world: World,
    law: Law,
    numbers: Packed,
    cases: Cases,
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
    openings: Floats | None = None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly every controller of a population, of one structure, from every start; n controllers and m starts.

    The outcomes have the shape (n, m). They depend neither on the number of worker threads, one per processor
    unless given, nor on how many flights fly side by side in `lanes`; see `lanes_for`.

    Parameters
    ----------
    tracks : (n * m, K+1, 3 or 15) float32, optional
        Filled with positions, m, Hill axes; if there is room also with velocities, m/s, the
        delta-v spent, m/s, the number of points not yet inspected, the force fired over the control period
        that follows, N, the boresight, both in Hill axes, and the deputy's angular rate relative to Hill,
        rad/s: columns as in `pipeline.flight.state.arrays`.
    openings : (m, 3) array, optional
        Fired in the first control period instead of what the rules decide, N, Hill axes.

    Raises
    ------
    FlightError
        If a flight's numbers are not finite.
    """
    num_pairs = len(numbers.values) * len(cases)
    outcomes = np.empty((num_pairs, NUM_OUTCOMES))
    workers = workers or os.cpu_count() or 1
    # flights of one vector stay together
    shares = _shares(num_pairs, lanes if len(numbers.values) == 1 else max(1, len(cases)), workers)
    workers, untaken = min(workers, len(shares)), iter(shares)
    parts, flights, inspectable = flights_of(world, law, numbers, cases, openings)
    results = Results(no_log(), NO_TRACKS if tracks is None else tracks, outcomes)

    def fly_shares(state: State, work: Workspace) -> None:
        """Fly shares one after the other, each not taken by another thread."""
        for first, last in untaken:
            fly_many(*parts, flights, state, work, results, first, last)

    states = [make_state(world, parts[-1], lanes) for _ in range(workers)]
    works = [make_workspace(world, lanes) for _ in range(workers)]
    in_threads(fly_shares, states, works, workers=workers)
    rows = outcomes.reshape(len(numbers.values), len(cases), NUM_OUTCOMES)
    return outcomes_of(rows, inspectable[:, : world.num_points].sum(axis=1, dtype=np.int64))


def _shares(num_flights: int, whole: int, workers: int) -> list[tuple[int, int]]:
    """Split flights into shares (first, last) of decreasing size, so that threads end together."""
    shares, first = [], 0
    while first < num_flights:
        left = -(-(num_flights - first) // whole)
        last = min(num_flights, first + whole * (left if workers == 1 else -(-left // (2 * workers))))
        shares.append((first, last))
        first = last
    return shares


def outcomes_of(rows: Floats, inspectable_count: NDArray[np.int64]) -> Outcomes:
    """Return rows of the kernel as outcomes, if all are finite."""
    check_finite(rows)
    spent, inspected, mean, nearest, farthest, outside, periods, corrected = np.moveaxis(rows, -1, 0)
    inspected, periods = np.rint(inspected).astype(np.int64), np.rint(periods).astype(np.int64)
    inspectable, distances = np.broadcast_to(inspectable_count, rows.shape[:-1]), (mean, nearest, farthest)
    return Outcomes(spent, inspected, inspectable, *distances, outside, periods, corrected)


def check_finite(*numbers: Floats) -> None:
    """Raise FlightError unless all numbers of a flight are finite."""
    if not all(np.isfinite(some).all() for some in numbers):
        raise FlightError(
            "a flight did not stay finite: its position, attitude or force became infinite or not a number; "
            "lower attitude.proportional_gain, deputy.max_torque_n_m or attitude_period_s, with which it "
            "cannot be flown"
        )
