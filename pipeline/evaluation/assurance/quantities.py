"""The quantities of formulas, from compiled tracks and from recordings alike.

A track holds, sample by sample, position (m) and velocity (m/s) in Hill axes, the delta-v spent (m/s), the
number of points not yet inspected, and so on, see `pipeline.flight.fly.population.fly_population`. A force
belongs to the sample from which it is fired, for the control period that follows; at the last one it is zero.

Of a fleet each deputy has a track, and each has the quantities: its own, or those of all deputies together.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats, Integers
from pipeline.evaluation.assurance.formula import (
    COASTING,
    COASTING_FARTHEST,
    COASTING_PAIR,
    NEAREST_PAIR,
    kind_of,
    seconds_of,
)
from pipeline.flight.cases.dispersions import OF_MOTION, groups_of
from pipeline.flight.cases.processes import drifts_of
from pipeline.flight.state import arrays
from pipeline.flight.state.log import Scenario, inspectable_rate
from pipeline.flight.world.coasting import FreeMotion
from pipeline.flight.world.pack import inspection_points
from pipeline.physics.quaternion import seen_from_hill
from pipeline.settings import plugged
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Mission
from telemetry.file.recording import Recording
from telemetry.file.topics import DEPUTY_CONTROL, DEPUTY_STATE, MISSION

_BORESIGHT = slice(arrays.TRACK_BORESIGHT, arrays.TRACK_BORESIGHT + 3)


class TrackFacts(NamedTuple):
    """What tracks do not hold: the mission, and points, in all and inspectable, (n,).

    Where cases draw settings of free motion, also the missions in which they move, each with the rows of its
    cases, and their scenarios, by which drag varies in time.
    """

    number: int
    inspectable: Integers
    mission: Mission
    drawn: Sequence[tuple[Mission, Sequence[int]]] = ()
    scenarios: Sequence[Scenario] = ()

    @property
    def mean_motion(self) -> float:
        """The chief's mean motion, rad/s."""
        return self.mission.orbit.mean_motion_rad_s

    @property
    def moving(self) -> Sequence[tuple[Mission, Sequence[int] | slice]]:
        """The missions in which cases move freely, each with the rows of its cases."""
        return self.drawn or [(self.mission, slice(None))]

    def drifts(
        self, motion: FreeMotion, mission: Mission, rows: Sequence[int] | slice, beyond_s: float
    ) -> Floats | None:
        """Return where drag leads the flights of some rows, which move in a mission; see `drifts_of`."""
        some = self.scenarios[rows] if isinstance(rows, slice) else [self.scenarios[row] for row in rows]
        return drifts_of(motion, mission, some, beyond_s)


#: from tracks, (n, K+1, 15), and what they do not hold to (n, K+1)
OfTracks = Callable[[Floats, TrackFacts], Floats]


@dataclass(frozen=True)
class Quantity:
    """A quantity recorded at every sample of a flight.

    Parameters
    ----------
    unit : str
        Empty if dimensionless.
    topic : str
        Its topic in recordings, or that of its inputs.
    description : str
    of_tracks : callable
    is_of_fleets : bool
        Whether it is of several deputies together: it takes the tracks of fleets, (n, D, K+1, 15).
    """

    unit: str
    topic: str
    description: str
    of_tracks: OfTracks
    is_of_fleets: bool = False


def _column(index: int) -> OfTracks:
    """Return the function that reads a column of tracks."""
    return lambda tracks, facts: tracks[..., index]


def _length(first: int) -> OfTracks:
    """Return the function that computes the length of a vector of three columns."""
    return lambda tracks, facts: np.linalg.norm(tracks[..., first : first + 3], axis=-1)


def _inspected(tracks: Floats, facts: TrackFacts) -> Floats:
    """Return the number of points inspected at each sample."""
    return facts.number - tracks[..., arrays.TRACK_LEFT]


def _degrees_between(first: Floats, second: Floats) -> Floats:
    """Return the angles between vectors, deg: by their tangents, which are accurate for small angles."""
    sines = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.degrees(np.arctan2(sines, np.sum(first * second, axis=-1)))


def _coasting(name: str, seconds: float | None = None) -> OfTracks:
    """Return a quantity of `FreeMotion.distances` over some seconds, an orbit unless given."""
    end = 0 if name == COASTING else 1

    def distance(tracks: Floats, facts: TrackFacts) -> Floats:
        distances = np.empty(tracks.shape[:2])
        for mission, rows in facts.moving:
            duration = _lasting(mission, seconds)
            motion = FreeMotion(mission, duration)
            drifts = facts.drifts(motion, mission, rows, duration)
            distances[rows] = motion.distances(tracks[rows, :, :6], duration, drifts=drifts)[end]
        return distances

    return distance


def _lasting(mission: Mission, seconds: float | None) -> float:
    """Return some seconds, or an orbit's where none are given."""
    return 2.0 * np.pi / mission.orbit.mean_motion_rad_s if seconds is None else seconds


def _pairs(tracks: Floats) -> Iterator[Floats]:
    """Yield the states of deputies relative to others, of each pair, (n, K+1, 6)."""
    for deputy, other in combinations(range(tracks.shape[1]), 2):
        yield tracks[:, deputy, :, :6] - tracks[:, other, :, :6]


def _nearest_pair(tracks: Floats, facts: TrackFacts) -> Floats:
    """Return the least distance between two deputies at each sample, m."""
    distances = [np.linalg.norm(relative[..., :3], axis=-1) for relative in _pairs(tracks)]
    return np.asarray(np.min(distances, axis=0))


def _coasting_pair(seconds: float | None = None) -> OfTracks:
    """Return how near two deputies come by free motion over some seconds, an orbit unless given."""

    def distance(tracks: Floats, facts: TrackFacts) -> Floats:
        duration = _lasting(facts.mission, seconds)
        motion = FreeMotion(facts.mission.of_each, duration)
        nearest = [motion.distances(each, duration, is_relative=True)[0] for each in _pairs(tracks)]
        return np.asarray(np.min(nearest, axis=0))

    return distance


def _along(name: str, topic: str, unit: str, first: int) -> dict[str, Quantity]:
    """Return the quantities of a vector's components along Hill's axes, by name."""
    axes = (("radial", "i"), ("along_track", "j"), ("cross_track", "k"))
    return {
        f"{name}_{axis}": Quantity(unit, f"{topic}[{n}]", f"{name} along Hill {letter}", _column(first + n))
        for n, (axis, letter) in enumerate(axes)
    }


#: quantities that need no package of one's own
SHIPPED: Mapping[str, Quantity] = {
    "distance": Quantity("m", f"{MISSION}.distance_m", "from the chief's centre", _length(0)),
    COASTING: Quantity(
        "m",
        f"{DEPUTY_STATE}.position_m",
        "the least from the chief's centre if nothing more is fired, in the next orbit or so many seconds",
        _coasting(COASTING),
    ),
    COASTING_FARTHEST: Quantity(
        "m",
        f"{DEPUTY_STATE}.position_m",
        "the greatest from the chief's centre if nothing more is fired, in the next orbit or so many seconds",
        _coasting(COASTING_FARTHEST),
    ),
    **_along("position", f"{DEPUTY_STATE}.position_m", "m", 0),
    "speed": Quantity(
        "m/s", f"{DEPUTY_STATE}.velocity_m_s", "relative to Hill, in any direction", _length(3)
    ),
    **_along("velocity", f"{DEPUTY_STATE}.velocity_m_s", "m/s", 3),
    "delta_v": Quantity("m/s", f"{MISSION}.delta_v_m_s", "spent so far", _column(arrays.TRACK_SPENT)),
    "inspected": Quantity("", f"{MISSION}.inspected_count", "points inspected so far", _inspected),
    "inspection_rate": Quantity(
        "%",
        f"{MISSION}.inspection_rate_percent",
        "share of the points inspected so far",
        lambda tracks, facts: 100.0 * _inspected(tracks, facts) / facts.number,
    ),
    "inspectable_rate": Quantity(
        "%",
        f"{MISSION}.inspected_count",
        "share, inspected so far, of the points that are lit at some sample of the flight",
        lambda tracks, facts: inspectable_rate(_inspected(tracks, facts), facts.inspectable[:, np.newaxis]),
    ),
    "force": Quantity(
        "N", f"{DEPUTY_CONTROL}.force_hill_n", "as fired, in any direction", _length(arrays.TRACK_FORCE)
    ),
    **_along("force", f"{DEPUTY_CONTROL}.force_hill_n", "N", arrays.TRACK_FORCE),
    "turn_rate": Quantity(
        "deg/s",
        f"{DEPUTY_STATE}.angular_velocity_rad_s",
        "of the deputy relative to Hill, about any axis",
        lambda tracks, facts: np.degrees(tracks[..., arrays.TRACK_TURN_RATE]),
    ),
    "pointing_error": Quantity(
        "deg",
        f"{DEPUTY_STATE}.quaternion",
        "from the camera's boresight to the chief's centre",
        lambda tracks, facts: _degrees_between(tracks[..., _BORESIGHT], -tracks[..., :3]),
    ),
    NEAREST_PAIR: Quantity(
        "m",
        f"{DEPUTY_STATE}.position_m",
        "of fleets: the least distance between two deputies",
        _nearest_pair,
        is_of_fleets=True,
    ),
    COASTING_PAIR: Quantity(
        "m",
        f"{DEPUTY_STATE}.position_m",
        "of fleets: the least distance between two if none fires anything more, in the next orbit or so many "
        "seconds",
        _coasting_pair(),
        is_of_fleets=True,
    ),
    "fleet_delta_v": Quantity(
        "m/s",
        f"{MISSION}.delta_v_m_s",
        "of fleets: spent so far by all deputies",
        lambda tracks, facts: tracks[..., arrays.TRACK_SPENT].sum(axis=1),
        is_of_fleets=True,
    ),
}

#: words for the flights with the least and with the greatest value, for which the braces stand
EXTREMES: Mapping[str, tuple[str, str]] = {
    "distance": ("the nearest {} from its centre", "the farthest {} from its centre"),
    COASTING: ("the nearest by coasting {} from its centre", "the farthest by coasting {} from its centre"),
    COASTING_FARTHEST: ("the nearest by coasting at most {} away", "the farthest by coasting {} away"),
    NEAREST_PAIR: ("two deputies nearest to each other at {}", "deputies farthest apart at {}"),
    COASTING_PAIR: ("two nearest to each other by coasting at {}", "farthest apart by coasting at {}"),
    "speed": ("the slowest at {}", "the fastest at {}"),
    "delta_v": ("the cheapest at {}", "the most expensive at {}"),
    "fleet_delta_v": ("the cheapest at {}", "the most expensive at {}"),
    "inspection_rate": ("the least at {}", "the most at {}"),
    "inspectable_rate": ("the least at {}", "the most at {}"),
}


class _Quantities(Mapping[str, Quantity]):
    """Those that ship, then those that installed packages offer, loaded when they are asked for."""

    def __getitem__(self, name: str) -> Quantity:
        if name in SHIPPED:
            return SHIPPED[name]
        if name not in plugged.names(plugged.QUANTITIES):
            raise KeyError(name)
        quantity = plugged.load(plugged.QUANTITIES, name)
        if not isinstance(quantity, Quantity):
            raise plugged.PluginError(
                f"{name} in the group {plugged.QUANTITIES} is {type(quantity).__name__}; it must be a "
                f"Quantity of {__name__}"
            )
        return quantity

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys([*SHIPPED, *plugged.names(plugged.QUANTITIES)]))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in SHIPPED or name in plugged.names(plugged.QUANTITIES)


class _Units(Mapping[str, str]):
    """The units of quantities."""

    def __getitem__(self, name: str) -> str:
        return QUANTITIES[name].unit

    def __iter__(self) -> Iterator[str]:
        return iter(QUANTITIES)

    def __len__(self) -> int:
        return len(QUANTITIES)

    def __contains__(self, name: object) -> bool:
        return name in QUANTITIES


QUANTITIES: Mapping[str, Quantity] = _Quantities()
UNITS: Mapping[str, str] = _Units()


def units_for(text: str) -> dict[str, str]:
    """Return the units of the quantities that ship, and of those of one's own that a formula names."""
    offered = set(re.findall(r"\w+", text)).intersection(plugged.names(plugged.QUANTITIES))
    return {name: UNITS[name] for name in (*SHIPPED, *sorted(offered.difference(SHIPPED)))}


def of_tracks(tracks: NDArray[Any], facts: TrackFacts, names: Iterable[str]) -> dict[str, Floats]:
    """Return quantities of flights, each (n, K+1), from their tracks, (n, K+1, 15).

    From those of fleets, (n, D, K+1, 15), they are (n D, K+1): of one deputy after the other.
    """
    exact = np.asarray(tracks, dtype=np.float64)
    if exact.ndim == 3:
        return {name: _of_name(name)(exact, facts) for name in names}
    deputies, each = exact.shape[1], exact.reshape(-1, *exact.shape[2:])
    of_each = facts._replace(
        inspectable=np.repeat(facts.inspectable, deputies), mission=facts.mission.of_each
    )
    return {
        name: np.repeat(_of_name(name)(exact, facts), deputies, axis=0)
        if is_of_fleets(name)
        else _of_name(name)(each, of_each)
        for name in names
    }


def is_of_fleets(name: str) -> bool:
    """Return whether a quantity is of several deputies together."""
    return QUANTITIES[kind_of(name)].is_of_fleets


def _of_name(name: str) -> OfTracks:
    """Return the function that computes a quantity, which may have seconds in brackets."""
    seconds, kind = seconds_of(name), kind_of(name)
    if seconds is None:
        return QUANTITIES[name].of_tracks
    return _coasting_pair(seconds) if kind == COASTING_PAIR else _coasting(kind, seconds)


def facts_of_flown(mission: Mission, scenarios: Sequence[Scenario], inspectable: Integers) -> TrackFacts:
    """Return what tracks of flights from some starts, or of fleets, do not hold.

    Parameters
    ----------
    mission : Mission
    scenarios : sequence of Scenario, of length n
        With settings that they draw, if the mission disperses some.
    inspectable : (n,)
        How many points can be inspected in each case.
    """
    missions = groups_of(mission, scenarios, OF_MOTION) if distributions(mission.dispersions) else ()
    return TrackFacts(len(inspection_points(mission)), inspectable, mission, missions, scenarios)


def track_of(recording: Recording, mission: Mission) -> tuple[Floats, TrackFacts]:
    """Return the track of a recorded flight, (1, K+1, 15), and what it does not hold."""
    state, inspection, control = recording[DEPUTY_STATE], recording[MISSION], recording[DEPUTY_CONTROL]
    num_points = int(np.asarray(inspection["inspected_mask"]).shape[1])
    inspectable = np.asarray(inspection["inspectable_count"][-1:], dtype=np.int64)
    left = num_points - np.asarray(inspection["inspected_count"], dtype=np.float64)
    fired = np.vstack([control["force_hill_n"], np.zeros(3)])
    boresight = np.array(recording.episode.boresight, dtype=np.float64)
    boresights = seen_from_hill(state["quaternion"].astype(np.float64), boresight)
    turn_rates = np.linalg.norm(state["angular_velocity_rad_s"], axis=1)
    spent = inspection["delta_v_m_s"]
    columns = [state["position_m"], state["velocity_m_s"], spent, left, fired, boresights, turn_rates]
    return np.column_stack(columns)[np.newaxis].astype(np.float64), TrackFacts(
        num_points, inspectable, mission
    )


def tracks_of(recordings: Sequence[Recording], mission: Mission) -> tuple[Floats, TrackFacts]:
    """Return the track of a recorded flight as `track_of` does; of a fleet those of its deputies, (1, D, …).

    Points that are left are those that none of a fleet's deputies has seen.
    """
    read = [track_of(recording, mission) for recording in recordings]
    track, facts = read[0]
    if not mission.has_fleet:
        return track, facts
    tracks = np.stack([track for track, _ in read], axis=1)
    masks = [np.asarray(recording[MISSION]["inspected_mask"], dtype=np.bool_) for recording in recordings]
    tracks[..., arrays.TRACK_LEFT] = facts.number - np.any(masks, axis=0).sum(axis=1)
    return tracks, facts
