"""Logged data as tables: each command reads their columns by the names of inputs."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from numpy.typing import NDArray
from pyarrow import parquet

from fis_tools.__main__ import main
from fis_tools.analysis import tables
from fis_tools.analysis.domain import as_mapping, box_of
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.findings.explanation import shares
from fis_tools.formats.serialize import load
from tests.places import PROJECT

TIPPER = PROJECT / "docs" / "examples" / "tipper.fis"
#: in the system's order, service and food
ROWS = np.array([[1.0, 9.0], [4.0, 8.0], [9.5, 2.0]])


def write(path: Path, rows: NDArray[np.float64]) -> Path:
    """Write columns in another order than the inputs', a time, and words that nobody asks for."""
    times = [10.0 * row for row in range(len(rows))]
    if path.suffix == ".parquet":
        columns = {"food": rows[:, 1], "guest": ["a, b"] * len(rows), "time_s": times, "service": rows[:, 0]}
        parquet.write_table(pa.table(columns), path)
        return path
    lines = [f'{food},"a, b",{time},{service}' for time, (service, food) in zip(times, rows, strict=True)]
    path.write_text("\ufefffood,guest,time_s, service\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def told(capsys: pytest.CaptureFixture[str], *words: object, status: int = 0) -> str:
    assert main([str(word) for word in words]) == status, capsys.readouterr().err
    captured = capsys.readouterr()
    return captured.out if status == 0 else captured.err


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_columns_go_by_their_names(ending: str, tmp_path: Path) -> None:
    values, time_s = tables.read(write(tmp_path / f"evening.{ending}", ROWS), ["service", "food"])
    assert np.array_equal(values, ROWS)
    assert np.array_equal(time_s, [0.0, 10.0, 20.0])


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_column_may_name_its_unit_and_no_other(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"heat.{ending}"
    if ending == "csv":
        path.write_text("temperature (°C)\n21.5\n", encoding="utf-8")
    else:
        parquet.write_table(pa.table({"temperature (°C)": [21.5]}), path)
    values, _ = tables.read(path, ["temperature"], {"temperature": "temperature (°C)"})
    assert np.array_equal(values, [[21.5]])
    with pytest.raises(ControllerFileError, match="it has no 'temperature'"):
        tables.read(path, ["temperature"], {"temperature": "temperature (K)"})


def test_every_command_that_takes_flights_takes_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logged = write(tmp_path / "evening.csv", ROWS)
    system = load(TIPPER).systems[0]
    strengths = np.array([infer(system, row).firing_strengths for row in ROWS])

    printed = told(capsys, "firing", logged, "--controller", TIPPER)
    assert "tipper: 3 inferences; 0 of 3 rules never fire" in printed
    for rule, strength in enumerate(strengths.T, start=1):
        (line,) = (line for line in printed.splitlines() if f" {rule}. If" in line)
        assert line.split()[0] == f"{100 * np.mean(strength >= 0.05):.1f}"
        assert line.split()[4:6] == [f"{strength.mean():.2f}", f"{strength.max():.2f}"]

    assert "3 logged inferences" in told(capsys, "audit", TIPPER, "--data", logged)
    expected = shares(system, ROWS)
    assert told(capsys, "explain", TIPPER, "--flights", logged) == expected.text()
    at_an_instant = told(capsys, "explain", TIPPER, "--flights", logged, "--time", "10")
    assert at_an_instant == told(capsys, "explain", TIPPER, "--inputs", "service=4,food=8")
    assert "along the logs" in " ".join(told(capsys, "simplify", TIPPER, "--flights", logged).split())
    doubled = (tmp_path / "other.fis", TIPPER.read_text(encoding="utf-8").replace("[1.5 0]", "[3 0]"))
    doubled[0].write_text(doubled[1], encoding="utf-8")
    assert "the flights, 3 inputs" in told(capsys, "diff", TIPPER, doubled[0], "--flights", logged)
    assert told(capsys, "show", TIPPER, "--by", "importance", "--flights", logged)
    told(capsys, "plot", TIPPER, "--flights", logged, "--only", "firing", "-o", tmp_path)
    assert (tmp_path / "tipper-firing.png").stat().st_size > 10_000
    told(capsys, "surface", TIPPER, "--flights", logged, "-o", tmp_path / "surface.png")
    met = tmp_path / "domain.json"
    met.write_text(json.dumps(as_mapping([box_of(system, ROWS[:2])])), encoding="utf-8")
    assert main(["domain", str(met), str(logged)]) == 1
    assert "at 20 s: tipper senses food = 2, outside 8 to 9" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("food", "fod"),
            "by the names of inputs (service, food), and it has no 'food'; did you mean 'fod'?",
        ),
        (("guest", "food"), "and it has two 'food'"),
        (("8.0,", "eight,"), "row 3: eight, a, b, 10.0, 4.0 does not hold a number"),
        (("8.0,", "nan,"), "food is nan in its sample 2, and missing or infinite in 1 of 3"),
        (("10.0,", "30.0,"), "time_s runs backwards"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(
    change: tuple[str, str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "evening.csv", ROWS)
    path.write_text(path.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    assert words in told(capsys, "audit", TIPPER, "--flights", path, status=2)


def test_a_table_without_times_goes_by_its_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rows.csv"
    path.write_text("service,food\n1,9\n4,8\n", encoding="utf-8")
    by_row = told(capsys, "explain", TIPPER, "--flights", path, "--time", "2")
    assert by_row == told(capsys, "explain", TIPPER, "--inputs", "service=4,food=8")
    assert "add --controller" in told(capsys, "firing", path, status=2)
