"""Policies with six degrees of freedom: what they fire is what ONNX's reference answers to what is observed.

Observed is what the environment of the same world shows of the state that a flight's log tells.
"""

from dataclasses import replace

import numpy as np
import onnx
import pytest
from onnx import TensorProto
from onnx.reference import ReferenceEvaluator
from scipy.spatial.transform import Rotation

from pipeline.controllers.policies import policy_of
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.gym import SixDofInspectionEnv, task_of
from pipeline.gym.published import PublishedObservation
from pipeline.recording.recorder import FlightRecorder
from pipeline.recording.reflight import fly_again
from pipeline.scenarios import CLUSTERS, evaluation_scenarios
from tests.pipeline.controllers.networks import network

MOST_RATE = 0.034907
WORLD = ["world=afrl_six_dof", "duration_s=300", "deputy.max_force_n=0.05"]
WHEELS = f"deputy.max_momentum_n_m_s={0.0573 * MOST_RATE}"
NUM_STARTS = 3
#: metadata of each kind of observation, by how many numbers it has
KINDS = {
    24: {"forces": "shares"},
    22: {"observations": "published", "forces": "shares"},
    18: {"observations": "published", "forces": "newtons"},
}


def made(width, metadata, kind=TensorProto.FLOAT, num_outputs=6):
    """A network whose torques go beyond what is possible, as policies' numbers do before they are clipped."""
    rng = np.random.default_rng(width)
    scales = np.array([100.0] * 3 + [1.0] * 3 + [0.5] * 7 + [20.0] * 2 + [1.0] * (width - 15))
    scales[-1] = 3600.0
    first = rng.normal(0.0, 0.4, (width, 12)) / scales[:, np.newaxis]
    last = rng.normal(0.0, 0.8, (12, num_outputs))
    if metadata.get("forces") == "newtons":
        last *= [0.05] * 3 + [0.001] * 3
    return network((first, last), metadata, kind)


def read(model):
    return policy_of("turning", model.SerializeToString(), "turning.onnx")


def world_of(width):
    """The words of a world whose agents observe so many numbers; AFRL's 18 have no priority."""
    return [*WORLD, *(["chief.weights=equal"] if width == 18 else [])]


def starts_of(words):
    task = task_of([*words, WHEELS])
    cases = replace(task.experiment.monte_carlo, num_cases=NUM_STARTS)
    return task, evaluation_scenarios(replace(task.experiment, monte_carlo=cases))


@pytest.mark.slow
@pytest.mark.parametrize("width", KINDS)
def test_it_fires_and_turns_by_what_the_reference_of_the_format_answers(width):
    metadata = KINDS[width]
    task, (start, *_) = starts_of(world_of(width))
    mission, log = task.mission, None
    log = fly_logged(mission, read(made(width, metadata)), start)
    env = SixDofInspectionEnv(world_of(width))
    shown = env if width == 24 else PublishedObservation(env, start.generator(CLUSTERS))
    shown.reset(options={"scenario": start})
    reference = ReferenceEvaluator(made(width, metadata, TensorProto.DOUBLE))
    most = np.repeat([mission.deputy.max_force_n, mission.deputy.max_torque_n_m], 3)
    assert mission.num_controls == 30
    for k in range(mission.num_controls):
        axes_b = Rotation.from_quat(log.quaternion_b_from_h[k])
        rate = log.angular_velocity_b_rad_s[k] + axes_b.inv().apply(
            [0.0, 0.0, mission.orbit.mean_motion_rad_s]
        )
        env._state = np.concatenate(
            [log.position_m[k], log.velocity_m_s[k], log.quaternion_b_from_h[k], rate]
        )
        env.num_flown, env.is_inspected[:] = k, log.is_inspected[k]
        seen = env.observation if width == 24 else shown._seen()
        (answered,) = reference.run(None, {"seen": seen.astype(np.float64)[np.newaxis]})
        scale = most if metadata["forces"] == "shares" else 1.0
        force, torque = np.split(np.clip(answered[0] * scale, -most, most), 2)
        np.testing.assert_allclose(log.force_asked_n[k], axes_b.apply(force), rtol=0.0, atol=1e-8)
        assert np.abs(log.torque_b_n_m[k, 0]).max() <= np.abs(torque).max() + 1e-12
        # what wheels do not limit is what was asked for
        limited = np.abs(log.wheel_momentum_b_n_m_s[k, 0]) > 0.4 * mission.deputy.max_momentum_n_m_s
        np.testing.assert_allclose(log.torque_b_n_m[k, 0, ~limited], torque[~limited], rtol=0.0, atol=1e-8)
    rates = log.angular_velocity_b_rad_s
    assert MOST_RATE * 0.99 < np.abs(rates).max() < MOST_RATE + 2.0 * mission.orbit.mean_motion_rad_s


@pytest.mark.slow
def test_many_fly_as_each_alone_does_and_recordings_fly_again(tmp_path):
    task, starts = starts_of(WORLD)
    controller = read(made(24, KINDS[24]))
    outcomes = fly_all(task.mission, controller, starts, 2)
    for case, start in enumerate(starts):
        log = fly_logged(task.mission, controller, start)
        assert log.delta_v_m_s[-1] == outcomes.delta_v_m_s[case] > 0.0
        assert log.is_inspected[-1].sum() == outcomes.inspected_count[case]
    FlightRecorder(task.experiment, controller, task.config).record(tmp_path / "a.mcap", start, log, "case")
    assert fly_again(tmp_path / "a.mcap").is_equal


@pytest.mark.slow
def test_the_reference_flies_it_alike():
    words = [*WORLD, WHEELS, "flight=reference", "duration_s=100"]
    task, controller = task_of(words), read(made(24, KINDS[24]))
    _, (start, *_) = starts_of(WORLD)
    there = fly_logged(task.mission, controller, start)
    here = fly_logged(task_of([*WORLD, WHEELS, "duration_s=100"]).mission, controller, start)
    np.testing.assert_allclose(there.position_m, here.position_m, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(there.quaternion_b_from_h, here.quaternion_b_from_h, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ([], r"turns by at most 2 degrees a second.*give deputy.max_momentum_n_m_s=0.002$"),
        (["attitude=ideal"], "attitude.mode is ideal, in which nothing does; choose world=afrl_six_"),
        ([WHEELS, "navigation=fixes"], "observes attitude and rate as they are; choose navigation=perfect"),
    ],
)
def test_missions_that_are_not_its_own_are_refused(words, reason):
    _, (start, *_) = starts_of(WORLD)
    with pytest.raises(ControllerError, match=reason):
        fly_logged(task_of([*WORLD, *words]).mission, read(made(24, {})), start)


def test_a_sun_or_a_priority_that_it_does_not_observe_is_refused():
    task, (start, *_) = starts_of(WORLD)
    with pytest.raises(ControllerError, match="observes no Sun out of the orbit plane"):
        fly_logged(task.mission, read(made(24, {})), replace(start, sun_elevation_rad=0.1))
    with pytest.raises(ControllerError, match=r"takes 18 of AFRL's numbers; .* there are 22"):
        fly_logged(task.mission, read(made(18, KINDS[18])), start)


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        (made(24, {"observations": "published"}), "takes the 24 numbers .* observations must be physical"),
        (made(22, {}), "takes the 22 numbers of a deputy that turns itself; .* must be published"),
        (made(24, {"observations": "normalized"}), "with six degrees of freedom observations are not norm"),
        (made(24, {"forces": "levels", "levels_n": "0.1"}), "with six degrees of freedom"),
        (made(24, {}, num_outputs=3), "answers with 3 numbers; .* along body axes and three torques"),
    ],
)
def test_files_that_are_not_of_its_kind_are_refused(model, reason):
    onnx.checker.check_model(model)
    with pytest.raises(ControllerError, match=reason):
        read(model)
