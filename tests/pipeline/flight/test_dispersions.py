"""Settings that each case has its own of: what is drawn, what is flown, what is refused."""

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm, uniform

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.cases.dispersions import drawn, mission_of_case
from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.settings.experiment import Experiment, SettingError

pytestmark = pytest.mark.slow

MASS = "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5}"
ANGLE = "+dispersions.sensor.half_angle_deg={kind:uniform,low:13,high:17}"
TORQUE = "+dispersions.deputy.max_torque_n_m={kind:normal,mean:0.01,std:0.002,low:0.009}"


def composed(*words: str) -> Experiment:
    return compose_experiment(["+experiment=evaluate", "controller=lqr", "seed=3", *words]).experiment


def test_cases_draw_by_their_distributions() -> None:
    experiment = composed(TORQUE, MASS, ANGLE, "monte_carlo.num_cases=400")
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    told = [drawn(experiment.mission, scenario) for scenario in scenarios]
    keys = ["deputy.mass_kg", "deputy.max_torque_n_m", "sensor.half_angle_deg"]
    assert all([key for key, _ in one] == keys for one in told)
    values = np.array([[value for _, value in one] for one in told])
    laws = norm(12.0, 0.5), truncnorm(-0.5, np.inf, 0.01, 0.002), uniform(13.0, 4.0)
    for column, law in zip(values.T, laws, strict=True):
        assert kstest(column, law.cdf).pvalue > 0.001
    assert np.abs(np.corrcoef(values.T) - np.eye(3)).max() < 0.2
    # a case is the same among however many others
    assert drawn(experiment.mission, scenarios[7]) == told[7]
    np.testing.assert_array_equal(
        [start.position_m for start in evaluation_scenarios(composed().monte_carlo, experiment.sun, 3)[:400]],
        [scenario.position_m for scenario in scenarios],
    )


def test_a_case_flies_its_own_mission_alone_and_among_others() -> None:
    experiment = composed(MASS, "monte_carlo.num_cases=4", "duration_s=600.0")
    mission, scenarios = (
        experiment.mission,
        evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed),
    )
    controller = named("lqr", mission)
    episodes, tracks = fly_cases(mission, controller, scenarios, 2)
    for case, scenario in enumerate(scenarios):
        own = mission_of_case(mission, scenario)
        assert not own.dispersions
        assert own.deputy.mass_kg == episodes["deputy.mass_kg"][case] != mission.deputy.mass_kg
        alone = fly_all(own, controller, [scenario], 1)
        assert alone.delta_v_m_s[0] == episodes["delta_v_m_s"][case]
        log = fly_logged(mission, controller, scenario)
        np.testing.assert_array_equal(tracks[case], log.position_m.astype(np.float32))
        spent = np.abs(log.force_hill_n).sum() * mission.control_period_s / own.deputy.mass_kg
        assert log.delta_v_m_s[-1] == pytest.approx(spent, rel=1e-12)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ("deputy.mas_kg={kind:uniform,low:1,high:2}", "deputy.mas_kg is no number that a flight can have"),
        ("chief.num_points={kind:uniform,low:1,high:2}", "chief.num_points is no number that a flight can"),
        (
            "duration_s={kind:uniform,low:1,high:2}",
            "duration_s is no number that a flight can have its own of",
        ),
        ("deputy.mass_kg=3", "deputy.mass_kg is 3; give a distribution"),
        (
            "deputy.mass_kg={kind:normal,mean:12}",
            "has mean; one of kind normal has mean, std, and may have correlation_s, high, low",
        ),
        ("deputy.mass_kg={kind:norm,mean:12,std:1}", "kind is 'norm'; it must be one of normal, uniform"),
        ("deputy.mass_kg={kind:uniform,low:2,high:1}", "low is 2 and .*high 1; the first must be less"),
        ("deputy.mass_kg={kind:normal,mean:12,std:1,low:25}", "more than eight standard deviations beside"),
        (
            "deputy.mass_kg={kind:normal,mean:12,std:1,correlation_s:60}",
            "deputy.mass_kg does not vary within a flight, as actuators.misalignment_deg, .* may; leave",
        ),
        (
            "actuators.scale_error={kind:normal,mean:0,std:0.1,correlation_s:60}",
            "actuators.scale_error counts only with actuators.kind=real",
        ),
        ("dynamics.drag_m_s2={kind:uniform,low:0,high:1,correlation_s:0}", "correlation_s is 0; it must be"),
        (
            "navigation.noise_m={kind:normal,mean:1,std:1,correlation_s:60}",
            "navigation.noise_m is a standard deviation, so that low must be at least 0",
        ),
    ],
)
def test_dispersions_that_cannot_be(told: str, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        composed("dynamics=two_body", "navigation=fixes", f"+dispersions.{told}")


def test_a_draw_that_cannot_be_names_its_cure() -> None:
    experiment = composed("+dispersions.deputy.mass_kg={kind:normal,mean:0.1,std:1.0}")
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    impossible = next(one for one in scenarios if drawn(experiment.mission, one)[0][1] < 0.0)
    with pytest.raises(SettingError, match=r"a case draws what cannot be: deputy.mass_kg is -.*truncate"):
        mission_of_case(experiment.mission, impossible)


def test_training_does_not_fly_dispersions() -> None:
    with pytest.raises(SettingError, match="stages has train, and dispersions are given"):
        compose_experiment(["+experiment=train", MASS])
