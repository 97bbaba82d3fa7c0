"""The words of a recording: what metadata `episode` and `fis.<name>` hold, and how they are spelled.

Metadata values are strings. Numbers and lists are spelled as JSON, words stand as they are, and a key whose
value is not known is left out.
"""

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final

from telemetry.file.errors import RecordingError

JsonValue = float | str | list[float] | list[str]

#: under which a record in a file carries the checksum of its other entries: MCAP has none for metadata
CHECKSUM_KEY: Final = "crc32"


def sealed(name: str, entries: Mapping[str, str]) -> dict[str, str]:
    """Add the checksum with which a metadata record stands in a file."""
    return {**entries, CHECKSUM_KEY: _checksum(name, entries)}


def unsealed(name: str, entries: Mapping[str, str]) -> dict[str, str]:
    """Take the checksum off a metadata record; one that carries none, of another writer, stays as it is.

    Raises
    ------
    ValueError
        If the entries are not those that were sealed.
    """
    found = {key: value for key, value in entries.items() if key != CHECKSUM_KEY}
    if CHECKSUM_KEY in entries and entries[CHECKSUM_KEY] != _checksum(name, found):
        raise ValueError(f"metadata {name} does not agree with its checksum")
    return found


def _checksum(name: str, entries: Mapping[str, str]) -> str:
    return str(zlib.crc32(json.dumps([name, sorted(entries.items())]).encode()))


@dataclass(frozen=True, kw_only=True)
class EpisodeDescription:
    """What an episode was, and what a replay needs to draw it; None where it is not known.

    Parameters
    ----------
    scenario_id, product_version, config_hash : str
        Which start it was, of which version, under which configuration.
    seed : int
    position_m, velocity_m_s : tuple of 3 floats
        The start, Hill axes.
    sun_angle_rad : float
        At the start.
    min_distance_m, max_distance_m : float
        Between which the deputy has to stay.
    max_force_n, max_torque_n_m : float
        Of each axis.
    half_angle_rad : float
        Of the camera's field of view.
    boresight : tuple of 3 floats
        Unit vector, body axes.
    inspection_threshold_percent : float
        From which inspection rate on the flight is a success.
    """

    scenario_id: str | None = None
    seed: int | None = None
    position_m: tuple[float, ...] | None = None
    velocity_m_s: tuple[float, ...] | None = None
    sun_angle_rad: float | None = None
    product_version: str | None = None
    config_hash: str | None = None
    min_distance_m: float | None = None
    max_distance_m: float | None = None
    max_force_n: float | None = None
    max_torque_n_m: float | None = None
    half_angle_rad: float | None = None
    boresight: tuple[float, ...] | None = None
    inspection_threshold_percent: float | None = None

    def to_metadata(self) -> dict[str, str]:
        """Spell the description as metadata, without the keys whose value is None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            key: value if isinstance(value, str) else json.dumps(value)
            for key, value in values.items()
            if value is not None
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> "EpisodeDescription":
        """Read the description back; unknown keys are ignored.

        Raises
        ------
        RecordingError
            If a value is not spelled as `to_metadata` spells it.
        """
        words = ("scenario_id", "product_version", "config_hash")
        known = {field.name for field in fields(cls)} & metadata.keys()
        values = {key: metadata[key] if key in words else _from_json(key, metadata[key]) for key in known}
        return cls(**{key: tuple(v) if isinstance(v, list) else v for key, v in values.items()})  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class FisDescription:
    """What the numbers of one fuzzy system's topic mean.

    Parameters
    ----------
    input_names, input_units : tuple of str
        In the order of the field `inputs`; an empty unit where there is none.
    output_name, output_unit : str
    rules : tuple of str
        In words, in the order of the field `firing_strengths`.
    """

    input_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_name: str
    output_unit: str
    rules: tuple[str, ...]

    def to_metadata(self) -> dict[str, str]:
        """Spell the description as metadata."""
        return {
            "input_names": json.dumps(self.input_names, ensure_ascii=False),
            "input_units": json.dumps(self.input_units, ensure_ascii=False),
            "output_name": self.output_name,
            "output_unit": self.output_unit,
            "rules": json.dumps(self.rules, ensure_ascii=False),
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> "FisDescription":
        """Read the description back.

        Raises
        ------
        RecordingError
            If a key is missing or a value is not spelled as `to_metadata` spells it.
        """
        missing = {field.name for field in fields(cls)} - metadata.keys()
        if missing:
            raise RecordingError(
                f"the metadata of a fuzzy system lacks {', '.join(sorted(missing))}; "
                "write it with telemetry.file.metadata.FisDescription"
            )
        return cls(
            input_names=_words_from_json("input_names", metadata["input_names"]),
            input_units=_words_from_json("input_units", metadata["input_units"]),
            output_name=metadata["output_name"],
            output_unit=metadata["output_unit"],
            rules=_words_from_json("rules", metadata["rules"]),
        )


def _from_json(key: str, text: str) -> JsonValue:
    try:
        value: JsonValue = json.loads(text)
    except ValueError as error:
        raise RecordingError(
            f"metadata {key!r} is {text!r}, but a number or a list in JSON is expected; "
            "write it with telemetry.file.metadata"
        ) from error
    return value


def _words_from_json(key: str, text: str) -> tuple[str, ...]:
    value = _from_json(key, text)
    if not isinstance(value, list):
        raise RecordingError(f"metadata {key!r} is {text!r}, but a JSON list of words is expected")
    return tuple(str(word) for word in value)
