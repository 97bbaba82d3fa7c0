"""AFRL's inspection, step for step: the same actions, and what their own code makes of them.

`afrl/make_tables.py` made the tables, of safe-autonomy-sims (https://github.com/act3-ace/safe-autonomy-sims).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.gym import AFRL, AFRL_WEIGHTED, InspectionEnv, task_of
from tests.places import PROJECT

#: of those, positions are kept
EVERY = 10
#: theirs integrates with a tolerance of 1e-3 and takes forces in single precision
CLOSE_M = 1e-4
WORLDS = {"afrl": AFRL, "afrl_weighted": AFRL_WEIGHTED}


class Episode(NamedTuple):
    """An episode of theirs of K steps."""

    start: NDArray[np.float64]  # position (m), velocity (m/s), the Sun's angle (rad), priority
    actions: NDArray[np.float32]  # (K, 3)
    counts: NDArray[np.uint8]  # (K+1,) points inspected
    weights: NDArray[np.float64]  # (K+1,) their weight; no rows where all count alike
    rewards: NDArray[np.float64]  # (K,)
    places: NDArray[np.float64]  # positions after each tenth step, from 0, and the last, m
    status: str


def episodes(world: str) -> Iterator[Episode]:
    """Read the episodes of a world."""
    with np.load(PROJECT / "tests" / "pipeline" / "gym" / "afrl" / f"{world}.npz") as table:
        columns = dict(table)
    samples, steps, kept = 0, 0, 0
    weights = columns.get("weights", np.zeros(0))
    for start, length, status in zip(columns["start"], columns["length"], columns["status"], strict=True):
        num_kept = -(-length // EVERY) + 1
        yield Episode(
            start,
            columns["actions"][steps : steps + length],
            columns["counts"][samples : samples + length + 1],
            weights[samples : samples + length + 1],
            columns["rewards"][steps : steps + length],
            columns["places"][kept : kept + num_kept],
            str(status),
        )
        samples, steps, kept = samples + length + 1, steps + length, kept + num_kept


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS)
def test_the_same_actions_give_the_same_episode(world: str) -> None:
    """Positions, points inspected, their weight, rewards and the end; half of the episodes are random."""
    env, ends = InspectionEnv([f"world={world}"], WORLDS[world]), []
    for one in episodes(world):
        place, velocity, (sun,), priority = np.split(one.start, [3, 6, 7])
        scenario = Scenario(place, velocity, -sun)  # their Sun's angle is counted from +i towards -j
        seen, told = env.reset(options={"scenario": scenario, "priority": priority})
        rows, places, is_over = [(0.0, told)], [seen[:3]], False
        for action in one.actions:
            assert not is_over
            seen, reward, terminated, truncated, told = env.step(action)
            rows.append((reward, told))
            places.append(env._episodes._flights.observed[0, :3].copy())
            is_over = terminated or truncated
        assert is_over
        assert terminated == (one.status in ("Success", "Crash"))
        assert truncated == (one.status in ("Out of Bounds", "Timeout"))
        ends.append(one.status)
        np.testing.assert_allclose([*places[:-1:EVERY], places[-1]], one.places, rtol=0, atol=CLOSE_M)
        assert [told["num_inspected"] for _, told in rows] == one.counts.tolist()
        if len(one.weights):
            found = [told["weight_inspected"] for _, told in rows]
            np.testing.assert_allclose(found, one.weights, rtol=0, atol=1e-12)
        np.testing.assert_allclose([reward for reward, _ in rows[1:]], one.rewards, rtol=0, atol=1e-6)
    assert len(ends) == 40
    assert set(ends) == {"Success", "Crash", "Out of Bounds", "Timeout"}


@pytest.mark.slow
def test_a_camera_of_60_degrees_sees_what_theirs_would() -> None:
    """Their law, from where the deputy is and how it is turned; the torques stay within 1 mN m."""
    task = task_of(["world=afrl_six_dof", "seed=3"])
    mission, experiment = task.mission, task.experiment
    start = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed, [0])[0]
    log, points = fly_logged(mission, coast(), start), inspection_points(mission)
    seen, closest = np.zeros(100, dtype=bool), []
    for k, (place, quaternion) in enumerate(zip(log.position_m, log.quaternion_b_from_h, strict=True)):
        axis, distance = Rotation.from_quat(quaternion).apply([-1.0, 0.0, 0.0]), np.linalg.norm(place)
        closest.append(np.degrees(np.arccos(-axis @ place / distance)))
        gone = points - place
        is_in_field = gone @ axis >= np.cos(np.radians(30.0)) * np.linalg.norm(gone, axis=1)
        sun = start.sun_angle_rad - mission.orbit.mean_motion_rad_s * 10.0 * k
        beam = np.array([np.cos(sun), np.sin(sun), 0.0])
        # a ray from 1e-5 m above the sphere of 10 m passes it
        is_lit = points @ beam / 10.0 > -np.sqrt(1.0 - (10.0 / (10.0 + 1e-5)) ** 2)
        seen |= is_in_field & is_lit & (points @ place >= 100.0)
        assert log.is_inspected[k].tolist() == seen.tolist()
    assert closest[0] > 30.0
    assert max(closest[30:]) < 5.0
    assert 20 < seen.sum() < 100
    assert np.abs(log.torque_b_n_m).max() == pytest.approx(0.001)
