"""Run the commands of the pages that show what commands print: ``python -m docs shown``.

A fenced block with a title is written to a file of that name, a block of ``sh`` is run, and a block of
``text`` right behind it is what it printed; a line of ``…`` there stands for lines that are left out.
Pictures that the commands write into ``pictures/`` go to ``docs/images/gallery``.
"""

import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import warnings
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

import fis_tools.__main__ as fis_tools
from docs.scripts.screenshot import screenshot

PROJECT = Path(__file__).resolve().parents[2]
PAGES = ("tutorial/control-system-to-sign-off.md", "tutorial/first-fuzzy-system.md")
PICTURES = PROJECT / "docs" / "images" / "gallery"
#: a fenced block: its language, its title, what it holds
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LEFT_OUT = "…\n"
#: of what is printed, characters
WIDTH = "110"


def main() -> None:
    """Write what the commands print into the pages, and their pictures into the gallery."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in PAGES:
        page = PROJECT / "docs" / name
        with tempfile.TemporaryDirectory() as scratch:
            text = rerun(page.read_text(encoding="utf-8"), Path(scratch))
            for picture in sorted(Path(scratch).glob("pictures/*.png")):
                if picture.name in text:
                    shutil.copy(picture, PICTURES)
            for review in sorted(Path(scratch).glob("*-review.html")):
                screenshot(review, "One inference, step by step", PICTURES / f"{review.stem}.png")
        page.write_text(text, encoding="utf-8")


def rerun(page: str, folder: Path) -> str:
    """Return a page with what its commands print now, run in ``folder`` beside a copy of ``docs/examples``.

    Raises
    ------
    ValueError
        Where a block that leaves lines out shows some that were not printed.
    """
    shutil.copytree(PROJECT / "docs" / "examples", folder / "docs" / "examples")
    pieces, end, printed = [], 0, ""
    for block in BLOCK.finditer(page):
        language, title, text = block.groups()
        between = page[end : block.start()]
        if title:
            (folder / title).write_text(text, encoding="utf-8")
        elif language == "sh":
            with patch.dict(os.environ, COLUMNS=WIDTH):
                printed = run(text, folder)
        elif language == "text" and not between.strip():
            text = shown(text, printed)
        pieces += [between, page[block.start() : block.start(3)], text, "```"]
        end = block.end()
    return "".join([*pieces, page[end:]])


def run(commands: str, folder: Path) -> str:
    """Run commands in a folder, one line after the other, and return what they print.

    The toolkit's own run in this process, for loading what compiles and draws takes longer than most of them.

    Raises
    ------
    ValueError
        If one fails.
    """
    printed = ""
    for command in commands.splitlines():
        words = shlex.split(command)
        is_ours = words[:3] == ["python", "-m", "fis_tools"]
        output, code = _called(words[3:], folder) if is_ours else _started(command, folder)
        printed += output
        if code:
            raise ValueError(f"a command of the page fails:\n{command}\n{output}")
    return "\n".join(line.rstrip() for line in printed.splitlines()) + "\n"


def _called(words: list[str], folder: Path) -> tuple[str, int]:
    """Run a command of the toolkit; return what it prints and its exit code."""
    output = io.StringIO()
    with chdir(folder), redirect_stdout(output), redirect_stderr(output), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        code = fis_tools.main(words)
    return output.getvalue(), code


def _started(command: str, folder: Path) -> tuple[str, int]:
    """Run any other command in a shell; return what it prints and its exit code."""
    done = subprocess.run(  # noqa: S603 - the commands of our own pages
        ["/bin/bash", "-ec", f'python() {{ "{sys.executable}" "$@"; }}\n{command}'],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.fspath(PROJECT), "PYTHONWARNINGS": "ignore"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.stdout, done.returncode


def shown(old: str, printed: str) -> str:
    """Return what a page shows of what was printed."""
    if LEFT_OUT not in old:
        return printed
    rest = printed
    for part in old.split(LEFT_OUT):
        if part not in rest:
            raise ValueError(f"the page shows\n{part}which is not among what is printed:\n{printed}")
        rest = rest[rest.index(part) + len(part) :]
    return old


if __name__ == "__main__":
    main()
