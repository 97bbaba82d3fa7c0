"""Flat tables of a recording, for tools that read CSV or Parquet: one number per cell, units in the names."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from plain_files.file_access import replacing
from telemetry.file import RecordingError, explained, topics
from telemetry.file.columns import arrow_table
from telemetry.file.recording import Recording, TopicColumns

if TYPE_CHECKING:
    import pyarrow as pa

Table = dict[str, NDArray[np.generic]]
Format = Literal["csv", "parquet"]

_AXES: Final = ("x", "y", "z", "w")


def export(recording: Recording, folder: Path, file_format: Format) -> list[Path]:
    """Write each topic with messages to a file of its own.

    Parameters
    ----------
    recording : Recording
    folder : Path
        Created if missing; files of the same names are replaced when the new ones are complete.
    file_format : str
        ``csv`` or ``parquet``.

    Returns
    -------
    list of Path
        The files, such as ``deputy_state.csv``.

    Raises
    ------
    RecordingError
        If the recording holds no messages of a flight, or the folder cannot be written to.
    """
    if not any(map(len, recording.topics.values())):
        raise RecordingError(
            f"{recording.path} holds no messages of a flight, so there is no table to write; "
            "give a recording that telemetry.EpisodeWriter wrote"
        )
    # pyarrow takes a tenth of a second to import; only exports need it
    import pyarrow.csv  # noqa: PLC0415
    import pyarrow.parquet  # noqa: PLC0415

    paths = []
    with explained(f"{folder} cannot be written to", "make room, or choose another folder with -o"):
        folder.mkdir(parents=True, exist_ok=True)
        for name, topic in recording.topics.items():
            if not len(topic):
                continue
            path = folder / f"{name.strip('/').replace('/', '_')}.{file_format}"
            table = flat_table(recording, name)
            with replacing(path) as stream:
                if file_format == "csv":
                    pyarrow.csv.write_csv(_without_formulas(table), stream)
                else:
                    pyarrow.parquet.write_table(table, stream)
            paths.append(path)
    return paths


def _without_formulas(table: "pa.Table") -> "pa.Table":
    """Escape texts that a spreadsheet would run as formulas."""
    import pyarrow as pa  # noqa: PLC0415 - as above
    import pyarrow.compute  # noqa: PLC0415

    for index, field in enumerate(table.schema):
        if pa.types.is_string(field.type):
            column = pa.compute.replace_substring_regex(table.column(index), r"\A(\s*[=+\-@]|[\t\r])", r"'\1")
            table = table.set_column(index, field, column)
    return table


def flat_table(recording: Recording, name: str) -> "pa.Table":
    """Split the columns of a topic into columns of numbers, for data frames.

    A vector becomes a column per axis, the unit last in its name (``position_x_m``). Attitude steps and
    inspection points become rows of their own.

    Parameters
    ----------
    recording : Recording
    name : str
        Of the topic.

    Returns
    -------
    pyarrow.Table
        `time_s` first; each field's metadata holds its ``unit``. ``to_pandas()`` converts it to a data frame.
    """
    topic = recording[name]
    columns = _flat_columns(recording, topic)
    units = {column: topic.units.get(column) or topics.unit_of(column) for column in columns}
    if name.startswith(topics.FIS_PREFIX):
        names = _component_names(recording, topic, "inputs") or ()
        words = recording.fis_description(name.removeprefix(topics.FIS_PREFIX))
        units |= dict(zip(names, words.input_units, strict=True))
    return arrow_table(columns, units, {"topic": name, "schema": topic.schema})


def _flat_columns(recording: Recording, topic: TopicColumns) -> Table:
    """Return the columns of a topic as a flat table."""
    if topic.topic == topics.DEPUTY_ATTITUDE:
        return _attitude_table(topic)
    if topic.topic in (topics.CHIEF_POINTS, topics.CHIEF_PULLS):
        return _point_table(topic)
    table: Table = {"time_s": topic.time_s}
    for field, values in topic.columns.items():
        table.update(_spread(field, values, _component_names(recording, topic, field)))
    return table


def _attitude_table(topic: TopicColumns) -> Table:
    """Return attitudes as a table with a row for each instant."""
    offsets = topic["time_offset_s"].astype(np.float64)
    table: Table = {"time_s": (topic.time_s[:, None] + offsets).ravel()}
    for field in ("quaternion", "angular_velocity_rad_s", "torque_n_m"):
        values = topic[field]
        table.update(_spread(field, values.reshape(-1, values.shape[-1]), None))
    return table


def _point_table(topic: TopicColumns) -> Table:
    """Return the chief's points as a table with a row for each point at each time."""
    num_samples, num_points = topic["position_m"].shape[:2]
    table = {
        "time_s": np.repeat(topic.time_s, num_points),
        "point": np.tile(np.arange(num_points), num_samples),
        **_spread("position_m", topic["position_m"].reshape(-1, 3), None),
    }
    if "state" not in topic.columns:
        return table | {name: values.ravel() for name, values in topic.columns.items() if values.ndim == 2}
    words = np.array([state.name.lower() for state in topics.PointState] + ["unknown"])
    return table | {"state": words[np.minimum(topic["state"].astype(np.int64), len(words) - 1).ravel()]}


def _component_names(recording: Recording, topic: TopicColumns, field: str) -> Sequence[str] | None:
    """Return names for the components of a field that has some of its own; None for others."""
    width = topic[field].shape[1] if topic[field].ndim > 1 else 0
    if field == "inputs" and topic.topic.startswith(topics.FIS_PREFIX):
        words = recording.fis_description(topic.topic.removeprefix(topics.FIS_PREFIX))
        pairs = zip(words.input_names, words.input_units, strict=True)
        return [f"input_{name}{topics.suffix_of(unit)}" for name, unit in pairs]
    if field == "firing_strengths":
        return [f"firing_strength_{rule}" for rule in range(1, width + 1)]
    if field == "inspected_mask":
        return [f"inspected_{point}" for point in range(width)]
    return None


def _spread(field: str, values: NDArray[np.generic], names: Sequence[str] | None) -> Table:
    """Return a field as columns, one for each component."""
    if values.ndim == 1:
        return {field: values}
    if names is None:
        stem, suffix = topics.split_unit(field)
        names = [f"{stem}_{axis}{suffix}" for axis in _AXES[: values.shape[1]]]
    return {name: np.ascontiguousarray(values[:, index]) for index, name in enumerate(names)}
