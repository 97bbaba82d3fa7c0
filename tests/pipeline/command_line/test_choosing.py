"""Which champion to take: what is said stands on the page that is named, of controllers there are."""

import re
from pathlib import Path

import pytest

from fis_tools.formats import serialize
from pipeline.command_line.guide import recommendations, table
from pipeline.settings.places import conf_folder

DOCS = Path(__file__).parents[3] / "docs"
NUMBER = re.compile(r"\d+\.\d+")
CHOICES = table()[1:]
#: constants of controllers that fire pushes which were chosen ahead
CHOSEN_AHEAD = re.compile(r"^  (foresight_pushes|rehearsal_reach_m_s):", re.MULTILINE)


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice[0])
def test_a_choice_has_the_figures_of_a_row_of_its_page(choice):
    name, *measured, page = choice
    rows = [row for row in (DOCS / page).read_text(encoding="utf-8").splitlines() if row[:1] == "|"]
    figures = NUMBER.findall(" ".join(measured[3:-1]))
    assert len(figures) > 2
    known = [set(NUMBER.findall(row)) for row in rows if f"`{name}` |" in row]
    assert any(numbers.issuperset(figures) for numbers in known), figures


def test_what_is_chosen_exists_and_help_says_it(ran):
    text = ran("--help", "controller").out
    assert text.startswith(recommendations())
    assert "controller.kind=" in text
    for name, num_rules, world, *_ in CHOICES:
        controller = serialize.load(conf_folder() / "controller" / f"{name}.yaml")
        assert int(num_rules) == sum(len(system.rules) for system in controller.systems)
        assert (conf_folder() / "world" / f"{world}.yaml").is_file()


def test_every_table_of_fuel_says_what_rules_fire_of_it():
    """Where it names a controller whose pushes are chosen ahead."""
    shipped = (conf_folder() / "controller").glob("*.yaml")
    ahead = {path.stem for path in shipped if CHOSEN_AHEAD.search(path.read_text(encoding="utf-8"))}
    named = set()
    for path in [*DOCS.rglob("*.md"), DOCS.parent / "README.md"]:
        for table_of in re.findall(r"(?:^\|.*\n)+", path.read_text(encoding="utf-8"), re.MULTILINE):
            heads, *rows = table_of.splitlines()
            for row in rows if "m/s" in heads else ():
                if names := ahead.intersection(re.findall(r"`(\w+)` \|", row)):
                    assert "that rules fire" in heads or "rules fire" in row or "rules the rest" in row, row
                    named |= names
    assert named == ahead
    assert all("rules fire" in choice[-2] for choice in CHOICES if choice[0] in ahead)


def test_the_prices_of_campaigns_are_those_of_every_champion():
    page = (DOCS / "how-to/run-on-many-machines.md").read_text(encoding="utf-8")
    rows = [re.findall(r"`(\w+)`", row.split("|")[1]) for row in page.splitlines() if row.startswith("| `")]
    # a name that begins with _ ends one that begins like the first
    priced = {name if name[0] != "_" else names[0] + name for names in rows for name in names}
    assert priced >= {path.stem for path in (conf_folder() / "controller").glob("*champion*.yaml")}
