"""The command line: what each command prints, and that mistakes end in one sentence."""

import csv
import io
import json
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import pytest

import fis_tools
from fis_tools.analysis.domain import as_mapping, box_of
from fis_tools.analysis.flights import inputs_along
from fis_tools.engines.inference import infer
from fis_tools.findings.audit import Thresholds
from fis_tools.findings.explanation import explain, shares
from fis_tools.formats.serialize import dump_json, load, loads
from fis_tools.model import ALL_SEMANTICS, FuzzyController, with_semantics
from fis_tools.words.text import outline
from plain_files.document import text
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.formats.exchange.systems import FLAT, NESTED, alone
from tests.fis_tools.sample_controllers import FORCE_X, GENERAL, PAPER_LIKE, TIPPER
from tests.places import PROJECT
from tests.programs import run_python


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return log_flight(tmp_path_factory.mktemp("flown") / "flight.mcap", PAPER_LIKE)


@pytest.fixture(scope="module")
def paths(tmp_path_factory, flight):
    """What words of a mistaken command stand for."""
    folder = tmp_path_factory.mktemp("places")
    paths = {"FLIGHT": flight, "FOLDER": folder, "PAPER/x.csv": folder / "PAPER.json" / "x.csv"}
    paths["TIPPER"] = TIPPER
    paths["SILENT"] = log_flight(folder / "silent.mcap", PAPER_LIKE, num_samples=0)
    first, second = PAPER_LIKE.systems
    others = {"OTHER": replace(first, name="other"), "SWAPPED": replace(second, name="force_x")}
    for name, system in others.items():
        paths[name] = log_flight(folder / f"{name}.mcap", FuzzyController("other", (system,)))
    alike = tuple(replace(first, name=name) for name in ("a b", "A/B"))
    written = {"PAPER": PAPER_LIKE, "GENERAL": GENERAL}
    written |= {"LESS": FuzzyController("less", (second,)), "ALIKE": FuzzyController("alike", alike)}
    for name, controller in written.items():
        paths[name] = folder / f"{name}.json"
        paths[name].write_text(dump_json(controller), encoding="utf-8")
    return paths


def test_show_reads_a_file_a_run_and_a_flight(tmp_path, paper, run, flight):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "champion.json").write_text(dump_json(PAPER_LIKE), encoding="utf-8")
    expected = text.write(outline(PAPER_LIKE))
    for source in (paper, tmp_path / "run", flight):
        assert run("show", source) == (expected, "")


@pytest.mark.slow
def test_plot_writes_pictures(tmp_path, run, flight):
    folder = tmp_path / "new" / "figures"
    printed = run("plot", flight, "-o", folder, "--format", "png", "--system", "force_x").out
    names = [f"force_x-{name}.png" for name in ("memberships", "rules", "surface", "surface-3d", "firing")]
    assert printed.split() == [str(folder / name) for name in names]
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in names)


@pytest.mark.slow
def test_plot_draws_what_is_asked_for(tmp_path, paper, run, flight):
    inputs = "distance=80,velocity_body_x=0.05"

    def drawn(*words):
        printed = run("plot", *words, "-o", tmp_path, "--system", "force_x").out
        return [Path(line).stem.removeprefix("force_x-") for line in printed.splitlines()]

    assert drawn(paper, "--only", "inference", "--inputs", inputs) == ["inference"]
    assert drawn(paper, "--only", "rules", "--only", "memberships") == ["memberships", "rules"]
    assert drawn(flight, "--time", "15", "--only", "inference", "--only", "firing") == ["inference", "firing"]


def test_a_dark_picture_is_dark_and_says_the_inputs(tmp_path, paper, run):
    words = ("plot", paper, "--only", "inference", "--inputs", "distance=80,velocity_body_x=0.05")
    run(*words, "--theme", "dark", "--format", "svg", "-o", tmp_path)
    content = (tmp_path / "force_x-inference.svg").read_text(encoding="utf-8")
    assert content.startswith("<?xml")
    assert "#14181d" in content
    assert "velocity_body_x = 0.05 m/s" in content.replace("\xa0", " ")


def test_pictures_whose_names_come_to_the_same_do_not_replace_one_another(tmp_path, saved, run):
    first, other = (replace(FORCE_X, name=name) for name in ("a/b", "A b"))
    path = saved(FuzzyController("alike", (first, other)))
    printed = run("plot", path, "--only", "rules", "-o", tmp_path / "out").out
    names = [Path(line).name for line in printed.splitlines()]
    assert names == ["a_b-rules.png", "A_b-rules-2.png"]
    assert sorted(names) == sorted(picture.name for picture in (tmp_path / "out").iterdir())


def test_surface_prints_numbers_or_draws(tmp_path, paper, run, flight):
    words = ("surface", paper, "--system", "force_x", "--points", "3")
    header, *rows = csv.reader(io.StringIO(run(*words).out))
    assert header == ["distance", "velocity_body_x", "force_x"]
    assert len(rows) == 9
    for row in (rows[1], rows[5]):
        x, y, value = map(float, row)
        assert value == pytest.approx(infer(FORCE_X, [x, y]).values[0], abs=1e-13)  # type: ignore[arg-type]
    run(*words, "-o", tmp_path / "surface.png")
    assert (tmp_path / "surface.png").read_bytes().startswith(b"\x89PNG")
    picture = tmp_path / "space.svg"
    run(*words, "--3d", "--theme", "dark", "--flights", flight, "-o", picture)
    assert "force_x (N)" in picture.read_text(encoding="utf-8")


def test_export_writes_every_form(tmp_path, paper, run):
    assert run("export", paper, "--format", "markdown").out == text.write_markdown(outline(PAPER_LIKE))
    for form in ("json", "yaml"):
        path = tmp_path / f"copy.{form}"
        assert run("export", paper, "--format", form, "-o", path) == ("", "")
        assert load(path) == PAPER_LIKE
    for form in ("csv", "text"):
        assert "very near" in run("export", paper, "--format", form).out
    for form, start in (("html", "<!"), ("latex", "%"), ("c", "/*")):
        assert run("export", paper, "--format", form).out.startswith(start)


def test_explain_tells_each_system_whose_inputs_are_given(paper, run):
    words = ("explain", paper, "--inputs", "distance=80, velocity_body_x=5e-2")
    printed = run(*words).out
    assert printed == explain(FORCE_X, {"distance": 80.0, "velocity_body_x": 0.05}).text()
    crossing = run(*words, "--crossing", "-0.02", "--all").out
    assert "What would take force_x " in crossing
    assert len(crossing.splitlines()) > len(printed.splitlines())
    (plain,) = json.loads(run(*words, "--json").out)["explanations"]
    assert plain["inputs"] == {"distance": 80.0, "velocity_body_x": 0.05}


def test_explain_tells_the_share_of_each_rule_over_flights(tmp_path, paper, run):
    flights = [log_flight(tmp_path / f"{seed}.mcap", PAPER_LIKE, seed=seed) for seed in (1, 2)]
    expected = shares(FORCE_X, inputs_along(flights)["force_x"])
    assert run("explain", paper, "--flights", *flights, "--system", "force_x").out == expected.text()
    assert "force_x over 4 inferences: " in run("explain", flights[0], "--all").out
    plain = json.loads(run("explain", flights[0], "--json").out)
    assert [entry["samples"] for entry in plain["shares"]] == [4, 4]
    silent = log_flight(tmp_path / "silent.mcap", PAPER_LIKE, num_samples=0)
    assert "never fired anything" in run("explain", silent).out


def test_explain_takes_the_inputs_of_a_logged_flight(tmp_path, run, flight):
    words = ("explain", flight, "--system", "force_z", "--time")
    at = {time: run(*words, time) for time in (10, 15, 20, 30, 40)}
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
        (["audit", "PAPER", "--thresholds", "coverage=-1"], "the threshold 'coverage' is -1; give a share"),
        (["audit", "PAPER", "--thresholds", "coverage=7"], "'coverage' is 7; give a share from 0 to 1"),
        (["audit", "PAPER", "--thresholds", "rules=-1"], "'rules' is -1; give a number that is not below 0"),
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
        (["audit", "PAPER", "--thresholds", "cover=1"], "no threshold 'cover'; did you mean 'coverage'?"),
        (["audit", "PAPER", "--flights", "OTHER"], "give flights of this controller"),
        (["audit", "PAPER", "--flights", "missing.mcap"], "cannot be opened"),
        (
            ["audit", "PAPER", "--system", "force_x", "--flights", "SWAPPED"],
            "senses distance, velocity_body_x",
        ),
        (["diff", "PAPER", "missing.yaml"], "cannot be read"),
        (["diff", "PAPER", "PAPER", "--system", "force_y"], "did you mean 'force_"),
        (["diff", "PAPER", "LESS", "--system", "force_x"], "'less' has no system 'force_x'"),
        (["simplify", "PAPER", "--max-change", "5"], "'5' is no share from 0% to 100%; write 5% or 0.05"),
        (["simplify", "PAPER", "--mean-change=-1%"], "is no share"),
        (["simplify", "PAPER", "--max-change", "much"], "is no share"),
        (["simplify", "PAPER", "--look-alike", "0%"], "give a likeness above 0"),
        (["simplify", "PAPER", "--flights-only"], "--flights-only needs flights"),
        (["simplify", "PAPER", "-o", "simpler.fis"], "ends in none of .json, .yaml, .yml"),
        (["export", "PAPER", "--format", "fis"], "force_x, force_z; add --system, or -o FOLDER"),
        (["export", "PAPER", "--format", "fis", "-o", "x.fis"], "-o FOLDER for a file each"),
        (["export", "GENERAL", "--format", "fis"], "room: rule 1 cannot be said in a .fis file"),
        (["export", "ALIKE", "--format", "fll", "-o", "out"], "both be written as A_B.fll"),
        (["import", "TIPPER", "TIPPER"], "both have a system 'tipper'"),
        (["import", "TIPPER", "-o", "x.fis"], "ends in none of .json, .yaml, .yml"),
        (["import", "TIPPER", "--points", "1"], "Give a whole number from 2 to 4000000"),
        (["import", "missing.fis"], "cannot be read"),
        (["import", "TIPPER", "--name", " "], "a name is printable text"),
        (["fly"], 'Unknown command "fly"'),
        (["firing", "a.mcap"], "firing is now part of `explain CONTROLLER"),
    ],
)
def test_a_mistake_writes_one_sentence_alone(paths, refused, words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sentence in refused(*(paths.get(word, word) for word in words))
    assert list(tmp_path.iterdir()) == []


def test_what_is_printed_into_a_file_reads_back_in_any_locale(saved):
    controller = replace(PAPER_LIKE, name="Prüfling \N{RIGHTWARDS ARROW} 漢")
    words = ("-m", "fis_tools", "export", saved(controller), "--format", "json")
    printed = run_python(*words, PYTHONIOENCODING="ascii", PYTHONUTF8="0").stdout
    assert loads(printed, "json") == controller


def test_every_threshold_is_explained(run):
    printed = run("audit", "--help").out
    assert all(f" {field.name} ({field.default}): " in printed for field in fields(Thresholds))


def test_it_runs_as_a_module_without_an_output_and_into_a_closed_pipe(paper):
    command = [sys.executable, "-m", "fis_tools", "show", str(paper)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:  # noqa: S603
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0
    closed = " ".join([f'"{word}"' for word in command]) + " >&-"
    piped = subprocess.run(closed, shell=True, capture_output=True, check=False)  # noqa: S602
    assert (piped.returncode, piped.stderr) == (0, b"")


def test_domain_tells_when_flights_left_it(tmp_path, run, refused, flight):
    sensed = inputs_along([flight])
    boxes = [box_of(system, sensed[system.name]) for system in PAPER_LIKE.systems]
    path = tmp_path / "domain.json"
    path.write_text(json.dumps(as_mapping(boxes)), encoding="utf-8")
    assert run("domain", path, flight) == (f"{flight}: stayed inside\n", "")
    first = boxes[0]
    smaller = replace(first, high=(0.5 * (first.low[0] + first.high[0]), *first.high[1:]))
    path.write_text(json.dumps(as_mapping([smaller, *boxes[1:]])), encoding="utf-8")
    printed = run("domain", path, flight, code=1).out
    assert f"{first.system} senses {first.inputs[0]} = {first.high[0]:.6g}" in printed
    path.write_text(json.dumps(as_mapping(boxes[1:])), encoding="utf-8")
    assert "which the domain does not have" in refused("domain", path, flight)


@pytest.mark.parametrize("form", ["fis", "fll"])
def test_systems_go_into_a_file_each_and_come_back_as_one_controller(tmp_path, saved, run, form):
    source = saved(replace(PAPER_LIKE, purpose="It inspects."))
    folder = tmp_path / "new" / "exchange"
    printed, notes = run("export", source, "--format", form, "-o", folder)
    files = [folder / f"force_x.{form}", folder / f"force_z.{form}"]
    assert printed.split() == [str(path) for path in files]
    assert f"force_x.{form}: attributes are left out: force_axes" in notes
    assert run("import", *files, "-o", tmp_path / "back.yaml") == ("", "")
    assert (tmp_path / "back.yaml").read_text(encoding="utf-8") == source.read_text(encoding="utf-8")
    for command in ("show", "audit"):
        run(command, files[0])


def test_one_system_goes_to_a_file_or_is_printed(tmp_path, saved, run):
    source = saved(PAPER_LIKE)
    chosen = ("export", source, "--format", "fis", "--system", "force_x")
    printed, notes = run(*chosen)
    assert "[System]" in printed
    assert "units are left out" in notes
    run(*chosen, "-o", tmp_path / "one.fis")
    assert (tmp_path / "one.fis").read_text(encoding="utf-8") == printed
    for folder in (tmp_path, tmp_path / "new"):
        assert run(*chosen, "-o", folder).out == f"{folder / 'force_x.fis'}\n"
        assert (folder / "force_x.fis").read_text(encoding="utf-8") == printed


def test_what_was_assumed_is_printed(tmp_path, run):
    words = ("import", TIPPER, "--name", "tips", "--points", 201)
    notes = run(*words, "-o", tmp_path / "tips.json").err
    assert "assumed: tipper: tip is 15 when no rule fires" in notes
    controller = load(tmp_path / "tips.json")
    assert controller.name == "tips"
    (system,) = controller.systems
    assert {v.num_points for v in (*system.inputs, *system.outputs)} == {201}
    assert "points" not in notes
    spiky = Path(__file__).parents[1] / "formats" / "exchange" / "spiky.fis"  # y jumps at 15.5 and 25.25
    assert ["jumps" in run("import", spiky, "--points", count).err for count in (201, 401)] == [True, False]
    assert run("import", TIPPER).out.startswith('{\n  "schema": "fuzzy-controller"')


def test_facts_of_several_files_are_put_together(tmp_path, saved, run, refused):
    flat = alone(FLAT)
    other = replace(alone(replace(NESTED, name="other")), provenance=(("made_by", "machine"),))
    paths = [saved(flat, "one.yaml"), saved(other, "other.yaml")]
    notes = run("import", *paths, "-o", tmp_path / "both.json").err
    assert "left out: the provenance made_by" in notes
    both = load(tmp_path / "both.json")
    assert (both.name, both.attributes, both.provenance) == (flat.name, flat.attributes, ())
    for path, controller in zip(paths, (flat, other), strict=True):
        saved(replace(controller, purpose=f"It is {path.stem}."), path.name)
    assert "left out: the purpose, which differs" in run("import", *paths, "-o", tmp_path / "both.json").err
    saved(replace(other, attributes=(("axis", "y"),)), "other.yaml")
    assert "differ in the attribute 'axis'" in refused("import", *paths)


def test_a_file_can_be_imported_as_another_program_infers_it(run, tmp_path):
    path = tmp_path / "tipper.yaml"
    for tool in ALL_SEMANTICS:
        run("import", PROJECT / "docs" / "examples" / "tipper.fis", "--as", tool, "-o", path)
        (system,) = load(path).systems
        assert system.semantics == tool
        assert ("inferred as" in run("show", path).out) == (tool != "scikit-fuzzy")
    assert (
        len({fis_tools.compile(with_semantics(system, tool))([[2.0, 1.0]])[0, 0] for tool in ALL_SEMANTICS})
        == 4
    )


def test_what_a_program_prints_does_not_stand_before_the_json(run, tmp_path):
    program = tmp_path / "chatty.py"
    tipper = str(PROJECT / "docs" / "examples" / "tipper.fis")
    lines = ["import fis_tools", "print('tip', 12.5)", "def make():", "    print('made')"]
    lines.append(f"    return fis_tools.read_controller({tipper!r}).systems[0]")
    program.write_text("\n".join(lines) + "\n", encoding="utf-8")
    printed = run("audit", f"{program}:make", "--trust", "--json")
    assert json.loads(printed.out)["systems"][0]["name"] == "tipper"
    assert "tip 12.5" in printed.err
    assert "made" in printed.err
