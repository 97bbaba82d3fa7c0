"""Each command that is printed for the user is typed in a shell's words: it flies the mission of its run."""

import ast
import errno
import hashlib
import inspect
import json
import os
import re
import shlex
from dataclasses import fields
from html import unescape
from pathlib import Path

import pytest

import telemetry
from fis_tools.__main__ import main as fis_tools
from fis_tools.formats import serialize
from pipeline.command_line.cli import main
from pipeline.recording.recorder import CONFIG_ATTACHMENT
from pipeline.run import artifacts, configuration, manifests, sweep, tables, typed
from pipeline.settings.experiment import Mission
from pipeline.settings.schema import experiment_from
from telemetry.commands import main as watched
from telemetry.file.partial_file import PartialFile
from telemetry.file.topics import MISSION
from tests.fis_tools.sample_controllers import PAPER_LIKE
from tests.hostile import kills
from tests.pipeline.command_line.cases import FLY, use_stages
from tests.places import PACKAGES, PROJECT

SMALL = ["stages=[scenario,evaluate]", "monte_carlo.num_cases=3", "duration_s=600"]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def mission_hash(config):
    """The hash of what a flight of a configuration depends on: its mission."""
    keys = {field.name for field in fields(Mission)}
    kept = {key: value for key, value in config.items() if key in keys}
    assert {"orbit", "deputy", "chief", "duration_s", "problem"} <= kept.keys()
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def flown(ran, words):
    """Type a command that flies; return its configuration and what its only recording holds."""
    assert words[:3] == ["python", "-m", "pipeline"]
    folder = Path(ran(*words[3:]).out.strip())
    (path,) = (folder / artifacts.RECORDINGS).glob("*.mcap")
    recording = telemetry.read(path)
    attached = configuration.parse(recording.attachments[CONFIG_ATTACHMENT])
    assert mission_hash(attached) == mission_hash(configuration.read(folder))
    return folder, recording


def commands_of(text):
    """The commands in what is printed, or in a page."""
    text = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)  # programs are no commands
    codes = re.findall(r"<code>(python -m .*?)</code>|: (python -m .*)|(python -m pipeline fly .*)", text)
    return [shlex.split(unescape("".join(code))) for code in codes]


def test_a_summary_offers_what_its_runs_flew(ran):
    """Also where the experiment makes the mission, and the folder's name means something to a shell."""
    words = ["+experiment=train_docking", "controller=champion_docking", *SMALL, "seed=1,2"]
    ran("-m", *words, "hydra.sweep.dir='a; b $x'")
    printed = ran("summary", "a; b $x").out
    page = Path("a; b $x", "summary.html").read_text(encoding="utf-8")
    offered = commands_of(printed)
    assert offered
    assert offered == commands_of(page)
    for words in offered:
        run = Path(words[4])
        folder, _ = flown(ran, [*words, "case=2"])
        then, now = (experiment_from(configuration.read(path)) for path in (run, folder))
        assert mission_hash(configuration.read(folder)) == mission_hash(configuration.read(run))
        assert (now.seed, now.case, now.monte_carlo) == (then.seed, 2, then.monte_carlo)
        assert now.controller == then.controller


def test_a_case_is_flown_as_it_was_evaluated(ran):
    ran(
        "+experiment=evaluate",
        "controller=champion_27",
        *SMALL,
        "sun=random",
        "world=leo",
        "hydra.run.dir=run",
    )
    episodes = tables.read_parquet(Path("run"), artifacts.EPISODES)
    for case in (0, 2):
        _, recording = flown(ran, ["python", "-m", "pipeline", "fly", "run", f"case={case}"])
        assert float(recording[MISSION]["delta_v_m_s"][-1]) == pytest.approx(
            episodes["delta_v_m_s"][case], rel=1e-9
        )


def test_the_controller_is_the_one_that_the_run_made_or_another(ran, monkeypatch):
    called = use_stages(monkeypatch)
    ran("+experiment=train", "hydra.run.dir=run", "seed=4")
    Path("run", artifacts.CHAMPION).write_text(serialize.dump_json(PAPER_LIKE))
    ran("fly", "run", "case=7")
    _, experiment, _ = called[-1]
    assert experiment.controller == {"path": str(Path("run", artifacts.CHAMPION).resolve())}
    assert (experiment.case, experiment.seed, experiment.stages) == (7, 4, ("record",))
    ran("fly", "run", "controller=lqr", "controller.ring_size_m=60")
    assert (called[-1][1].controller["kind"], called[-1][1].controller["ring_size_m"]) == ("lqr", 60)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "fly takes the folder of a run"),
        (["nowhere"], "nowhere is no folder"),
        (["run", "seed=3"], "and no seed=3: all else is the run's"),
        (["run", "case=-1"], "case is -1"),
        (["run", "hydra.searchpath=[x]"], "hydra.searchpath x is no folder"),
    ],
)
def test_what_cannot_be_flown_again_is_told(words, message, ran, monkeypatch):
    use_stages(monkeypatch)
    ran(*FLY, "hydra.run.dir=run")
    assert message in ran("fly", *words, code=2).err


def test_a_sweep_that_stopped_prints_a_command_that_goes_on(ran, monkeypatch):
    def stop(_experiment, _folder):
        raise KeyboardInterrupt

    use_stages(monkeypatch, record=stop)
    name = "it's; here"
    printed = ran("-m", *FLY, "seed=1,2", f'hydra.sweep.dir="{name}"', code=130).err
    called = use_stages(monkeypatch)
    (line,) = re.findall(r"To go on with all: (.*)", printed)
    assert main(shlex.split(line)[3:]) == 0
    assert [experiment.seed for _, experiment, _ in called] == [1, 2]
    assert {sweep.state_of(Path(name), run) for run in sweep.read(Path(name))} == {sweep.DONE}


#: means something to a shell, and to Hydra
NAME = "a; b $x"
PROGRAMS = {"pipeline": main, "telemetry": watched, "fis_tools": fis_tools}


def carry_out(words, folder, flight=""):
    """Type a command of a page in the folder of its run, or from outside with the folder for RUN."""
    assert words[:2] == ["python", "-m"]
    program, rest = words[2], [str(folder) if word == typed.RUN else word for word in words[3:]]
    rest = [flight if word == "FLIGHT.mcap" else word for word in rest]
    if program == "telemetry":
        assert Path(folder, rest[1]).exists()
        rest = [rest[0], str(Path(folder, rest[1])), "--save", "seen.rrd"]
    if program == "fis_tools":
        rest[1] = str(Path(folder, rest[1]))
    assert PROGRAMS[program](rest) in (0, 1, 3, 5), words
    return program, rest[0]


@pytest.mark.slow
def test_each_command_on_the_pages_of_an_evaluation_is_carried_out(capsys):
    start = ["+experiment=evaluate", "controller=champion_27", "seed=5", "monte_carlo.num_cases=3"]
    stages = "stages=[scenario,evaluate,record,report]"
    assert main([*start, "duration_s=600", "world=leo", stages, f"hydra.run.dir='{NAME}'"]) == 0
    offered = commands_of(capsys.readouterr().err)
    assert {tuple(words[2:4]) for words in offered} == {("telemetry", "replay"), ("telemetry", "campaign")}
    for words in offered:
        carry_out(words, "")
    before = manifests.read(Path(NAME))
    page = Path(NAME, artifacts.REPORT).read_text(encoding="utf-8")
    typed_words = commands_of(page)
    done = {carry_out(words, NAME) for words in typed_words}
    assert done == {("telemetry", "replay"), ("pipeline", "again"), ("pipeline", "repeat")}
    (other,) = Path("outputs", "evaluate").iterdir()
    assert mission_hash(configuration.read(other)) == mission_hash(configuration.read(Path(NAME)))
    assert manifests.read(other)["config_hash"] == before["config_hash"]
    then, now = (manifests.read(folder)["sha256"] for folder in (Path(NAME), other))
    # but for the words with which each was started, which the page repeats
    assert {name for name in then if then[name] != now.get(name)} <= {artifacts.REPORT}
    assert then == before["sha256"]


@pytest.mark.slow
def test_each_command_on_the_page_of_a_fit_and_of_evidence_is_carried_out(capsys):
    fit, assured = Path(NAME), Path("it's")
    assert main(kills.words_of("fit", f"'{NAME}'")) == 5
    assert commands_of((fit / artifacts.FIT_PAGE).read_text()) == [shlex.split(typed.fly(typed.RUN))]
    capsys.readouterr()
    assert carry_out(["python", "-m", "pipeline", "fly", "RUN"], fit) == ("pipeline", "fly")
    folder = Path(capsys.readouterr().out.strip())
    assert mission_hash(configuration.read(folder)) == mission_hash(configuration.read(fit))
    assert main(kills.words_of("assure", '"it\'s"')) in (0, 3)
    (flight,) = list((assured / artifacts.WORST_FLIGHTS).glob("*.mcap"))[:1]
    offered = commands_of((assured / artifacts.EVIDENCE_PAGE).read_text(encoding="utf-8"))
    done = {carry_out(words, assured, str(flight)) for words in offered}
    assert {("fis_tools", "domain"), ("pipeline", "repeat"), ("telemetry", "replay")} == done


def test_what_is_refused_tells_commands_that_go_on(ran, monkeypatch):
    called = use_stages(monkeypatch)
    ran(*FLY, f"hydra.run.dir='{NAME}'")
    for words in (["seed=4", *FLY, f"hydra.run.dir='{NAME}'"], [f"hydra.run.dir='{NAME}'"]):
        said = ran(*words, code=2).err
        offered = [shlex.split(line) for line in re.findall(r"python -m pipeline [^,\n]*(?=[,\n])", said)]
        assert shlex.split(typed.resume(NAME)) in offered
        for command in offered:
            ran(*command[3:])
    assert [name for name, *_ in called] == ["record", "report", "report"]


def offered_by(program, words, capsys):
    """The command that a refusal offers between backquotes or at its end, as the words of a shell."""
    capsys.readouterr()
    assert program(words) == 2
    said = capsys.readouterr().err
    (command,) = re.findall(r"`(python -m telemetry [^`]*)`|: (python -m telemetry .*)$", said, re.MULTILINE)
    return shlex.split("".join(command))


def test_what_is_offered_for_a_recording_shows_the_mission_of_its_run(ran, capsys):
    """A flight for a campaign, one that was cut off, and one that is damaged."""
    ran(*FLY, "duration_s=600", "world=leo", f"hydra.run.dir='{NAME}'")
    (path,) = Path(NAME, artifacts.RECORDINGS).glob("*.mcap")
    replayed = offered_by(watched, ["campaign", str(path)], capsys)
    assert replayed == shlex.split(typed.replay(path))
    carry_out(replayed, "")
    content, wanted = path.read_bytes(), mission_hash(configuration.read(Path(NAME)))
    cut, damaged = (Path(NAME, name) for name in ("it's cut.mcap.partial", "$(damaged).mcap"))
    cut.write_bytes(content[:-100])
    damaged.write_bytes(content[: len(content) // 2] + b"\0\0" + content[len(content) // 2 + 2 :])
    for broken in (cut, damaged):
        words = offered_by(watched, ["info", str(broken)], capsys)
        assert words[:4] == ["python", "-m", "telemetry", "recover"]
        assert watched([*words[3:], "-o", "rescued.mcap"]) == 0
        attached = telemetry.read(Path("rescued.mcap")).attachments[CONFIG_ATTACHMENT]
        assert mission_hash(configuration.parse(attached)) == wanted
        Path("rescued.mcap").unlink()


def test_a_recording_that_cannot_be_written_offers_what_is_rescued(ran, monkeypatch):
    """The disk fills before the end of the file is written."""
    words = [*FLY, "duration_s=1800", f"hydra.run.dir='{NAME}'"]
    commit = PartialFile.commit

    def fill(self):
        self.abandon()
        os.truncate(self.partial_path, self.partial_path.stat().st_size - 100)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(PartialFile, "commit", fill)
    said = ran(*words, code=2).err
    monkeypatch.setattr(PartialFile, "commit", commit)
    (command,) = re.findall(r"`(python -m telemetry recover [^`]*)`", said)
    assert watched([*shlex.split(command)[3:], "-o", "rescued.mcap"]) == 0
    attached = telemetry.read(Path("rescued.mcap")).attachments[CONFIG_ATTACHMENT]
    assert mission_hash(configuration.parse(attached)) == mission_hash(configuration.read(Path(NAME)))


def test_again_makes_the_same_run_and_refuses_another_controller(ran, monkeypatch):
    use_stages(monkeypatch)
    Path("mine.json").write_text(serialize.dump_json(PAPER_LIKE))
    ran("+experiment=evaluate", "controller=mine.json", "hydra.run.dir=run")
    folder = Path(ran("again", "run").out.strip())
    assert configuration.read(folder) == configuration.read(Path("run"))
    assert manifests.read(folder)["command"] == ["again", "run"]
    assert "again takes the folder of a run" in ran("again", code=2).err
    assert "stages has 'fly'; the stages are scenario" in ran("repeat", "run", "fly", code=2).err
    assert "repeat takes the folder of a run, and stages" in ran("repeat", "run", code=2).err


def interpolated(path):
    """What a source puts into commands, which it writes itself, as expressions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr) and "python -m " in ast.unparse(node):
            has_begun = False
            for part in node.values:
                has_begun |= isinstance(part, ast.Constant) and "python -m " in str(part.value)
                if isinstance(part, ast.FormattedValue) and has_begun:
                    yield ast.unparse(part.value)


#: what is the program's own word, is quoted before, or follows the command
HARMLESS = {
    ("pipeline/command_line/config.py", "package"),
    ("pipeline/run/extras.py", "PACKAGES[module]"),
    ("fis_tools/errors.py", "cure"),
    ("pipeline/command_line/results.py", "command"),
    ("fis_tools/__main__.py", "chosen"),
    ("fis_tools/review/page.py", "option"),
}


def test_no_command_is_put_together_without_quotes():
    bare = {
        (path.relative_to(PROJECT).as_posix(), word)
        for package in PACKAGES
        for path in (PROJECT / package).rglob("*.py")
        for word in interpolated(path)
        if not word.startswith(("shlex.", "typed."))
    }
    assert bare == HARMLESS


def test_every_kind_of_command_is_carried_out_here():
    """Those of `pipeline.run.typed` are what pages and messages print."""
    kinds = {name for name, _ in inspect.getmembers(typed, inspect.isfunction) if name in vars(typed)}
    text = Path(__file__).read_text(encoding="utf-8")
    assert {name for name in kinds if not re.search(rf'"{name}"|typed\.{name}\(', text)} == set()
