"""Run the commands of the pages that show what commands print: ``python -m docs.shown``.

A fenced block with a title is written to a file of that name, a block of ``sh`` is run, and a block of
``text`` right behind it is what it printed; a line of ``…`` there stands for lines that are left out.
Pictures that the commands write into ``pictures/`` go to ``docs/images/gallery``.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from docs.screenshot import screenshot

PROJECT = Path(__file__).resolve().parents[1]
PAGES = ("gallery.md", "tutorial/control-system-to-sign-off.md", "tutorial/first-fuzzy-system.md")
PICTURES = PROJECT / "docs" / "images" / "gallery"
#: a fenced block: its language, its title, what it holds
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LEFT_OUT = "…\n"


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
            printed = run(text, folder)
        elif language == "text" and not between.strip():
            text = shown(text, printed)
        pieces += [between, page[block.start() : block.start(3)], text, "```"]
        end = block.end()
    return "".join([*pieces, page[end:]])


def run(commands: str, folder: Path) -> str:
    """Run commands in a folder and return what they print."""
    done = subprocess.run(  # noqa: S603 - the commands of our own pages
        ["/bin/bash", "-ec", f'python() {{ "{sys.executable}" "$@"; }}\n{commands}'],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.fspath(PROJECT), "COLUMNS": "110", "PYTHONWARNINGS": "ignore"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        raise ValueError(f"a command of the page fails:\n{commands}{done.stdout}")
    return "\n".join(line.rstrip() for line in done.stdout.splitlines()) + "\n"


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
