"""What can be added to stands in one list: no other file has all stages, signals, shapes, forms or kinds."""

import re
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest

from fis_tools.formats.serialize import FORMS
from fis_tools.model.membership import SHAPES
from pipeline.flight.state.signals import CONSTANTS, SIGNALS
from pipeline.settings.controllers import PLANNED, ControllerSettings
from pipeline.settings.groups import tags_of
from pipeline.settings.stages import STAGES
from tests.places import PACKAGES, PROJECT

#: what can be added to, and the files that may enumerate it: the list itself, and what needs no addition
LISTS: dict[str, tuple[Collection[str], set[str]]] = {
    "stages": (STAGES, {"pipeline/settings/stages.py"}),
    "signals": (SIGNALS, set()),
    "constants": (CONSTANTS, set()),
    # the second has the shapes whose formulas are compiled; others are tables
    "shapes": (SHAPES, {"fis_tools/engines/degrees.py"}),
    # the second is the type of their names
    "forms": (FORMS, {"fis_tools/formats/serialize.py", "fis_tools/model/membership.py"}),
    "kinds of controllers": (tags_of(ControllerSettings)["kind"].values(), set()),
    # the first has names of options, which happen to be these
    "planning kinds": (PLANNED, {"pipeline/settings/experiment.py"}),
}
FOLDERS = (*PACKAGES, "tests", "benchmarks", "docs")
WORDS = re.compile(r"[A-Za-z_][\w.]*")


def enumerations(words: list[str], names: Collection[str]) -> Iterator[set[str]]:
    """Yield names that follow one another without other words between: three fifths of them all, or more."""
    row: set[str] = set()
    for word in [*words, ""]:
        if word in names:
            row.add(word)
        elif word not in {"and", "or"}:
            if len(row) >= max(3, 0.6 * len(names)):
                yield row
            row = set()


@pytest.fixture(scope="module")
def sources() -> dict[str, list[str]]:
    """The words of the sources, by their paths."""
    files = (path for folder in FOLDERS for path in (PROJECT / folder).rglob("*.py"))
    return {
        path.relative_to(PROJECT).as_posix(): WORDS.findall(path.read_text(encoding="utf-8"))
        for path in files
    }


@pytest.mark.parametrize("what", LISTS)
def test_nothing_is_listed_twice(what: str, sources: dict[str, list[str]]) -> None:
    names, allowed = LISTS[what]
    again = {path: next(enumerations(words, names), None) for path, words in sources.items()}
    assert {path for path, row in again.items() if row} <= allowed, what


def test_a_second_list_would_be_noticed() -> None:
    for names, _ in LISTS.values():
        most = list(names)[: max(3, -(-len(names) * 3 // 4))]
        listed = ", ".join(f'"{name}"' for name in most)
        assert list(enumerations(WORDS.findall(f"x = ({listed})\nif x: pass"), names))
        assert not list(enumerations(WORDS.findall(" is ".join(most)), names))


def test_the_stages_are_the_modules_of_their_folder() -> None:
    assert {path.stem for path in Path(PROJECT, "pipeline", "stages").glob("[a-z]*.py")} == set(STAGES)
