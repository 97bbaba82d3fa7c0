"""Runs: their folder, resuming, repeating a stage, interrupts, faults, progress, parts of one."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from pipeline.command_line.cli import main
from pipeline.controllers.source import controller_of_run
from pipeline.flight.control.controller import coast
from pipeline.run import artifacts, configuration, manifests, progress, runner, tables, writing
from pipeline.run.progress import Progress
from pipeline.settings import start_table
from tests.pipeline.command_line.cases import EVALUATE, FLY, use_stages
from tests.places import PROJECT

STAGES = ["scenario", "evaluate", "record", "report"]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def run_folder(name: str) -> Path:
    """The only run's folder."""
    (folder,) = [path for path in Path("outputs", name).iterdir() if path.is_dir()]
    return folder


@pytest.fixture
def finished(monkeypatch) -> Path:
    """The folder of an evaluation whose stages wrote a file each."""
    use_stages(monkeypatch)
    assert main(EVALUATE) == 0
    return run_folder("evaluate")


def test_a_run_whose_folder_is_renamed_is_refused_and_goes_on_there(monkeypatch, ran):
    def move(_experiment, folder):
        folder.rename("elsewhere")
        writing.write_atomically(folder / artifacts.CHECKPOINT, "of the next generation")

    with monkeypatch.context() as patch:
        use_stages(patch, scenario=move)
        refusal = ran(*EVALUATE, "hydra.run.dir=run", code=2).err
    assert "run has been deleted or moved while the run was at work" in refusal
    assert not Path("run").exists()
    use_stages(monkeypatch)
    ran("resume=elsewhere")
    assert manifests.read(Path("elsewhere"))["finished_stages"] == STAGES
    assert not list(Path("elsewhere").rglob(".*"))


def test_a_run_calls_its_stages_in_order_in_a_folder_of_its_own(monkeypatch, capsys):
    called = use_stages(monkeypatch)
    assert main([*EVALUATE, "seed=5", "monte_carlo.num_cases=12"]) == 0
    folder = run_folder("evaluate")
    assert not set("=, ") & set(folder.as_posix())
    assert [name for name, _, _ in called] == STAGES
    for _, experiment, given in called:
        assert given.resolve() == folder.resolve()
        assert (experiment.seed, experiment.monte_carlo.num_cases, experiment.resume) == (5, 12, False)
    assert capsys.readouterr().out == f"{folder}\n"
    config = yaml.safe_load((folder / "config.yaml").read_text())
    assert (config["seed"], config["name"], config["controller"]) == (5, "evaluate", {"kind": "coast"})
    assert "hydra" not in config
    manifest = manifests.read(folder)
    assert (manifest["finished_stages"], manifest["seed"]) == (STAGES, 5)
    assert manifest["command"] == [*EVALUATE, "seed=5", "monte_carlo.num_cases=12"]
    assert set(manifest["sha256"]) == {"config.yaml", *(f"{stage}.txt" for stage in STAGES)}
    assert manifest["versions"]["deap"]
    assert "stage report took" in (folder / "pipeline.log").read_text()


@pytest.mark.parametrize("word", ["folder/own.json", "folder/a b.yaml", "'x=y,z.json'", "folder/it's.yml"])
def test_a_controller_may_be_a_path(word, monkeypatch):
    called = use_stages(monkeypatch)
    monkeypatch.setattr("pipeline.controllers.source.load", lambda _source, _mission: coast())
    assert main(["+experiment=fly", f"controller={word}"]) == 0
    assert called[0][1].controller == {"path": word.strip("'")}


def test_an_interrupt_says_what_was_kept_and_resume_goes_on(monkeypatch, ran):
    def stop(_experiment, folder):
        writing.write_atomically(folder / artifacts.CHECKPOINT, "state")
        raise KeyboardInterrupt

    use_stages(monkeypatch, evaluate=stop)
    printed = ran(*EVALUATE, "seed=9", code=130).err
    folder = run_folder("evaluate")
    assert f"in the stage evaluate (finished before: scenario); kept in {folder}: scenario.txt" in printed
    assert f"python -m pipeline resume={folder}" in printed
    called = use_stages(monkeypatch)
    assert main([f"resume={folder}"]) == 0
    assert [(name, e.seed, e.resume) for name, e, _ in called] == [(name, 9, True) for name in STAGES[1:]]
    assert run_folder("evaluate") == folder
    called.clear()
    assert "nothing is left to do" in ran("+experiment=evaluate", f"resume={folder}").err
    assert called == []


def test_resume_takes_no_other_settings(finished, monkeypatch, ran):
    called = use_stages(monkeypatch)
    for other in ("seed=2", "+experiment=train", "sun=random"):
        assert f"drop {other}" in ran(f"resume={finished}", other, code=2).err
    path = finished / "config.yaml"
    path.write_text(path.read_text().replace("seed: 1", "seed: 2"))
    assert "is not what the run was made with" in ran(f"resume={finished}", code=2).err
    assert called == []


@pytest.mark.parametrize("base", [[], EVALUATE])
def test_a_stage_is_repeated_on_an_earlier_runs_files(base, monkeypatch):
    use_stages(monkeypatch)
    main([*EVALUATE, *(["seed=8"] if not base else [])])
    folder = run_folder("evaluate")
    before = (folder / "config.yaml").read_text()
    called = use_stages(monkeypatch, report=lambda _e, f: (f / "report.txt").write_text("again"))
    assert main([*base, "stages=[report]", f"hydra.run.dir={folder}"]) == 0
    assert [name for name, _, _ in called] == ["report"]
    assert called[0][1].seed == (1 if base else 8)
    assert not called[0][1].resume
    assert (folder / "report.txt").read_text() == "again"
    assert (folder / "config.yaml").read_text() == before
    manifest = manifests.read(folder)
    assert manifest["finished_stages"] == STAGES
    assert manifest["sha256"]["report.txt"] == artifacts.file_hash(folder / "report.txt")


def test_repeating_an_early_stage_leaves_the_later_ones_to_do(finished, monkeypatch):
    main(["stages=[evaluate]", f"hydra.run.dir={finished}"])
    assert manifests.read(finished)["finished_stages"] == ["scenario", "evaluate"]
    called = use_stages(monkeypatch)
    main([f"resume={finished}"])
    assert [name for name, _, _ in called] == ["record", "report"]


def test_a_repeated_stage_may_have_its_own_settings_but_no_others(finished, monkeypatch, ran):
    called, run_dir = use_stages(monkeypatch), f"hydra.run.dir={finished}"
    repeated = [*EVALUATE, "stages=[report]", run_dir, "report.dots_per_inch=300"]
    assert main(repeated) == 0
    assert called[0][1].report.dots_per_inch == 300
    assert configuration.read(finished)["stages"] == STAGES
    short = ["stages=[report]", run_dir]
    assert main([*short, "report.title=By itself"]) == 0
    again = called[1][1]
    assert (again.report.title, again.report.dots_per_inch, again.seed) == (
        "By itself",
        300,
        called[0][1].seed,
    )
    for words, message in (
        ([*repeated, "seed=2"], "was made with another seed"),
        ([*short, "seed=2"], "another seed (then 1, now 2); drop what changes that"),
        ([*short, "report.titel=X"], "did you mean report.title?"),
        (["stages=[record]", run_dir, "case=2"], "case counts only with telemetry.record_start=true"),
        ([*EVALUATE, "controller=tour", "++controller.attributes.tour_time_s=90000"], "give less than half"),
        ([*EVALUATE, run_dir], "holds a run already"),
        (["stages=[reprt]", run_dir], "did you mean report?"),
        ([*short, "--cfg", "job"], "--cfg and --info print what a new run would have; what this has is in"),
        ([f"resume={finished}", "--info"], "--cfg and --info print what a new run would have"),
    ):
        assert message in ran(*words, code=2).err


def test_a_repeated_command_flies_no_controller_that_its_file_no_longer_holds(monkeypatch, ran):
    text = (PROJECT / "conf/controller/champion_27.yaml").read_text()
    Path("c.yaml").write_text(text)
    words = ["+experiment=evaluate", "controller=c.yaml", "hydra.run.dir=run"]
    called = use_stages(monkeypatch, evaluate=controller_of_run)
    assert main(words) == main([*words, "stages=[evaluate]"]) == 0
    Path("c.yaml").write_text(text.replace("name: champion_27", "name: edited", 1))
    called.clear()
    printed = ran(*words, "stages=[evaluate]", code=2).err
    assert "c.yaml has changed since" in printed
    assert called == []
    # what names no file goes on with the copy
    assert main(["stages=[evaluate]", "hydra.run.dir=run"]) == 0


def test_a_folder_that_holds_no_run_is_refused(finished, monkeypatch, ran):
    """Stages alone are for one that does, and none is put where the files of another lie."""
    called, repeat = use_stages(monkeypatch), ["stages=[report]", "hydra.run.dir=typo"]
    assert "error: typo holds no run" in ran(*repeat, code=2).err
    assert not Path("typo").exists()
    Path("typo").mkdir()
    assert main(repeat) == 2
    assert list(Path("typo").iterdir()) == []
    (finished / "config.yaml").unlink()
    printed = ran(*FLY, f"hydra.run.dir={finished}", code=2).err
    assert "has no config.yaml" in printed
    assert called == []


@pytest.mark.parametrize("error", [artifacts.ArtifactError("champion.json is missing"), OSError("disk full")])
def test_an_error_in_a_stage_is_told_and_logged(error, monkeypatch, ran):
    def fail(_experiment, _folder):
        raise error

    use_stages(monkeypatch, record=fail)
    assert f"error: {error}" in ran(*FLY, code=2).err
    assert "Traceback" in (run_folder("fly") / "pipeline.log").read_text()
    assert manifests.read(run_folder("fly"))["finished_stages"] == []
    # a fault of the program shows its traceback
    error = ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        main([*FLY, "hydra.run.dir=faulty"])
    assert "ZeroDivisionError" in Path("faulty/pipeline.log").read_text()


@pytest.mark.parametrize("is_full", [False, True])
def test_a_log_that_cannot_be_written_is_told_once_and_ends_nothing(is_full, monkeypatch, ran):
    use_stages(monkeypatch)
    if is_full:
        monkeypatch.setattr(runner._Log, "_open", lambda _: open("/dev/full", "a"))  # noqa: SIM115
    else:
        Path("run", artifacts.LOG).mkdir(parents=True)
    said = ran(*EVALUATE, "hydra.run.dir=run").err
    reason = "No space left on device" if is_full else "Is a directory"
    path = Path("run", artifacts.LOG).absolute()
    assert said.count(f"note: {path} cannot be written ({reason}); the run has no log from here on") == 1
    assert manifests.read(Path("run"))["finished_stages"] == STAGES


PROGRAM = """
import os, signal
from pipeline.run import interrupts
class Lost:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))
signal.signal(signal.SIGINT, signal.default_int_handler)  # one that runs in the background ignores it
interrupts.remember()
said = "told"
class Faulty:
    def __del__(self):
        raise ValueError(said)
faulty = Faulty()
del faulty
try:
    with interrupts.heeded():
        lost = Lost()
        del lost
        print("went on")
except KeyboardInterrupt:
    print("interrupted")
said = "not told"
half_made = Faulty()
del half_made
"""


def test_an_interrupt_lost_in_a_finalizer_ends_the_work_without_a_traceback():
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split("\n")[-2] == "interrupted"
    assert "KeyboardInterrupt" not in done.stderr
    assert "ValueError: told" in done.stderr
    assert "not told" not in done.stderr


@pytest.fixture
def clock(monkeypatch):
    """Seconds, as the test sets them."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    return now


def test_lines_are_told_now_and_then_with_the_time_left(clock, capsys):
    with Progress("solved", 10, done=2) as shown:
        for done in (3, 4, 5, 9, 10):
            clock[0] += 2.0
            shown.show(done, f"case {done}")
    # before the first is shown code is compiled; after it six took six seconds
    printed = capsys.readouterr().err.splitlines()
    assert printed[:2] == ["  solved 3/10, case 3", "  solved 9/10, case 9, 1 s left"]
    assert printed[2:] == ["  solved 10/10, case 10, 0 s left"]
    with Progress("generation", 8) as shown:
        for done in (4, 6):
            clock[0] += 30.0
            shown.show(done)
    assert capsys.readouterr().err == "  generation 4/8\n  generation 6/8, 30 s left\n"


def test_a_terminal_shows_a_bar(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with Progress("solved", 4, done=0) as shown:
        shown.show(2, "case 1")
    printed = capsys.readouterr().err
    assert "case 1" in printed
    assert "2/4" in printed
    assert "s left\n" not in printed


@pytest.mark.parametrize("of_file", [False, True])
def test_a_campaign_in_parts_is_the_same_and_goes_on(of_file, tmp_path, monkeypatch):
    words = [*EVALUATE, "monte_carlo.num_cases=20", "stages=[evaluate]"]
    if of_file:  # in the first part all are at rest
        rows = [f"{60 + k},0,9,0,{-0.1 if k > 5 else 0},0,0" for k in range(20)]
        header = ",".join((*start_table.POSITION, *start_table.VELOCITY, "sun_angle_rad"))
        (tmp_path / "starts.csv").write_text("\n".join([header, *rows, ""]))
        words = [*EVALUATE, "stages=[evaluate]", f"starts={tmp_path / 'starts.csv'}"]
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    assert main([*words, f"hydra.run.dir={whole}"]) == 0
    written, room, write = [], 2, tables.write_parquet

    def write_some(path, *content):
        if len(written) == room:
            raise KeyboardInterrupt
        written.append(path)
        write(path, *content)

    monkeypatch.setattr(tables, "write_parquet", write_some)
    assert main([*words, "engine.part_cases=6", f"hydra.run.dir={parted}"]) == 130
    room = 9
    assert main([f"resume={parted}"]) == 0
    # four parts, none of them twice, and the comparison with the optimum where plans are known
    assert len(set(written)) == len(written) == (4 if of_file else 5)
    assert (whole / artifacts.EPISODES).read_bytes() == (parted / artifacts.EPISODES).read_bytes()
    assert not (parted / artifacts.TRAJECTORIES).exists()
    assert not (parted / artifacts.EPISODE_PARTS).exists()
