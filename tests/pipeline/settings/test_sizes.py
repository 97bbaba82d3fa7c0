"""The numbers of `pipeline.settings.sizes` are those of settings and pages."""

from pathlib import Path

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings import sizes
from pipeline.settings.experiment import SettingError

DOCS = Path(__file__).parents[3] / "docs"
#: what pages say of each number
PAGES = {
    "MOST": ("reference/keys.md", "Counts are at most {:,}"),
    "MOST_CASES": ("reference/keys.md", "cases of an evaluation {:,}"),
    "MOST_LISTED": ("reference/run-folder.md", "an evaluation with more than {:,} cases"),
    "BLOCK_ROWS": ("how-to/run-on-many-machines.md", "blocks of {:,} rows"),
}
#: the settings that a number bounds
KEYS = {"MOST": "optimizer.generations", "MOST_CASES": "monte_carlo.num_cases"}


@pytest.mark.parametrize("name", [name for name in vars(sizes) if name.isupper()])
def test_pages_tell_the_numbers(name):
    page, words = PAGES[name]
    text = " ".join((DOCS / page).read_text(encoding="utf-8").split())
    assert words.format(getattr(sizes, name)) in text


@pytest.mark.parametrize("name", KEYS)
def test_settings_take_no_more(name):
    most = getattr(sizes, name)
    assert compose_experiment(["+experiment=train", f"{KEYS[name]}={most}"])
    with pytest.raises(SettingError, match=f"{KEYS[name]} is {most + 1}; it must be"):
        compose_experiment(["+experiment=train", f"{KEYS[name]}={most + 1}"])


def test_the_last_of_the_most_cases_is_drawn_alone():
    experiment = compose_experiment(
        ["+experiment=evaluate", f"monte_carlo.num_cases={sizes.MOST_CASES}"]
    ).experiment
    (last,) = evaluation_scenarios(experiment, slice(sizes.MOST_CASES - 1, None))
    assert last.noise == (experiment.seed, 0, sizes.MOST_CASES - 1)
