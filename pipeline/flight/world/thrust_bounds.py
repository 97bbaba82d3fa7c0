"""How far what thrusters fire may be from a command, and what they burn, at most.

The safety layer's proof allows for it. A new setting of thrusters has its bound here, or is a premise that
fails. Thrusts of a layout are linear in the force while this stays in an octant of the body's axes, so that
what holds for all directions, and thus for all attitudes, is known by its eight octants.
"""

from functools import cache
from itertools import product
from math import ceil, radians, sqrt
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.constants import STANDARD_GRAVITY_M_S2
from pipeline.flight.world.estimates import SQRT_3
from pipeline.flight.world.layout import layout_of
from pipeline.settings.equipment import RealActuators

#: of a newton; what a thruster gives less of, by rounding, is nothing
NOTHING = 1e-9


class Capacity(NamedTuple):
    """Bounds over all directions of a force on what a layout gives for it."""

    least_force_n: float  # greatest length up to which any force is given as it is
    thrusts_per_newton: float  # greatest sum of thrusts for a newton
    most_at_once: int  # thrusters that fire for one force


def of_fired(
    actuators: RealActuators, period_s: float, probability: float, lighter: float
) -> tuple[float, float]:
    """Return the share of a command, and the force besides, N, by which what is fired may differ from it.

    The share is that of a linear map, at a probability. `lighter` is the share by which a force may count for
    more as propellant is used up.
    """
    share = largest_share(actuators.scale_error, radians(actuators.misalignment_deg), probability)
    share += (1.0 + share) * lighter
    half, least = 0.5 * actuators.impulse_step_n_s, actuators.least_impulse_n_s
    if actuators.thrusters is None:
        return share, SQRT_3 * (least + half) / period_s * (1.0 + lighter)
    # which round before what they fire is turned and scaled
    return share, most_missed(actuators.thrusters, -half, least + half) / period_s * (1.0 + share)


def propellant(
    actuators: RealActuators, share: float, force_n: float, period_s: float, num_periods: int
) -> float:
    """Return the propellant, kg, that forces up to a length take at most, one a control period."""
    rounded = 0.5 * actuators.impulse_step_n_s / period_s
    if actuators.thrusters is None:
        thrusts = SQRT_3 * (1.0 + share) * force_n + 3.0 * rounded
    else:
        capacity = capacity_of(actuators.thrusters)
        thrusts = capacity.thrusts_per_newton * force_n + capacity.most_at_once * rounded
    speed = STANDARD_GRAVITY_M_S2 * (actuators.specific_impulse_s or np.inf)
    return thrusts * period_s * num_periods / speed


@cache
def largest_share(scale: float, turn: float, probability: float) -> float:
    """Return a bound on ``|(I + S) R - I|``, for normal scales and a normal rotation, rad, at a probability.

    A quantile of at least 200,000 draws, 25 of them beyond it, at the upper end of its 99.9 % interval.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to import, used only here

    generator, count = np.random.default_rng(0), max(200_000, ceil(25.0 / (1.0 - probability)))
    scales, turns = generator.standard_normal((2, count, 3))
    rotations = Rotation.from_rotvec(turn * turns).as_matrix()
    off = rotations * (1.0 + scale * scales)[:, :, np.newaxis] - np.eye(3)
    shares = np.sort(np.sqrt(np.linalg.eigvalsh(off @ off.transpose(0, 2, 1))[:, -1]))
    above = 3.1 * sqrt(count * probability * (1.0 - probability))
    return float(shares[ceil(count * probability + above)])


@cache
def capacity_of(thrusters: tuple[tuple[float, ...], ...]) -> Capacity:
    """Return the bounds over all directions on what a layout, the rows of the settings, gives."""
    table, layout = layout_of(thrusters)
    least, thrusts, most = np.inf, 0.0, 0
    for columns in _octants(table):
        # no force of a newton takes more of a thruster than the length of its row
        least = min(least, float(np.min(layout[:, 6] / np.maximum(np.linalg.norm(columns, axis=1), NOTHING))))
        thrusts = max(thrusts, float(np.linalg.norm(columns.sum(axis=0))))
        most = max(most, int(np.count_nonzero((columns > NOTHING).any(axis=1))))
    return Capacity(least, thrusts, most)


@cache
def most_missed(thrusters: tuple[tuple[float, ...], ...], low: float, high: float) -> float:
    """Return the greatest force missed where each thruster that fires misses `low` to `high`, N.

    It is taken at a corner of these intervals, as a length is convex in them.
    """
    table, layout = layout_of(thrusters)
    greatest = 0.0
    for columns in _octants(table):
        directions = layout[(columns > NOTHING).any(axis=1), :3]
        corners = np.zeros((1, 3))
        for direction in directions:
            corners = np.vstack([corners + low * direction, corners + high * direction])
        greatest = max(greatest, float(np.linalg.norm(corners, axis=1).max()))
    return greatest


def _octants(table: Floats) -> list[Floats]:
    """Return the thrusts per newton along the three half-axes of each octant, (N, 3) each."""
    return [table[:, list(columns)] for columns in product((0, 3), (1, 4), (2, 5))]
