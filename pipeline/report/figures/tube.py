"""The tube of a proof over flights: how far from the chief all starts lead, and how fast."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.goals.reach import ends, limit_at
from pipeline.report.figures import style
from pipeline.settings.mission_parts import Problem

CAPTION = (
    "What the proof bounds for all starts, second by second (shaded), and {count} flights of the cases "
    "(lines): the distance from the chief, and the speed, with its limit at the least distance that is "
    "possible then (dashed)."
)


def draw(
    tube: Mapping[str, Floats],
    tracks: NDArray[np.float32],
    problem: Problem,
    period_s: float,
    dots_per_inch: int,
) -> style.Illustration:
    """Draw a tube, as `prove` writes it, over flights.

    Parameters
    ----------
    tube : mapping of (n,)
        Boxes by step and axis: positions, m, and velocities plus ``shear_per_s`` times the position, m/s.
    tracks : (num_flights, num_samples, 6 or more)
        Positions and velocities, m and m/s.
    problem : Problem
    period_s : float
        From sample to sample.
    dots_per_inch : int
    """
    least, most, fastest = bounds(tube)
    time = period_s * np.arange(len(most))
    distance, speed = (
        np.linalg.norm(tracks[..., first : first + 3], axis=-1).astype(np.float64) for first in (0, 3)
    )
    last, _, _ = ends(problem, distance, speed)
    with style.style():
        figure = style.Figure(figsize=(8.0, 5.6), layout="constrained")
        far, fast = figure.subplots(2, 1, sharex=True)
        far.fill_between(time, least, most, color=style.BLUE, alpha=0.2, linewidth=0)
        fast.fill_between(time, 0.0, fastest, color=style.BLUE, alpha=0.2, linewidth=0)
        fast.plot(time, limit_at(problem, least), color=style.VERMILION, linestyle="--", label="limit")
        for ax, values in ((far, distance), (fast, speed)):
            for row, end in enumerate(last):
                shown = slice(0, end + 1)
                ax.plot(period_s * np.arange(end + 1), values[row, shown], color=style.BLUE, linewidth=0.5)
        far.set(ylabel="distance from the chief (m)", ylim=(0.0, None))
        fast.set(xlabel="time (s)", ylabel="speed (m/s)", xlim=(0.0, time[-1]), ylim=(0.0, None))
        fast.legend(loc="upper right")
        return style.illustrate("tube", CAPTION.format(count=len(tracks)), figure, dots_per_inch)


def bounds(tube: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats]:
    """Return the least and greatest distance, m, and the greatest speed, m/s, after each step."""
    step, axis = (tube[name].astype(np.int64) for name in ("step", "axis"))
    low, high, shear = tube["low_m"], tube["high_m"], tube["shear_per_s"]
    leaning = np.sort([shear * low, shear * high], axis=0)
    fast = np.maximum(np.abs(tube["least_m_s"] - leaning[1]), np.abs(tube["greatest_m_s"] - leaning[0]))
    squared = np.zeros((3, step.max() + 1, 3))
    squared[0] = np.inf
    np.minimum.at(squared[0], (step, axis), np.maximum(0.0, np.maximum(low, -high)) ** 2)
    np.maximum.at(squared[1], (step, axis), np.maximum(np.abs(low), np.abs(high)) ** 2)
    np.maximum.at(squared[2], (step, axis), fast**2)
    squared[0][np.isinf(squared[0])] = 0.0
    least, most, fastest = np.sqrt(squared.sum(axis=-1))
    return least, most, fastest
