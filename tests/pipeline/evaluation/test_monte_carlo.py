"""What an evaluation tells of each case, by definitions of its own."""

import math

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.scenarios import evaluation_scenarios


def test_propellant_is_what_the_rocket_equation_says():
    words = ("actuators=real", "actuators.specific_impulse_s=60", "actuators.propellant_kg=0.5")
    few = ("monte_carlo.num_cases=3", "controller=champion_27")
    experiment = compose_experiment(["+experiment=evaluate", *few, *words]).experiment
    controller = load(experiment.controller, experiment.mission)
    episodes, _ = fly_cases(experiment.mission, controller, evaluation_scenarios(experiment), 1)
    mass_kg = experiment.mission.deputy.mass_kg
    for used_kg, delta_v_m_s in zip(episodes["propellant_kg"], episodes["delta_v_m_s"], strict=True):
        # Tsiolkovsky's, with standard gravity, 9.80665 m/s²
        left_kg = mass_kg / math.exp(delta_v_m_s / (60.0 * 9.80665))
        assert 0.0 < used_kg == pytest.approx(mass_kg - left_kg, rel=1e-9)
