"""Every reader refuses damaged files in a sentence, soon and in little memory, as `benchmarks fuzz` tries."""

import pytest

from tests.hostile.attack import attack
from tests.hostile.readers import all_readers

pytestmark = pytest.mark.slow

NAMES = (
    "json",
    "yaml",
    "fis",
    "fll",
    "fml",
    "fcl",
    "starts",
    "requirements",
    "settings",
    "run",
    "forces",
    "conditions",
    "table",
    "checkpoint",
    "onnx",
    "obj",
    "stl",
    "sweep",
    "journal",
    "learned_csv",
    "learned_parquet",
    "logged_csv",
    "logged_parquet",
    "analyses",
)


@pytest.mark.parametrize("name", [*NAMES, "recording", "verify"])
def test_a_reader_refuses_what_is_damaged(name, tmp_path):
    (reader,) = all_readers([name]).values()
    reader.read(reader.samples[0], tmp_path)
    assert attack(reader, 150, 7, tmp_path) == 150
