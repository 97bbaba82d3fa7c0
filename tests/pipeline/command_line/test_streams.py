"""Standard streams that are closed, full or poor in letters end no work, in a process or in a call."""

import io
import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

import pytest

from fis_tools.__main__ import main as review
from pipeline.command_line.cli import main
from telemetry.commands import main as telemetry
from tests import night
from tests.places import PROJECT

FLIGHT = [sys.executable, "-m", "pipeline", "+experiment=fly", "controller=coast", "duration_s=600"]
#: what prints, a package each
PRINTERS = [
    ["pipeline", "--help"],
    ["fis_tools", "show", "docs/examples/tipper.fis"],
    ["telemetry", "--help"],
]
HELPS = [["pipeline", "--help"], ["fis_tools", "bounds", "--help"], ["telemetry"]]


def shell(command, redirection, **variables):
    """Run a command as a shell redirects its streams; return what came out of those that are left."""
    line = f"{shlex.join(map(str, command))} {redirection}"
    options = {"shell": True, "cwd": PROJECT, "env": os.environ | variables, "capture_output": True}
    return subprocess.run(line, check=False, text=True, **options)  # noqa: S603


@pytest.mark.slow
@pytest.mark.parametrize(
    ("redirection", "note"),
    night.by_day(
        [
            (">&-", ""),
            ("2>&-", ""),
            ("<&- >&- 2>&-", ""),
            ("2>/dev/full", ""),
            (
                ">/dev/full",
                "note: the work is done; standard output cannot be written (No space left on device)",
            ),
        ],
        2,
    ),
)
def test_a_run_is_finished_whatever_became_of_its_streams(redirection, note, tmp_path):
    folder = tmp_path / "run"
    done = shell([*FLIGHT, f"hydra.run.dir={folder}"], redirection)
    assert done.returncode == 0
    assert (folder / "episodes" / "start.mcap").stat().st_size > 10_000
    assert "Traceback" not in done.stderr
    assert note in done.stderr
    # nothing was printed into a file that took the number of a closed stream
    assert all(b"run folder" not in path.read_bytes() for path in folder.rglob("*") if path.is_file())


@pytest.mark.slow
@pytest.mark.parametrize("words", PRINTERS)
def test_what_is_asked_for_and_cannot_be_printed_is_an_error_in_a_sentence(words):
    done = shell([sys.executable, "-m", *words], ">/dev/full")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "standard output" in done.stderr
    assert "No space left on device" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("words", PRINTERS)
def test_a_reader_may_go_and_a_stream_may_be_closed(words):
    gone = shell(["sh", "-c", f"({shlex.join([sys.executable, '-m', *words])}; echo $? >&2) | true"], "")
    assert gone.stderr == "0\n"
    closed = shell([sys.executable, "-m", *words], ">&-")
    assert (closed.returncode, closed.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("words", PRINTERS)
def test_letters_that_an_encoding_lacks_are_written_as_escapes(words):
    done = shell([sys.executable, "-m", *words], "", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    if words[0] == "pipeline":
        assert re.search(r"distance +\[m\].*\\u221a", done.stdout)


@pytest.mark.parametrize("call", [main, review, telemetry])
def test_a_call_prints_to_the_streams_of_its_caller_and_leaves_them(call):
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        before = sys.stdout, sys.stderr
        assert call(["--help"]) == 0
        assert call(["no-such-command"]) == 2
        assert (sys.stdout, sys.stderr) == before
    assert "python -m" in out.getvalue()
    assert "no-such-command" in err.getvalue()


@pytest.mark.parametrize("call", [main, review, telemetry])
def test_a_call_works_without_streams(call, monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert call(["--help"]) == 0
    assert call(["no-such-command"]) == 2
    assert (sys.stdout, sys.stderr) == (None, None)


@pytest.mark.parametrize("call", [main, review, telemetry])
def test_a_call_writes_escapes_to_a_stream_of_another_encoding(call):
    raw = io.BytesIO()
    with redirect_stdout(io.TextIOWrapper(raw, encoding="ascii")) as out:
        assert call(["--help"]) == 0
        out.flush()
    raw.getvalue().decode("ascii")


@pytest.mark.slow
@pytest.mark.parametrize("words", night.by_day(HELPS, 2))
def test_help_is_whole_without_docstrings(words):
    whole, stripped = (shell([sys.executable, *option, "-m", *words], "") for option in ((), ("-OO",)))
    assert (stripped.returncode, stripped.stdout) == (whole.returncode, whole.stdout)
    assert "python -m" in stripped.stdout


@pytest.mark.slow
def test_flights_are_the_same_without_assertions_and_docstrings(tmp_path):
    """The stripped ones in plain Python: compiled, each would be compiled for this test alone."""
    recordings = []
    for option, is_plain in night.by_day((("-B", "0"), ("-O", "1"), ("-OO", "1")), 2):
        folder = tmp_path / option
        words = [FLIGHT[0], option, *FLIGHT[1:], f"hydra.run.dir={folder}"]
        done = shell(words, "", NUMBA_DISABLE_JIT=is_plain)
        assert done.returncode == 0, done.stderr
        recordings.append((folder / "episodes" / "start.mcap").read_bytes())
    assert len(set(recordings)) == 1
