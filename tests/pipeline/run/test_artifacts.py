"""Files of a run: written whole, accounted for, read back with clear errors."""

import hashlib
import json
import subprocess

import pytest
import yaml

from pipeline.run import artifacts, maker
from pipeline.run.artifacts import ArtifactError
from tests.pipeline.command_line.cases import plain_config


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file.txt"
    artifacts.write_atomically(path, "old\r\n")
    assert path.read_bytes() == b"old\r\n"

    def fail(*_arguments):
        raise OSError("no space left")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="no space left"):
        artifacts.write_atomically(path, b"new")
    assert [p.name for p in path.parent.iterdir()] == ["file.txt"]
    assert path.read_bytes() == b"old\r\n"


def test_config_hash_is_that_of_sorted_json_without_hydra():
    config = {"b": [1, 2.5, None], "a": {"y": "ü", "x": True}}
    by_hand = '{"a": {"x": true, "y": "\\u00fc"}, "b": [1, 2.5, null]}'
    assert artifacts.config_hash(config) == hashlib.sha256(by_hand.encode()).hexdigest()
    assert artifacts.config_hash({**config, "hydra": {"run": 1}}) == artifacts.config_hash(config)
    assert artifacts.config_hash({**config, "b": []}) != artifacts.config_hash(config)


def test_the_written_configuration_reads_back_to_the_same_hash(tmp_path):
    config = plain_config("optimizer.penalty.missed_point_m_s=1e-5", "report.title='Ångström: yes'")
    artifacts.write_config(tmp_path, config)
    assert artifacts.read_config(tmp_path) == config
    read = yaml.safe_load((tmp_path / "config.yaml").read_text(encoding="utf-8"))
    assert artifacts.config_hash(read) == artifacts.config_hash(config)


def test_manifest_accounts_for_finished_files_only(tmp_path):
    config = plain_config("seed=3")
    artifacts.write_config(tmp_path, config)
    for name in (
        "champion.json",
        "train/checkpoint.npz",
        "episodes/a.mcap",
        "episodes/b.mcap.partial",
        ".hydra/x",
    ):
        artifacts.write_atomically(tmp_path / name, name)
    (tmp_path / "pipeline.log").write_text("x")
    artifacts.write_manifest(tmp_path, config, ["scenario"], makers=[maker.present_maker()])
    manifest = artifacts.read_manifest(tmp_path)
    assert set(manifest["sha256"]) == {"config.yaml", "champion.json", "episodes/a.mcap"}
    assert manifest["sha256"]["champion.json"] == hashlib.sha256(b"champion.json").hexdigest()
    assert manifest["config_hash"] == artifacts.config_hash(config)
    assert (manifest["seed"], manifest["finished_stages"], manifest["name"]) == (3, ["scenario"], "evaluate")
    assert manifest["versions"]["product"] == maker.product_version()
    assert manifest["versions"]["numpy"] != "absent"


def test_git_revision_is_that_of_the_sources_or_none(tmp_path, monkeypatch):
    monkeypatch.setattr(maker, "SOURCES", tmp_path)
    assert maker.git_revision() is None
    git = ["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e@x"]
    for words in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "x"]):
        subprocess.run([*git, *words], check=True)  # noqa: S603
    revision = maker.git_revision()
    assert revision is not None
    assert len(revision) == 40
    (tmp_path / "a").write_text("1")
    subprocess.run([*git, "add", "a"], check=True)  # noqa: S603
    assert maker.git_revision() == f"{revision}+changes"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("champion.json", None, r"has no champion.json; the stage train writes it, run that first"),
        ("evaluate/summary.json", '{"a": ', r"summary.json cannot be read .*; repeat the stage"),
    ],
)
def test_reading_what_is_not_there_or_cut(name, content, message, tmp_path):
    if content is not None:
        artifacts.write_atomically(tmp_path / name, content)
    with pytest.raises(ArtifactError, match=message):
        artifacts.read_json(tmp_path, name)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("- 1\n", "holds no configuration"),
        ("a: [1", "cannot be read"),
        ("a: !!python/object/apply:os.getcwd []", "cannot be read"),
        (None, "has no config.yaml; choose the folder of a run"),
    ],
)
def test_configurations_that_are_none(content, message, tmp_path):
    if content is not None:
        (tmp_path / "config.yaml").write_text(content)
    with pytest.raises(ArtifactError, match=message):
        artifacts.read_config(tmp_path)


def test_manifest_of_another_version(tmp_path):
    (tmp_path / "manifest.json").write_text(json.dumps({"manifest_version": 99}))
    with pytest.raises(ArtifactError, match="manifest version 99, this program reads 1 and 2"):
        artifacts.read_manifest(tmp_path)


def test_numbers_that_json_does_not_have_are_refused(tmp_path):
    content = {"seed": 1, "cases": [{"mean": 0.5}, {"mean": float("nan")}]}
    with pytest.raises(ArtifactError, match=r"x\.json is not written, for cases\[1\]\.mean is not finite"):
        artifacts.write_json(tmp_path / "x.json", content)
    assert list(tmp_path.iterdir()) == []


def test_a_key_that_is_no_text_is_refused():
    for content in (b"1: 2\na: 3", b"a: [{on: 3}]"):
        with pytest.raises(ValueError, match="is no text; write it in quotes"):
            artifacts.parse_config(content)
