"""Every file is opened and written by `plain_files.file_access`, by what the source says."""

import ast

import pytest

from tests.places import PACKAGES, PROJECT
from tests.smoke.file_calls import READERS, REASON, SHIPPED, WRITERS, calls, calls_of


def test_every_file_is_opened_by_one_module():
    allowed = READERS | WRITERS | {SHIPPED}
    others = [each for each in calls() if each.name.rpartition("file_access.")[2] not in allowed]
    strays = [f"{each.module}:{each.line} calls {each.name}" for each in others if not each.reason]
    assert strays == []


def test_no_reason_is_out_of_date():
    sources = (
        path.read_text(encoding="utf-8") for name in PACKAGES for path in (PROJECT / name).rglob("*.py")
    )
    lines = {(each.module, each.line) for each in calls() if each.reason}
    assert sum(len(REASON.findall(source)) for source in sources) == len(lines)


@pytest.mark.parametrize(
    "line",
    [
        "open('x')",
        "path.open('rb')",
        "Path('x').read_text()",
        "path.write_bytes(b'')",
        "path.replace(other)",
        "path.rename(other)",
        "os.open('x', os.O_RDONLY)",
        "os.replace('x', 'y')",
        "np.load('x')",
        "np.loadtxt(path)",
        "pq.read_table(path)",
        "ParquetFile(path)",
        "shutil.copyfile('x', 'y')",
        "tempfile.NamedTemporaryFile()",
        "figure.savefig(path)",
    ],
)
def test_a_file_opened_otherwise_is_noticed(line):
    heads = "import os, shutil, tempfile\nimport numpy as np\nimport pyarrow.parquet as pq\n"
    source = f"{heads}from pyarrow.parquet import ParquetFile\ndef f(path, other, figure):\n    {line}\n"
    (call,) = calls_of(ast.parse(source), "module")
    assert call.site == "module.f"


@pytest.mark.parametrize(
    "line",
    [
        "text.replace('a', 'b')",
        "replace(system, name='x')",
        "np.load(io.BytesIO(content))",
        "pq.read_table(stream)",
    ],
)
def test_what_opens_no_file_is_none(line):
    heads = "import io\nimport numpy as np\nimport pyarrow.parquet as pq\nfrom dataclasses import replace\n"
    source = f"{heads}def f(text, system, content):\n    stream = io.BytesIO(content)\n    {line}\n"
    assert list(calls_of(ast.parse(source), "module")) == []
