"""Tables for other tools: one number a cell, and units in the names."""

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file.tables import export
from tests.telemetry import synthetic_flight
from tests.telemetry.odd_files import fill_disk


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_every_topic_is_a_file(short_flight, short_file, tmp_path, file_format):
    recording = telemetry.read(short_file)
    paths = export(recording, tmp_path / "tables", file_format)
    names = [name.removeprefix("/") for name, topic in recording.topics.items() if len(topic)]
    assert {path.stem for path in paths} == {name.replace("/", "_") for name in names}
    path = tmp_path / "tables" / f"deputy_state.{file_format}"
    table = pyarrow.csv.read_csv(path) if file_format == "csv" else pyarrow.parquet.read_table(path)
    assert table.column_names[:2] == ["time_s", "position_x_m"]
    assert table.column_names[4] == "velocity_x_m_s"
    position = np.column_stack([table[f"position_{axis}_m"].to_numpy() for axis in "xyz"])
    np.testing.assert_array_equal(position, short_flight.position_m)


def test_attitude_instants_and_points_are_rows_with_units_and_words(short_flight, short_file, tmp_path):
    export(telemetry.read(short_file), tmp_path, "parquet")
    table = pyarrow.parquet.read_table(tmp_path / "deputy_attitude.parquet")
    np.testing.assert_array_equal(table["time_s"].to_numpy(), np.arange(1300.0))
    expected = short_flight.torque_n_m[:, :, 2].ravel().astype(np.float32)
    np.testing.assert_array_equal(table["torque_z_n_m"].to_numpy(), expected)
    assert units(table)["torque_x_n_m"] == "N m"
    table = pyarrow.parquet.read_table(tmp_path / "chief_points.parquet")
    assert table.num_rows == 131 * 99
    words = [("dark", "lit", "in_view_but_dark", "inspected")[state] for state in short_flight.states[130]]
    assert table["state"].to_pylist()[-99:] == words
    assert table["point"].to_pylist()[-99:] == list(range(99))


def test_a_folder_that_cannot_be_is_said(short_file, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RecordingError, match="choose another folder with -o"):
        export(telemetry.read(short_file), tmp_path / "file", "csv")


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_a_table_has_its_name_only_once_it_is_complete(short_file, tmp_path, monkeypatch, file_format):
    recording = telemetry.read(short_file, "/mission")
    (path,) = export(recording, tmp_path, file_format)
    before = path.read_bytes()
    fill_disk(monkeypatch, 1_000)
    with pytest.raises(RecordingError, match="No space left on device; make room"):
        export(recording, tmp_path, file_format)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == before


def test_csv_has_no_cell_that_a_spreadsheet_runs(short_flight, tmp_path):
    metadata = synthetic_flight.metadata(short_flight)
    with EpisodeWriter(tmp_path / "flight.mcap", metadata=metadata, attachments={}) as writer:
        writer.log(0.0, "info", "=HYPERLINK(1)")
        writer.log(1.0, "info", "near the limit")
        writer.log(2.0, "info", " \t@SUM(1)")
    export(telemetry.read(tmp_path / "flight.mcap"), tmp_path / "tables", "csv")
    table = pyarrow.csv.read_csv(tmp_path / "tables" / "log.csv")
    assert table["message"].to_pylist() == ["'=HYPERLINK(1)", "near the limit", "' \t@SUM(1)"]


def units(table: pa.Table) -> dict[str, str]:
    return {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}


def test_a_topic_is_a_table_of_its_columns(short_file):
    table = telemetry.read(short_file)["/deputy/state"].to_arrow()
    assert table.schema.field("position_m").type == pa.list_(pa.float64(), 3)
    assert table.schema.field("quaternion").type == pa.list_(pa.float64(), 4)
    assert table.schema.metadata == {b"topic": b"/deputy/state", b"schema": b"inspection.DeputyState"}
    expected_units = {"time_s": "s", "position_m": "m", "velocity_m_s": "m/s", "quaternion": ""}
    assert units(table) == expected_units | {"angular_velocity_rad_s": "rad/s"}


@pytest.mark.slow
def test_every_topic_is_a_table_whatever_its_shape(short_file, tmp_path):
    recording = telemetry.read(short_file)
    # whoever takes streams of Arrow takes a topic
    assert pa.table(recording["/mission"]).equals(recording["/mission"].to_arrow())
    for topic in recording.topics.values():
        table = topic.to_arrow()
        assert table.column_names == ["time_s", *topic.columns]
        np.testing.assert_array_equal(table["time_s"].to_numpy(), topic.time_s)
        for field, values in topic.columns.items():
            np.testing.assert_equal(table[field].to_pylist(), values.tolist(), f"{topic.topic} {field}")
    with EpisodeWriter(tmp_path / "bare.mcap", metadata={"fis.force_x": {}}, attachments={}):
        pass
    bare = telemetry.read(tmp_path / "bare.mcap").topics
    assert all(topic.to_arrow().num_rows == len(topic) for topic in bare.values())
    assert len(bare["/deputy/attitude"]) == len(bare["/chief/points"]) == len(bare["/fis/force_x"]) == 0


def test_a_flat_table_has_one_number_a_cell_and_its_unit(short_flight, short_file):
    recording = telemetry.read(short_file)
    state = telemetry.flat_table(recording, "/deputy/state")
    assert all(pa.types.is_floating(field.type) for field in state.schema)
    assert units(state)["velocity_y_m_s"] == "m/s"
    np.testing.assert_array_equal(state["velocity_y_m_s"].to_numpy(), short_flight.velocity_m_s[:, 1])
    inference = units(telemetry.flat_table(recording, "/fis/force_y"))
    assert inference["input_lambda_u_rad"] == "rad"
    assert inference["input_velocity_body_y_m_s"] == "m/s"
    assert (inference["firing_strength_7"], inference["output_n"]) == ("", "N")
    with pytest.raises(KeyError, match="no topic '/fis/force_w'"):
        telemetry.flat_table(recording, "/fis/force_w")


def test_a_unit_that_no_suffix_tells_is_kept(tmp_path):
    metadata = synthetic_flight.metadata(synthetic_flight.fly(2))
    metadata["fis.force_x"]["input_units"] = '["furlong", ""]'
    with EpisodeWriter(tmp_path / "odd.mcap", metadata=metadata, attachments={}) as writer:
        writer.record("/fis/force_x", 0.0, inputs=[1.0, 2.0], firing_strengths=[0.5] * 25, output_n=0.1)
    kept = units(telemetry.flat_table(telemetry.read(tmp_path / "odd.mcap"), "/fis/force_x"))
    assert (kept["input_distance"], kept["input_velocity_body_x"]) == ("furlong", "")
