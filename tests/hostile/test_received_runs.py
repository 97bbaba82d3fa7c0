"""What is received from somebody else is data: a run's folder leads nowhere else, and text is cleaned."""

import hashlib
import io
import json
import os
from pathlib import Path

import pytest

import telemetry
from fis_tools.formats import serialize
from fis_tools.review import page as review_page
from fis_tools.review.content import read_evidence
from pipeline.command_line.cli import main
from pipeline.report.proof_of_run import read_theorem
from pipeline.run import artifacts, configuration, lock, manifests, writing
from plain_files.plain_text import MISSING_SIGN, plain
from tests.fis_tools.sample_controllers import PAPER_LIKE
from tests.pipeline.command_line.cases import EVALUATE, plain_config, use_stages


def received(folder: Path, **groups) -> Path:
    """A run's folder that holds a configuration alone."""
    config = plain_config() | groups
    if "tracking" in groups:  # the name that the group had in 0.1.0
        del config["logger"]
    configuration.write(folder, config)
    return folder


@pytest.mark.parametrize(("group", "again"), [("logger", ["stages=[train]"]), ("tracking", [])])
def test_a_logger_in_a_stored_configuration_writes_nowhere_else(again, group, tmp_path):
    controller = plain_config("controller=paper_champion")["controller"]
    small = {
        "controller": controller,
        "optimizer": {"population_size": 4, "generations": 1},
        "duration_s": 60.0,
    }
    logger = {"kind": "tensorboard", "place": str(tmp_path / "elsewhere")}
    folder = received(tmp_path / "run", stages=["train"], **{group: logger}, **small)
    if again:
        assert main([f"resume={folder}"]) == 0
    assert main([f"hydra.run.dir={folder}", *again] if again else [f"resume={folder}"]) == 0
    assert list((folder / artifacts.TENSORBOARD).iterdir())
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_settings_that_no_result_depends_on_may_be_given_anew(tmp_path, monkeypatch, ran):
    called = use_stages(monkeypatch)
    folder = received(tmp_path / "run")
    assert main([f"resume={folder}", "engine.part_cases=7", "logger.kind=tensorboard"]) == 0
    experiment = called[-1][1]
    assert (experiment.engine.part_cases, experiment.logger.kind) == (7, "tensorboard")
    assert main([*EVALUATE, f"hydra.run.dir={folder}", "stages=[report]", "monte_carlo.workers=3"]) == 0
    assert called[-1][1].monte_carlo.workers == 3
    assert "drop seed=3" in ran(f"resume={folder}", "seed=3", code=2).err
    plain = plain_config()
    changed = plain | {"engine": {"kind": "dask", "scheduler": "tcp://x:1"}, "logger": {"kind": "none"}}
    changed["monte_carlo"] = plain["monte_carlo"] | {"workers": 7}
    assert configuration.config_hash(changed) == configuration.config_hash(plain)


def test_a_run_of_a_version_that_hashed_every_key_is_resumed(tmp_path, monkeypatch):
    use_stages(monkeypatch)
    folder = received(tmp_path / "run", engine={"kind": "dask", "processes": 3, "scheduler": "tcp://x:1"})
    assert main([f"resume={folder}"]) == 0
    manifest = manifests.read(folder)
    whole = json.dumps(configuration.read(folder), sort_keys=True)
    manifest["config_hash"] = hashlib.sha256(whole.encode()).hexdigest()
    writing.write_json(folder / artifacts.MANIFEST, manifest)
    assert main([f"resume={folder}"]) == 0


LINKED = (".lock", "pipeline.log", "config.yaml", "evaluate", "search/journal.log.lock", "outputs/made")


@pytest.mark.parametrize("name", LINKED)
@pytest.mark.parametrize("is_finished", [False, True])
def test_a_link_in_a_runs_folder_is_not_followed(name, is_finished, tmp_path, monkeypatch, ran):
    called = use_stages(monkeypatch)
    folder, outside = received(tmp_path / "run"), tmp_path / "outside"
    if is_finished:
        assert main([f"resume={folder}"]) == 0
    outside.write_text((folder / "config.yaml").read_text())
    before = outside.read_bytes()
    called.clear()
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(outside)
    repeat = [[f"hydra.run.dir={folder}", "stages=[report]"]] if is_finished else []
    for command in [[f"resume={folder}"], [*EVALUATE, f"hydra.run.dir={folder}"], *repeat]:
        assert "a link" in ran(*command, code=2).err
    assert outside.read_bytes() == before
    assert called == []


def test_pipes_and_devices_are_refused_before_they_are_opened(tmp_path, ran):
    folder = received(tmp_path / "run")
    os.mkfifo(folder / "pipeline.log")
    assert "pipeline.log is a pipe, socket or device" in ran(f"resume={folder}", code=2).err


HARMFUL = ("\x1b[31mred\x1b[0m", "\x9b31m", "a\u202eb", "\u2066x", "\ud800", "\x00", "\x07", "\u2028")
HARMLESS = ("°C", "m/s²", "Größe", "速度", "two\nlines", "a\u00a0b", "e\u0301", "👩\u200d🚀")


@pytest.mark.parametrize("text", HARMLESS)
def test_other_letters_stay(text):
    assert plain(text) == text


@pytest.mark.parametrize("text", HARMFUL)
def test_harmful_letters_are_replaced_also_in_a_controller(text):
    clean = plain(text)
    assert MISSING_SIGN in clean
    assert not set(clean) & set("\x1b\x9b\u202e\u2066\ud800\x00\x07\u2028")
    clean.encode()
    content = json.loads(serialize.dump_json(PAPER_LIKE))
    variable = content["systems"][0]["inputs"][0]
    variable |= {"unit": text, "description": text}
    content |= {"attributes": {"maker": text}, "provenance": {text: "x"}}
    read = serialize.loads(json.dumps(content), "json")
    first = read.systems[0].inputs[0]
    assert (first.unit, first.description) == (clean, clean)
    assert (read.attributes, read.provenance) == ((("maker", clean),), ((clean, "x"),))
    serialize.dump_yaml(read).encode()


def test_what_a_recording_and_a_configuration_say(tmp_path):
    path = tmp_path / "said.mcap"
    words = {"input_names": json.dumps(["\u202ea"]), "input_units": "[]", "output_name": "\x1b[2J"}
    metadata = {"fis.x": {**words, "output_unit": "", "rules": "[]"}}
    with telemetry.EpisodeWriter(path, metadata=metadata, attachments={}):
        pass
    assert telemetry.read(path).metadata["fis.x"]["output_name"] == f"{MISSING_SIGN}[2J"
    read = configuration.parse(b'{name: "\\e[31m", list: ["\\u202e"]}')
    assert read == {"name": f"{MISSING_SIGN}[31m", "list": [MISSING_SIGN]}


@pytest.mark.parametrize("text", HARMFUL)
def test_what_a_lock_a_proof_and_evidence_say_is_made_plain(text, tmp_path):
    holder = {"process": 1, "host": text, "since": text}
    said = lock._holder(io.StringIO(json.dumps(holder)))
    (tmp_path / "prove").mkdir()
    (tmp_path / artifacts.THEOREM).write_text(json.dumps({"fault": text}))
    requirement = {"id": text, "title": text, "sentence": text}
    evidence = {
        "schema": "evidence",
        "controller": {"name": text, "sha256": "0"},
        "requirements": [requirement],
    }
    (tmp_path / "evidence.json").write_text(json.dumps(evidence))
    read = read_evidence(tmp_path / "evidence.json", "0")
    for words in (said, str(read_theorem(tmp_path)["fault"]), *read[1][0]):
        assert MISSING_SIGN in words
        assert not set(words) & set("\x1b\x9b\u202e\u2066\ud800\x00\x07\u2028")


def test_a_verdict_is_told_with_what_was_checked_of_it(tmp_path):
    """Forged evidence names a controller by its hash as well; the manifest of its run tells."""
    folder = tmp_path / "run"
    requirement = {"id": "R1", "sentence": "Shown: nothing ever fails."}
    evidence = {"schema": "evidence", "requirements": [requirement]}
    evidence["controller"] = {"name": "x", "sha256": serialize.fingerprint(PAPER_LIKE)}
    writing.write_atomically(folder / artifacts.CONFIG, "x")
    writing.write_json(folder / artifacts.EVIDENCE, evidence)
    path = folder / artifacts.EVIDENCE

    def page():
        return review_page.write(PAPER_LIKE, evidence=path)

    assert "beside it is no manifest of a run" in page()
    digest = artifacts.file_hash(path)
    writing.write_json(folder / artifacts.MANIFEST, {"sha256": {artifacts.EVIDENCE: digest}})
    assert "it is as the manifest of its run says" in page()
    requirement["sentence"] = "Shown: all of it."
    writing.write_json(path, evidence)
    assert "ALTERED: it is not what the manifest of its run says" in page()
    row = page().partition("Shown: all of it.")[2][:200]
    assert "as the file says, not checked here" in row
