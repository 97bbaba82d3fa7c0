"""Systems of Python programs, ``module.py:object``: nothing runs unless it is trusted."""

import shutil
from pathlib import Path

import pytest

from fis_tools.__main__ import main
from fis_tools.commands import COMMANDS
from tests.places import PROJECT

TIPPING = PROJECT / "docs" / "examples" / "tipping.py"
PROGRAM = """\
from pathlib import Path
Path({mark!r}).touch()
import tipping
built = tipping.build_tipping()
fast = 1
def broken():
    raise RuntimeError("no luck")
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    shutil.copy(TIPPING, tmp_path)
    path = tmp_path / "mine.py"
    path.write_text(PROGRAM.format(mark=str(tmp_path / "it-ran")), encoding="utf-8")
    return path


#: of each command what it needs besides a controller; `domain` and `learn` read none
NEEDED: dict[str, tuple[str, ...]] = {
    "firing": ("log.csv", "--controller"),
    "export": ("--format", "markdown"),
    "explain": ("--inputs", "quality=6.5,service=9.8"),
    "diff": (str(PROJECT / "docs" / "examples" / "tipper.fis"),),
    "plot": ("--only", "rules"),
}


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in {"domain", "learn"}])
def test_every_command_takes_a_program_that_is_trusted(
    command: str, program: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(program.parent)
    Path("log.csv").write_text("quality,service\n6.5,9.8\n", encoding="utf-8")
    needed = NEEDED.get(command, ())
    system = ("mine.py:built",)
    words = [command, *(needed + system if command == "firing" else system + needed)]
    assert main(words) == 2
    assert (
        "reading it runs its code with all your rights; add --trust if you trust" in capsys.readouterr().err
    )
    assert not Path("it-ran").exists()
    assert main([*words, "--trust"]) == 0, capsys.readouterr().err
    assert Path("it-ran").exists()


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("mine.py:buitl", "mine.py has no object 'buitl'; did you mean 'built'?"),
        ("mine.py", "mine.py has no object ''"),
        ("none.py:built", "none.py:built: there is no such file"),
        ("mine.py:broken", "mine.py:broken cannot be run (RuntimeError: no luck)"),
        ("mine.py:fast", "mine.py:fast: "),
    ],
)
def test_what_cannot_be_read_is_told(
    written: str,
    words: str,
    program: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(program.parent)
    assert main(["show", written, "--trust"]) == 2
    assert f"error: {words}" in capsys.readouterr().err
