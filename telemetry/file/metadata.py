"""The metadata records `episode` and `fis.<name>`: their keys, and how values are encoded.

Metadata values are strings. Numbers and lists are encoded as JSON, text is stored as it is, and keys with
unknown values are left out.
"""

import json
import sys
import zlib
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from datetime import UTC, datetime, timedelta
from typing import Any, Final, Self

from plain_files.plain_text import parse_json, plain
from telemetry.file import RecordingError

#: keys with text, and with lists of words; all others have numbers
TEXTS: Final = (
    *("scenario_id", "product_version", "config_hash", "epoch", "fleet_sharing"),
    *("output_name", "output_unit", "output_axes"),
)
WORDS: Final = ("input_names", "input_units", "rules", "names")
#: keys with a list of numbers, and how many; None for any number
NUMBERS_OF: Final[Mapping[str, int | None]] = {
    **dict.fromkeys(("position_m", "velocity_m_s", "boresight", "noise"), 3),
    **dict.fromkeys(("settings", "costs_m_s", "holding", "paths_m")),
}
#: keys with whole numbers
WHOLE: Final = ("seed", "noise", "holding", "num_tried", "deputy", "fleet_deputies")
#: the greatest magnitudes of whole and of other numbers
MOST_WHOLE: Final = 2**63 - 1
MOST: Final = sys.float_info.max

#: how a record that cannot be used is mended
CURE: Final = "write it with telemetry.file.metadata"

#: key of the checksum of a record's other entries; MCAP itself has none for metadata
CHECKSUM_KEY: Final = "crc32"


def sealed(name: str, entries: Mapping[str, str]) -> dict[str, str]:
    """Add a checksum to a metadata record, for writing it to a file."""
    return {**entries, CHECKSUM_KEY: _checksum(name, entries)}


def unsealed(name: str, entries: Mapping[str, str]) -> dict[str, str]:
    """Remove the checksum from a metadata record, and clean its text.

    A record of another writer, without a checksum, is read as it is.

    Raises
    ------
    ValueError
        If the checksum does not match the entries.
    """
    content = {key: value for key, value in entries.items() if key != CHECKSUM_KEY}
    if CHECKSUM_KEY in entries and entries[CHECKSUM_KEY] != _checksum(name, content):
        raise ValueError(f"metadata {name} does not match its checksum")
    return {key: plain(value) for key, value in content.items()}


def _checksum(name: str, entries: Mapping[str, str]) -> str:
    return str(zlib.crc32(json.dumps([name, sorted(entries.items())]).encode()))


@dataclass(frozen=True, kw_only=True)
class Description:
    """Base of metadata records: a key for each field."""

    def to_metadata(self) -> dict[str, str]:
        """Encode the description as metadata, without the keys whose value is None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            key: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            for key, value in values.items()
            if value is not None
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> Self:
        """Decode metadata; unknown keys are ignored.

        Raises
        ------
        RecordingError
            If a key is missing, a value is not encoded as `to_metadata` does, or values contradict others.
        """
        known = {field.name: field for field in fields(cls)}
        missing = {name for name, field in known.items() if field.default is MISSING} - metadata.keys()
        if missing:
            raise RecordingError(
                f"the metadata lacks {', '.join(sorted(missing))}; "
                f"write it with telemetry.file.metadata.{cls.__name__}"
            )
        return cls(**{key: _decoded(key, metadata[key]) for key in known.keys() & metadata.keys()})


@dataclass(frozen=True, kw_only=True)
class EpisodeDescription(Description):
    """Description of an episode, with what a replay needs to draw it; unknown values are None.

    Parameters
    ----------
    scenario_id, product_version, config_hash : str
        The start, the version of the product, and the hash of the configuration.
    epoch : str
        Date and time of UTC at which the simulation time is 0, ISO 8601; None where the mission has none.
    seed : int
    noise : tuple of 3 ints
        Seed, stage and case that errors of navigation and thrusters are drawn from.
    settings : tuple of float
        Values of the dispersed keys, in their sorted order, where the flight was given its own.
    position_m, velocity_m_s : tuple of 3 floats
        The start, Hill axes.
    sun_angle_rad, sun_elevation_rad : float
        Of the Sun in the orbit plane and over it, at the start.
    min_distance_m, max_distance_m : float
        Limits of the deputy's distance to the chief.
    max_force_n, max_torque_n_m : float
        Limits per axis.
    half_angle_rad : float
        Of the camera's field of view; None of a rectangular one.
    keep_out_m : tuple of float
        Spheres that the deputy must stay out of: the centre, chief axes, and the radius, of each in turn.
    boresight : tuple of 3 floats
        Unit vector, body axes.
    inspection_threshold_percent : float
        A flight is a success from this inspection rate on.
    end_s : float
        When a flight towards a goal ends: what follows does not count. None where it ends with its time.
    deputy, fleet_deputies : int
        Of a fleet, the deputy's number, from 1, and how many there are. Each has a recording.
    fleet_sharing : str
        What its deputies heed of one another.
    """

    scenario_id: str | None = None
    epoch: str | None = None
    seed: int | None = None
    noise: tuple[float, ...] | None = None
    settings: tuple[float, ...] | None = None
    position_m: tuple[float, ...] | None = None
    velocity_m_s: tuple[float, ...] | None = None
    sun_angle_rad: float | None = None
    sun_elevation_rad: float | None = None
    product_version: str | None = None
    config_hash: str | None = None
    min_distance_m: float | None = None
    max_distance_m: float | None = None
    max_force_n: float | None = None
    max_torque_n_m: float | None = None
    half_angle_rad: float | None = None
    boresight: tuple[float, ...] | None = None
    keep_out_m: tuple[float, ...] | None = None
    inspection_threshold_percent: float | None = None
    end_s: float | None = None
    deputy: int | None = None
    fleet_deputies: int | None = None
    fleet_sharing: str | None = None


@dataclass(frozen=True, kw_only=True)
class FisDescription(Description):
    """The meaning of the numbers on a fuzzy system's topic.

    Parameters
    ----------
    input_names, input_units : tuple of str
        In the order of the field `inputs`; the unit is empty if there is none.
    output_name, output_unit : str
    rules : tuple of str
        In words, in the order of the field `firing_strengths`.
    holding : tuple of int
        The numbers of those, from 1, that conclude what the output is without any rule, and so hold back.
    output_axes : str
        Along which axes the output is: ``hill`` or ``body``.
    """

    input_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_name: str
    output_unit: str
    rules: tuple[str, ...]
    holding: tuple[int, ...] = ()
    output_axes: str = "hill"

    def __post_init__(self) -> None:
        """Raise RecordingError for the number of a rule that does not exist."""
        if not all(1 <= number <= len(self.rules) for number in self.holding):
            raise RecordingError(
                f"metadata 'holding' is {list(self.holding)}, but numbers of rules, from 1 to "
                f"{len(self.rules)}, are expected; {CURE}"
            )


@dataclass(frozen=True, kw_only=True)
class Rehearsal(Description):
    """A rehearsal: alternatives flown ahead, with their costs, of which the cheapest was taken.

    Parameters
    ----------
    names : tuple of str
        The ways, in words.
    costs_m_s : tuple of float
        What each would have cost.
    until_s : float
        Simulation time until which the choice tells what is done.
    from_s : float
        Simulation time of the choice.
    num_tried : int
        How many were compared, if these are the best of them alone.
    paths_m : tuple of float
        Positions, Hill axes, to which each way leads, evenly spaced in time from the choice on: those of the
        first way, then those of the others, as many of each.
    """

    names: tuple[str, ...]
    costs_m_s: tuple[float, ...]
    until_s: float
    from_s: float = 0.0
    num_tried: int | None = None
    paths_m: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        """Raise RecordingError unless each name has a cost, and a path if any has."""
        if not 0 < len(self.names) == len(self.costs_m_s):
            raise RecordingError(
                f"metadata 'costs_m_s' has {len(self.costs_m_s)} numbers for {len(self.names)} names, but "
                f"one for each name, and at least one, is expected; {CURE}"
            )
        if self.paths_m is not None and (not self.paths_m or len(self.paths_m) % (3 * len(self.names))):
            raise RecordingError(
                f"metadata 'paths_m' has {len(self.paths_m)} numbers for {len(self.names)} names, but as "
                f"many positions of three numbers for each are expected; {CURE}"
            )


#: before which MCAP has no times
UNIX_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


def epoch_of(episode: Mapping[str, str]) -> datetime | None:
    """Return the time, UTC, at which the simulation time is 0, by the metadata of an episode.

    Raises
    ------
    RecordingError
        If it is no date and time.
    """
    text = episode.get("epoch")
    if text is None:
        return None
    try:
        time = datetime.fromisoformat(text)
        return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)
    except (ValueError, OverflowError) as error:
        raise _unfit("epoch", text, "a date and time of UTC, as 2026-11-26T12:00:00, is") from error


def epoch_ns_of(episode: Mapping[str, str]) -> int:
    """Return what time stamps have at simulation time 0, ns; 0 without an epoch, or before 1970.

    Raises
    ------
    RecordingError
        If the epoch is no date and time.
    """
    epoch = epoch_of(episode)
    return max(0, (epoch - UNIX_EPOCH) // timedelta(microseconds=1) * 1000) if epoch else 0


def _decoded(key: str, text: str) -> Any:
    """Decode the value of a key."""
    if key in TEXTS:
        return text
    try:
        value = parse_json(text)
    except (ValueError, RecursionError) as error:
        raise _unfit(key, text, "a number or a list in JSON is") from error
    if key not in WORDS:
        return _numbers(key, text, value)
    if not isinstance(value, list):
        raise _unfit(key, text, "a JSON list of words is")
    return tuple(map(str, value))


def _numbers(key: str, text: str, value: Any) -> Any:
    """Return a finite number, or as many as a key has."""
    given = value if isinstance(value, list) else [value]
    kinds, most = ((int,), MOST_WHOLE) if key in WHOLE else ((int, float), MOST)
    are_numbers = all(type(number) in kinds and abs(number) <= most for number in given)
    has_all = len(given) == (NUMBERS_OF.get(key) or len(given))
    if not are_numbers or not has_all or isinstance(value, list) != (key in NUMBERS_OF):
        kind = "whole numbers" if key in WHOLE else "numbers"
        how_many = NUMBERS_OF.get(key, 1) or "any number of"
        raise _unfit(key, text, f"{how_many} finite {kind} are")
    return tuple(given) if key in NUMBERS_OF else value


def _unfit(key: str, text: str, expected: str) -> RecordingError:
    return RecordingError(f"metadata {key!r} is {text[:80]!r}, but {expected} expected; {CURE}")
