"""The environments fly what all experiments fly: their episodes are recorded flights, to the last bit."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, MultiDiscrete
from gymnasium.utils.env_checker import check_env

import telemetry
from benchmarks.field import is_enough_in_rso
from pipeline import gym
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.control.controller import coast
from pipeline.flight.fly import stepping
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog, Scenario, empty_log
from pipeline.flight.world.pack import inspection_points
from pipeline.gym import InspectionEnv, task_of
from pipeline.gym.parallel import MultiInspectionEnv
from pipeline.recording.reflight import fly_again
from pipeline.scenarios import evaluation_scenarios

#: what differs in the parts of a flight that are compiled
WORLDS = {"paper": ["safety=filter"], "afrl": ["world=afrl"], "leo": ["world=leo", "duration_s=1200"]}


def known(log: FlightLog, k: int) -> np.ndarray:
    """What a flight's log says of what is observed at a sample."""
    state = [*log.position_m[k], *log.velocity_m_s[k]]
    if log.estimate.any():
        state = list(log.estimate[k])
    counts = [log.is_inspected[k].sum(), log.num_candidates[k], log.delta_v_m_s[k]]
    return np.array([*state, *log.target_m[k], *counts])


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS)
def test_flights_driven_with_the_forces_of_a_log_are_that_flight(world: str) -> None:
    task = task_of([*WORLDS[world], "controller=lqr", "monte_carlo.num_cases=2", "seed=7"])
    experiment, mission = task.experiment, task.mission
    scenarios = evaluation_scenarios(experiment)
    logs = [fly_logged(mission, load(experiment.controller, mission), start) for start in scenarios]
    flights = stepping.SteppedFlights(mission, 2, is_tilted=task.is_tilted)
    for flight, scenario in enumerate(scenarios):
        flights.start(flight, scenario)
    flights.step(np.zeros((2, 3)))
    columns = [*range(9), stepping.NUM_INSPECTED, stepping.NUM_CANDIDATES, stepping.SPENT]
    for k in range(mission.num_controls + 1):
        for flight, log in enumerate(logs):
            assert (flights.observed[flight, columns] == known(log, k)).all(), (flight, k)
        if k < mission.num_controls:
            flights.step(np.array([log.force_asked_n[k] for log in logs]))
    for flight, log in enumerate(logs):
        assert flights.observed[flight, stepping.NUM_ACTED] == np.count_nonzero(log.safety_limit)
        per_force = mission.control_period_s / mission.deputy.mass_kg
        corrected = np.abs(log.safety_force_hill_n).sum() * per_force
        assert flights.observed[flight, stepping.CORRECTED] == pytest.approx(corrected)


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS)
def test_gymnasium_finds_no_fault(world: str) -> None:
    env = gymnasium.make("pipeline.gym:Inspection-v0", overrides=WORLDS[world]).unwrapped
    check_env(env)
    assert len(stepping.OBSERVED) == stepping.NUM_SEEN == env.observation_space.shape[0]


def test_six_degrees_of_freedom_fly_one_world() -> None:
    with pytest.raises(ValueError, match="safety: this is not flown with six degrees of freedom"):
        gym.SixDofInspectionEnv(["world=afrl_six_dof", "safety=filter"])


@pytest.mark.slow
def test_an_action_that_is_no_number_is_refused() -> None:
    many = gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=3, overrides=WORLDS["paper"])
    for env in (InspectionEnv(WORLDS["paper"]), many, gym.SixDofInspectionEnv(["world=afrl_six_dof"])):
        env.reset(seed=1)
        action = np.zeros(env.action_space.shape, dtype=np.float32)
        action[..., 1] = np.nan
        with pytest.raises(ValueError, match=r"an action is nan; .* from -1 to 1"):
            env.step(action)


@pytest.mark.slow
def test_actions_outside_the_space_are_refused() -> None:
    words = {"overrides": WORLDS["paper"]}
    many = gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=3, **words)
    for env in (InspectionEnv(**words), many, gym.SixDofInspectionEnv(["world=afrl_six_dof"])):
        env.reset(seed=1)
        most = np.ones(env.action_space.shape, dtype=np.float32)
        env.step(most)
        for wrong, words in ((1.2 * most, "is 1.2"), (np.inf * most, "is inf"), (np.ones(9), "shape")):
            with pytest.raises(ValueError, match=words):
                env.step(wrong)
    levels = InspectionEnv(WORLDS["paper"], levels_n=0.1)
    levels.reset(seed=1)
    levels.step(levels.action_space.sample())
    for number in (255, -1, 1.5):
        with pytest.raises(ValueError, match=f"is {number}; each number must be 0, 1 or 2"):
            levels.step(np.array([1, number, 1]))


@pytest.fixture(scope="module")
def flown() -> InspectionEnv:
    """An episode of the paper's world under the safety layer, to its end."""
    env = InspectionEnv(WORLDS["paper"])
    env.reset(seed=3)
    generator = np.random.default_rng(0)
    while True:
        *_, terminated, truncated, _ = env.step(generator.normal(0.0, 0.05, 3).astype(np.float32))
        if terminated or truncated:
            return env


@pytest.mark.slow
def test_an_episode_is_a_flight_and_its_recording_flies_again(flown, tmp_path) -> None:
    log, info = flown.log(), flown._info()
    assert flown._episodes.flights.samples[0] == flown.task.mission.num_controls  # by the limit of time
    assert info["delta_v_m_s"] == log.delta_v_m_s[-1]
    assert info["num_inspected"] == log.is_inspected[-1].sum()
    assert info["outside_m"] == 0.0
    flown.record(tmp_path / "episode.mcap")
    assert telemetry.read(tmp_path / "episode.mcap").episode.scenario_id == "episode"
    assert fly_again(tmp_path / "episode.mcap").is_equal


@pytest.mark.slow
def test_a_picture_shows_the_episode_so_far(flown) -> None:
    assert flown.render() is None
    env = gymnasium.make("pipeline.gym:Inspection-v0", overrides=WORLDS["paper"], render_mode="rgb_array")
    env.reset(seed=3)
    first = env.render()
    env.step(np.array([0.0, 0.1, 0.0], dtype=np.float32))
    then = env.render()
    assert first.shape == then.shape == (800, 960, 3)
    assert first.dtype == np.uint8
    assert 0 < (first != then).any(axis=2).mean() < 0.5
    assert (first > 250).all(axis=2).mean() > 0.5


@pytest.mark.slow
def test_rewards_are_what_they_are_said_to_be(flown) -> None:
    env, reward = flown, flown.task.reward
    scenario = replace(env._episodes._scenarios[0], position_m=np.array([18.0, 1.0, 2.0]))
    _, before = env.reset(options={"scenario": scenario})
    _, rewarded, *ends, after = env.step(np.array([-1.0, 0.5, 0.0]))
    gained = after["num_inspected"] - before["num_inspected"]
    assert rewarded == pytest.approx(reward.per_point * gained - reward.per_delta_v * after["delta_v_m_s"])
    assert ends == [False, False]
    outward = replace(scenario, velocity_m_s=np.array([400.0, 0.0, 0.0]))
    _, before = env.reset(options={"scenario": outward})
    _, rewarded, *ends, info = env.step(np.zeros(3))
    assert ends == [True, False]
    assert info["outside_m"] > 0.0
    # the safety layer brakes
    gained, braked = info["num_inspected"] - before["num_inspected"], info["delta_v_m_s"]
    assert rewarded == pytest.approx(reward.per_point * gained - reward.per_delta_v * braked - reward.outside)


@pytest.mark.slow
@pytest.mark.parametrize("world", ["afrl", "afrl_six_dof"])
@pytest.mark.parametrize("velocity_m_s", [0.0, 400.0, -4.0])
def test_success_is_inside_the_limits_alone(world, velocity_m_s) -> None:
    """A hundredth of the points is seen from the start; after 10 s it is there, too far, or too near."""
    kind = gym.SixDofInspectionEnv if "six_dof" in world else InspectionEnv
    env = kind([f"world={world}", "inspection_threshold_percent=1"])
    start = Scenario(np.array([-40.0, 0.0, 0.0]), np.array([-velocity_m_s, 0.0, 0.0]), np.pi)
    _, before = env.reset(options={"scenario": start, "priority": np.array([-1.0, 0.0, 0.0])})
    *_, info = env.step(np.zeros(env.action_space.shape))
    assert before["is_success"]
    assert info["num_inspected"] >= 1.0
    assert info["is_success"] == (velocity_m_s == 0.0)


@pytest.mark.slow
def test_many_flights_are_single_ones_and_start_anew() -> None:
    settings = {"overrides": WORLDS["paper"], "levels_n": 0.05}
    many = gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=3, **settings)
    singles = [InspectionEnv(**settings) for _ in range(3)]
    assert many.single_action_space == MultiDiscrete([3, 3, 3])
    seen, _ = many.reset(seed=11)
    assert (seen == [env.reset(seed=11 + index)[0] for index, env in enumerate(singles)]).all()
    generator, has_ended = np.random.default_rng(1), np.zeros(3, dtype=bool)
    for _ in range(400):
        actions = generator.integers(0, 3, (3, 3))
        seen, rewards, terminated, truncated, _ = many.step(actions)
        for index, env in enumerate(singles):
            alone = (env.reset()[0], 0.0, False, False) if has_ended[index] else env.step(actions[index])[:4]
            assert (alone[0] == seen[index]).all()
            assert alone[1:] == (rewards[index], terminated[index], truncated[index])
        has_ended = terminated | truncated


@pytest.mark.slow
def test_many_flights_are_drawn_and_end_when_asked() -> None:
    words = {"overrides": WORLDS["paper"], "render_mode": "rgb_array", "max_episode_steps": 3}
    many = gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=2, **words)
    alone = gymnasium.make("pipeline.gym:Inspection-v0", **words)
    many.reset(seed=5)
    alone.reset(seed=5)
    for step in range(3):
        action = np.full(3, 0.02, dtype=np.float32)
        *_, is_cut, _ = many.step(np.stack([action, action]))
        assert is_cut.all() == is_cut.any() == (step == 2) == alone.step(action)[3]
    first, second = many.render()
    np.testing.assert_array_equal(first, alone.render())
    assert not np.array_equal(first, second)
    with pytest.raises(ValueError, match="max_episode_steps is 0; it must be at least 1"):
        gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=2, max_episode_steps=0)
    assert gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=2).render() is None


def test_normalised_observations_are_about_one() -> None:
    single = gym.NormalizedObservation(InspectionEnv(WORLDS["paper"]))
    many = gym.NormalizedVectorObservation(gym.InspectionVectorEnv(2, WORLDS["paper"]))
    seen = single.reset(seed=5)[0]
    assert (many.reset(seed=5)[0][0] == seen).all()
    assert single.observation_space.contains(seen)
    assert np.abs(seen).max() <= 1.0
    assert isinstance(single.action_space, Box)


def test_what_cannot_be_learnt_in_is_refused(flown) -> None:
    task = flown.task
    tilted = replace(flown._episodes._scenarios[0], sun_elevation_rad=0.5)
    with pytest.raises(ValueError, match="out of the orbit plane; pass is_tilted=True"):
        stepping.SteppedFlights(task.mission, 1, is_tilted=False).start(0, tilted)
    with pytest.raises(ValueError, match=r"levels_n is 9\.0; it must be above 0 and at most"):
        task_of(levels_n=9.0)
    with pytest.raises(ValueError, match="leave dispersions out"):
        InspectionEnv(["+dispersions.deputy.mass_kg={kind:uniform,low:10,high:14}"])
    for words in ("controller=lqr", "monte_carlo.num_cases=5", "seed=7"):
        with pytest.raises(ValueError, match=f"{words} changes no episode; leave it out"):
            InspectionEnv([words])


@pytest.mark.slow
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_start_that_is_not_finite_is_refused_with_its_field(bad, flown) -> None:
    start, fleet = flown.scenario, MultiInspectionEnv(num_deputies=2)
    fields = {
        "position_m": np.array([-40.0, bad, 0.0]),
        "velocity_m_s": np.array([0.0, 0.0, bad]),
        "sun_angle_rad": bad,
        "sun_elevation_rad": bad,
        "settings": (1.0, bad),
        "others": (start, replace(start, sun_angle_rad=bad)),
    }
    for name, value in fields.items():
        broken = replace(start, **{name: value})
        words = rf"^scenario\.{name}(\[1\]\.sun_angle_rad)? is .*; give (a )?finite number"
        with pytest.raises(ValueError, match=words):
            flown.reset(options={"scenario": broken})
        with pytest.raises(ValueError, match=rf"^scenarios\[1\]\.{name}"):
            fleet.reset(options={"scenarios": [start, broken]})
    for env, word in ((flown, "scenario"), (fleet, "scenarios")):
        given = start if env is flown else [start, start]
        with pytest.raises(ValueError, match=r"^priority is .* give finite numbers, shape \(3,\)"):
            env.reset(options={word: given, "priority": [1.0, bad, 0.0]})
        with pytest.raises(ValueError, match=r"^priority is zero"):
            env.reset(options={word: given, "priority": np.zeros(3)})
    with pytest.raises(ValueError, match=r"position_m is .* give finite numbers, shape \(3,\)"):
        flown.reset(options={"scenario": replace(start, position_m=np.zeros(2))})
    with pytest.raises(ValueError, match=r"^scenario is of type dict; give a pipeline.flight.state.log.Sc"):
        flown.reset(options={"scenario": {"position_m": [1.0, 2.0, 3.0]}})


def test_points_are_seen_within_30_degrees_and_lit_within_60_and_10_m_s_are_spent() -> None:
    env = InspectionEnv(["world=rso"])
    normals, position = inspection_points(env.task.mission), np.array([0.0, 120.0, 160.0])
    _, info = env.reset(options={"scenario": Scenario(position, np.zeros(3), np.radians(60.0))})
    towards = position - normals
    is_in_view = np.sum(normals * towards, axis=1) >= np.cos(np.pi / 6) * np.linalg.norm(towards, axis=1)
    is_lit = normals @ [0.5, np.sqrt(0.75), 0.0] > 0.5
    assert info["num_inspected"] == np.sum(is_in_view & is_lit) > 0
    spent = []
    for k in range(30):
        *_, info = env.step(np.array([1.0 if k % 4 in (0, 3) else -1.0, 0.0, 0.0]))
        spent.append(info["delta_v_m_s"])
    assert spent[0] == pytest.approx(1.0, rel=1e-3)
    assert spent[-1] == spent[-2] == pytest.approx(10.0, rel=1e-3)
    far = Scenario(np.array([0.0, 0.0, 252.0]), np.zeros(3), 0.0, np.pi / 2)
    assert InspectionEnv(["world=rso"]).reset(options={"scenario": far})[1]["num_inspected"] == 0.0


def test_as_in_bsk_rl_enough_is_seen_only_once_many_points_were_lit_or_an_orbit_has_passed() -> None:
    mission = compose_experiment(["+experiment=evaluate", "world=rso"]).experiment.mission
    normals, over_the_pole = inspection_points(mission), Scenario(np.zeros(3), np.zeros(3), 0.0, np.pi / 2)
    is_lit = normals[:, 2] > 0.5
    assert is_lit.sum() == 23
    log = empty_log(mission.num_controls, mission.num_attitude_steps, 100, 0)
    for num_seen, first in ((21, 101), (20, None)):  # 0.9 of 23; an orbit takes 100.7 periods of a minute
        log.is_inspected[:] = is_lit & (np.cumsum(is_lit) <= num_seen)
        is_enough = is_enough_in_rso(mission, over_the_pole, log)
        assert (int(is_enough.argmax()) if is_enough.any() else None) == first


@pytest.mark.slow
def test_an_episode_is_judged_by_what_follows_it() -> None:
    env = InspectionEnv(["duration_s=300", "after_s=3000", "inspection_threshold_percent=1"])
    mission, seen = env.task.mission, set()
    starts = [env.task.draw(np.random.default_rng(seed)) for seed in range(12)]
    coasted = fly_all(mission, coast(), starts, 1)
    for flight, start in enumerate(starts):
        env.reset(options={"scenario": start})
        for _ in range(mission.num_controls):
            before = env._info()["num_inspected"]
            _, reward, terminated, truncated, info = env.step(np.zeros(3))
        assert info["outside_m"] == coasted.outside_m[flight]
        assert (terminated, truncated) == (bool(info["outside_m"]), not info["outside_m"])
        assert bool(info["is_success"]) == (not info["outside_m"])
        points = info["num_inspected"] - before
        assert reward == pytest.approx(0.1 * points + (-1.0 if terminated else 1.0))
        seen.add(terminated)
    assert seen == {True, False}


def test_episodes_that_end_early_refuse_to_look_at_what_follows() -> None:
    with pytest.raises(ValueError, match="after_s is 60, and AFRL's episodes end as soon as enough is seen"):
        task_of(["after_s=60"], gym.AFRL)
