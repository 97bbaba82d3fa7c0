"""A policy flies each deputy of a fleet: it fires what ONNX's reference answers to what learners observe."""

import numpy as np
import pytest
from onnx import TensorProto
from onnx.reference import ReferenceEvaluator

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.policies import policy_of
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.fleets import OF_DEPUTIES
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.gym import Reward
from pipeline.gym.parallel import MultiInspectionEnv
from pipeline.scenarios import evaluation_scenarios
from tests.pipeline.controllers.networks import network

WORLD = ["world=paper", "sun=random", "duration_s=900"]
FLEET = ["fleet.deputies=3", "fleet.sharing=mask"]
NUM_SEEN, FORCE_N, PERIOD_S = 19, 0.03, 30.0
SPENT = OF_DEPUTIES.index("delta_v_m_s")


def model(kind=TensorProto.FLOAT, width=NUM_SEEN, metadata=None):
    """A small network from observations to forces, decided every 30 s."""
    rng = np.random.default_rng(8)
    scales = np.array([100.0] * 3 + [0.5] * 3 + [10.0] * 3 + [1.0] * 6 + [99.0] * 2 + [1.0, 3600.0])[:width]
    layers = (
        rng.normal(0.0, 0.5, (width, 8)) / scales[:, np.newaxis],
        FORCE_N * rng.normal(0.0, 0.6, (8, 3)),
    )
    return network(layers, metadata or {"decision_period_s": f"{PERIOD_S:g}"}, kind)


def read(made):
    return policy_of("together", made.SerializeToString(), "together.onnx")


def cases_of(words):
    composed = compose_experiment(
        ["+experiment=evaluate_fleet", "controller=coast", *WORLD, *words, "monte_carlo.num_cases=3"]
    )
    return composed.experiment.mission, evaluation_scenarios(composed.experiment)


@pytest.mark.slow
def test_each_deputy_fires_what_the_reference_of_the_format_answers_in_the_learners_fleet():
    mission, (case, *_) = cases_of(FLEET)
    logs = fly_logged_fleet(mission, read(model()), case)
    env = MultiInspectionEnv(WORLD, 3, Reward(), collision_m=0.0, decision_period_s=PERIOD_S)
    seen, _ = env.reset(options={"scenarios": list(case.fleet)})
    reference = ReferenceEvaluator(model(TensorProto.DOUBLE))
    most, k = mission.deputy.max_force_n, 0
    while env.agents:
        observed = np.array([seen[agent] for agent in env.agents], dtype=np.float64)
        (answered,) = reference.run(None, {"seen": observed})
        for log, expected in zip(logs, answered, strict=True):
            np.testing.assert_allclose(log.flight.force_asked_n[k], expected, rtol=0.0, atol=1e-8)
            assert not log.flight.force_asked_n[k + 1 : k + 3].any()
            np.testing.assert_allclose(log.flight.position_m[k], observed[log.deputy - 1, :3], atol=1e-4)
        seen, *_ = env.step(dict(zip(env.agents, answered / most, strict=True)))
        k += 3
    assert k > 30
    assert np.ptp([log.flight.delta_v_m_s[-1] for log in logs]) > 0.0


@pytest.mark.slow
def test_many_fleets_fly_as_each_is_logged():
    mission, cases = cases_of(FLEET)
    outcomes = fly_all_fleets(mission, read(model()), cases, 2)
    assert not outcomes.ahead_delta_v_m_s.any()
    for case, start in enumerate(cases):
        logs = fly_logged_fleet(mission, read(model()), start)
        spent = [log.flight.delta_v_m_s[-1] for log in logs]
        np.testing.assert_array_equal(outcomes.of_deputies[case, :, SPENT], spent)
        assert (logs[0].seen_by[-1] > 0).sum() == outcomes.inspected_count[case]


@pytest.mark.parametrize(
    ("words", "made", "reason"),
    [
        (
            ["fleet.sharing=nearer"],
            model(),
            "which points any has seen, and no more; give fleet.sharing=mask$",
        ),
        (["fleet.sharing=mask", "fleet.delay_periods=2"], model(), "; give fleet.delay_periods=0$"),
        (["fleet.sharing=mask"], model(width=11, metadata={"observations": "published"}), "as AFRL's agents"),
    ],
)
def test_fleets_that_learners_do_not_fly_in_are_refused(words, made, reason):
    mission, cases = cases_of(["fleet.deputies=2", *words])
    with pytest.raises(ControllerError, match=reason):
        fly_all_fleets(mission, read(made), cases)
