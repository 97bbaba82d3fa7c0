"""One process at a time in a run's folder."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts
from pipeline.run.lock import LOCK, HeldError, held
from tests.pipeline.command_line.cases import use_stages
from tests.places import PROJECT

HOLD = "import sys, time; from pathlib import Path; from pipeline.run.lock import held\n" + (
    "with held(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(600)\n"
)
FLY = ["+experiment=fly", "controller=coast"]


@contextmanager
def holder(folder: Path) -> Iterator[subprocess.Popen]:
    """A process that holds a folder; killed in the end."""
    command = [sys.executable, "-c", HOLD, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=PROJECT) as process:  # noqa: S603
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        try:
            yield process
        finally:
            process.kill()


def test_a_second_process_is_refused_and_told_whose_the_folder_is(tmp_path, monkeypatch, capsys):
    called = use_stages(monkeypatch)
    folder = tmp_path / "run"
    with holder(folder) as process:
        with pytest.raises(HeldError, match=rf"run is held by process {process.pid} on \S+ since 20"):
            held(folder).__enter__()
        assert main([*FLY, f"hydra.run.dir={folder}"]) == 2
        assert f"is held by process {process.pid} on" in capsys.readouterr().err
    assert called == []
    assert not (folder / artifacts.CONFIG).exists()


def test_the_lock_of_a_killed_process_is_told_and_taken_over(tmp_path, monkeypatch, capsys):
    use_stages(monkeypatch)
    folder = tmp_path / "run"
    with holder(folder) as process:
        pass
    assert (folder / LOCK).exists()
    assert main([*FLY, f"hydra.run.dir={folder}"]) == 0
    told = capsys.readouterr().err
    assert f"was held by process {process.pid} on" in told
    assert "which is gone; its lock is taken over" in told
    assert not (folder / LOCK).exists()


def test_a_second_run_of_another_seed_leaves_the_first_ones_results_alone(tmp_path, monkeypatch, capsys):
    """Started while the first is in a stage."""
    folder, codes = tmp_path / "run", []

    def meanwhile(_experiment, _folder):
        codes.append(main([*FLY, "seed=2", f"hydra.run.dir={folder}"]))
        codes.append(main([f"resume={folder}"]))

    use_stages(monkeypatch, record=meanwhile)
    assert main([*FLY, "seed=1", f"hydra.run.dir={folder}"]) == 0
    assert codes == [2, 2]
    assert f"is held by process {os.getpid()} on" in capsys.readouterr().err
    assert artifacts.read_config(folder)["seed"] == 1
    assert artifacts.read_manifest(folder)["seed"] == 1


@pytest.mark.parametrize("resumed", [True, False])
def test_a_run_killed_before_its_manifest_goes_on_or_begins_anew(resumed, tmp_path, monkeypatch):
    called = use_stages(monkeypatch)
    folder = tmp_path / "run"
    words = [*FLY, "seed=4", f"hydra.run.dir={folder}"]
    with monkeypatch.context() as patched:
        patched.setattr(artifacts, "write_manifest", lambda *_, **__: (_ for _ in ()).throw(SystemExit(9)))
        with pytest.raises(SystemExit):
            main(words)
    assert [path.name for path in folder.iterdir()] == [artifacts.CONFIG]
    assert main([f"resume={folder}"] if resumed else words) == 0
    assert [(name, e.seed) for name, e, _ in called] == [("record", 4)]
    assert artifacts.read_manifest(folder)["finished_stages"] == ["record"]
