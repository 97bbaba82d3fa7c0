"""A recording in memory: each topic's messages as typed columns."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from telemetry.array_types import Floats
from telemetry.file import RecordingError, columns, topics
from telemetry.file.metadata import EpisodeDescription, FisDescription, Rehearsal, epoch_of

if TYPE_CHECKING:
    import pyarrow as pa

#: times closer than this are the same, s
SAME_TIME_S: Final = 1e-6
#: a number of a vector; squares of greater ones have no room in single precision
GREATEST: Final = 1e18


@dataclass(frozen=True)
class TopicColumns:
    """Messages of a topic as columns.

    Parameters
    ----------
    topic, schema : str
        The topic, and the full name of its protobuf type.
    time_s : (N,)
        Simulation time of each message, ascending.
    columns : mapping of str to array
        One array per field; the first axis, of length N, is the message.
    units : mapping of str to str
        The unit of each column; empty if it has none.
    """

    topic: str
    schema: str
    time_s: Floats
    columns: Mapping[str, NDArray[np.generic]]
    units: Mapping[str, str]

    def __len__(self) -> int:
        return len(self.time_s)

    def to_arrow(self) -> "pa.Table":
        """Return the columns as an Arrow table: `time_s` first, vectors as lists of fixed size.

        Each field's metadata holds its ``unit``; `telemetry.flat_table` returns one number per cell instead.
        """
        described = {"topic": self.topic, "schema": self.schema}
        values = {"time_s": self.time_s, **self.columns}
        units = {"time_s": "s", **self.units}
        return columns.arrow_table(values, units, described)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        # anything that accepts Arrow's stream protocol accepts a topic: polars.DataFrame(topic), duckdb
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def __contains__(self, field: object) -> bool:
        return field in self.columns

    def __getitem__(self, field: str) -> NDArray[np.generic]:
        if field not in self.columns:
            raise KeyError(f"topic {self.topic} has no field {field!r}; it has {', '.join(self.columns)}")
        return self.columns[field]


@dataclass(frozen=True, eq=False)
class Recording(Mapping[str, TopicColumns]):
    """A recording, or the part of it that was read: a mapping from topics to their columns.

    Parameters
    ----------
    path : Path
    topics : mapping of str to TopicColumns
        By name; a topic without messages is included.
    metadata : mapping of str to mapping of str to str
        By name: `episode`, ``fis.<name>``, and `recovery` in a recovered file.
    attachments : mapping of str to bytes
        By file name.
    """

    path: Path
    topics: Mapping[str, TopicColumns]
    metadata: Mapping[str, Mapping[str, str]]
    attachments: Mapping[str, bytes]

    def __getitem__(self, topic: str) -> TopicColumns:
        if topic not in self.topics:
            raise KeyError(f"{self.path} has no topic {topic!r} here; it has {', '.join(self.topics)}")
        return self.topics[topic]

    def __iter__(self) -> Iterator[str]:
        return iter(self.topics)

    def __len__(self) -> int:
        return len(self.topics)

    def check_vectors(self, topic: str, field: str, length: int) -> None:
        """Check that a field has some finite numbers in each message.

        Parameters
        ----------
        topic, field : str
            Of the recording.
        length : int
            How many numbers.

        Raises
        ------
        RecordingError
            If a message has others.
        """
        messages = self[topic]
        values = np.asarray(messages[field], dtype=np.float64)
        is_fine = np.full(len(messages), values.shape[1:] == (length,))
        if is_fine.any():
            is_fine = np.all(np.abs(values) <= GREATEST, axis=1)
        if not is_fine.all():
            when = messages.time_s[int(np.argmin(is_fine))]
            raise RecordingError(
                f"{self.path} has no {length} finite numbers as {field} on {topic} at {when:g} s; record "
                "the flight again, or leave out such messages"
            )

    @property
    def fis_names(self) -> tuple[str, ...]:
        """Names of the fuzzy systems that the metadata describes, in the order of the recording."""
        return tuple(topics.under(topics.FIS_METADATA_PREFIX, self.metadata))

    @property
    def episode(self) -> EpisodeDescription:
        """Description of the episode; unknown values are None."""
        return EpisodeDescription.from_metadata(self.metadata.get(topics.EPISODE_METADATA, {}))

    @property
    def epoch(self) -> datetime | None:
        """The time, UTC, at which the simulation time is 0; None where the mission has none."""
        return epoch_of(self.metadata.get(topics.EPISODE_METADATA, {}))

    @property
    def rehearsals(self) -> dict[str, Rehearsal]:
        """The rehearsals, by what was chosen in each, such as ``first push`` or ``image of the tour``."""
        entries = topics.under(topics.REHEARSAL_METADATA_PREFIX, self.metadata)
        return {what: Rehearsal.from_metadata(entries) for what, entries in entries.items()}

    def fis_description(self, name: str) -> FisDescription:
        """Return the meaning of the numbers of the fuzzy system `name`.

        Raises
        ------
        RecordingError
            If the metadata is missing, or contradicts the recorded messages.
        """
        key = topics.FIS_METADATA_PREFIX + name
        if key not in self.metadata:
            raise RecordingError(f"{self.path} has no metadata {key}; it does not say what was sensed")
        description = FisDescription.from_metadata(self.metadata[key])
        topic = self.topics.get(topics.fis_topic(name))
        if topic is not None and len(topic):
            described = (len(description.input_names), len(description.rules))
            recorded = (topic["inputs"].shape[1], topic["firing_strengths"].shape[1])
            if described != recorded or len(description.input_units) != described[0]:
                raise RecordingError(
                    f"{self.path}: metadata fis.{name} describes {described[0]} inputs and {described[1]} "
                    f"rules, but {recorded[0]} and {recorded[1]} are recorded; record the flight again, with "
                    "metadata and inferences of the same fuzzy system"
                )
        return description

    @property
    def control_time_s(self) -> Floats:
        """When the control periods begin; empty where they were not read."""
        control = self.topics.get(topics.DEPUTY_CONTROL)
        return np.empty(0) if control is None else control.time_s

    @property
    def end_s(self) -> float:
        """When the flight ended, s; infinite where it went on to its full duration."""
        end_s = self.episode.end_s
        return np.inf if end_s is None else end_s

    @property
    def last_sample(self) -> int:
        """Index on `/mission` of the last sample up to the end of the flight."""
        return max(0, int(np.searchsorted(self[topics.MISSION].time_s, self.end_s, side="right")) - 1)

    @property
    def outcome(self) -> dict[str, float]:
        """The outcome of the flight, with a unit in each name; empty where it is not recorded."""
        mission = self.topics.get(topics.MISSION)
        if mission is None or not len(mission):
            return {}
        end_s, last = self.episode.end_s, self.last_sample
        distance = mission["distance_m"][: last + 1]
        return ({} if end_s is None else {"end_s": end_s}) | {
            "inspected_count": int(mission["inspected_count"][last]),
            "num_points": mission["inspected_mask"].shape[1],
            "inspectable_count": int(mission["inspectable_count"][last]),
            "inspection_rate_percent": float(mission["inspection_rate_percent"][last]),
            "delta_v_m_s": float(mission["delta_v_m_s"][last]),
            "min_distance_m": float(distance.min()),
            "max_distance_m": float(distance.max()),
        }

    @property
    def command_age_s(self) -> float:
        """The delay from a command to the control period that fires it; 0 where it is not recorded."""
        control = self.topics.get(topics.DEPUTY_CONTROL)
        return 0.0 if control is None else float(control["command_age_s"].max(initial=0.0))

    def fired_reasons(self, component: str, time_s: NDArray[np.float64]) -> NDArray[np.str_]:
        """Return why thrust was, or was not, fired along an axis in some control periods.

        Parameters
        ----------
        component : str
            What the output of a fuzzy system is called, such as ``force_x``.
        time_s : (N,)
            When the periods begin.

        Returns
        -------
        (N,) array of str
            Words of `telemetry.file.topics.Reason`; ``unknown`` where the recording does not say. In one from
            before reasons were recorded, ``silent`` where no force was fired.
        """
        control = self.topics.get(topics.DEPUTY_CONTROL)
        if control is None or not self._is_commanded_at(component, time_s):
            return np.full(len(time_s), topics.Reason.UNKNOWN.name.lower())
        rows = np.searchsorted(control.time_s, time_s)
        is_fired = np.any(control["force_hill_n"][rows], axis=1)
        if control["reason"].shape[1] == 0:
            return np.where(is_fired, topics.Reason.UNKNOWN.name.lower(), topics.Reason.SILENT.name.lower())
        axis = topics.FORCE_COMPONENTS.index(component)
        reasons: NDArray[np.str_] = control["reason"][rows, axis].astype(np.str_)
        if control["command_reason"].shape[1]:
            return reasons
        # recorded reasons are of the command alone
        is_lost = np.isin(reasons, topics.FIRED) & ~is_fired
        return np.where(is_lost, topics.Reason.BELOW_LEAST_IMPULSE.name.lower(), reasons)

    def reasons(self, component: str, time_s: NDArray[np.float64], axes: str = "hill") -> NDArray[np.str_]:
        """Return whether a force component commanded at some times was fired, or why not.

        The arguments and the words are those of `fired_reasons`: where it was commanded, the word is of the
        control period that fires it, ``delayed`` if the recording ends before that. Thrusters fire along Hill
        axes: a component along one of the axes ``body`` is fired if anything is.
        """
        control = self.topics.get(topics.DEPUTY_CONTROL)
        if control is None or not len(time_s) or not self._is_commanded_at(component, time_s):
            return self.fired_reasons(component, time_s)
        due = self._due(time_s)
        due_s = control.time_s[np.minimum(due, len(control) - 1)]
        fired = self.fired_reasons(component, due_s)
        fired = np.where(due < len(control), fired, topics.Reason.DELAYED.name.lower())
        if control["command_reason"].shape[1] == 0:
            return fired
        for other in topics.FORCE_COMPONENTS if axes == "body" else ():
            there = self.fired_reasons(other, due_s)
            fired = np.where(np.isin(there, topics.FIRED) & (due < len(control)), there, fired)
        rows = np.searchsorted(control.time_s, time_s)
        commanded = control["command_reason"][rows, topics.FORCE_COMPONENTS.index(component)].astype(np.str_)
        return np.where(np.isin(commanded, topics.FIRED), fired, commanded)

    def _is_commanded_at(self, component: str, time_s: NDArray[np.float64]) -> bool:
        """Return whether a name is a force component's, and a control period begins at all of some times."""
        return component in topics.FORCE_COMPONENTS and bool(np.all(np.isin(time_s, self.control_time_s)))

    def _due(self, time_s: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the rows on `/deputy/control` of the periods that fire what was commanded at some times."""
        return np.searchsorted(self.control_time_s, time_s + self.command_age_s - SAME_TIME_S)

    def fired(self, name: str) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return which inferences of a fuzzy system were fired, and when.

        Returns
        -------
        rows, fired_s : (n,)
            Of the system's topic, and when the control periods begin that fire them.
        """
        decided_s = self[topics.fis_topic(name)].time_s
        description = self.fis_description(name)
        words = self.reasons(description.output_name, decided_s, description.output_axes)
        rows = np.flatnonzero(np.isin(words, topics.FIRED))
        due = self._due(decided_s[rows])
        is_known = bool(np.all(due < len(self.control_time_s)))
        return rows, self.control_time_s[due] if is_known else decided_s[rows]
