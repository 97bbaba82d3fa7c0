"""What is written about the keys is what the settings say."""

import re

import pytest
import yaml

from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.settings.groups import value_at
from pipeline.settings.reference import commented, descriptions, sections, tables
from pipeline.settings.schema import schema
from tests.pipeline.command_line.cases import plain_config


def test_every_key_and_group_has_a_meaning():
    names = {*schema(), *tables()} - {""}
    assert [name for name in names if not descriptions().get(name, "").endswith(".")] == []


def test_a_row_says_default_unit_range_and_condition():
    rows = sections().splitlines()
    assert "`mass_kg` **d**|`12.0` kg|greater than 0|Mass." in rows
    (row,) = (row for row in rows if row.startswith("`range_noise_m`"))
    assert row.startswith("`range_noise_m` **t**|`0.1` m|greater than 0|Standard deviation of a range.")
    assert row.endswith("Only with `navigation.measures=range_bearing`.")
    assert "`num_points`|`100`|whole, from 1 to 10000|" in sections()


def test_a_commented_configuration_reads_back_to_the_same_data():
    config = plain_config("navigation=fixes", "+dispersions.deputy.mass_kg={kind:uniform,low:10,high:14}")
    text = commented(config)
    assert yaml.safe_load(text) == config
    assert "  # Mass. (kg)\n  mass_kg: 12.0\n" in text


def test_help_on_a_group_a_key_and_what_is_no_key(capsys):
    assert main(["--help", "safety"]) == 0
    assert (
        "  safety.braking_force_n=0.8 N\n      Greatest force along each Hill axis" in capsys.readouterr().out
    )
    assert main(["--help", "sun.mode", "seed"]) == 0
    told = capsys.readouterr().out
    assert "(fixed, random, mixed)" in told
    assert "  seed=1\n" in told
    assert main(["--help", "deputy.mass"]) == 2
    assert "did you mean deputy.mass_kg?" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--help", "train_front"], ["+experiment=train_front", "--help"]])
def test_help_on_an_experiment_shows_what_people_change_with_its_values(words, capsys):
    assert main(words) == 0
    told = capsys.readouterr().out
    assert told.startswith("+experiment=train_front: Breed a front")
    shown = re.findall(r"^  ([\w.]+)=(.*)$", told, re.MULTILINE)
    assert len(shown) == 11  # the stages, and ten keys or groups
    composed = compose_experiment(["+experiment=train_front", "controller=champion_27"]).config
    values = {key: yaml.safe_load(value) for key, value in shown if value != "NAME"}
    assert values == {key: value_at(composed, key) for key in values}
    assert "optimizer.population_size" in values
    assert "assurance.num_cases" not in values
