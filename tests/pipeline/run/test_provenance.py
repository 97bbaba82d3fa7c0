"""Who made a run: several makers are all named, and told; and what its files were is checked."""

import json
import shutil

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
    assert set(manifest["makers"][0]["processor"]) == {
        *("machine", "compiled_for", "features", "libm", "numpy", "blas", "reproducible")
    }
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


def test_two_runs_are_compared_with_what_may_make_them_differ(folder, tmp_path, monkeypatch, capsys):
    use_stages(monkeypatch)
    assert main([f"resume={folder}"]) == 0
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    capsys.readouterr()
    assert main(["verify", str(folder), str(other)]) == 0
    assert capsys.readouterr().out == "files: 4 equal to the last bit\n"
    manifest = json.loads((other / artifacts.MANIFEST).read_text())
    manifest["makers"][0]["processor"] |= {"libm": "glibc 2.99 with fma", "compiled_for": "znver9"}
    manifest["sha256"] |= {"evaluate.txt": "0", "more.txt": "0"}
    (other / artifacts.MANIFEST).write_text(json.dumps(manifest))
    config = artifacts.read_config(other)
    artifacts.write_config(other, {**config, "seed": 5})
    assert main(["verify", str(folder), str(other)]) == 1
    libm = present_maker()["processor"]["libm"]
    assert capsys.readouterr().out.splitlines() == [
        "configuration: seed (here 1, there 5)",
        "files: 3 equal to the last bit",
        "  evaluate.txt differs",
        "  more.txt is in one of them alone",
        f"makers differ (libm {libm}, now glibc 2.99 with fma): results may differ in the last digits",
    ]


@pytest.mark.parametrize("words", [["verify"], ["verify", "a", "b", "c"], ["verify", "nowhere"]])
def test_verify_takes_a_run_or_two(words, capsys):
    assert main(words) == 2
    assert capsys.readouterr().err.startswith("error: ")
