"""Who made a run: several makers are all named, and told; and what its files were is checked."""

import json

import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts, runner
from pipeline.run.maker import present_maker
from tests.pipeline.command_line.cases import use_stages

EVALUATE = ["+experiment=evaluate", "controller=coast"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run of whose stages the second failed."""

    def fail(_experiment, _folder):
        raise OSError("disk full")

    with monkeypatch.context() as patched:
        use_stages(patched, evaluate=fail)
        assert main([*EVALUATE, f"hydra.run.dir={tmp_path / 'run'}"]) == 2
    return tmp_path / "run"


def test_a_run_that_another_maker_goes_on_with_names_both(folder, monkeypatch, capsys):
    first = artifacts.read_manifest(folder)
    assert first["made_by"] == {"scenario": [0], "evaluate": [0]}
    capsys.readouterr()
    use_stages(monkeypatch)
    other = {**present_maker(), "sources": "0" * 64}
    monkeypatch.setattr(runner, "present_maker", lambda: other)
    assert main([f"resume={folder}"]) == 0
    assert (
        "note: another maker began this run (other sources); what is made now may" in capsys.readouterr().err
    )
    manifest = artifacts.read_manifest(folder)
    assert manifest["makers"] == [*first["makers"], other]
    assert manifest["made_by"] == {"scenario": [0], "evaluate": [0, 1], "record": [1], "report": [1]}


def test_the_same_maker_is_named_once_and_nothing_is_told(folder, monkeypatch, capsys):
    use_stages(monkeypatch)
    capsys.readouterr()
    assert main([f"resume={folder}"]) == 0
    assert "another maker" not in capsys.readouterr().err
    manifest = artifacts.read_manifest(folder)
    assert len(manifest["makers"]) == 1
    assert set(manifest["makers"][0]["processor"]) == {"machine", "compiled_for", "features", "libm", "blas"}
    assert manifest["made_by"]["evaluate"] == [0]


def test_a_run_of_a_version_without_makers_keeps_what_it_told(folder, monkeypatch, capsys):
    use_stages(monkeypatch)
    manifest = json.loads((folder / artifacts.MANIFEST).read_text())
    for name in ("makers", "made_by"):
        del manifest[name]
    manifest["versions"]["numpy"] = "1.0"
    (folder / artifacts.MANIFEST).write_text(json.dumps(manifest))
    capsys.readouterr()
    assert main([f"resume={folder}"]) == 0
    assert "(numpy 1.0, now " in capsys.readouterr().err
    assert artifacts.read_manifest(folder)["makers"][0]["versions"]["numpy"] == "1.0"


def test_verify_tells_each_file_that_is_not_what_was_written(folder, monkeypatch, capsys):
    use_stages(monkeypatch)
    assert main([f"resume={folder}"]) == 0
    capsys.readouterr()
    assert main(["verify", str(folder)]) == 0
    assert capsys.readouterr().out == "files: 5 as they were written\nflights: none is recorded\n"
    (folder / "evaluate.txt").write_text("better")
    (folder / "record.txt").unlink()
    (folder / "more.txt").write_text("x")
    assert main(["verify", str(folder)]) == 1
    told = capsys.readouterr().out
    assert "files: 3 as they were written" in told
    assert "evaluate.txt has CHANGED since it was written" in told
    assert "record.txt is MISSING" in told
    assert "more.txt is not in the manifest" in told


@pytest.mark.parametrize("words", [["verify"], ["verify", "a", "b"], ["verify", "nowhere"]])
def test_verify_takes_one_run(words, capsys):
    assert main(words) == 2
    assert capsys.readouterr().err.startswith("error: ")
