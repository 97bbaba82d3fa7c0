"""The command line: what each command prints, and that mistakes end in one sentence."""

import csv
import io
import json
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import pytest

from fis_tools.analysis.domain import as_mapping, box_of
from fis_tools.analysis.flights import inputs_along
from fis_tools.document import text
from fis_tools.engines.inference import infer
from fis_tools.findings.audit import Thresholds
from fis_tools.findings.explanation import explain, shares
from fis_tools.formats.serialize import dump_json, load, loads
from fis_tools.model import FuzzyController
from fis_tools.words.text import outline
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.sample_controllers import FORCE_X, PAPER_LIKE


@pytest.fixture
def flight(tmp_path):
    return log_flight(tmp_path / "flight.mcap", PAPER_LIKE)


def test_show_reads_a_file_a_run_and_a_flight(tmp_path, paper, run, flight):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "champion.json").write_text(dump_json(PAPER_LIKE), encoding="utf-8")
    expected = text.write(outline(PAPER_LIKE))
    for source in (paper, tmp_path / "run", flight):
        assert run("show", source) == (0, expected, "")


def test_plot_writes_pictures(tmp_path, paper, run):
    folder = tmp_path / "new" / "figures"
    status, printed, _ = run("plot", paper, "-o", folder, "--format", "png", "--system", "force_x")
    assert status == 0
    names = [f"force_x-{name}.png" for name in ("memberships", "rules", "surface", "surface-3d")]
    assert printed.split() == [str(folder / name) for name in names]
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in names)


@pytest.mark.slow
def test_plot_draws_what_is_asked_for(tmp_path, paper, run, flight):
    inputs = "distance=80,velocity_body_x=0.05"

    def drawn(*words):
        status, printed, _ = run("plot", *words, "-o", tmp_path, "--system", "force_x")
        assert status == 0
        return [Path(line).stem.removeprefix("force_x-") for line in printed.splitlines()]

    assert drawn(paper, "--only", "inference", "--inputs", inputs) == ["inference"]
    assert drawn(paper, "--only", "rules", "--only", "memberships") == ["memberships", "rules"]
    assert drawn(flight, "--time", "15", "--only", "inference", "--only", "firing") == ["inference", "firing"]
    assert drawn(flight)[-1] == "firing"


def test_a_dark_picture_is_dark_and_says_the_inputs(tmp_path, paper, run):
    words = ("plot", paper, "--only", "inference", "--inputs", "distance=80,velocity_body_x=0.05")
    assert run(*words, "--theme", "dark", "--format", "svg", "-o", tmp_path)[0] == 0
    content = (tmp_path / "force_x-inference.svg").read_text(encoding="utf-8")
    assert content.startswith("<?xml")
    assert "#14181d" in content
    assert "velocity_body_x = 0.05 m/s" in content.replace("\xa0", " ")


def test_pictures_whose_names_come_to_the_same_do_not_replace_one_another(tmp_path, saved, run):
    one, other = (replace(FORCE_X, name=name) for name in ("a/b", "A b"))
    path = saved(FuzzyController("alike", (one, other)))
    printed = run("plot", path, "--only", "rules", "-o", tmp_path / "out")[1]
    assert [Path(line).name for line in printed.splitlines()] == ["a_b-rules.png", "A_b-rules-2.png"]
    assert len(list((tmp_path / "out").iterdir())) == 2


def test_surface_prints_numbers_or_draws(tmp_path, paper, run, flight):
    words = ("surface", paper, "--system", "force_x", "--points", "3")
    status, printed, _ = run(*words)
    assert status == 0
    header, *rows = csv.reader(io.StringIO(printed))
    assert header == ["distance", "velocity_body_x", "force_x"]
    assert len(rows) == 9
    for row in (rows[1], rows[5]):
        x, y, value = map(float, row)
        assert value == pytest.approx(infer(FORCE_X, [x, y]).values[0], abs=1e-13)  # type: ignore[arg-type]
    assert run(*words, "-o", tmp_path / "surface.png")[0] == 0
    assert (tmp_path / "surface.png").read_bytes().startswith(b"\x89PNG")
    picture = tmp_path / "space.svg"
    assert run(*words, "--3d", "--theme", "dark", "--flights", flight, "-o", picture)[0] == 0
    assert "force_x (N)" in picture.read_text(encoding="utf-8")


def test_export_writes_every_form(tmp_path, paper, run):
    told = run("export", paper, "--format", "markdown")[1]
    assert told == text.write_markdown(outline(PAPER_LIKE))
    for form in ("json", "yaml"):
        path = tmp_path / f"copy.{form}"
        assert run("export", paper, "--format", form, "-o", path) == (0, "", "")
        assert load(path) == PAPER_LIKE
    for form in ("csv", "text"):
        assert "very near" in run("export", paper, "--format", form)[1]
    for form, start in (("html", "<!"), ("latex", "%"), ("c", "/*")):
        assert run("export", paper, "--format", form)[1].startswith(start)


def test_explain_tells_each_system_whose_inputs_are_given(paper, run):
    words = ("explain", paper, "--inputs", "distance=80, velocity_body_x=5e-2")
    status, told, _ = run(*words)
    assert status == 0
    assert told == explain(FORCE_X, {"distance": 80.0, "velocity_body_x": 0.05}).text()
    _, crossing, _ = run(*words, "--crossing", "-0.02", "--all")
    assert "What would take force_x " in crossing
    assert len(crossing.splitlines()) > len(told.splitlines())
    _, printed, _ = run(*words, "--json")
    assert json.loads(printed)["explanations"][0]["inputs"] == {"distance": 80.0, "velocity_body_x": 0.05}


def test_explain_tells_the_share_of_each_rule_over_flights(tmp_path, paper, run):
    flights = [log_flight(tmp_path / f"{seed}.mcap", PAPER_LIKE, seed=seed) for seed in (1, 2)]
    expected = shares(FORCE_X, inputs_along(flights)["force_x"])
    status, told, _ = run("explain", paper, "--flights", *flights, "--system", "force_x")
    assert (status, told) == (0, expected.text())
    _, alone, _ = run("explain", flights[0], "--all")
    assert "force_x over 4 inferences: " in alone
    _, printed, _ = run("explain", flights[0], "--json")
    assert [one["samples"] for one in json.loads(printed)["shares"]] == [4, 4]
    silent = log_flight(tmp_path / "silent.mcap", PAPER_LIKE, num_samples=0)
    assert "never fired anything" in run("explain", silent)[1]


def test_explain_takes_the_inputs_of_a_logged_flight(tmp_path, run, flight):
    at = {
        time: run("explain", flight, "--time", time, "--system", "force_z") for time in (10, 15, 20, 30, 40)
    }
    assert at[10][0] == 0
    assert at[10] == at[15] != at[20]
    assert at[15] != at[30] == at[40]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["show", "missing.yaml"], "cannot be read (no such file or directory)"),
        (["show", "missing"], "no controller of that name; give the path of a controller file"),
        (["show", "FOLDER"], "folder without champion.json"),
        (["show", "missing.mcap"], "cannot be opened"),
        (["show", "PAPER", "--system", "force"], "did you mean 'force_"),
        (["surface", "PAPER"], "several systems, force_x, force_z; add --system"),
        (["surface", "PAPER", "--system", "force_x", "--x", "distanse"], "did you mean 'distance'?"),
        (["surface", "PAPER", "--system", "force_x", "--points", "1"], "Give a whole number from 2 to 1000"),
        (["surface", "PAPER", "--system", "force_x", "--fixed", "a=1"], "no input 'a'"),
        (["surface", "PAPER", "--system", "force_z", "--fixed", "eta_u=inf"], "finite"),
        (["surface", "PAPER", "--system", "force_x", "--3d"], "--3d and --flights are for pictures; add -o"),
        (["surface", "PAPER", "--system", "force_x", "-o", "x.jpg"], "ends in none of .png, .svg, .pdf,"),
        (["surface", "PAPER", "--system", "force_x", "--fixed", "a=1,a=2"], "'a' is given twice"),
        (["plot", "PAPER", "--only", "rules", "--inputs", "distance=1"], "add --only inference"),
        (["plot", "PAPER", "--time", "1"], "--time is for one file of logged data"),
        (["audit", "PAPER", "--thresholds", "coverage=-1"], "the threshold 'coverage' is below 0"),
        (["plot", "PAPER", "--only", "firing"], "--only firing is for logged data"),
        (["plot", "PAPER", "--only", "inference"], "force_x needs distance, velocity_body_x"),
        (["plot", "PAPER", "--inputs", "distance=1"], "the inputs of no system are all given"),
        (["plot", "PAPER", "--only", "surface"], 'Did you mean "surfaces"?'),
        (["explain", "PAPER"], "force_x needs distance, velocity_body_x"),
        (["explain", "PAPER", "--inputs", "distance=1"], "add --inputs"),
        (["explain", "PAPER", "--inputs", "distanse=1"], "did you mean 'distance'?"),
        (["explain", "PAPER", "--inputs", "distance"], "write NAME=NUMBER"),
        (["explain", "PAPER", "--inputs", "distance=nan"], "write NAME=NUMBER"),
        (["explain", "PAPER", "--time", "1"], "--time is for one file of logged data"),
        (["explain", "PAPER", "--inputs", "distance=1", "--flights", "FLIGHT"], "drop --inputs, or the"),
        (["explain", "FLIGHT", "--steps"], "about one inference; add --time"),
        (["explain", "FLIGHT", "--time", "1", "--steps", "--json"], "drop one of them"),
        (["explain", "FLIGHT", "--time", "1", "--crossing", "nan"], "Give a finite number"),
        (["explain", "FLIGHT", "--time", "-1"], "-1 s is on no control period of"),
        (["explain", "FLIGHT", "--time", "99999"], "99999 s is on no control period of"),
        (["explain", "FLIGHT", "--time", "40.1", "--system", "force_z"], "which covers 0 to 40 s"),
        (["explain", "FLIGHT", "--time", "nan"], "which covers 0 to 40 s"),
        (["explain", "SILENT", "--time", "5"], "which has none"),
        (["explain", "FLIGHT", "--time", "1", "--system", "x"], "no system 'x'"),
        (["export", "PAPER", "--format", "csv", "-o", "PAPER/x.csv"], "cannot be written"),
        (["export", "PAPER", "--format", "word"], "Choose from: "),
        (["fly"], 'Unknown command "fly"'),
        (["firing", "a.mcap"], "firing is now part of `explain CONTROLLER"),
    ],
)
def test_a_mistake_ends_in_one_sentence(tmp_path, paper, run, words, sentence, flight):
    places = {
        "PAPER": paper,
        "FLIGHT": flight,
        "SILENT": log_flight(tmp_path / "silent.mcap", PAPER_LIKE, num_samples=0),
        "PAPER/x.csv": paper / "x.csv",
        "FOLDER": tmp_path,
    }
    status, printed, told = run(*(places.get(word, word) for word in words))
    assert (status, printed) == (2, "")
    assert sentence in told
    assert "Traceback" not in told


def test_what_is_printed_into_a_file_reads_back_in_any_locale(saved):
    controller = replace(PAPER_LIKE, name="Prüfling \N{RIGHTWARDS ARROW} 漢")
    command = [sys.executable, "-m", "fis_tools", "export", str(saved(controller)), "--format", "json"]
    narrow = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    printed = subprocess.run(command, env=narrow, capture_output=True, check=True).stdout  # noqa: S603
    assert loads(printed.decode("utf-8"), "json") == controller


def test_every_threshold_is_explained(run):
    printed = run("audit", "--help")[1]
    assert all(f" {field.name} ({field.default}): " in printed for field in fields(Thresholds))


def test_it_runs_as_a_module_without_an_output_and_into_a_closed_pipe(paper):
    command = [sys.executable, "-m", "fis_tools", "show", str(paper)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:  # noqa: S603
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0
    closed = " ".join([f'"{word}"' for word in command]) + " >&-"
    told = subprocess.run(closed, shell=True, capture_output=True, check=False)  # noqa: S602
    assert (told.returncode, told.stderr) == (0, b"")


def test_domain_tells_when_flights_left_it(tmp_path, run, refused, flight):
    sensed = inputs_along([flight])
    boxes = [box_of(system, sensed[system.name]) for system in PAPER_LIKE.systems]
    path = tmp_path / "domain.json"
    path.write_text(json.dumps(as_mapping(boxes)), encoding="utf-8")
    assert run("domain", path, flight) == (0, f"{flight}: stayed inside\n", "")
    first = boxes[0]
    smaller = replace(first, high=(0.5 * (first.low[0] + first.high[0]), *first.high[1:]))
    path.write_text(json.dumps(as_mapping([smaller, *boxes[1:]])), encoding="utf-8")
    status, told, _ = run("domain", path, flight)
    assert status == 1
    assert f"{first.system} senses {first.inputs[0]} = {first.high[0]:.6g}" in told
    path.write_text(json.dumps(as_mapping(boxes[1:])), encoding="utf-8")
    assert "which the domain does not have" in refused("domain", path, flight)
