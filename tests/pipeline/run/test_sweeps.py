"""Sweeps: runs that fail sink no other, what is interrupted goes on, and the summary tells all of it."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.cli import main
from pipeline.evaluation.monte_carlo import summarise
from pipeline.run import artifacts, sweep, tables
from tests.pipeline.command_line.cases import use_stages
from tests.pipeline.evaluation.test_statistics import evaluation

OUT = Path("out")

SWEEP = [
    "-m", "+experiment=evaluate", "controller=coast", "stages=[scenario,evaluate]", "hydra.sweep.dir=out",
    "seed=1,2,3", "deputy.mass_kg=10,12", "sun=fixed,random",
]  # fmt: skip
#: the same with four seeds: 16 runs
LARGE = ["seed=range(1,5)" if word.startswith("seed=") else word for word in SWEEP]
#: the other parts of a run in a sweep's file
REST = '"differs": {}, "command": [], "failure": ""'
#: what goes wrong in which run: a mistake, the disk, memory, and a fault of the program
INJECTED = {
    ("2", 12.0, "fixed"): ValueError("nothing to be flown"),
    ("3", 10.0, "random"): OSError(28, "No space left on device"),
    ("3", 12.0, "random"): MemoryError(),
    ("1", 10.0, "random"): RuntimeError("a slip"),
    ("4", 10.0, "fixed"): ValueError("nothing to be flown, again"),
}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def evaluate(experiment, folder):
    """Write an evaluation in which a heavier deputy burns 0.3 m/s less, whatever else differs."""
    episodes = evaluation(experiment.seed, shift=-0.15 * (experiment.mission.deputy.mass_kg - 10.0))
    tables.write_parquet(folder / artifacts.EPISODES, episodes)
    names = {"mean_distance_m": np.ones(40)}
    summary = {"confidence_percent": 95.0, "num_cases": 40, **summarise({**episodes, **names}, 95.0)}
    artifacts.write_json(folder / artifacts.SUMMARY, summary)


def key_of(experiment):
    return str(experiment.seed), experiment.mission.deputy.mass_kg, experiment.sun.mode


@pytest.mark.slow
def test_a_sweep_with_injected_failures_is_summarised(monkeypatch, capsys):
    def evaluate_or_fail(experiment, folder):
        if error := INJECTED.get(key_of(experiment)):
            raise error
        evaluate(experiment, folder)

    use_stages(monkeypatch, evaluate=evaluate_or_fail)
    assert main(LARGE) == 2
    told = capsys.readouterr().err
    *_, ends = told.split("[16/16]")
    assert ends.count("failed: ") == len(INJECTED)
    assert "failed: seed=2+deputy.mass_kg=12+sun=fixed: nothing to be flown" in ends
    assert "seed=1+deputy.mass_kg=10+sun=random: a fault of the program: RuntimeError: a slip" in ends
    assert "11 of 16 runs are done; to try the others again: python -m pipeline resume=out" in ends
    assert main(["summary", "out"]) == 0
    rows = tables.read_parquet(OUT, "summary.parquet")
    states = dict(zip(rows["run"].tolist(), rows["state"].tolist(), strict=True))
    failed = {f"seed={seed}+deputy.mass_kg={mass:g}+sun={sun}" for seed, mass, sun in INJECTED}
    assert {name for name, state in states.items() if state == "failed"} == failed
    assert (rows["state"] == "done").sum() == 11
    assert np.isnan(rows["delta_v_m_s"]).sum() == len(INJECTED)
    found = tables.read_parquet(OUT, "effects.parquet")
    heavier = (found["factor"] == "deputy.mass_kg") & (found["metric"] == "delta_v_m_s")
    # of all seeds but 2 and 4 under a fixed Sun, and but 1 and 3 under a random one, both masses were flown
    assert found["difference"][heavier] == pytest.approx(-0.3)
    assert found["pairs"][heavier].tolist() == [4]
    page = (OUT / "summary.html").read_text()
    assert all(name in page for name in failed)
    assert "controller=coast" in page

    use_stages(monkeypatch, evaluate=evaluate)
    assert main(["resume=out"]) == 0
    assert "16 of 16 runs are done" in capsys.readouterr().err
    known = sweep.read(OUT)
    assert [run.failure for run in known] == [""] * 16
    assert artifacts.read_manifest(OUT / known[0].folder)["command"] == list(known[0].command)
    assert main(["resume=out"]) == 0
    assert "nothing is left to do: all 16 runs are finished" in capsys.readouterr().err


def test_an_interrupted_sweep_goes_on_with_what_is_left(monkeypatch, capsys):
    def stop(experiment, folder):
        if experiment.seed == 2:
            raise KeyboardInterrupt
        evaluate(experiment, folder)

    words = [word for word in SWEEP if not word.startswith(("deputy", "sun"))]
    use_stages(monkeypatch, evaluate=stop)
    assert main(words) == 130
    assert "2 runs of the sweep are left. To go on with all: python -m pipeline resume=out" in (
        capsys.readouterr().err
    )
    called = use_stages(monkeypatch, evaluate=evaluate)
    assert main(["resume=out"]) == 0
    assert [(name, e.seed) for name, e, _ in called] == [("evaluate", 2), ("scenario", 3), ("evaluate", 3)]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "out holds no sweep, it has no sweep.json"),
        ('{"sweep_version": 1, "runs": [{"folder": "../x"}]}', "is no file of a sweep"),
        ('{"sweep_version": 1, "runs": [{"folder": "/x", ' + REST + "}]}", "lies outside"),
        ('{"sweep_version": 1, "runs": [{"folder": "' + 252 * "x" + '", ' + REST + "}]}", "is longer than"),
    ],
)
def test_a_file_that_is_no_sweeps_is_refused(content, told, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    if content:
        (tmp_path / "out" / "sweep.json").write_text(content)
    assert main(["summary", "out"]) == 2
    assert told in capsys.readouterr().err
