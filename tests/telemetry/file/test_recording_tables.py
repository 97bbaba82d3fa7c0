"""Tables for other tools: one number a cell, and units in the names."""

from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest

import telemetry
from telemetry import RecordingError
from telemetry.file import topics
from telemetry.file.tables import Format, export
from tests.telemetry import synthetic_flight
from tests.telemetry.full_disk import fill_disk
from tests.telemetry.synthetic_flight import SyntheticFlight


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_every_topic_is_a_file(
    short_flight: SyntheticFlight, short_file: Path, tmp_path: Path, file_format: Format
) -> None:
    paths = export(telemetry.read(short_file), tmp_path / "tables", file_format)
    assert {path.stem for path in paths} == {
        "tf",
        "deputy_pose",
        "chief_points",
        "deputy_state",
        "deputy_attitude",
        "deputy_control",
        "guidance",
        "mission",
        "log",
        "fis_f_x",
        "fis_f_y",
        "fis_f_z",
    }
    path = tmp_path / "tables" / f"deputy_state.{file_format}"
    table = pyarrow.csv.read_csv(path) if file_format == "csv" else pyarrow.parquet.read_table(path)
    assert table.column_names[:5] == [
        "time_s",
        "position_x_m",
        "position_y_m",
        "position_z_m",
        "velocity_x_m_s",
    ]
    position = np.column_stack([table[f"position_{axis}_m"].to_numpy() for axis in "xyz"])
    np.testing.assert_array_equal(position, short_flight.position_m)


def test_attitude_instants_are_rows(short_flight: SyntheticFlight, short_file: Path, tmp_path: Path) -> None:
    export(telemetry.read(short_file), tmp_path, "parquet")
    table = pyarrow.parquet.read_table(tmp_path / "deputy_attitude.parquet")
    np.testing.assert_array_equal(table["time_s"].to_numpy(), np.arange(1300.0))
    expected = short_flight.torque_n_m[:, :, 2].ravel().astype(np.float32)
    np.testing.assert_array_equal(table["torque_z_n_m"].to_numpy(), expected)


def test_points_are_rows_with_their_state_in_words(
    short_flight: SyntheticFlight, short_file: Path, tmp_path: Path
) -> None:
    export(telemetry.read(short_file), tmp_path, "parquet")
    table = pyarrow.parquet.read_table(tmp_path / "chief_points.parquet")
    assert table.num_rows == 131 * 99
    words = [("dark", "lit", "in_view_but_dark", "inspected")[state] for state in short_flight.states[130]]
    assert table["state"].to_pylist()[-99:] == words
    assert table["point"].to_pylist()[-99:] == list(range(99))


def test_fuzzy_columns_have_names_and_units(short_file: Path, tmp_path: Path) -> None:
    export(telemetry.read(short_file), tmp_path, "csv")
    names = pyarrow.csv.read_csv(tmp_path / "fis_f_y.csv").column_names
    assert names[:4] == ["time_s", "input_lambda_u_rad", "input_velocity_body_y_m_s", "firing_strength_1"]
    assert names[-2:] == ["firing_strength_25", "output_n"]


def test_a_folder_that_cannot_be_is_said(short_file: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RecordingError, match="choose another folder with -o"):
        export(telemetry.read(short_file), tmp_path / "file", "csv")


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_a_table_has_its_name_only_once_it_is_complete(
    short_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file_format: Format
) -> None:
    recording = telemetry.read(short_file, "/mission")
    (path,) = export(recording, tmp_path, file_format)
    before = path.read_bytes()
    fill_disk(monkeypatch, 1_000)
    with pytest.raises(RecordingError, match="No space left on device; make room"):
        export(recording, tmp_path, file_format)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("field", "unit"),
    [
        ("angular_velocity_rad_s", "rad/s"),
        ("velocity_m_s", "m/s"),
        ("torque_n_m", "N m"),
        ("eta_u_rad", "rad"),
        ("mass_kg", "kg"),
        ("num_candidates", ""),
    ],
)
def test_a_name_tells_its_unit(field: str, unit: str) -> None:
    assert topics.unit_of(field) == unit
    assert field.endswith(topics.suffix_of(unit))


def test_csv_has_no_cell_that_a_spreadsheet_runs(short_flight: SyntheticFlight, tmp_path: Path) -> None:
    told = {"metadata": synthetic_flight.metadata(short_flight), "attachments": {}}
    with telemetry.EpisodeWriter(tmp_path / "flight.mcap", **told) as writer:
        writer.log(0.0, "info", "=HYPERLINK(1)")
        writer.log(1.0, "info", "near the limit")
    export(telemetry.read(tmp_path / "flight.mcap"), tmp_path / "tables", "csv")
    table = pyarrow.csv.read_csv(tmp_path / "tables" / "log.csv")
    assert table["message"].to_pylist() == ["'=HYPERLINK(1)", "near the limit"]
