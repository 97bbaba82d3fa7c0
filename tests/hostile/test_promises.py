"""Every promise of SECURITY.md, and of the pages on runs and limits, names tests that exist and hold it."""

import re
from functools import cache
from pathlib import Path

import pytest

from tests.places import PROJECT

TEST = re.compile(r"`(test_\w+)::(test_\w+)`")
RUNS = PROJECT / "docs" / "reference" / "run-folder.md"
LIMITS = PROJECT / "docs" / "reference" / "keys.md"


@cache
def names_of_tests() -> frozenset[tuple[str, str]]:
    """All tests, by their modules."""
    return frozenset(
        (path.stem, name)
        for path in (PROJECT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
    )


def between(page: Path, first: str, last: str) -> str:
    """What a page says from a heading on, up to another line."""
    return page.read_text(encoding="utf-8").partition(first)[2].partition(last)[0]


def promises() -> list[str]:
    """The entries of lists, and the rows of tables, that promise something."""
    security = (PROJECT / "SECURITY.md").read_text(encoding="utf-8").partition("What is not promised")[0]
    runs = between(RUNS, "## A run goes on", "## Tests under faults")
    limits = between(LIMITS, "## Limits of settings", "<!-- keys -->")
    entries = re.findall(r"^- .*(?:\n  .*)*", f"{security}\n{runs}\n{limits}", re.MULTILINE)
    rows = [line for line in limits.splitlines() if line.startswith("| ") and "limit |" not in line]
    return [*entries, *rows]


@pytest.mark.parametrize("promise", promises(), ids=lambda promise: re.sub(r"\W+", " ", promise)[:50].strip())
def test_a_promise_is_held_by_tests_that_exist(promise):
    names = TEST.findall(promise)
    assert names
    assert set(names) - names_of_tests() == set()


def test_every_name_on_the_page_is_one_of_a_test():
    for path in (PROJECT / "SECURITY.md", RUNS, LIMITS):
        text = path.read_text(encoding="utf-8")
        assert set(TEST.findall(text)) - names_of_tests() == set()
        assert "tests/" not in text  # a whole file promises nothing
