"""The linear law that benchmarks fly in place of rules, against the sum computed from logged signals."""

from dataclasses import replace

import numpy as np

from benchmarks import linear_law
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.flight.cases.starts import cases_of, evaluation_scenarios
from pipeline.flight.control.controller import law_of
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.world.pack import pack_world


def test_first_push_is_the_limited_sum_of_the_signals_beyond_the_dead_band() -> None:
    words = ["+experiment=evaluate", "controller=champion_27", "sun=random", "monte_carlo.num_cases=8"]
    experiment = compose_experiment(words).experiment
    mission = replace(experiment.mission, duration_s=experiment.mission.control_period_s)
    starts = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    champion = named("champion_27", mission)
    laws = linear_law.LinearLaw(champion)
    numbers = laws.pack(np.array([[0.6, 0.4, 0.1, 0.7, 0.55, 0.5, 0.8, 0.3, 0.9]]))
    with linear_law.flying():
        world, law, cases = pack_world(mission), law_of(champion, mission), cases_of(mission, starts)
        flown = fly_population(world, law, numbers, cases)
    slopes = numbers.values[0, -3 * linear_law.NUMBERS :].reshape(3, linear_law.NUMBERS)
    bands = [float(dict(champion.fuzzy.attributes)[f"dead_band_force_{axis}_n"]) for axis in "xyz"]
    expected = []
    for start in starts:
        signals = fly_logged(mission, champion, start).fis_input[0]
        force = np.clip((slopes[:, :3] * signals).sum(axis=1), -slopes[:, 4], slopes[:, 4])
        force[np.abs(force) < bands] = 0.0
        expected.append(np.abs(force).sum() * mission.control_period_s / mission.deputy.mass_kg)
    assert min(expected) > 0.0
    np.testing.assert_allclose(flown.delta_v_m_s[0], expected, rtol=1e-9)
