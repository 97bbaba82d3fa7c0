"""Sweeps as jobs: the script that SLURM is given, and the task that goes on with a run of the sweep."""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
from pipeline.command_line.cluster import ranges, script
from pipeline.run import artifacts, sweep
from tests.pipeline.command_line.cases import use_stages

pytestmark = pytest.mark.slow

SWEEP = [
    "cluster", "slurm", "--cpus", "3", "--partition", "batch", "--at-once", "2",
    "--setup", "module load this", "+experiment=evaluate", "controller=coast", "stages=[scenario,evaluate]",
    "seed=1,2,3", "hydra.sweep.dir=out", "monte_carlo.workers=5",
]  # fmt: skip


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_sweep_is_written_down_with_the_script_of_its_jobs(capsys, tmp_path):
    assert main(SWEEP) == 0
    assert "3 of 3 runs are left; to start them: sbatch out/slurm.sh" in capsys.readouterr().err
    text = Path("out/slurm.sh").read_text()
    for line in (
        "#SBATCH --array=0-2%2", "#SBATCH --requeue", "#SBATCH --signal=B:USR1@120",
        "#SBATCH --partition=batch", "#SBATCH --cpus-per-task=3", "module load this",
        f"cd {tmp_path} || exit",
    ):  # fmt: skip
        assert line in text.splitlines()
    config = artifacts.read_config(Path("out/seed=2"))
    assert (config["seed"], config["optimizer"]["workers"], config["monte_carlo"]["workers"]) == (2, 3, 5)


def test_tasks_go_on_with_their_runs_and_note_how_they_ended(monkeypatch, capsys):
    assert main(SWEEP) == 0

    def fail(experiment, folder):
        raise ValueError("nothing to be flown")

    use_stages(monkeypatch, evaluate=fail)
    assert main(["cluster", "run", "out", "1"]) == 2
    called = use_stages(monkeypatch)
    assert main(["cluster", "run", "out", "0"]) == 0
    assert [(name, experiment.seed) for name, experiment, _ in called] == [("scenario", 1), ("evaluate", 1)]
    known = sweep.read(Path("out"))
    assert [sweep.state_of(Path("out"), run) for run in known] == ["done", "failed", "unfinished"]
    assert known[1].failure == "nothing to be flown"
    # the same command again is about what is left; a run that then ends is forgiven
    assert main(SWEEP) == 0
    assert "#SBATCH --array=1-2%2" in Path("out/slurm.sh").read_text()
    assert main(["cluster", "run", "out", "1"]) == 0
    assert [name for name, experiment, _ in called if experiment.seed == 2] == ["evaluate"]
    assert [sweep.state_of(Path("out"), run) for run in sweep.read(Path("out"))][1] == "done"
    assert main(["cluster", "run", "out", "3"]) == 2
    assert "its 3 runs are counted from 0" in capsys.readouterr().err


def test_files_that_another_task_is_writing_stay(tmp_path):
    assert main(SWEEP) == 0
    theirs, ours = (
        tmp_path / "out" / name for name in ("seed=1/train/.c.npz.x.unfinished", ".s.x.unfinished")
    )
    for path in (theirs, ours):
        path.parent.mkdir(exist_ok=True)
        path.with_name(path.name.replace(".unfinished", artifacts.UNFINISHED)).touch()
    assert main(SWEEP) == 0
    assert theirs.exists()
    assert not ours.exists()


def test_a_job_whose_time_is_nearly_up_puts_itself_back_into_the_queue(tmp_path, monkeypatch):
    told, begun = tmp_path / "told", tmp_path / "begun"
    for name, lines in {
        "scontrol": f'echo "$@" > {told}',
        "python": f"trap 'exit 7' TERM; touch {begun}; while :; do sleep 0.1; done",
    }.items():
        (tmp_path / name).write_text(f"#!/bin/bash\n{lines}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    given = {"time": "1", "cpus": 1, "memory": "1G", "partition": None, "at_once": None}
    chosen = argparse.Namespace(**given, notice=60, setup=[])
    (tmp_path / "job.sh").write_text(script(tmp_path, [0], chosen))
    environment = {
        "PATH": f"{tmp_path}:{os.environ['PATH']}", "SLURM_JOB_ID": "17", "SLURM_ARRAY_TASK_ID": "0"
    }  # fmt: skip
    job = subprocess.Popen(["/bin/bash", "job.sh"], env=environment, start_new_session=True)
    try:
        while not begun.exists():
            time.sleep(0.05)
        job.send_signal(signal.SIGUSR1)
        while not (told.exists() and told.read_text()):
            time.sleep(0.05)
        assert told.read_text() == "requeue 17\n"
        assert job.poll() is None  # the run goes on until SLURM ends it
    finally:
        os.killpg(job.pid, signal.SIGTERM)
        job.wait()


@pytest.mark.parametrize(("numbers", "told"), [([0], "0"), ([0, 1, 2], "0-2"), ([1, 3, 4, 9], "1,3-4,9")])
def test_numbers_are_written_in_ranges(numbers, told):
    assert ranges(numbers) == told


@pytest.mark.parametrize("words", [[], ["qsub"], ["slurm", "--cpus", "many", "+experiment=fly"]])
def test_what_is_no_command_is_refused(words, capsys):
    assert main(["cluster", *words]) == 2
    assert capsys.readouterr().err.startswith("error: ")
