"""Compares two recordings: where they first differ, and how much each field differs at most."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from telemetry.array_types import Floats, Integers
from telemetry.file import RecordingError, topics
from telemetry.file.recording import Recording, TopicColumns
from telemetry.file.summary import aligned

Indices = Integers
Value = float | int | bool | str

#: within a sample a topic depends on those before it, so the first that differs is nearest to the cause
_DATA_FLOW: Final = (
    *(topics.DEPUTY_STATE, topics.DEPUTY_POSE, topics.TRANSFORMS, topics.CHIEF_POINTS, topics.MISSION),
    *(topics.NAVIGATION, topics.GUIDANCE, topics.CHIEF_PULLS, topics.FIS_PREFIX),
    *(topics.DEPUTY_CONTROL, topics.DEPUTY_ATTITUDE, topics.LOG),
)
_KEY: Final = np.dtype([("time_s", np.float64), ("occurrence", np.int64)])


@dataclass(frozen=True)
class FirstDifference:
    """Where two fields first differ by more than the tolerance.

    Parameters
    ----------
    topic, field, unit : str
    sample : int
        Index of the time among all times of both recordings.
    time_s : float
    component : tuple of int
        Index within the field; that of the largest difference, if several differ.
    first, second : float, int, bool or str
        The two values.
    """

    topic: str
    field: str
    unit: str
    sample: int
    time_s: float
    component: tuple[int, ...]
    first: Value
    second: Value


@dataclass(frozen=True)
class FieldComparison:
    """How much a field differs over all messages that both recordings have.

    Parameters
    ----------
    topic, field, unit : str
    greatest : float
        The largest difference, in the field's unit; infinite if a number is not finite, or texts or
        lengths differ.
    greatest_time_s : float
        Time of the largest difference.
    first_difference : FirstDifference or None
        None if the field never differs by more than the tolerance.
    """

    topic: str
    field: str
    unit: str
    greatest: float
    greatest_time_s: float
    first_difference: FirstDifference | None


@dataclass(frozen=True)
class LoneMessages:
    """Messages of a topic that only one recording has.

    Parameters
    ----------
    topic : str
    is_in_first : bool
        Whether the first recording has them.
    num_messages : int
    sample, time_s : int, float
        Of the first of them.
    """

    topic: str
    is_in_first: bool
    num_messages: int
    sample: int
    time_s: float


@dataclass(frozen=True)
class Comparison:
    """Two recordings compared: what both have, what only one has, and where they differ.

    Parameters
    ----------
    first, second : Path
    tolerance : float
        Differences of quantities up to it count as equal, in each field's own unit.
    num_samples : int
        Number of distinct times in both recordings.
    fields : tuple of FieldComparison
        In the order of data flow within a sample.
    lone : tuple of LoneMessages
    told_apart : tuple of str
        Metadata entries and attachments that differ; they may explain differences but do not count as such.
    """

    first: Path
    second: Path
    tolerance: float
    num_samples: int
    fields: tuple[FieldComparison, ...]
    lone: tuple[LoneMessages, ...]
    told_apart: tuple[str, ...]

    @property
    def is_equal(self) -> bool:
        """Whether nothing differs by more than the tolerance."""
        return not self.lone and all(field.first_difference is None for field in self.fields)

    @property
    def first_difference(self) -> FirstDifference | LoneMessages | None:
        """The first difference, None if there is none."""
        differences = [field.first_difference for field in self.fields if field.first_difference is not None]
        candidates: list[FirstDifference | LoneMessages] = [*self.lone, *differences]
        return min(candidates, key=lambda each: (each.sample, _flow(each.topic)), default=None)


def compare(first: Recording, second: Recording, tolerance: float = 0.0) -> Comparison:
    """Compare two recordings message by message, pairing messages of a topic by time.

    Parameters
    ----------
    first, second : Recording
        They may differ in length and topics.
    tolerance : float
        The largest difference that counts as equal, in each field's own unit. It applies to quantities;
        counts, states, masks and texts must be identical. Two NaNs are equal.

    Returns
    -------
    Comparison

    Raises
    ------
    RecordingError
        If the tolerance is negative or NaN.
    """
    if not tolerance >= 0.0:
        raise RecordingError(
            f"the tolerance is {tolerance}, but zero or a positive number is expected; "
            "give the largest difference that counts as equal"
        )
    recorded = [topic for recording in (first, second) for topic in recording.topics.values()]
    samples = np.unique(np.concatenate([np.empty(0), *(topic.time_s for topic in recorded)]))
    fields: list[FieldComparison] = []
    lone: list[LoneMessages] = []
    for name in sorted({topic.topic for topic in recorded}, key=_flow):
        pair = first.topics.get(name), second.topics.get(name)
        # the same time, and the same index among those of that time
        keys = _keys(pair[0]), _keys(pair[1])
        _, rows, other_rows = np.intersect1d(*keys, assume_unique=True, return_indices=True)
        for topic, common, is_in_first in zip(pair, (rows, other_rows), (True, False), strict=True):
            times = np.empty(0) if topic is None else np.delete(topic.time_s, common)
            if times.size:
                first_s = float(times[0])
                row = _sample(samples, first_s)
                lone.append(LoneMessages(name, is_in_first, len(times), row, first_s))
        if pair[0] is not None and pair[1] is not None and rows.size:
            fields += _compared_fields(pair[0], pair[1], (rows, other_rows), samples, tolerance)
    apart = tuple(_told_apart(first, second))
    return Comparison(
        first.path, second.path, tolerance, len(samples), tuple(fields), tuple(lone), told_apart=apart
    )


def _told_apart(first: Recording, second: Recording) -> Iterator[str]:
    """Yield the names of metadata and attachments that differ between two recordings."""
    for name in sorted(first.metadata.keys() | second.metadata.keys()):
        entries, others = first.metadata.get(name, {}), second.metadata.get(name, {})
        for key in sorted(entries.keys() | others.keys()):
            if entries.get(key) != others.get(key):
                yield f"{name} {key}"
    for name in sorted(first.attachments.keys() | second.attachments.keys()):
        if first.attachments.get(name) != second.attachments.get(name):
            yield name


def _flow(topic: str) -> tuple[int, str]:
    """Return a topic's sort key: by data flow, other topics last."""
    kind = topics.FIS_PREFIX if topic.startswith(topics.FIS_PREFIX) else topic
    return (_DATA_FLOW.index(kind) if kind in _DATA_FLOW else len(_DATA_FLOW)), topic


def _keys(topic: TopicColumns | None) -> NDArray[np.void]:
    """Return each message's key: its time, and its number among messages of that time."""
    times = np.empty(0) if topic is None else topic.time_s
    keys = np.empty(len(times), dtype=_KEY)
    keys["time_s"] = times
    keys["occurrence"] = np.arange(len(times)) - np.searchsorted(times, times)
    return keys


def _compared_fields(
    first: TopicColumns,
    second: TopicColumns,
    rows: tuple[Indices, Indices],
    samples: Floats,
    tolerance: float,
) -> Iterator[FieldComparison]:
    """Yield for each field of a topic how far two recordings lie apart, and where first."""
    times = first.time_s[rows[0]]
    for field in (name for name in first.columns if name in second.columns):
        first_value, other = first[field][rows[0]], second[field][rows[1]]
        apart = _apart(first_value, other)
        greatest = apart.reshape(len(apart), -1).max(axis=1, initial=0.0)
        # the tolerance does not apply to counts and states
        beyond = np.flatnonzero(greatest > (tolerance if first_value.dtype.kind == "f" else 0.0))
        unit = first.units.get(field, "")
        first_difference = None
        if beyond.size:
            row = int(beyond[0])
            sample, time_s = _sample(samples, times[row]), float(times[row])
            component, value, other_value = _values(first_value, other, apart, row)
            first_difference = FirstDifference(
                first.topic, field, unit, sample, time_s, component, value, other_value
            )
        most = float(greatest.max())
        when_s = float(times[greatest.argmax()])
        yield FieldComparison(first.topic, field, unit, most, when_s, first_difference)


def _apart(first: NDArray[np.generic], other: NDArray[np.generic]) -> Floats:
    """Return absolute differences; infinite where numbers cannot be subtracted."""
    if first.shape != other.shape:
        return np.full(len(first), np.inf)
    if first.dtype.kind == "U":
        return np.where(first == other, 0.0, np.inf)
    numbers, others = first.astype(np.float64), other.astype(np.float64)
    is_same = (numbers == others) | (np.isnan(numbers) & np.isnan(others))
    with np.errstate(invalid="ignore"):
        apart = np.abs(numbers - others)
    return np.where(is_same, 0.0, np.where(np.isfinite(apart), apart, np.inf))


def _values(
    first: NDArray[np.generic], other: NDArray[np.generic], apart: Floats, row: int
) -> tuple[tuple[int, ...], Value, Value]:
    """Return the index of the largest difference in a row, and both values."""
    if first.shape != other.shape:
        return (), _length(first), _length(other)
    component = tuple(int(i) for i in np.unravel_index(int(apart[row].argmax()), apart.shape[1:]))
    position = (row, *component)
    return component, first[position].item(), other[position].item()


def _length(values: NDArray[np.generic]) -> str:
    return f"{' x '.join(map(str, values.shape[1:]))} values"


def _sample(samples: Floats, time_s: float) -> int:
    return int(np.searchsorted(samples, time_s))


def in_words(comparison: Comparison) -> list[str]:
    """Describe a comparison: the first difference, unmatched messages, each field that differs."""
    pair = f"{comparison.first} and {comparison.second}"
    first_difference = comparison.first_difference
    if first_difference is None:
        extent = f"{comparison.num_samples} samples, {len(comparison.fields)} fields"
        within = f" to within {comparison.tolerance:g}" if comparison.tolerance else ""
        lines = [f"{pair} are the same{within}: {extent}"]
    else:
        lines = [f"{pair} differ from {_first_difference_in_words(first_difference, comparison.num_samples)}"]
    for lone in comparison.lone:
        owner = "first" if lone.is_in_first else "second"
        lines.append(
            f"  {lone.topic}: {lone.num_messages} messages only in the {owner}, from {lone.time_s:g} s on"
        )
    if comparison.told_apart:
        lines.append(f"  described differently: {', '.join(comparison.told_apart)}")
    return lines + _table(comparison.fields)


def _first_difference_in_words(difference: FirstDifference | LoneMessages, num_samples: int) -> str:
    """Describe the first difference between two recordings: where, when, and both values."""
    instant = (
        f"sample {difference.sample} of 0 to {num_samples - 1} ({difference.time_s:g} s): {difference.topic}"
    )
    if isinstance(difference, LoneMessages):
        return f"{instant} has a message only in the {'first' if difference.is_in_first else 'second'}"
    first, second, unit = difference.first, difference.second, _spaced(difference.unit)
    index = f"[{', '.join(map(str, difference.component))}]" if difference.component else ""
    values = f"is {first!r}{unit} in the first and {second!r}{unit} in the second"
    sentence = f"{instant} {difference.field}{index} {values}"
    if isinstance(first, str) or isinstance(second, str) or not np.isfinite(first - second):
        return sentence
    return f"{sentence}, {abs(first - second):.6g}{unit} apart"


def _spaced(unit: str) -> str:
    """Return a unit to follow a number; empty for a field whose numbers have several units."""
    return f" {unit}" if unit and "," not in unit else ""


def _table(fields: tuple[FieldComparison, ...]) -> list[str]:
    """Tabulate the fields that differ, and count the others."""
    rows = [("field", "differs from", "largest difference", "at")]
    for field in fields:
        if field.greatest > 0.0:
            since = (
                "within the tolerance"
                if field.first_difference is None
                else f"{field.first_difference.time_s:g} s"
            )
            is_number = np.isfinite(field.greatest)
            most = f"{field.greatest:.6g}{_spaced(field.unit)}" if is_number else "differs"
            rows.append((f"{field.topic} {field.field}", since, most, f"{field.greatest_time_s:g} s"))
    if len(rows) == 1:
        return []
    return ["", *aligned(rows), "", f"  the other {len(fields) - len(rows) + 1} fields are the same"]
