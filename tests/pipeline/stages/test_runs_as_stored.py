"""What stages print and write in small runs is as it was when somebody last looked: lines, files, tables."""

import pytest

from tests import stored
from tests.pipeline.stored_runs import RUNS, made

pytestmark = pytest.mark.slow
#: told elsewhere, or of the machine
LEFT_OUT = (
    r"\.mcap$",
    r"^config\.yaml",
    r"^manifest",
    r"^pipeline\.log",
    r"\.html$",
    r"\.json$",
    r"^assure/",
    r"^train/",
    r"^compare/.*parquet",
    r"logbook",
    r"\.jsonl$",
)


@pytest.mark.parametrize("name", RUNS)
def test_a_run_prints_and_writes_what_it_did(name, tmp_path, file_regression):
    _, printed = made(tmp_path, name)
    text = stored.rounded(printed) + stored.folder(tmp_path, LEFT_OUT)
    file_regression.check(text, extension=".txt", basename=name)
