"""Each command that is printed for the user is typed in a shell's words: it flies the mission of its run."""

import re
import shlex
from html import unescape
from pathlib import Path

import pytest

import telemetry
from fis_tools.formats import serialize
from pipeline.command_line.cli import main
from pipeline.recording.recorder import CONFIG_ATTACHMENT
from pipeline.run import artifacts, configuration, sweep, tables
from pipeline.settings.schema import experiment_from
from telemetry.file.topics import MISSION
from tests.fis_tools.sample_controllers import PAPER_LIKE
from tests.pipeline.command_line.cases import FLY, use_stages

SMALL = ["stages=[scenario,evaluate]", "monte_carlo.num_cases=3", "duration_s=600"]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def flown(ran, words):
    """Type a command that flies; return its configuration and what its only recording holds."""
    assert words[:3] == ["python", "-m", "pipeline"]
    folder = Path(ran(*words[3:]).out.strip())
    (path,) = (folder / artifacts.RECORDINGS).glob("*.mcap")
    recording = telemetry.read(path)
    attached = configuration.parse(recording.attachments[CONFIG_ATTACHMENT])
    assert experiment_from(attached).mission == experiment_from(configuration.read(folder)).mission
    return folder, recording


def commands_of(text):
    """The commands in what is printed, or in a page."""
    codes = re.findall(r"<code>(python .*?)</code>|(python -m pipeline fly .*)", text)
    return [shlex.split(unescape(code or line)) for code, line in codes]


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
        assert now.mission == then.mission
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
