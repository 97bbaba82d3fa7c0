"""Recordings of small runs are as they were when somebody last looked: events, descriptions, columns."""

import pytest

import telemetry
from telemetry.file import topics
from tests import stored
from tests.pipeline.stored_runs import made

pytestmark = pytest.mark.slow
LEFT_OUT = ("product_version", "config_hash", "checksum", "rules")


@pytest.mark.parametrize(
    ("name", "recorded"), [("evaluation", "worst"), ("fleet", "worst"), ("docking", "median")]
)
def test_a_recording_is_as_it_was(name, recorded, tmp_path, file_regression):
    made(tmp_path, name)
    text = ""
    for number, path in enumerate(sorted((tmp_path / "episodes").glob(f"{recorded}*.mcap"))):
        recording = telemetry.read(path)
        log = recording[topics.LOG]
        rows = zip(log.time_s.tolist(), log["level"].tolist(), log["message"].tolist(), strict=True)
        parts = {"events": [f"{time_s:g} s {level}: {message}" for time_s, level, message in rows]}
        parts |= {"metadata": {name: dict(each) for name, each in recording.metadata.items()}}
        if number == 0:
            parts |= {
                topic: {"times": of.time_s, **of.columns}
                for topic, of in recording.topics.items()
                if topic != topics.LOG
            }
        text += f"== {path.name}\n{stored.text_of(parts, LEFT_OUT)}"
    file_regression.check(text, extension=".txt", basename=name)
