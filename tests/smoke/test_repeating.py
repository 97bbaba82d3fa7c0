"""The same again: the same seed, other workers, another start, after an interrupt, one stage alone."""

import json
import signal
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts
from pipeline.stages import train
from tests.smoke.command_line import MINIATURE, run_pipeline

pytestmark = pytest.mark.slow

ONE_WORKER = ("optimizer.workers=1", "monte_carlo.workers=1")
TRAINING = ("+experiment=train", *MINIATURE, "stages=[scenario,train,evaluate]")


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> Path:
    """A training that everything else is compared with."""
    return run_pipeline(
        *TRAINING,
        *ONE_WORKER,
        folder=tmp_path_factory.mktemp("first") / "run",
    )


def numbers(folder: Path) -> tuple[object, str, str]:
    """What a run found: the champion's systems, how it was found, and what it flew."""
    champion = json.loads((folder / artifacts.CHAMPION).read_text())
    return (
        champion["systems"],
        (folder / artifacts.LOGBOOK).read_text(),
        artifacts.file_hash(folder / artifacts.EPISODES),
    )


def test_the_same_seed_finds_the_same_champion_on_any_number_of_workers(first, tmp_path):
    again = run_pipeline(*TRAINING, "optimizer.workers=2", "monte_carlo.workers=2", folder=tmp_path / "again")
    assert numbers(again) == numbers(first)


@pytest.fixture
def heeded_interrupt():
    """Ctrl-C as in a terminal: what runs in the background may be started with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeded_interrupt")
def test_an_interrupted_training_goes_on_as_if_nothing_had_been(first, tmp_path, monkeypatch, capsys):
    show = train.TrainingProgress.show_generation

    def show_and_interrupt(self, generation):
        show(self, generation)
        if generation.generation == 1:
            signal.raise_signal(signal.SIGINT)

    folder = tmp_path / "interrupted"
    words = [*TRAINING, *ONE_WORKER, f"hydra.run.dir={folder}"]
    with monkeypatch.context() as patched:
        patched.setattr(train.TrainingProgress, "show_generation", show_and_interrupt)
        assert main(words) == 130
    assert f"python -m pipeline resume={folder}" in capsys.readouterr().err
    assert artifacts.read_manifest(folder)["finished_stages"] == ["scenario"]
    kept = json.loads((folder / artifacts.CHAMPION).read_text())
    assert kept["provenance"]["interrupted"] == "true"
    assert main([f"resume={folder}"]) == 0
    assert (folder / artifacts.CHAMPION).read_bytes() == (first / artifacts.CHAMPION).read_bytes()
    assert numbers(folder) == numbers(first)


def test_a_stage_alone_is_repeated_on_an_earlier_runs_files(first):
    words = ["stages=[report]", f"hydra.run.dir={first}"]
    assert main(words) == 0
    before = artifacts.read_manifest(first)
    (first / artifacts.REPORT).unlink()
    assert main(words) == 0
    after = artifacts.read_manifest(first)
    assert after["finished_stages"] == ["scenario", "train", "evaluate", "report"]
    assert after["sha256"].keys() == before["sha256"].keys()
    # the page names the stages that were finished before it
    same = {name for name, digest in after["sha256"].items() if before["sha256"][name] == digest}
    assert after["sha256"].keys() - same <= {artifacts.REPORT}
