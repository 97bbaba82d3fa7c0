"""`verify` of damaged and forged runs: a sentence for each file, exit code 1, and no traceback."""

import base64
import json
import shutil
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
from tests.hostile.damage import forged

FLIGHT = "episodes/start.mcap"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown") / "run"
    words = ["+experiment=fly", "controller=paper_champion", "duration_s=60", f"hydra.run.dir={folder}"]
    assert main(words) == 0
    return folder


@pytest.fixture
def run(flown, tmp_path):
    return Path(shutil.copytree(flown, tmp_path / "run"))


def controller(text, name="controller.json"):
    return lambda content: forged(content, attachments={name: text.encode()})


def episode(key, text):
    return lambda content: forged(content, episode={key: text})


NO_POLICY = json.dumps({"kind": "policy", "onnx": base64.b64encode(b"x" * 99).decode()})
#: what is done to a recording, and what is told
FORGERIES = {
    "cut short": (lambda content: content[:5000], "start.mcap"),
    "no recording": (lambda _: b"x" * 5000, "start.mcap"),
    **{
        f"controller {text}": (controller(text), "controller.json") for text in ("5", "null", "[]", "{", "''")
    },
    "policy": (controller('{"kind": "policy", "onnx": "\\ud800!"}'), "policy cannot be read"),
    "policy of nothing": (controller(NO_POLICY), "policy"),
    "configuration a list": (controller("[]", "config.yaml"), "config.yaml holds no configuration"),
    "configuration of numbers": (controller("{deputy: 3}", "config.yaml"), "start.mcap"),
    **{
        f"{key} {text}": (episode(key, text), f"metadata '{key}'")
        for key, text in (
            *(("noise", "[1e400, 1, 2]"), ("noise", "[1, 2]"), ("position_m", "[NaN, 1, 2]")),
            *(("position_m", '{"x": 1}'), ("velocity_m_s", '["a", "b", "c"]'), ("sun_angle_rad", "[]")),
            *(("seed", "1" * 4000), ("settings", "3")),
        )
    },
}


@pytest.mark.parametrize("name", FORGERIES)
def test_a_damaged_recording_is_told_in_a_sentence(name, run, ran):
    damage, sentence = FORGERIES[name]
    path = run / FLIGHT
    path.write_bytes(damage(path.read_bytes()))
    said = ran("verify", run, code=1).out
    assert f"{FLIGHT} has CHANGED since it was written" in said
    (line,) = [line for line in said.splitlines() if line.startswith("  start.mcap: CANNOT BE CHECKED: ")]
    assert sentence in line
    assert len(line) > len("  start.mcap: CANNOT BE CHECKED: ValueError")
    if name.startswith(("controller", "policy", "configuration a list")):
        assert line.endswith("record the flight anew")


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("config.yaml", None, "config.yaml is MISSING"),
        ("config.yaml", "[]", "config.yaml has CHANGED"),
        ("config.yaml", "\x00", "config.yaml has CHANGED"),
        ("manifest.json", "[]", "manifest.json has manifest version None"),
        ("manifest.json", "[" * 100_000, "manifest.json cannot be read"),
        (FLIGHT, None, f"{FLIGHT} is MISSING"),
        (FLIGHT, "", f"{FLIGHT} has CHANGED"),
    ],
)
def test_a_damaged_file_is_told_in_a_sentence(name, content, sentence, run, ran):
    (run / name).unlink()
    if content is not None:
        (run / name).write_text(content)
    assert sentence in ran("verify", run, code=1).out


@pytest.mark.parametrize(
    ("key", "value"),
    [("sha256", []), ("sha256", {"x": 5}), ("makers", 5), ("makers", [5]), ("makers", [{"versions": []}]),
     ("makers", [{"processor": 3}]), ("config_hash", 5), ("finished_stages", "x"), ("made_by", {"train": 5})],
)  # fmt: skip
def test_a_manifest_of_other_kinds_is_told_by_its_key(key, value, run, ran):
    manifest = json.loads((run / "manifest.json").read_text()) | {key: value}
    (run / "manifest.json").write_text(json.dumps(manifest))
    assert f"it has no proper {key}" in ran("verify", run, code=1).out
    assert f"it has no proper {key}" in ran(f"resume={run}", code=2).err


def test_a_link_is_told_and_not_followed(run, tmp_path, ran):
    (tmp_path / "outside").write_bytes((run / FLIGHT).read_bytes())
    (run / FLIGHT).unlink()
    (run / FLIGHT).symlink_to(tmp_path / "outside")
    output = ran("verify", run, code=1).out
    assert f"{FLIGHT} is a link to {tmp_path / 'outside'}, which is not followed" in output
    assert f"{FLIGHT} is MISSING" in output


def test_a_file_that_is_not_in_the_manifest_is_no_file_of_the_run(run, ran):
    """As where a file is altered and its line deleted."""
    manifest = json.loads((run / "manifest.json").read_text())
    del manifest["sha256"][FLIGHT]
    (run / "manifest.json").write_text(json.dumps(manifest))
    assert f"{FLIGHT} is not in the manifest" in ran("verify", run, code=1).out
