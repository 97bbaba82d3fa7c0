"""Many flights at once: every controller of a population from every start, on all processors."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import FEW_LANES, LANES
from fis_tools.engines.packing import Packed
from fis_tools.processors import num_processors
from pipeline.array_types import Bytes, Floats
from pipeline.flight.cases.starts import Cases
from pipeline.flight.fly.many import NO_TRACKS, NOTHING_KNOWN, FlightBatch, Results, fly_many
from pipeline.flight.fly.workspace import Parts, make_state, make_workspace, parts_in_use, points_of_cases
from pipeline.flight.state.arrays import NUM_OUTCOMES, FlightState, Law, Workspace, World
from pipeline.flight.state.log import Outcomes
from pipeline.threads import in_threads


class FlightError(ValueError):
    """A flight whose state became infinite or not a number; its results mean nothing."""


def lanes_for(num_starts: int) -> int:
    """Return the flights to fly side by side when few starts are flown often, such as by many controllers.

    A half-empty vector takes as long as a full one; but each width is compiled separately.
    """
    return FEW_LANES if num_starts <= FEW_LANES else LANES


def lanes_of_group(num_groups: int, num_starts: int, lanes: int) -> int:
    """Return how many flights of a group to fly side by side: fewer, by its starts, if groups are many."""
    return lanes_for(num_starts) if num_groups > FEW_LANES else lanes


def flights_of(
    world: World,
    law: Law,
    numbers: Packed,
    cases: Cases,
    openings: Floats | None = None,
    changes: Sequence[int] = (),
    wanted: Bytes | None = None,
) -> tuple[Parts, FlightBatch, NDArray[np.uint8]]:
    """Return flights from some starts as compiled code takes them, and the points that can be inspected.

    See `fly_population`.
    """
    inspectable, counted = points_of_cases(world, cases.starts) if wanted is None else (wanted, wanted)
    values, rules = numbers.values[:, np.newaxis], numbers.rules
    if len(changes):
        values, rules = numbers.values[np.newaxis], numbers.rules[:1]
    opened = np.zeros((0, 0, 4)) if openings is None else openings
    samples = np.array(changes, dtype=np.int64)
    flights = FlightBatch(world, law, values, rules, samples, cases.starts, counted, opened)
    return parts_in_use(world, cases), flights, inspectable


def fly_population(
    world: World,
    law: Law,
    numbers: Packed,
    cases: Cases,
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
    openings: Floats | None = None,
    lanes: int = LANES,
    changes: Sequence[int] = (),
    wanted: Bytes | None = None,
    known: Floats | None = None,
) -> Outcomes:
    """Fly every controller of a population, of one structure, from every start; n controllers and m starts.

    The outcomes have the shape (n, m). They depend neither on the number of worker threads, one per processor
    unless given, nor on how many flights fly side by side in `lanes`; see `lanes_for`.

    Parameters
    ----------
    tracks : (n * m, K+1, 3 or 15) float32, optional
        Filled with positions, m, Hill axes, or all columns of a track, see `pipeline.flight.state.arrays`.
    openings : (m, n, 4) array, optional
        Forces of the first n control periods, N, Hill axes, and 1 for each that is fired instead of what the
        rules decide.
    changes : sequence of int, optional
        Samples at which flights go over to the next row of `numbers`. These are then not a population but
        one controller, in so many stretches and one more.
    wanted : (m, P padded) array, optional
        1 for the points that flights are about, instead of those that are lit in them.
    known : (n * m, 6+P or 42+P) array, optional
        Filled with what the deputies know at the end: position, m, velocity, m/s, Hill axes, 1 for each
        point that is still to be inspected, and the covariance, where they navigate by fixes.

    Raises
    ------
    FlightError
        If a flight's numbers are not finite.
    """
    parts, flights, inspectable = flights_of(world, law, numbers, cases, openings, changes, wanted)
    num_controllers = len(flights.values)
    num_pairs = num_controllers * len(cases)
    outcomes = np.empty((num_pairs, NUM_OUTCOMES))
    workers = workers or num_processors()
    # flights of one vector stay together
    shares = shares_of(num_pairs, lanes if num_controllers == 1 else max(1, len(cases)), workers)
    workers, untaken = min(workers, len(shares)), iter(shares)
    tracks, known = NO_TRACKS if tracks is None else tracks, NOTHING_KNOWN if known is None else known
    results = Results(outcomes, tracks=tracks, known=known)

    def fly_shares(state: FlightState, work: Workspace) -> None:
        """Fly shares one after the other, each not taken by another thread."""
        for first, last in untaken:
            fly_many(*parts, flights, state, work, results, first, last)

    states = [make_state(world, parts[-1], lanes) for _ in range(workers)]
    works = [make_workspace(world, lanes) for _ in range(workers)]
    in_threads(fly_shares, states, works, workers=workers)
    rows = outcomes.reshape(num_controllers, len(cases), NUM_OUTCOMES)
    num_inspectable = inspectable[:, : world.num_points].sum(axis=1, dtype=np.int64)
    forces = np.abs(flights.openings[..., :3]) * (flights.openings[..., 3:] > 0.0)
    ahead = np.minimum(forces, world.max_force).sum(axis=(1, 2)) * world.delta_v_per_force
    return outcomes_of(rows, num_inspectable, ahead if len(ahead) else np.zeros(len(cases)))


def shares_of(num_flights: int, whole: int, workers: int) -> list[tuple[int, int]]:
    """Split flights into shares (first, last) of decreasing size, so that threads end together."""
    shares, first = [], 0
    while first < num_flights:
        left = -(-(num_flights - first) // whole)
        last = min(num_flights, first + whole * (left if workers == 1 else -(-left // (2 * workers))))
        shares.append((first, last))
        first = last
    return shares


def outcomes_of(rows: Floats, inspectable_count: NDArray[np.int64], ahead_delta_v: Floats) -> Outcomes:
    """Return rows of the kernel as outcomes, if all are finite.

    The points that can be inspected, and what is fired as chosen ahead (m/s), are those of each start.
    """
    check_finite(rows)
    spent, inspected, mean, nearest, farthest, outside, periods, corrected, full = np.moveaxis(rows, -1, 0)
    inspected, periods = np.rint(inspected).astype(np.int64), np.rint(periods).astype(np.int64)
    inspectable = np.broadcast_to(inspectable_count, rows.shape[:-1])
    ahead = np.broadcast_to(ahead_delta_v, rows.shape[:-1])
    distances = mean, nearest, farthest
    return Outcomes(spent, inspected, inspectable, *distances, outside, periods, corrected, ahead, full)


def check_finite(*numbers: Floats) -> None:
    """Raise FlightError unless all numbers of a flight are finite."""
    if not all(np.isfinite(some).all() for some in numbers):
        raise FlightError(
            "a flight did not stay finite: its position, attitude or force became infinite or not a number; "
            "lower attitude.proportional_gain, deputy.max_torque_n_m or attitude_period_s, with which it "
            "cannot be flown"
        )
