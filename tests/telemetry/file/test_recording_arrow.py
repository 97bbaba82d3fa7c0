"""Recordings as Arrow tables: types, shapes and units arrive, and so they do in data frames."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

import telemetry
from telemetry import EpisodeWriter
from telemetry.file.tables import export
from tests.telemetry import synthetic_flight
from tests.telemetry.synthetic_flight import SyntheticFlight


def units(table: pa.Table) -> dict[str, str]:
    return {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}


def test_a_topic_is_a_table_of_its_columns(short_flight: SyntheticFlight, short_file: Path) -> None:
    table = telemetry.read(short_file)["/deputy/state"].to_arrow()
    assert table.schema.field("position_m").type == pa.list_(pa.float64(), 3)
    assert table.schema.field("quaternion").type == pa.list_(pa.float64(), 4)
    assert table.schema.metadata == {b"topic": b"/deputy/state", b"schema": b"inspection.DeputyState"}
    assert units(table) == {
        "time_s": "s",
        "position_m": "m",
        "velocity_m_s": "m/s",
        "quaternion": "",
        "angular_velocity_rad_s": "rad/s",
    }
    np.testing.assert_array_equal(table["time_s"].to_numpy(), short_flight.time_s)
    assert table["position_m"].to_pylist() == short_flight.position_m.tolist()


def test_every_topic_is_a_table_whatever_its_shape(short_file: Path, tmp_path: Path) -> None:
    recording = telemetry.read(short_file)
    for topic in recording.topics.values():
        table = topic.to_arrow()
        assert table.num_rows == len(topic)
        assert table.column_names == ["time_s", *topic.columns]
        for field, values in topic.columns.items():
            np.testing.assert_equal(table[field].to_pylist(), values.tolist(), f"{topic.topic} {field}")
    with EpisodeWriter(tmp_path / "bare.mcap", metadata={"fis.f_x": {}}, attachments={}):
        pass
    for topic in telemetry.read(tmp_path / "bare.mcap").topics.values():
        assert topic.to_arrow().num_rows == len(topic)


def test_whoever_takes_arrow_streams_takes_a_topic(short_file: Path) -> None:
    mission = telemetry.read(short_file)["/mission"]
    assert pa.table(mission).equals(mission.to_arrow())


def test_a_flat_table_has_one_number_a_cell_and_its_unit(
    short_flight: SyntheticFlight, short_file: Path
) -> None:
    recording = telemetry.read(short_file)
    state = telemetry.flat_table(recording, "/deputy/state")
    assert all(pa.types.is_floating(field.type) for field in state.schema)
    assert units(state)["velocity_y_m_s"] == "m/s"
    np.testing.assert_array_equal(state["velocity_y_m_s"].to_numpy(), short_flight.velocity_m_s[:, 1])
    inference = units(telemetry.flat_table(recording, "/fis/f_y"))
    assert inference["input_lambda_u_rad"] == "rad"
    assert inference["input_velocity_body_y_m_s"] == "m/s"
    assert (inference["firing_strength_7"], inference["output_n"]) == ("", "N")
    with pytest.raises(KeyError, match="no topic '/fis/f_w'"):
        telemetry.flat_table(recording, "/fis/f_w")


def test_a_unit_that_no_suffix_tells_is_kept(tmp_path: Path) -> None:
    metadata = synthetic_flight.metadata(synthetic_flight.fly(2))
    metadata["fis.f_x"]["input_units"] = '["furlong", ""]'
    with EpisodeWriter(tmp_path / "odd.mcap", metadata=metadata, attachments={}) as writer:
        writer.fis(0.0, "f_x", [1.0, 2.0], [0.5] * 25, 0.1)
    told = units(telemetry.flat_table(telemetry.read(tmp_path / "odd.mcap"), "/fis/f_x"))
    assert (told["input_distance"], told["input_velocity_body_x"]) == ("furlong", "")


def test_parquet_files_carry_the_units(short_file: Path, tmp_path: Path) -> None:
    export(telemetry.read(short_file), tmp_path, "parquet")
    table = pyarrow.parquet.read_table(tmp_path / "deputy_attitude.parquet")
    assert units(table)["torque_x_n_m"] == "N m"
