"""What formulas may speak of: quantities of a flight, from compiled tracks and from recordings alike.

A track holds, sample by sample, position (m) and velocity (m/s) in Hill axes, the delta-v spent (m/s) and the
number of points not yet inspected, see `pipeline.flight.simulation.fly_population`.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from telemetry.file.reader import Recording
from telemetry.file.topics import DEPUTY_STATE, MISSION

Floats = NDArray[np.float64]
#: from tracks, (n, K+1, 8), and the number of inspection points to (n, K+1)
OfTracks = Callable[[Floats, int], Floats]

SPENT, LEFT = 6, 7


@dataclass(frozen=True)
class Quantity:
    """Something that is recorded at every sample of a flight.

    Parameters
    ----------
    unit : str
        Empty for a pure number.
    topic : str
        Where recordings hold it, or what it is made of.
    description : str
    of_tracks : callable
    """

    unit: str
    topic: str
    description: str
    of_tracks: OfTracks


def _column(place: int) -> OfTracks:
    return lambda tracks, num_points: tracks[..., place]


def _length(first: int) -> OfTracks:
    return lambda tracks, num_points: np.linalg.norm(tracks[..., first : first + 3], axis=-1)


def _along(name: str, topic: str, unit: str, first: int) -> dict[str, Quantity]:
    axes = (("radial", "i"), ("along_track", "j"), ("cross_track", "k"))
    return {
        f"{name}_{axis}": Quantity(unit, f"{topic}[{n}]", f"{name} along Hill {letter}", _column(first + n))
        for n, (axis, letter) in enumerate(axes)
    }


QUANTITIES: Mapping[str, Quantity] = {
    "distance": Quantity("m", f"{MISSION}.distance_m", "from the chief's centre", _length(0)),
    **_along("position", f"{DEPUTY_STATE}.position_m", "m", 0),
    "speed": Quantity(
        "m/s", f"{DEPUTY_STATE}.velocity_m_s", "relative to Hill, in any direction", _length(3)
    ),
    **_along("velocity", f"{DEPUTY_STATE}.velocity_m_s", "m/s", 3),
    "delta_v": Quantity("m/s", f"{MISSION}.delta_v_m_s", "spent so far", _column(SPENT)),
    "inspected": Quantity(
        "",
        f"{MISSION}.inspected_count",
        "points inspected so far",
        lambda tracks, num: num - tracks[..., LEFT],
    ),
    "inspection_rate": Quantity(
        "%",
        f"{MISSION}.inspection_rate_percent",
        "share of the points inspected so far",
        lambda tracks, num: 100.0 * (num - tracks[..., LEFT]) / num,
    ),
}

UNITS: Mapping[str, str] = {name: quantity.unit for name, quantity in QUANTITIES.items()}


def of_tracks(tracks: NDArray[Any], num_points: int, names: Iterable[str]) -> dict[str, Floats]:
    """Return quantities of flights, each (n, K+1), from their tracks, (n, K+1, 8)."""
    exact = np.asarray(tracks, dtype=np.float64)
    return {name: QUANTITIES[name].of_tracks(exact, num_points) for name in names}


def track_of(recording: Recording) -> tuple[Floats, int]:
    """Return the track of a recorded flight, (1, K+1, 8), and the number of its inspection points."""
    state, mission = recording[DEPUTY_STATE], recording[MISSION]
    num_points = int(np.asarray(mission["inspected_mask"]).shape[1])
    left = num_points - np.asarray(mission["inspected_count"], dtype=np.float64)
    columns = [state["position_m"], state["velocity_m_s"], mission["delta_v_m_s"], left]
    return np.column_stack(columns)[np.newaxis].astype(np.float64), num_points
