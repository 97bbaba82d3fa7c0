"""The configuration files: each option composes and says what differs, the paper's numbers stand."""

import math
from itertools import zip_longest
from pathlib import Path

import pytest
import yaml

from pipeline.command_line.choices import options
from pipeline.command_line.config import compose_experiment, conf_folder
from pipeline.settings.keys import KNOWN, value_at
from pipeline.settings.schema import schema
from tests.pipeline.command_line.cases import FLY, leaves, plain_config

EXPERIMENTS = options([conf_folder()])["experiment"]
VALUES = sorted(conf_folder().rglob("*.yaml"))
VALUES = [path for path in VALUES if path.relative_to(conf_folder()).parts[0] not in ("experiment", "hydra")]
VALUES = [path for path in VALUES if path.parent.name not in ("controller", "champions", "requirements")]


def composed(name):
    return compose_experiment([f"+experiment={name}", "controller=file", "controller.path=x.json"]).experiment


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_composes(name):
    assert composed(name).name == name
    assert composed(name).stages


#: every option of every group: the first of each together, then the second of each, and so on
TOGETHER = list(
    zip_longest(
        *(
            [f"{group}={name}" for name in names if (group, name) != ("starts", "file")]  # it needs a path
            for group, names in options([conf_folder()]).items()
            if group not in ("experiment", "controller", "problem") and "/" not in group
        )
    )
)
#: a problem brings its starts
TOGETHER += [(f"problem={name}",) for name in options([conf_folder()])["problem"]]


@pytest.mark.parametrize("words", TOGETHER, ids=lambda words: " ".join(filter(None, words))[:60])
def test_every_option_composes(words):
    assert compose_experiment([*FLY, *filter(None, words)]).experiment.name == "fly"


@pytest.mark.parametrize("path", VALUES, ids=lambda path: path.relative_to(conf_folder()).as_posix())
def test_an_option_says_what_differs_from_the_defaults_and_nothing_else(path: Path):
    group = path.parent.relative_to(conf_folder()).as_posix()
    content = yaml.safe_load(path.read_text()) or {}
    # an option that builds on another may take back what that says
    builds_on_another = "defaults" in content
    for name, value in leaves({key: value for key, value in content.items() if key != "defaults"}):
        key = schema()[f"{group}.{name}" if group not in (".", "world", "problem") else name]
        is_choice = name in ("mode", "kind", "model", "shadow", "reflection", "algorithm")
        assert is_choice or builds_on_another or value != key.default, key.name
    assert path.name == "config.yaml" or path.read_text().startswith("# ")


def test_the_fixed_keys_stand():
    fixed = """orbit.mean_motion_rad_s deputy.mass_kg deputy.inertia_kg_m2 deputy.initial_position_m
        deputy.initial_velocity_m_s chief.inertia_kg_m2 chief.initial_angular_velocity_rad_s
        sensor.half_angle_deg sun.angle_deg attitude.mode attitude.proportional_gain attitude.derivative_gain
        attitude_period_s control_period_s duration_s guidance.kind guidance.engine monte_carlo.num_cases seed
        optimizer.population_size optimizer.generations stages name"""
    assert set(fixed.split()) <= KNOWN


def test_the_papers_numbers():
    config = plain_config()
    papers = """
        orbit: {mean_motion_rad_s: 0.0011068}
        deputy: {mass_kg: 12, max_force_n: 1, max_torque_n_m: 0.010, min_distance_m: 15, max_distance_m: 200}
        sensor: {half_angle_deg: 15, boresight: [-1, 0, 0], max_incidence_deg: 90, max_range_m: null}
        sensor.min_sun_angle_deg: 0
        optimizer.elitism_rate: 0.1
        inspection_threshold_percent: 95
        duration_s: 3600
        control_period_s: 10
        chief: {inspection_radius_m: 10}
        optimizer: {population_size: 200, generations: 500, tournament_size: 4, crossover_rate: 0.8}
        monte_carlo: {num_cases: 1000, min_distance_m: 50, max_distance_m: 100}
        """
    for key, value in leaves(yaml.safe_load(papers)):
        assert value_at(config, key) == value, key
    assert math.hypot(*config["deputy"]["initial_position_m"]) == pytest.approx(75, rel=1e-15)
    assert len(set(config["deputy"]["initial_position_m"])) == 1
    assert config["light"] == {"shadow": "none", "past_terminator_deg": 0, "reflection": "none"}


@pytest.mark.parametrize("name", ["train_paper", "train_champion"])
def test_no_controller_that_breaks_a_limit_beats_one_that_breaks_none(name):
    experiment = composed(name)
    deputy = experiment.mission.deputy
    penalty = experiment.optimizer.penalty.of_round(experiment.optimizer.rounds - 1)
    # the greatest delta-v: full force along three axes all the time
    greatest = 3 * deputy.max_force_n / deputy.mass_kg * experiment.mission.duration_s
    cases = experiment.starts.num_cases
    short, missed = penalty.short_point_m_s, penalty.missed_point_m_s
    if (
        name == "train_paper"
    ):  # the champion's training puts a price on points, see conf/optimizer/champion.yaml
        assert short / cases > greatest + 99 * missed
    assert penalty.outside_m_s / cases > greatest + 95 * short + 99 * missed
