"""Tables of forces, and controllers by any of their ways into a run."""

import logging

import numpy as np
import pytest

from pipeline.controllers.played import read_played
from pipeline.controllers.source import load
from pipeline.flight.control.controller import ControllerError
from pipeline.settings.schema import experiment_from
from tests.pipeline.command_line.cases import plain_config

HEADER = "time_s,force_x_n,force_y_n,force_z_n\n"
MISSION = experiment_from(plain_config()).mission


def test_coast_has_no_force():
    assert load({"kind": "coast"}, MISSION).plan.shape == (0, 3)


def test_a_table_of_forces(tmp_path, caplog):
    path = tmp_path / "plan.csv"
    path.write_text(HEADER + "0,0.1,-0.2,0.3\n10,0,1.5,-2\n20.0,0,0,0\n", encoding="utf-8-sig")
    with caplog.at_level(logging.WARNING, logger="pipeline"):
        controller = load({"kind": "open_loop", "path": str(path)}, MISSION)
    np.testing.assert_array_equal(controller.plan, [[0.1, -0.2, 0.3], [0, 1.5, -2], [0, 0, 0]])
    assert controller.name == "plan"
    assert "2 components beyond 1 N are clipped" in caplog.text


def test_a_table_without_rows_is_a_flight_without_force(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text(HEADER)
    assert read_played(path, MISSION).plan.shape == (0, 3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "does not begin with the header time_s,force_x_n"),
        ("t,x,y,z\n0,0,0,0\n", "does not begin with the header"),
        (
            HEADER + "0,0,0,0\n20,0,0,0\n",
            "data row 2 has time_s 20, expected 10; give one row for each control",
        ),
        (HEADER + "5,0,0,0\n", "data row 1 has time_s 5, expected 0"),
        (HEADER + "0,0,0\n", "line 2 is '0,0,0'; write 4 finite numbers"),
        (HEADER + "0,0,zero,0\n", "line 2 is '0,0,zero,0'; write 4 finite numbers"),
        (HEADER + "0,0,nan,0\n", "write 4 finite numbers"),
        (
            HEADER + "".join(f"{10 * k},0,0,0\n" for k in range(361)),
            "has 361 rows, the flight 360 control periods",
        ),
    ],
)
def test_tables_that_cannot_be_flown(content, message, tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text(content)
    with pytest.raises(ControllerError, match=message):
        read_played(path, MISSION)


def test_a_table_that_is_no_text(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ControllerError, match="cannot be read"):
        read_played(path, MISSION)
