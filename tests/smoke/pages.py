"""The pages that a person reads, and the commands on them."""

import re
import shlex
from pathlib import Path

from tests.places import PROJECT

DOCS = PROJECT / "docs"
PAGES = [*sorted(PROJECT.glob("*.md")), PROJECT / "telemetry" / "README.md", *sorted(DOCS.rglob("*.md"))]
#: run whole, with what it prints, by test_tutorial.py
FOLLOWED = DOCS / "tutorial" / "your-own-case.md"
#: whose package is installed, and whose commands are typed, by test_plugged.py
PLUGGED = DOCS / "how-to" / "plug-in-your-own.md"
#: what a page says where the reader puts a name of their own, and a name that will do
PLACEHOLDERS = {"FROM": "ellipse", "NAME": "paper_champion", "SUN": "fixed", "LAYER": "filter"}


def name_of(page: Path) -> str:
    return page.relative_to(PROJECT).as_posix()


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a page in a language."""
    return blocks_of(page.read_text(encoding="utf-8"), language)


def blocks_of(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(page: Path) -> list[list[str]]:
    """The commands ``python -m …`` of a page, as words: those in blocks, then those in sentences."""
    lines = [line for block in blocks(page, "sh") for line in block.replace("\\\n", " ").splitlines()]
    # where an option is left out or a name follows, a sentence names a command and does not show one
    lines += re.findall(r"`(python -m [^`…]+)`", page.read_text(encoding="utf-8"))
    shown = [part for line in lines for part in re.sub(r" +#.*", "", line).strip().split(" && ")]
    return [words_of(each) for each in shown if re.match(r"(\S+/)?python3? -m ", each)]


def words_of(command: str) -> list[str]:
    words = shlex.split(command)
    return [re.sub(r"(?<==)[A-Z]+$", lambda name: PLACEHOLDERS[name[0]], word) for word in words]


def calls_of(module: str) -> list[list[str]]:
    """What follows ``python -m MODULE`` on all pages but those that have a test of their own, each once."""
    pages = [page for page in PAGES if page not in (FOLLOWED, PLUGGED)]
    calls = {tuple(words[3:]): None for page in pages for words in commands(page) if words[2] == module}
    return [list(words) for words in calls]


def sentences(page: Path) -> list[str]:
    """The sentences of a page, and those of its tables' cells; code in a line counts as a word."""
    text = re.sub(
        r"^( *)```.*?^\1```|^---\n.*?^---\n|<!--.*?-->", "\n\n", page.read_text("utf-8"), flags=re.M | re.S
    )
    text = re.sub(r"!?\[((?:[^\]\[]|\[[^\]]*\])*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "X", text))
    parts = re.split(r"\n\s*\n|\n(?= *(?:[-*>]|\d+\.|#|\|) )|\n(?=\|| {4})|(?<=\S) \| ", text)
    return [each for part in parts for each in re.split(r"(?<=[.!?:;])[\")*_]*\s+(?=[A-Z0-9\"*(_])", part)]
