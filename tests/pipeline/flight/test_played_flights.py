"""Flights played from tables: forces along body axes, torques, attitudes, and starts that already turn."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.vectors import load, store
from fis_tools.formats import serialize
from fis_tools.genes.parameters import Bounds, SystemEncoding
from fis_tools.model import FuzzyController
from pipeline.controllers.played import read_played
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import ControllerError, coast, from_fuzzy, law_of, open_loop
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.lanes import arctangent, exponential
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.pack import pack_world
from tests.pipeline.flight.cases import COMPLETED, MIXED, OVER_POLES, STARTS, STEERING, mission
from tests.pipeline.flight.missions import FULL_INERTIA, MEAN_MOTION
from tests.places import PROJECT

TURNED = Rotation.from_euler("zyx", [100.0, -35.0, 20.0], degrees=True)
RATE = (0.01, -0.02, 0.005)
BEGUN = {"initial_quaternion": tuple(TURNED.as_quat().tolist()), "initial_angular_velocity_rad_s": RATE}
MINUTES = mission(deputy=BEGUN | {"inertia_kg_m2": FULL_INERTIA}, duration_s=600.0)


def table(path, names, rows):
    lines = [",".join(["time_s", *names])]
    lines += [",".join(map(repr, [10.0 * k, *row])) for k, row in enumerate(np.asarray(rows).tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def turned_by_scipy(torques):
    """Attitudes, body axes from Hill, and inertial rates after each control period, from Euler's equation."""
    inertia = np.array(FULL_INERTIA)
    # rotations here are active, from body to inertial axes, which are Hill's at the start
    state = np.concatenate((TURNED.as_quat(), RATE + TURNED.inv().apply([0.0, 0.0, MEAN_MOTION])))

    def rates(time, state, torque):
        x, y, z, w = state[:4]
        a, b, c = rate = state[4:]
        spun = 0.5 * np.array(
            [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
        )
        return np.concatenate((spun, np.linalg.solve(inertia, torque - np.cross(rate, inertia @ rate))))

    attitudes = [TURNED]
    for k, torque in enumerate(torques):
        state = solve_ivp(rates, (0.0, 10.0), state, "DOP853", rtol=1e-12, atol=1e-13, args=(torque,)).y[
            :, -1
        ]
        hill = Rotation.from_rotvec([0.0, 0.0, MEAN_MOTION * 10.0 * (k + 1)])
        attitudes.append(hill.inv() * Rotation.from_quat(state[:4]))
    return attitudes


def test_torques_turn_the_deputy_as_scipy_does(tmp_path):
    torques = np.random.default_rng(4).normal(0.0, 2e-4, (60, 3))
    path = table(tmp_path / "torques.csv", ["torque_x_n_m", "torque_y_n_m", "torque_z_n_m"], torques)
    controller = read_played(path, MINUTES)
    log = fly_logged(MINUTES, controller, STARTS[0])
    np.testing.assert_array_equal(log.torque_b_n_m, np.repeat(torques[:, np.newaxis], 10, axis=1))
    for quaternion, wanted in zip(log.quaternion_b_from_h, turned_by_scipy(torques), strict=True):
        assert (Rotation.from_quat(quaternion).inv() * wanted).magnitude() < 1e-6
    assert Rotation.from_quat(log.quaternion_b_from_h[-1]).magnitude() > 0.1
    # an evaluation flies the same
    assert (
        fly_all(MINUTES, controller, STARTS[:1]).min_distance_m[0]
        == np.linalg.norm(log.position_m, axis=1).min()
    )


def test_attitudes_are_had_with_ideal_pointing_and_sought_with_flown(tmp_path):
    wanted = Rotation.random(3, random_state=8).as_quat()
    path = table(tmp_path / "turns.csv", ["q1", "q2", "q3", "q4"], np.round(wanted, 6))
    ideal = replace(MINUTES, attitude=replace(MINUTES.attitude, mode="ideal"))
    log = fly_logged(ideal, read_played(path, ideal), STARTS[0])
    held = np.concatenate((wanted, np.repeat(wanted[-1:], 58, axis=0)))
    assert np.abs(np.sum(log.quaternion_b_from_h * held, axis=1)).min() > 1.0 - 1e-10
    log = fly_logged(MINUTES, read_played(path, MINUTES), STARTS[0])
    assert abs(log.quaternion_b_from_h[-1] @ wanted[-1]) > 1.0 - 1e-4


@pytest.mark.parametrize("mode", ["flown", "ideal"])
def test_forces_along_body_axes_are_turned_with_the_deputy(mode, tmp_path):
    forces = np.random.default_rng(6).normal(0.0, 0.02, (60, 3))
    path = table(tmp_path / "body.csv", ["force_body_x_n", "force_body_y_n", "force_body_z_n"], forces)
    what = replace(MINUTES, attitude=replace(MINUTES.attitude, mode=mode))
    log = fly_logged(what, read_played(path, what), STARTS[0])
    turned = Rotation.from_quat(log.quaternion_b_from_h[:60]).apply(forces)
    np.testing.assert_allclose(log.force_hill_n, turned, atol=1e-15)
    np.testing.assert_allclose(log.force_body_n, forces, atol=1e-15)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("time_s,force_x_n,force_y_n\n", "has 0 columns force_z_n; give it one"),
        ("time_s,q1,q2,q3,q4,q1\n", "has 2 columns q1; give it one"),
        ("time_s,speed\n", "has a column 'speed'; besides time_s the columns are force_x_n"),
        ("time_s,force_x_n,force_body_x_n\n", "has both force_x_n and force_body_x_n; keep one group"),
        ("time_s,q1,torque_x_n_m\n", "has both torque_x_n_m and q1; keep one group"),
        ("time_s,q1,q2,q3,q4\n0,0,0,0,0.9\n", "data row 1 has an attitude of length 0.9; it must be 1"),
        ("time_s,q1,q2,q3,q4\n0,0,0,0\n", "line 2 is '0,0,0,0'; write 5 finite numbers"),
    ],
)
def test_tables_that_cannot_be_played(content, message, tmp_path):
    path = tmp_path / "odd.csv"
    path.write_text(content)
    with pytest.raises(ControllerError, match=message):
        read_played(path, MINUTES)


def test_nothing_is_turned_by_torques_where_pointing_is_ideal(tmp_path):
    path = table(tmp_path / "t.csv", ["torque_x_n_m", "torque_y_n_m", "torque_z_n_m"], [[0.0, 0.0, 1e-3]])
    with pytest.raises(ControllerError, match=r"has torques, but attitude\.mode is ideal"):
        read_played(path, replace(MINUTES, attitude=replace(MINUTES.attitude, mode="ideal")))


PAPER = serialize.load(PROJECT / "conf" / "controller" / "paper.yaml")
MISSION = mission(guidance={"kind": "clusters"})
FLIGHTS = [*STARTS, *OVER_POLES, COMPLETED]


@pytest.mark.parametrize("workers", [1, 3])
def test_a_genome_its_json_and_its_yaml_fly_the_same_bit_for_bit(workers: int, tmp_path: Path) -> None:
    encoding = SystemEncoding(PAPER.systems, Bounds())
    genomes = np.random.default_rng(8).random((5, encoding.num_genes))
    genomes[0] = encoding.encode(PAPER.systems)
    law = law_of(from_fuzzy(PAPER), MISSION)
    tracks = np.empty((5 * len(FLIGHTS), MISSION.num_controls + 1, 3), dtype=np.float32)
    population = fly_population(
        pack_world(MISSION), law, encoding.pack(genomes), cases_of(MISSION, FLIGHTS), workers, tracks
    )
    assert population.delta_v_m_s.shape == (5, len(FLIGHTS))
    assert len(np.unique(population.delta_v_m_s)) == population.delta_v_m_s.size
    for row, genome in enumerate(genomes):
        champion = FuzzyController("champion", encoding.decode(genome), PAPER.attributes)
        (tmp_path / "champion.json").write_text(serialize.dump_json(champion), encoding="utf-8")
        (tmp_path / "champion.yaml").write_text(serialize.dump_yaml(champion), encoding="utf-8")
        for name in ("champion.json", "champion.yaml"):
            track = np.empty((len(FLIGHTS), MISSION.num_controls + 1, 3), dtype=np.float32)
            alone = fly_all(MISSION, from_fuzzy(serialize.load(tmp_path / name)), FLIGHTS, 1, track)
            np.testing.assert_array_equal(track, tracks[row * len(FLIGHTS) : (row + 1) * len(FLIGHTS)])
            for fact, values in vars(alone).items():
                np.testing.assert_array_equal(values, getattr(population, fact)[row], err_msg=fact)


def test_a_template_of_which_nothing_is_clipped_survives_its_genome() -> None:
    encoding = SystemEncoding(PAPER.systems, Bounds())
    again = FuzzyController("again", encoding.decode(encoding.encode(PAPER.systems)), PAPER.attributes)
    one, other = (fly_all(MISSION, from_fuzzy(fuzzy), FLIGHTS) for fuzzy in (PAPER, again))
    np.testing.assert_array_equal(one.inspected_count, other.inspected_count)
    np.testing.assert_allclose(one.delta_v_m_s, other.delta_v_m_s, rtol=1e-6)


Floats = NDArray[np.float64]
WIDTH = 8
ROUNDING = 2.0**-52


@njit(error_model="numpy")
def exponentials(x: Floats, out: Floats) -> None:
    for i in range(0, len(x), WIDTH):
        store(out, i, exponential(load(x, i, WIDTH)))


@njit(error_model="numpy")
def angles(y: Floats, x: Floats, out: Floats) -> None:
    for i in range(0, len(x), WIDTH):
        store(out, i, arctangent(load(y, i, WIDTH), load(x, i, WIDTH)))


@pytest.mark.parametrize(("low", "high"), [(-1e-6, 1e-6), (-1.0, 1.0), (-40.0, 40.0), (-699.0, 699.0)])
def test_the_exponential_is_right_to_rounding(low: float, high: float) -> None:
    x = np.random.default_rng(1).uniform(low, high, 8000)
    found = np.empty_like(x)
    exponentials(x, found)
    np.testing.assert_allclose(found, np.exp(x), rtol=2 * ROUNDING, atol=0.0)


def test_the_exponential_of_zero_is_one_and_of_little_nothing() -> None:
    x = np.array([0.0, -0.0, -701.0, -1e300, -np.inf, 1.0, -1.0, np.log(2.0)])
    found = np.empty_like(x)
    exponentials(x, found)
    np.testing.assert_array_equal(found[:5], [1.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found[5:], [np.e, 1.0 / np.e, 2.0], rtol=2 * ROUNDING)


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
def test_angles_are_right_to_rounding(scale: float) -> None:
    y, x = scale * np.random.default_rng(2).normal(size=(2, 8000))
    found = np.empty_like(x)
    angles(y, x, found)
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=2 * ROUNDING, atol=0.0)


def test_angles_on_the_axes_are_those_from_minus_to_plus_pi_without_the_former() -> None:
    y = np.array([0.0, 0.0, -0.0, 1.0, -1.0, 1.0, -1.0, 1e-300])
    x = np.array([1.0, -1.0, -1.0, 0.0, 0.0, 1.0, -1.0, -1.0])
    found = np.empty_like(x)
    angles(y, x, found)
    turn = np.pi / 4.0
    np.testing.assert_allclose(
        found, turn * np.array([0, 4, 4, 2, -2, 1, -3, 4]), rtol=2 * ROUNDING, atol=0.0
    )


def assert_same(fast: FlightLog, plain: FlightLog, metres: float, others: float) -> None:
    """Compare two flights field by field: positions and targets to `metres`, other numbers to `others`."""
    for name in FlightLog._fields:
        values, expected = getattr(fast, name), getattr(plain, name)
        assert (values.shape, values.dtype) == (expected.shape, expected.dtype), name
        tolerance = metres if name in ("position_m", "target_m") else others
        if values.dtype == np.float64:
            np.testing.assert_allclose(values, expected, rtol=0, atol=tolerance, err_msg=name)
        else:
            np.testing.assert_array_equal(values, expected, err_msg=name)


def along_track(metres: float, velocity_m_s: float = 0.0) -> Scenario:
    """Ahead of the chief, where nothing pulls a deputy that rests."""
    return Scenario(np.array([0.0, metres, 0.0]), np.array([0.0, velocity_m_s, 0.0]), 0.0)


def test_outcomes_are_what_the_log_holds() -> None:
    narrow = mission(
        deputy={"max_force_n": 0.01, "min_distance_m": 64.0, "max_distance_m": 80.0}, control_period_s=20.0
    )
    starts = [*STARTS, *OVER_POLES, COMPLETED]
    outcomes = fly_all(narrow, STEERING, starts)
    for case, start in enumerate(starts):
        log = fly_logged(narrow, STEERING, start)
        spent = sum(np.abs(force).sum() for force in log.force_hill_n) * 20.0 / 12.0
        distance = [float(np.sqrt(np.dot(r, r))) for r in log.position_m]
        outside = max(max(64.0 - d, d - 80.0, 0.0) for d in distance[1:])
        assert outcomes.delta_v_m_s[case] == pytest.approx(spent, rel=1e-12)
        assert outcomes.inspected_count[case] == log.is_inspected[-1].sum()
        assert outcomes.mean_distance_m[case] == pytest.approx(sum(distance) / 181, rel=1e-12)
        assert outcomes.min_distance_m[case] == pytest.approx(min(distance), rel=1e-12)
        assert outcomes.max_distance_m[case] == pytest.approx(max(distance), rel=1e-12)
        assert outcomes.outside_m[case] == pytest.approx(outside, rel=1e-12)
        assert outcomes.is_violated[case] == (outside > 0.0)
        assert np.abs(log.force_hill_n).max() == 0.01
    assert 0 < outcomes.is_violated.sum() < len(starts)
    assert outcomes.min_distance_m.min() < 64.0
    assert outcomes.max_distance_m.max() > 80.0


def test_delta_v_sums_the_magnitudes_of_what_is_applied() -> None:
    """Ten periods of 10 s at (0.3, -0.4, 2) N, of which 1 N is applied along k, on 12 kg."""
    plan = open_loop("plan", np.tile([0.3, -0.4, 2.0], (10, 1)))
    outcomes = fly_all(mission(duration_s=200.0), plan, [along_track(75.0)])
    assert outcomes.delta_v_m_s[0] == pytest.approx(10 * 10.0 * (0.3 + 0.4 + 1.0) / 12.0, rel=1e-14)


@pytest.mark.parametrize(
    ("metres", "outside_m"),
    [
        (15.0, 0.0),
        (200.0, 0.0),
        (14.0, 1.0),
        (203.0, 3.0),
        (np.nextafter(15.0, 0.0), 15.0 - np.nextafter(15.0, 0.0)),
    ],
)
def test_the_ends_of_the_distance_limits_are_inside(metres: float, outside_m: float) -> None:
    outcomes = fly_all(mission(duration_s=600.0), coast(), [along_track(metres)])
    assert outcomes.outside_m[0] == outside_m
    assert outcomes.is_violated[0] == (outside_m > 0.0)
    assert outcomes.min_distance_m[0] == outcomes.max_distance_m[0] == outcomes.mean_distance_m[0] == metres


@pytest.mark.parametrize(("metres", "velocity_m_s"), [(14.9, 0.05), (200.5, -0.1)])
def test_the_start_itself_may_be_outside(metres: float, velocity_m_s: float) -> None:
    outcomes = fly_all(mission(duration_s=100.0), coast(), [along_track(metres, velocity_m_s)])
    assert not outcomes.is_violated[0]
    assert metres in (outcomes.min_distance_m[0], outcomes.max_distance_m[0])


def test_scikit_learn_flies_the_same_outcomes_and_logs() -> None:
    kept = {"duration_s": 300.0, "chief": {"initial_angular_velocity_rad_s": (0.01, -0.02, 0.005)}}
    ours, theirs = (
        mission(guidance={"kind": "clusters", "engine": engine}, **kept) for engine in ("compiled", "sklearn")
    )
    starts = [STARTS[1], COMPLETED]
    tracks = [np.full((2, 31, 3), np.nan, dtype=np.float32) for _ in range(2)]
    outcomes = [
        fly_all(what, MIXED, starts, 1, track) for what, track in zip((ours, theirs), tracks, strict=True)
    ]
    for name, values in vars(outcomes[0]).items():
        np.testing.assert_allclose(values, getattr(outcomes[1], name), rtol=0, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(*tracks, rtol=0, atol=1e-5)
    assert outcomes[1].inspected_count.dtype == np.int64
    assert_same(fly_logged(ours, MIXED, COMPLETED), fly_logged(theirs, MIXED, COMPLETED), 1e-6, 1e-6)


def test_scikit_learn_flies_plans_too() -> None:
    kept = {"duration_s": 100.0}
    plan = open_loop("plan", np.tile([0.0, 0.02, -0.01], (5, 1)))
    ours, theirs = (
        mission(guidance={"kind": "clusters", "engine": engine}, **kept) for engine in ("compiled", "sklearn")
    )
    assert_same(fly_logged(ours, plan, COMPLETED), fly_logged(theirs, plan, COMPLETED), 1e-6, 1e-6)
    assert_same(fly_logged(ours, coast(), COMPLETED), fly_logged(theirs, coast(), COMPLETED), 1e-6, 1e-6)
