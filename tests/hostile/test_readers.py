"""Every reader refuses damaged files in a sentence, soon and in little memory; `benchmarks.fuzz` goes on."""

import pytest
from benchmarks.readers import all_readers

from benchmarks.fuzz import attack

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
)


@pytest.mark.parametrize("name", [*NAMES, pytest.param("recording", marks=pytest.mark.slow)])
def test_a_reader_refuses_what_is_damaged(name, tmp_path):
    (reader,) = all_readers([name]).values()
    reader.read(reader.samples[0], tmp_path)
    assert attack(reader, 150, 7, tmp_path) >= 100
