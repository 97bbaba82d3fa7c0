"""Every file is opened and written by `fis_tools.file_access`, by what the source says."""

import ast

import pytest

from tests.smoke.file_calls import READERS, SHIPPED, WRITERS, calls, calls_of

#: functions that open something else, or nothing that another person could have put there
ELSEWHERE = {
    "fis_tools.compiled.cache": "its own folder, whose owner and permissions it checks",
    "fis_tools.document.html.read": "a part of the program",
    "fis_tools.edit.page.Editor": "a dialog",
    "fis_tools.edit.server": "a browser",
    "fis_tools.formats.c.fmu._compiled": "a folder of its own that is removed",
    "fis_tools.processors": "files of the kernel",
    "fis_tools.streams": "the null device",
    "pipeline.run.lock": "locks, of which no link is followed",
    "telemetry.file.partial_file.PartialFile.commit": "gives a file that `create` made its name",
    "telemetry.file.partial_file._sync_folder": "a folder",
    "telemetry.scene.screenshot": "a viewer, and a folder of its own that is removed",
}


def test_every_file_is_opened_by_one_module():
    allowed = READERS | WRITERS | {SHIPPED}
    others = [each for each in calls() if each.name.rpartition("file_access.")[2] not in allowed]
    strays = [
        f"{each.module}:{each.line} calls {each.name}"
        for each in others
        if not any(each.site == site or each.site.startswith(f"{site}.") for site in ELSEWHERE)
    ]
    assert strays == []


def test_no_exception_is_out_of_date():
    sites = [each.site for each in calls()]
    assert [site for site in ELSEWHERE if not any(each.startswith(site) for each in sites)] == []


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
