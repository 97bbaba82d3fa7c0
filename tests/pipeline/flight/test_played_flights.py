"""Flights played from tables: forces along body axes, torques, attitudes, and starts that already turn."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.elementary import exponential
from fis_tools.compiled.vectors import load, store
from pipeline.controllers.played import read_played
from pipeline.flight.control.controller import ControllerError, coast, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.lanes import arctangent
from pipeline.flight.state.log import Scenario
from pipeline.recording.events import events
from pipeline.settings.experiment import Mission
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import COMPLETED, MIXED, STARTS, mission
from tests.pipeline.flight.departures import TUMBLING
from tests.pipeline.flight.missions import FULL_INERTIA

TURNED = Rotation.from_euler("zyx", [100.0, -35.0, 20.0], degrees=True)
RATE = (0.01, -0.02, 0.005)
BEGUN = {"initial_quaternion": tuple(TURNED.as_quat().tolist()), "initial_angular_velocity_rad_s": RATE}
MINUTES = mission(deputy=BEGUN | {"inertia_kg_m2": FULL_INERTIA}, duration_s=600.0)


def table(path, names, rows):
    lines = [",".join(["time_s", *names])]
    lines += [",".join(map(repr, [10.0 * k, *row])) for k, row in enumerate(np.asarray(rows).tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


RANDOM = np.random.default_rng(4)
TORQUES = ("torque_x_n_m", "torque_y_n_m", "torque_z_n_m"), RANDOM.normal(0.0, 2e-4, (60, 3))
TURNS = ("q1", "q2", "q3", "q4"), Rotation.random(3, random_state=8).as_quat().round(6)
FORCES = ("force_body_x_n", "force_body_y_n", "force_body_z_n"), RANDOM.normal(0.0, 0.02, (60, 3))


@pytest.mark.parametrize(
    ("played", "mode"),
    [(TORQUES, "flown"), (TURNS, "flown"), (TURNS, "ideal"), (FORCES, "flown"), (FORCES, "ideal")],
)
def test_what_is_played_is_flown_as_written(played, mode, tmp_path):
    """Torques turn the deputy; attitudes are had where pointing is ideal, and sought where it is flown."""
    what = replace(MINUTES, attitude=replace(MINUTES.attitude, mode=mode))
    names, rows = played
    controller = read_played(table(tmp_path / "played.csv", names, rows), what)
    log = assert_as_written(what, controller, STARTS[0])
    logged = {"force_body_x_n": log.force_body_n, "torque_x_n_m": log.torque_b_n_m[:, 0]}
    if names in (TORQUES[0], FORCES[0]):
        np.testing.assert_allclose(logged[names[0]], rows, atol=1e-15)
    else:
        assert abs(log.quaternion_b_from_h[-1] @ rows[-1]) > 1.0 - 1e-4
    # an evaluation flies the same
    nearest = np.linalg.norm(log.position_m, axis=1).min()
    assert fly_all(what, controller, STARTS[:1]).min_distance_m[0] == nearest


@pytest.mark.parametrize("flight", ["compiled", "reference"])
def test_a_slew_with_wheels_that_fill_takes_its_closed_form_time(flight, tmp_path):
    """Through an angle A under a torque m, with a momentum H: ``J A/H + H/m``, mostly with a full wheel."""
    moment, most, torque, angle = 2.0, 0.2, 0.01, 6.0
    time = moment * angle / most + most / torque
    what = mission(
        deputy={
            "inertia_kg_m2": (moment * np.eye(3)).tolist(),
            "max_momentum_n_m_s": most,
            "initial_angular_velocity_rad_s": (0.0, 0.0, 0.0),
        },
        duration_s=time,
        flight=flight,
    )
    rows = np.zeros((round(time / 10.0), 3))
    rows[:, 2] = np.where(10.0 * np.arange(len(rows)) < time - most / torque, torque, -torque)
    slew = read_played(table(tmp_path / "slew.csv", TORQUES[0], rows), what)
    log = fly_logged(what, slew, STARTS[0])
    np.testing.assert_allclose(log.angular_velocity_b_rad_s[-1], 0.0, atol=1e-9)
    end = Rotation.from_quat(log.quaternion_b_from_h[-1])
    assert (end * Rotation.from_rotvec([0.0, 0.0, -angle])).magnitude() < 1e-6
    assert log.angular_velocity_b_rad_s[:, 2].max() == pytest.approx(most / moment, rel=1e-9)
    held = log.wheel_momentum_b_n_m_s.reshape(-1, 3)[:, 2]
    assert held.min() == pytest.approx(-most, rel=1e-9)
    # at each instant from 20 s on, up to that from which it is emptied
    assert np.count_nonzero(held <= -0.99 * most) == 41
    assert fly_all(what, slew, STARTS[:1]).full_wheel_s[0] == 41.0
    words = [event.text for event in events(what, log, 5.0) if "wheel" in event.text]
    assert words == ["a wheel is full, at 0.2 N m s; in all one is for 41 s"]


def test_wheels_turn_the_body_as_scipy_integrates_both():
    """Euler's equation of a body with wheels whose motors give what is logged, under gravity's gradient."""
    inertia, most = np.array(FULL_INERTIA), 0.03
    what = mission(
        deputy=BEGUN | {"inertia_kg_m2": FULL_INERTIA, "max_momentum_n_m_s": most},
        attitude={"gravity_gradient": True},
        duration_s=200.0,
    )
    log = fly_logged(what, MIXED, STARTS[0])
    n, inverse = what.orbit.mean_motion_rad_s, np.linalg.inv(inertia)
    start = Rotation.from_quat(log.quaternion_b_from_h[0])
    inertial = log.angular_velocity_b_rad_s[0] + start.inv().apply([0.0, 0.0, n])
    state = np.concatenate((start.as_quat(), inertial, np.zeros(3)))
    logged = zip(log.torque_b_n_m.reshape(-1, 3), log.wheel_momentum_b_n_m_s.reshape(-1, 3), strict=True)
    for second, (torque, held) in enumerate(logged):
        np.testing.assert_allclose(held, state[7:], atol=1e-6)
        upward = Rotation.from_quat(state[:4]).inv().apply([np.cos(n * second), np.sin(n * second), 0.0])
        pull = 3.0 * n**2 * np.cross(upward, inertia @ upward)

        def rates(_time, s, torque=torque, pull=pull):
            (x, y, z, c), w, held = s[:4], s[4:7], s[7:]
            turn = 0.5 * np.array([[c, -z, y], [z, c, -x], [-y, x, c], [-x, -y, -z]]) @ w
            motors = -torque - np.cross(w, held)
            spin = inverse @ (pull - motors - np.cross(w, inertia @ w + held))
            return np.concatenate((turn, spin, motors))

        state = solve_ivp(rates, (0.0, 1.0), state, rtol=1e-9, atol=1e-11).y[:, -1]
    end = Rotation.from_rotvec([0.0, 0.0, -n * 200.0]) * Rotation.from_quat(state[:4])
    assert (end.inv() * Rotation.from_quat(log.quaternion_b_from_h[-1])).magnitude() < 1e-5
    # they fill, and hold no more but for what the rate changes within a period
    assert 0.99 * most < np.abs(log.wheel_momentum_b_n_m_s).max() < 1.01 * most


def test_nothing_is_turned_by_torques_where_pointing_is_ideal(tmp_path):
    ideal = replace(MINUTES, attitude=replace(MINUTES.attitude, mode="ideal"))
    with pytest.raises(ControllerError, match=r"has torques, but attitude\.mode is ideal"):
        read_played(table(tmp_path / "torques.csv", *TORQUES), ideal)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("time_s,force_x_n,force_y_n\n", "has 0 columns force_z_n; give it one"),
        ("time_s,q1,q2,q3,q4,q1\n", "has 2 columns q1; give it one"),
        ("time_s,speed\n", "has a column 'speed'; besides time_s the columns are force_x_n"),
        (
            "time_s,force_x_n,force_body_x_n\n",
            "has both force_x_n and force_body_x_n; keep one of the two groups",
        ),
        ("time_s,q1,torque_x_n_m\n", "has both torque_x_n_m and q1; keep one of the two groups"),
        ("time_s,q1,q2,q3,q4\n0,0,0,0,0.9\n", "data row 1 has an attitude of length 0.9; it must be 1"),
        ("time_s,q1,q2,q3,q4\n0,0,0,0\n", "line 2 is '0,0,0,0'; write 5 finite numbers"),
    ],
)
def test_tables_that_cannot_be_played(content, message, tmp_path):
    path = tmp_path / "odd.csv"
    path.write_text(content)
    with pytest.raises(ControllerError, match=message):
        read_played(path, MINUTES)


WIDTH = 8
#: of two roundings
CLOSE = {"rtol": 2.0**-51, "atol": 0.0}


@njit(error_model="numpy")
def exponentials(x, _, out):
    for i in range(0, len(x), WIDTH):
        store(out, i, exponential(load(x, i, WIDTH)))


@njit(error_model="numpy")
def angles(y, x, out):
    for i in range(0, len(x), WIDTH):
        store(out, i, arctangent(load(y, i, WIDTH), load(x, i, WIDTH)))


def computed(function, *inputs):
    out = np.empty(len(inputs[0]))
    function(np.array(inputs[0]), np.array(inputs[-1]), out)
    return out


@pytest.mark.parametrize("reach", [1e-6, 1.0, 40.0, 699.0])
def test_the_exponential_is_right_to_rounding(reach: float) -> None:
    x = np.random.default_rng(1).uniform(-reach, reach, 8000)
    np.testing.assert_allclose(computed(exponentials, x), np.exp(x), **CLOSE)
    special = computed(exponentials, [0.0, -0.0, -701.0, -1e300, -np.inf, 1.0, -1.0, np.log(2.0)])
    np.testing.assert_array_equal(special[:5], [1.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(special[5:], [np.e, 1.0 / np.e, 2.0], **CLOSE)


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
def test_angles_are_right_to_rounding_from_minus_to_plus_pi_without_the_former(scale: float) -> None:
    y, x = scale * np.random.default_rng(2).normal(size=(2, 8000))
    np.testing.assert_allclose(computed(angles, y, x), np.arctan2(y, x), **CLOSE)
    y = [0.0, 0.0, -0.0, 1.0, -1.0, 1.0, -1.0, 1e-300]
    x = [1.0, -1.0, -1.0, 0.0, 0.0, 1.0, -1.0, -1.0]
    eighths = np.array([0, 4, 4, 2, -2, 1, -3, 4])
    np.testing.assert_allclose(computed(angles, y, x), np.pi / 4.0 * eighths, **CLOSE)


def along_track(metres: float, velocity_m_s: float = 0.0) -> Scenario:
    """Ahead of the chief, where nothing pulls a deputy that rests."""
    return Scenario(np.array([0.0, metres, 0.0]), np.array([0.0, velocity_m_s, 0.0]), 0.0)


BARELY_LESS = np.nextafter(15.0, 0.0)


@pytest.mark.parametrize(
    ("metres", "outside_m"),
    [(15.0, 0.0), (200.0, 0.0), (14.0, 1.0), (203.0, 3.0), (BARELY_LESS, 15.0 - BARELY_LESS)],
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


ENGINES = "compiled", "sklearn"
PLAN = open_loop("plan", np.tile([0.0, 0.02, -0.01], (5, 1)))


def with_engine(engine: str) -> Mission:
    return mission(guidance={"kind": "clusters", "engine": engine}, duration_s=300.0, chief=TUMBLING)


@pytest.mark.parametrize("controller", [MIXED, PLAN, coast()], ids=["rules", "plan", "coast"])
def test_scikit_learn_flies_the_same_logs(controller) -> None:
    fast, plain = (fly_logged(with_engine(engine), controller, COMPLETED) for engine in ENGINES)
    for name, values, expected in zip(fast._fields, fast, plain, strict=True):
        assert (values.shape, values.dtype) == (expected.shape, expected.dtype), name
        exact = 0.0 if values.dtype != np.float64 else 1e-6
        np.testing.assert_allclose(values, expected, rtol=0, atol=exact, err_msg=name)


def test_scikit_learn_flies_the_same_outcomes() -> None:
    tracks = np.full((2, 2, 31, 3), np.nan, dtype=np.float32)
    ours, theirs = (
        fly_all(with_engine(engine), MIXED, [STARTS[1], COMPLETED], 1, track)
        for engine, track in zip(ENGINES, tracks, strict=True)
    )
    for name, values in vars(ours).items():
        np.testing.assert_allclose(values, getattr(theirs, name), rtol=0, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(*tracks, rtol=0, atol=1e-5)
    assert theirs.inspected_count.dtype == np.int64
