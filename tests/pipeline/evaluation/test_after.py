"""What follows flights, against orbits that SciPy integrates without any rate of Hill axes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.after import aftermath
from pipeline.evaluation.assurance.quantities import facts_of_flown, of_tracks
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.coasting import FreeMotion
from pipeline.report.board_flights import flights_of_board
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.mission import TwoBody
from pipeline.settings.orbit import OrbitSettings
from tests.pipeline.evaluation.propagated import Orbit, about_the_earth, linear
from tests.pipeline.flight.cases import mission

ORBIT = Orbit(6_878_137.0, np.radians(51.6), j2=1.08262668e-3, drag=3e-7)
MEAN_MOTION = ORBIT.rate
ORBIT_S = 2.0 * np.pi / MEAN_MOTION
PERIOD = 10.0


def flown(dynamics):
    orbit = OrbitSettings(kind="elements", semi_major_axis_m=ORBIT.axis, inclination_deg=51.6)
    return mission(orbit=orbit, dynamics=dynamics, duration_s=2.0 * PERIOD)


def states(count, seed):
    """States near closed ellipses of up to 110 m, some of which pass near the chief or leave it."""
    generator, drawn = np.random.default_rng(seed), []
    for _ in range(count):
        size, phase, across = generator.uniform(4.0, 110.0), *generator.uniform(0.0, 2.0 * np.pi, 2)
        wide, ahead, drift = generator.uniform(0.0, 20.0), *generator.normal(0.0, [25.0, 10.0])
        x, u = size * np.cos(phase), -size * MEAN_MOTION * np.sin(phase)
        y, v = ahead - 2.0 * size * np.sin(phase), -2.0 * MEAN_MOTION * x - 1.5 * MEAN_MOTION * drift / 3.0
        z, w = wide * np.cos(across), -wide * MEAN_MOTION * np.sin(across)
        drawn.append([x, y, z, u, v, w])
    return np.array(drawn)


@pytest.mark.slow
@pytest.mark.parametrize("is_linear", [True, False], ids=["linear", "about the Earth"])
def test_flights_stay_and_are_safe_as_integrations_have_it(is_linear):
    what = flown(TwoBody(j2=ORBIT.j2, drag_m_s2=ORBIT.drag) if not is_linear else mission().dynamics)
    ends, seen = states(24 if is_linear else 12, 3), []
    tracks = np.repeat(ends[:, np.newaxis], 3, axis=1)  # at the start, a period later, and at the end
    after = aftermath(what, tracks)
    low, high = what.deputy.min_distance_m, what.deputy.max_distance_m
    times = np.arange(0.0, 3.0 * ORBIT_S, 4.0)
    is_first_orbit = times <= ORBIT_S
    for state in ends:
        of_end, *failures = (
            linear(MEAN_MOTION, state, times) if is_linear else about_the_earth(ORBIT, state, times, began)
            for began in ((2.0 * PERIOD, PERIOD, 2.0 * PERIOD) if not is_linear else (0.0, 0.0))
        )
        inside = (of_end >= low) & (of_end <= high)
        is_safe = all((each[is_first_orbit] >= low).all() for each in failures)
        seen.append((inside[is_first_orbit].all(), inside.all(), is_safe))
    np.testing.assert_array_equal(np.column_stack(after), seen)
    for column in np.column_stack(after).T:
        assert 0 < column.sum() < len(ends)


#: drag that varies within flights, and goes on after them
VARYING = "+dispersions.dynamics.drag_m_s2={kind:normal,mean:4e-7,std:3e-7,correlation_s:1200}"
OF_VARYING = (
    *("+experiment=evaluate", "world=leo", "controller=coast", "dynamics.radiation_m_s2=0.0"),
    *("monte_carlo.num_cases=8", "monte_carlo.parked=true", VARYING),
)


@pytest.mark.slow
def test_drag_that_varies_goes_on_after_the_end_as_in_longer_flights():
    of_flight, longer = (
        compose_experiment([*OF_VARYING, f"duration_s={seconds}"]).experiment for seconds in (1800, 7400)
    )
    what, starts = of_flight.mission, evaluation_scenarios(of_flight)
    (_, tracks), (_, whole) = (fly_tracked(of.mission, coast(), starts, 1) for of in (of_flight, longer))
    last, seconds = what.num_controls, longer.mission.duration_s - what.duration_s
    np.testing.assert_array_equal(whole[:, : last + 1, :6], tracks[..., :6])
    distances = np.linalg.norm(whole[:, last:, :3], axis=2)
    facts = facts_of_flown(what, starts, np.full(len(starts), 99))
    each = of_tracks(tracks, facts, (f"coasting_farthest[{seconds:g}]", f"coasting_distance[{seconds:g}]"))
    farthest, nearest = (values[:, -1] for values in each.values())
    np.testing.assert_allclose(farthest, distances.max(axis=1), atol=0.1)
    np.testing.assert_allclose(nearest, distances.min(axis=1), atol=0.1)
    board = flights_of_board(facts, tracks, len(starts))
    samples = np.round(board.after_s / what.control_period_s).astype(int)
    np.testing.assert_allclose(board.after_m, distances[:, samples], atol=0.1)
    # a limit that a flight would keep if drag were constant, or break
    constant, orbit_s = replace(what, dispersions={}), 2.0 * np.pi / what.orbit.mean_motion_rad_s
    motion = FreeMotion(constant, orbit_s)
    _, as_constant = motion.distances(tracks[:, -1:, :6].astype(np.float64), orbit_s, sample=last)
    until = distances[:, : int(orbit_s / what.control_period_s) + 1].max(axis=1)
    flight = int(np.argmax(np.abs(until - as_constant[:, 0])))
    assert abs(until[flight] - as_constant[flight, 0]) > 2.0
    limit = 0.5 * (until[flight] + as_constant[flight, 0])
    limited = replace(what, deputy=replace(what.deputy, max_distance_m=float(limit)))
    after = aftermath(limited, tracks, 1, starts)
    assert after.stays_orbit[flight] == (until[flight] <= limit)
    assert aftermath(limited, tracks).stays_orbit[flight] != after.stays_orbit[flight]


def test_a_mission_that_goes_on_counts_what_follows_as_outside():
    starts = [Scenario(state[:3], state[3:], 0.0) for state in states(16, 5)]
    plain, longer = (mission(duration_s=600.0, after_s=after) for after in (0.0, 6000.0))
    before, counted = (fly_all(what, coast(), starts, 1) for what in (plain, longer))
    # of coasting throughout, as if the flight were longer
    whole = fly_all(mission(duration_s=6600.0), coast(), starts, 1)
    assert before.is_violated.sum() < counted.is_violated.sum() < len(starts)
    np.testing.assert_array_equal(counted.is_violated, whole.is_violated)
    np.testing.assert_array_equal(counted.max_distance_m, before.max_distance_m)


#: control periods, s, and for how long free motion is followed, s
LOOKS = [(10.0, 1800.0), (10.0, ORBIT_S), (1.0, 900.0), (25.0, 3000.0), (10.0, 5.0), (4.0, 33.0)]


@pytest.mark.parametrize(("period", "seconds"), LOOKS)
def test_free_motion_from_every_sample_is_what_its_matrix_says(period, seconds):
    n, num_periods = mission().orbit.mean_motion_rad_s, 60
    rates = np.zeros((6, 6))
    rates[:3, 3:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3.0 * n * n, 2.0 * n, -2.0 * n, -n * n
    over_period, over_second = expm(rates * period), expm(rates)
    generator = np.random.default_rng(11)
    tracks = np.empty((8, num_periods + 1, 6))
    tracks[:, 0] = states(8, 7)
    for k in range(num_periods):
        # coasting, now and then a push, and one flight that never coasts
        pushes = np.where(generator.random((8, 1)) < 0.1, generator.normal(0.0, 0.02, (8, 3)), 0.0)
        pushes[0] = generator.normal(0.0, 1e-3, 3)
        tracks[:, k + 1] = tracks[:, k] @ over_period.T
        tracks[:, k + 1, 3:] += pushes
    what = mission(duration_s=num_periods * period, control_period_s=period)
    rounded = tracks.astype(np.float32).astype(np.float64)
    nearest, farthest = FreeMotion(what, seconds).distances(rounded, seconds, workers=2)
    now, least = tracks, np.linalg.norm(tracks[..., :3], axis=-1)
    most = least
    for _ in range(int(seconds)):
        now = now @ over_second.T
        distance = np.linalg.norm(now[..., :3], axis=-1)
        least, most = np.minimum(least, distance), np.maximum(most, distance)
    last = tracks @ expm(rates * seconds).T
    distance = np.linalg.norm(last[..., :3], axis=-1)
    least, most = np.minimum(least, distance), np.maximum(most, distance)
    # what a second of the matrix may miss beside the chief
    speed = 2.0 * n * most
    missed = np.sqrt(least**2 + (0.5 * speed) ** 2) - least
    assert (nearest <= least + 0.02).all()
    assert (nearest >= least - 0.02 - missed).all()
    np.testing.assert_allclose(farthest, most, rtol=0.0, atol=0.02)
    only, _ = FreeMotion(what, seconds).distances(rounded[:, -1:], seconds, sample=num_periods)
    np.testing.assert_allclose(only[:, 0], nearest[:, -1], rtol=0.0, atol=0.02)
