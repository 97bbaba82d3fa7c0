"""Many flights at once: every controller of a population from every start, on all processors."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import FEW_LANES, LANES
from fis_tools.engines.packing import Packed
from pipeline.flight.cases import Cases
from pipeline.flight.inspectable import counted_points, inspectable_points
from pipeline.flight.kernel import arrays
from pipeline.flight.kernel.arrays import NUM_OUTCOMES, Law, Workspace, World
from pipeline.flight.kernel.loop import fly_many
from pipeline.flight.log import Outcomes, no_log
from pipeline.flight.workspace import Parts, make_workspace, parts_in_use

Floats = NDArray[np.float64]

#: where the rules decide on the first control period, too
NO_OPENINGS = np.zeros((0, 3))


class FlightError(ValueError):
    """A flight whose state became infinite or not a number: it tells nothing."""


def lanes_for(num_starts: int) -> int:
    """Return how many should fly side by side where few starts are flown often: by many controllers, say.

    A vector half of whose lanes are empty takes as long as a full one; but each width is compiled by itself.
    """
    return FEW_LANES if num_starts <= FEW_LANES else LANES


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
    """Fly every controller of a population from every start.

    Parameters
    ----------
    world : World
    law : Law
        Of the structure that the population shares.
    numbers : Packed
        n controllers.
    cases : Cases
        m starts.
    workers : int, optional
        Threads; one for each processor unless given. The result does not depend on it.
    tracks : (n * m, K+1, 3 or 15) float32, optional
        Filled with positions, m, Hill axes; where there is room for them also with velocities, m/s, the
        delta-v spent, m/s, the number of points not yet inspected, the force fired over the control period
        that follows, N, the boresight, both in Hill axes, and how fast the deputy turns relative to Hill,
        rad/s: columns as in `pipeline.flight.kernel.arrays`.
    openings : (m, 3) array, optional
        What is fired from each start in the first control period in place of what the rules decide, N, Hill
        axes.
    lanes : int
        Flights side by side. The result does not depend on it; see `lanes_for`.

    Returns
    -------
    Outcomes
        Arrays of shape (n, m).

    Raises
    ------
    FlightError
        If a flight did not stay finite.
    """
    num_pairs = len(numbers.values) * len(cases)
    outcomes = np.empty((num_pairs, NUM_OUTCOMES))
    workers = workers or os.cpu_count() or 1
    # what flies side by side stays together
    shares = _shares(num_pairs, lanes if len(numbers.values) == 1 else max(1, len(cases)), workers)
    workers, untaken = min(workers, len(shares)), iter(shares)
    silent = no_log()
    inspectable = inspectable_points(world, cases.starts)
    counted = counted_points(world, cases.starts, inspectable)
    tracks = np.empty((0, 0, 3), dtype=np.float32) if tracks is None else tracks

    def fly_shares(work: Workspace, parts: Parts) -> None:
        """Fly one share after the other, of those that no other thread has taken."""
        for first, last in untaken:
            fly_many(
                world,
                *parts,
                law,
                numbers.values,
                numbers.rules,
                cases.starts,
                counted,
                NO_OPENINGS if openings is None else openings,
                work,
                silent,
                tracks,
                first,
                last,
                outcomes,
            )

    works = [make_workspace(world, lanes) for _ in range(workers)]
    parts = [parts_in_use(world, law, cases, lanes) for _ in range(workers)]
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(fly_shares, works, parts))
    else:
        list(map(fly_shares, works, parts))
    rows = outcomes.reshape(len(numbers.values), len(cases), NUM_OUTCOMES)
    return outcomes_of(rows, inspectable[:, : world.num_points].sum(axis=1, dtype=np.int64))


def _shares(num_flights: int, whole: int, workers: int) -> list[tuple[int, int]]:
    """Share flights out as (first, last), in ever smaller multiples of so many: threads end together."""
    shares, first = [], 0
    while first < num_flights:
        left = -(-(num_flights - first) // whole)
        last = min(num_flights, first + whole * (left if workers == 1 else -(-left // (2 * workers))))
        shares.append((first, last))
        first = last
    return shares


def outcomes_of(rows: Floats, inspectable_count: NDArray[np.int64]) -> Outcomes:
    """Return rows of the kernel's as outcomes, if all are finite."""
    check_finite(rows)
    return Outcomes(
        delta_v_m_s=rows[..., arrays.DELTA_V],
        inspected_count=np.rint(rows[..., arrays.INSPECTED]).astype(np.int64),
        inspectable_count=np.broadcast_to(inspectable_count, rows.shape[:-1]),
        mean_distance_m=rows[..., arrays.MEAN_DISTANCE],
        min_distance_m=rows[..., arrays.MIN_DISTANCE],
        max_distance_m=rows[..., arrays.MAX_DISTANCE],
        outside_m=rows[..., arrays.OUTSIDE],
        safety_periods=np.rint(rows[..., arrays.SAFETY_PERIODS]).astype(np.int64),
        safety_delta_v_m_s=rows[..., arrays.SAFETY_DELTA_V],
    )


def check_finite(*numbers: Floats) -> None:
    """Raise FlightError unless all numbers of a flight are finite."""
    if not all(np.isfinite(some).all() for some in numbers):
        raise FlightError(
            "a flight did not stay finite: its position, attitude or force became infinite or not a number; "
            "lower attitude.proportional_gain, deputy.max_torque_n_m or attitude_period_s, with which it "
            "cannot be flown"
        )
