"""Sweeps: failures, interrupts, resuming, and files that are none of theirs."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.cli import main
from pipeline.evaluation.monte_carlo import summarise
from pipeline.run import artifacts, lock, manifests, sweep, tables, writing
from tests.pipeline.command_line.cases import EVALUATE, FLY, use_stages
from tests.pipeline.evaluation.test_paired_runs import evaluation

OUT = Path("out")

SWEEP = [
    "-m", *EVALUATE, "stages=[scenario,evaluate]", "hydra.sweep.dir=out", "seed=1,2,3",
    "deputy.mass_kg=10,12", "sun=fixed,random",
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


def test_the_jobs_of_a_sweep_leave_another_sweeps_runs_alone(monkeypatch, ran):
    use_stages(monkeypatch)
    sweep = ["-m", *FLY, "hydra.sweep.dir=sweep"]
    assert main([*sweep, "seed=1,2"]) == 0
    before = {path: path.read_bytes() for path in Path("sweep").glob("seed=?/[a-z]*.*")}
    called = use_stages(monkeypatch)
    printed = ran(*sweep, "seed=2,3", "duration_s=1800", code=2).err
    assert f"{Path('sweep', 'seed=2')} holds another run" in printed
    assert f"resume={Path('sweep', 'seed=2')}" in printed
    assert called == []
    assert not Path("sweep/seed=3").exists()
    assert all(path.read_bytes() == content for path, content in before.items())


def evaluate(experiment, folder):
    """Write an evaluation in which a heavier deputy burns 0.3 m/s less, whatever else differs."""
    episodes = evaluation(experiment.seed, shift=-0.15 * (experiment.mission.deputy.mass_kg - 10.0))
    tables.write_parquet(folder / artifacts.EPISODES, episodes)
    summary = summarise({**episodes, "mean_distance_m": np.ones(40)}, 95.0)
    writing.write_json(folder / artifacts.SUMMARY, {"confidence_percent": 95.0, "num_cases": 40, **summary})


@pytest.mark.slow
def test_a_sweep_with_injected_failures_is_summarised(monkeypatch, ran):
    def evaluate_or_fail(experiment, folder):
        key = str(experiment.seed), experiment.mission.deputy.mass_kg, experiment.sun.mode
        if error := INJECTED.get(key):
            raise error
        evaluate(experiment, folder)

    use_stages(monkeypatch, evaluate=evaluate_or_fail)
    *_, ends = ran(*LARGE, code=2, slips=True).err.split("[16/16]")
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
    results = tables.read_parquet(OUT, "effects.parquet")
    heavier = (results["factor"] == "deputy.mass_kg") & (results["metric"] == "delta_v_m_s")
    # of all seeds but 2 and 4 under a fixed Sun, and but 1 and 3 under a random one, both masses were flown,
    # from 40 starts each; seeds only draw the starts, so that each start counts
    assert results["difference"][heavier] == pytest.approx(-0.3)
    assert results["pairs"][heavier].tolist() == [4 * 40]
    page = (OUT / "summary.html").read_text()
    assert all(name in page for name in failed)
    assert "python -m pipeline fly out/" in page

    use_stages(monkeypatch, evaluate=evaluate)
    assert "16 of 16 runs are done" in ran("resume=out").err
    known = sweep.read(OUT)
    assert [run.failure for run in known] == [""] * 16
    assert manifests.read(OUT / known[0].folder)["command"] == list(known[0].command)
    assert "nothing is left to do: all 16 runs are finished" in ran("resume=out").err


def test_an_interrupted_sweep_goes_on_with_what_is_left(monkeypatch, ran):
    def stop(experiment, folder):
        if experiment.seed == 2:
            raise KeyboardInterrupt
        evaluate(experiment, folder)

    words = [word for word in SWEEP if not word.startswith(("deputy", "sun"))]
    use_stages(monkeypatch, evaluate=stop)
    assert "2 runs of the sweep are left. To go on with all: python -m" in ran(*words, code=130).err
    called = use_stages(monkeypatch, evaluate=evaluate)
    left = Path("out", "seed=1", lock.LOCK)  # by a process that was killed when it had finished the run
    left.touch()
    assert main(["resume=out"]) == 0
    assert [(name, e.seed) for name, e, _ in called] == [("evaluate", 2), ("scenario", 3), ("evaluate", 3)]
    assert not left.exists()
    with lock.held(left.parent):  # by a process that is alive
        assert "nothing is left to do" in ran("resume=out").err
        assert left.exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "out holds no runs; give the folder of a sweep, or"),
        ('{"sweep_version": 1, "runs": [{"folder": "../x"}]}', "is no file of a sweep"),
        ('{"sweep_version": 1, "runs": [{"folder": "/x", ' + REST + "}]}", "lies outside"),
        ('{"sweep_version": 1, "runs": [{"folder": "' + 256 * "x" + '", ' + REST + "}]}", "is longer than"),
    ],
)
def test_a_file_that_is_no_sweeps_is_refused(content, message, tmp_path, ran):
    (tmp_path / "out").mkdir()
    if content:
        (tmp_path / "out" / "sweep.json").write_text(content)
    assert message in ran("summary", "out", code=2).err


@pytest.mark.parametrize("damage", ["{", '{"sweep_version": 9, "runs": []}'])
def test_a_sweep_goes_on_without_its_damaged_file(damage, monkeypatch, ran):
    """By the cure that the message names."""
    use_stages(monkeypatch, evaluate=evaluate)
    words = ["-m", *EVALUATE, "stages=[scenario,evaluate]", "seed=1,2"]
    assert main([*words, "hydra.sweep.dir=out"]) == 0
    (OUT / sweep.SWEEP).write_text(damage)
    shutil.rmtree(OUT / "seed=2")
    for refused in (["summary", "out"], ["resume=out"], [*words, "hydra.sweep.dir=out"]):
        cure = ran(*refused, code=2).err
        assert "; restore it, or delete it: python -m pipeline summary " in cure
        assert "where hydra.sweep.dir=" in cure
    (OUT / sweep.SWEEP).unlink()
    assert ran("summary", "out").out.count("seed=") > 2
    called = use_stages(monkeypatch, evaluate=evaluate)
    assert main([*words, "hydra.sweep.dir=out"]) == 0
    assert {experiment.seed for _, experiment, _ in called} == {2}
    assert [run.folder for run in sweep.read(OUT)] == ["seed=1", "seed=2"]


@pytest.mark.parametrize("of_sweep", [True, False])
@pytest.mark.parametrize(
    "name", [artifacts.SUMMARY, artifacts.CONFIG, artifacts.MANIFEST, artifacts.EPISODES]
)
def test_a_run_that_cannot_be_read_is_left_out_of_a_summary_and_named(name, of_sweep, monkeypatch, ran):
    use_stages(monkeypatch, evaluate=evaluate)
    words = ["-m", *EVALUATE, "stages=[scenario,evaluate]", "seed=1", "deputy.mass_kg=10,11,12"]
    assert main([*words, "hydra.sweep.dir=out"]) == 0
    (OUT / "deputy.mass_kg=11" / name).write_text("{")
    if not of_sweep:
        (OUT / sweep.SWEEP).unlink()
    printed = ran("summary", "out").out
    assert f"left out: deputy.mass_kg=11: {OUT}/deputy.mass_kg=11/{name} cannot be read" in printed
    rows = tables.read_parquet(OUT, "summary.parquet")
    assert rows["state"].tolist() == ["done", "unreadable", "done"]
    difference = rows["delta_v_m_s"][2] - rows["delta_v_m_s"][0]
    assert difference == pytest.approx(-0.3)
    assert "Left out" in (OUT / "summary.html").read_text()
    for other in (10, 12):
        (OUT / f"deputy.mass_kg={other}" / name).write_text("{")
    assert "cannot be read" in ran("summary", "out", code=2).err


def test_where_a_run_is_needed_those_of_a_sweep_are_named(tmp_path, ran, monkeypatch):
    use_stages(monkeypatch)
    assert main(["-m", *FLY, "hydra.sweep.dir=sweep", "seed=range(1,6)"]) == 0
    first = ", ".join(f"sweep/seed={seed}" for seed in (1, 2, 3))
    for words in (
        *(["again", "sweep"], ["fly", "sweep"], ["verify", "sweep"], ["repeat", "sweep", "record"]),
        *(["stages=[record]", "hydra.run.dir=sweep"], ["compare=sweep,sweep"]),
    ):
        assert f"; choose the folder of a run, such as {first}" in ran(*words, code=2).err, words
    # from the folder of all runs, too, and of what cannot be read nothing is said
    (tmp_path / "all" / "fly-sweep").mkdir(parents=True)
    Path("sweep").rename("all/fly-sweep/20260101")
    assert "such as all/fly-sweep/20260101/seed=1, all/fly" in ran("again", "all", code=2).err
    monkeypatch.setattr("os.scandir", lambda folder: (folder / "none").stat())
    assert ran("again", "all", code=2).err.endswith("; choose the folder of a run\n")


def test_one_run_is_compared_with_none_and_others_are_named(ran, monkeypatch):
    use_stages(monkeypatch)
    assert main(["-m", *FLY, "hydra.sweep.dir=sweep", "seed=1,2"]) == 0
    for words in (["compare=sweep"], ["compare", "sweep"]):
        printed = ran(*words, code=2).err
        assert "compare takes 2 to 8 folders and nothing else, and 1 word is given" in printed
        assert "; choose the folders of runs, such as sweep/seed=1, sweep/seed=2; see" in printed
    assert "; choose others too, such as sweep/seed=2; see" in ran("compare=sweep/seed=1", code=2).err
    assert "there is no key compare.a" in ran("compare={a:1,b:2}", *FLY, code=2).err


def test_folders_with_commas_in_their_names_are_compared(ran, monkeypatch):
    use_stages(monkeypatch, evaluate=evaluate)
    assert main(["-m", *EVALUATE, "stages=[evaluate]", "hydra.sweep.dir=sweep", "deputy.mass_kg=10,12"]) == 0
    Path("sweep").rename("a, b")
    compared = ran("compare=a, b/deputy.mass_kg=10,a, b/deputy.mass_kg=12").out
    assert "A: deputy.mass_kg=10  B: deputy.mass_kg=12" in compared
    assert "a is no folder" in ran("compare=a,b", code=2).err


def test_a_damaged_summary_is_refused_where_runs_are_summarised_or_compared(tmp_path, ran):
    for name in ("a", "b"):
        for path, text in ((artifacts.CONFIG, "name: x"), (artifacts.SUMMARY, "{}")):
            writing.write_atomically(tmp_path / "out" / name / path, text)
    (tmp_path / "out" / "b" / artifacts.MANIFEST).write_text("{}")
    assert "out/b is one run; give the folder that holds it" in ran("summary", "out/b", code=2).err
    assert "nowhere is no folder" in ran("summary", "nowhere", code=2).err
    runs = '[{"folder": "a", ' + REST + "}]"
    (tmp_path / "out" / "sweep.json").write_text(f'{{"sweep_version": 1, "runs": {runs}}}')
    for words in (("summary", "out"), ("compare=out/a,out/b",)):
        assert "summary.json has no number num_cases" in ran(*words, code=2).err
