"""Files of a run that someone made to harm: refused in a sentence, at once, in little memory."""

import json
import tracemalloc

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fis_tools.errors import ControllerFileError
from fis_tools.source import read_controller
from pipeline.run import artifacts
from telemetry import RecordingError
from telemetry.scene import runs

BILLION = b"a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + b"".join(
    b"a%d: &a%d [%s]\n" % (level, level, b", ".join([b"*a%d" % (level - 1)] * 9)) for level in range(1, 9)
)
TRACK = {"case": [0, 0], "sample": [0, 1], **{f"position_{axis}_m": [0.0, 1.0] for axis in "xyz"}}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (BILLION, r"it has an alias \(\*\)"),
        (b"a: " + b"[" * 100_000, "nested more than 64 deep"),
        (b"#" * 3_000_000, "it has 3000000 bytes, and at most"),
        (b"\xff\xfe\x00", "cannot be read"),
        (b"a: 99-99-99T\nb: 2001-99-99\n", "cannot be read"),
    ],
)
def test_configurations(content, message, tmp_path):
    (tmp_path / artifacts.CONFIG).write_bytes(content)
    tracemalloc.start()
    with pytest.raises(artifacts.ArtifactError, match=message):
        artifacts.read_config(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()


def test_deep_manifests(tmp_path):
    (tmp_path / artifacts.CONFIG).write_text("a: 1\n")
    (tmp_path / artifacts.MANIFEST).write_text("[" * 100_000)
    with pytest.raises(artifacts.ArtifactError, match=r"manifest\.json cannot be read"):
        artifacts.read_manifest(tmp_path)
    with pytest.raises(RecordingError, match=r"manifest\.json cannot be read"):
        runs.file_of(tmp_path, "champion")


@pytest.mark.parametrize("name", ["../secret.json", "/etc/passwd"])
def test_a_manifest_leads_nowhere_else(name, tmp_path):
    (tmp_path / artifacts.MANIFEST).write_text(json.dumps({"files": {"champion": name}}))
    with pytest.raises(RecordingError, match="lies outside the folder"):
        runs.file_of(tmp_path, "champion")
    with pytest.raises(ControllerFileError, match="names a champion outside the folder"):
        read_controller(tmp_path)


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("sample", ["a", "b"], "no column sample of numbers without gaps"),
        ("sample", [0, None], "no column sample of numbers without gaps"),
        ("sample", [0.0, float("nan")], "no whole numbers in its column sample"),
        ("sample", [0, 2**62], "does not hold whole trajectories"),
        ("position_x_m", [[1.0], [2.0]], "no column position_x_m of numbers"),
        ("case", [{"a": 1}, {"a": 2}], "no column case of numbers"),
    ],
)
def test_tables_of_other_types(column, values, message, tmp_path):
    path = tmp_path / "trajectories.parquet"
    pq.write_table(pa.table({**TRACK, column: values}), path)
    with pytest.raises(RecordingError, match=message):
        runs.read_evaluation(path)


def test_a_table_that_unpacks_to_more_than_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "MOST_BYTES", 10_000_000)
    path = tmp_path / "trajectories.parquet"
    zeros = pa.array(np.zeros(2_000_000, dtype=np.int64))
    pq.write_table(pa.table(dict.fromkeys(TRACK, zeros)), path, compression="zstd", use_dictionary=True)
    assert path.stat().st_size < 100_000
    with pytest.raises(RecordingError, match=r"unpacks to .* bytes; at most"):
        runs.read_evaluation(path)
