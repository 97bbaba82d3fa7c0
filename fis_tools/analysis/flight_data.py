"""What is read from a recorded flight or a table: inferences, periods, outcomes, inspection points."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.array_types import Booleans, Floats
from fis_tools.model import FuzzySystem
from fis_tools.model.thrust import COUNTED, UNKNOWN

if TYPE_CHECKING:
    from telemetry.file.recording import TopicColumns

Words = NDArray[np.str_]
#: times closer than this are the same, s
SAME_TIME_S = 1e-6


@dataclass(frozen=True)
class FlownSystem:
    """The inferences of one fuzzy system along a flight or a table, one per row.

    Parameters
    ----------
    system : FuzzySystem
        As the flight carries it along; of a table the one that is asked about.
    time_s : (n,)
        When inference decided the force; of a table without times the number of each row, from 1.
    inputs : (n, num_inputs)
        Before they are clipped to the universes.
    firing_strengths : (n, num_rules)
        As logged, in single precision; of a table as inferred.
    output : (n,)
        The first, as logged; of a table as inferred.
    reason : (n,)
        What became of the output, one of `fis_tools.model.thrust.REASONS`; `UNKNOWN` where the log does not
        say.
    is_timed : bool
        Whether `time_s` are times, and not numbers of rows.
    delay_s : float
        From an inference to the control period that fires its output.
    points : PointsAlong, optional
        Which points the inputs come from, where that is logged.
    """

    system: FuzzySystem
    time_s: Floats
    inputs: Floats
    firing_strengths: Floats
    output: Floats
    reason: Words
    is_timed: bool = True
    delay_s: float = 0.0
    points: "PointsAlong | None" = None

    @property
    def is_counted(self) -> Booleans:
        """Whether the output was fired, perhaps clipped or later; true where the log does not say."""
        return np.isin(self.reason, (*COUNTED, UNKNOWN))

    def at(self, rows: Booleans) -> "FlownSystem":
        """Return some of the inferences, by their indices."""
        columns = ("time_s", "inputs", "firing_strengths", "output", "reason")
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})


@dataclass(frozen=True)
class Period:
    """A system's inference over one control period of a flight, and what was fired of it.

    Parameters
    ----------
    flown : FlownSystem
        All of its inferences.
    time_s : float
        When the control period began.
    reason : str
        Why something was, or was not, fired along the system's axis, one of
        `fis_tools.model.thrust.REASONS`; `UNKNOWN` where the log does not say.
    row : int, optional
        The inference that was due then: that of the time before by which thrusters are late; None where
        there was none.
    """

    flown: FlownSystem
    time_s: float
    reason: str
    row: int | None


class FlightOutcome(NamedTuple):
    """The outcome of a recorded flight; None where the recording does not hold it.

    Attributes
    ----------
    end_s : float or None
        When it ended; None too where its time did.
    came_to : dict of str to float
        What it came to, with a unit in each name, see `telemetry.file.recording.Recording.outcome`; empty
        where the recording does not say.
    is_success, is_outside : bool or None
        Whether it reached the rate that it records as the goal, and left the distances it records as limits.
    num_safety : int or None
        Control periods in which the safety layer acted.
    constants : dict of str to str
        The meanings of the controller's attributes, by their names.
    """

    end_s: float | None
    came_to: dict[str, float]
    is_success: bool | None
    is_outside: bool | None
    num_safety: int | None
    constants: dict[str, str]


@dataclass(frozen=True)
class Points:
    """The inspection points that make up inputs of a controller, at an instant of a flight.

    Parameters
    ----------
    latitude_deg, longitude_deg : (P,)
        Where each point is on the body that it belongs to.
    dark_in_s : (P,)
        Until it is lit for the last time; at most 0 where that is over.
    parts : dict of str to (P,)
        What each adds to an input, by the input's name, in its unit. What of the input they do not sum to is
        no point's doing.
    is_missed : (P,), optional
        Whether it stays unseen if nothing is fired any more; None where the controller does not ask.
    is_shared : bool
        Whether other vehicles look for points too.
    """

    latitude_deg: Floats
    longitude_deg: Floats
    dark_in_s: Floats
    parts: dict[str, Floats]
    is_missed: Booleans | None
    is_shared: bool = False


@dataclass(frozen=True)
class PointsAlong:
    """What each inspection point adds to the inputs along a flight.

    Parameters
    ----------
    cloud : TopicColumns
        Places and parts of the points; a row holds until the next.
    start_s : (K,)
        When the control periods begin.
    is_asked : (K,)
        Whether the controller asks then what would stay unseen.
    names : tuple of str
        The inputs.
    is_shared : bool
        See `Points`.
    """

    cloud: "TopicColumns"
    start_s: Floats
    is_asked: Booleans
    names: tuple[str, ...]
    is_shared: bool = False

    def at(self, time_s: float) -> Points | None:
        """Return the points in the control period that contains a time, s; None before the first."""
        cloud, period = self.cloud, int(np.searchsorted(self.start_s, time_s + SAME_TIME_S)) - 1
        row = int(np.searchsorted(cloud.time_s, self.start_s[period] + SAME_TIME_S)) - 1
        if period < 0 or row < 0:
            return None
        x, y, z = cloud["position_m"][row].astype(np.float64).T
        return Points(
            np.degrees(np.arctan2(z, np.hypot(x, y))),
            np.degrees(np.arctan2(y, x)),
            cloud["last_light_s"][row].astype(np.float64) - self.start_s[period],
            {name: cloud[name][row].astype(np.float64) for name in self.names},
            cloud["is_missed"][row] != 0 if self.is_asked[period] else None,
            self.is_shared,
        )
