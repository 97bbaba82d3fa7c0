"""The safety layer beside a chief whose orbit is no circle, against SciPy's motion of both craft."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.compiled.three import Three
from pipeline.command_line.config import compose_experiment
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.act.safety import MOST_CUTS, NO_SUN, corrected_force
from pipeline.flight.reference.safety import SafetyLayer
from pipeline.flight.reference.two_body import hill_axes
from pipeline.flight.state.log import KEEP_IN, KEEP_OUT, PASSIVE_SAFETY, SAFE, SPEED, Scenario
from pipeline.flight.world.bounds import bounds_of, spheres_of
from pipeline.flight.world.pack import pack_world
from tests.pipeline.flight.cases import isotropic
from tests.pipeline.flight.guarded import pushing

#: semi-major axis, m, eccentricity and true anomaly, deg: towards the perigee and through it
ORBITS = {"0.3": (9_615_714.0, 0.3, 300.0), "transfer": (24_478_137.0, 0.725, 320.0)}
LIMITS = {KEEP_OUT: "keep_out", KEEP_IN: "keep_in", PASSIVE_SAFETY: "passive_safety", SPEED: "speed"}


def mission_of(name, *overrides):
    axis, eccentricity, anomaly = ORBITS[name]
    orbit = f"orbit.semi_major_axis_m={axis}", f"orbit.eccentricity={eccentricity}"
    beside = "dynamics=two_body", "attitude=ideal", "orbit=elements", "duration_s=1200"
    orbit += (f"orbit.true_anomaly_deg={anomaly}",)
    job = compose_experiment(["+experiment=evaluate", "controller=coast", *beside, *orbit, *overrides])
    return job.experiment.mission


def starts(low, high, count, seed):
    generator = np.random.default_rng(seed)
    positions = isotropic(generator, count) * generator.uniform(low, high, (count, 1))
    return [Scenario(position, np.zeros(3), 0.0) for position in positions]


def nearest_of_drift(flight, k, state, seconds):
    """The least distance, each 10 s, of free motion about the Earth from a state at a sample, m."""
    earth, chief = flight.earth, flight.orbit[k]
    axes, turning = hill_axes(earth, chief)
    away = state[:3] @ axes
    deputy = chief + np.concatenate([away, state[3:] @ axes + np.cross(turning, away)])

    def rates(_time, both):
        first, second = both.reshape(2, 6)
        return np.concatenate(
            [first[3:], earth.attraction(first[:3]), second[3:], earth.attraction(second[:3])]
        )

    times = np.arange(0.0, seconds + 1.0, 10.0)
    start = np.concatenate([chief, deputy])
    path = solve_ivp(rates, (0.0, seconds), start, "DOP853", times, rtol=1e-10, atol=1e-4).y
    return np.linalg.norm(path[6:9] - path[:3], axis=0).min()


def towards_the_chief(predicted, start, sample):
    """The same start, but free motion along the ellipse, as predicted, meets the chief at a sample."""
    phi = predicted.between(0, sample)[:3]
    return replace(start, velocity_m_s=np.linalg.solve(phi[:, 3:], -phi[:, :3] @ start.position_m))


@pytest.mark.parametrize("name", ORBITS)
def test_should_all_thrusters_fail_free_motion_along_the_ellipse_keeps_clear(name):
    """And if the layer counts with a circle it does not."""
    horizon, seen = 1800.0, {"true": [], "uniform": []}
    safety = "safety=filter", f"safety.passive_horizon_s={horizon:g}"
    begun, samples = starts(40.0, 90.0, 4, 3), (60, 90, 120, 150)
    # the chief's motion, and how it is predicted, are the same for every start
    along = reference_of(mission_of(name, *safety, "orbit.course=true"), coast(), begun[0])
    for course, nearest in seen.items():
        mission = mission_of(name, *safety, f"orbit.course={course}")
        for anywhere, sample in zip(begun, samples, strict=True):
            log = fly_logged(mission, coast(), towards_the_chief(along.predicted, anywhere, sample))
            states = np.hstack([log.position_m, log.velocity_m_s])
            nearest += [nearest_of_drift(along, k, states[k], horizon) for k in (1, 30, 60, 90)]
            assert course == "uniform" or PASSIVE_SAFETY in log.safety_limit
    # the layer's sphere has 16 m; it does not know the second order of the attraction
    assert min(seen["true"]) > 15.9
    assert min(seen["uniform"]) < 15.0


@pytest.mark.parametrize("name", ORBITS)
def test_the_layer_changes_a_force_as_written(name):
    mission = mission_of(name, "safety=filter", "safety.keep_in_horizon_s=900")
    flight, world = reference_of(mission, coast(), starts(50.0, 60.0, 1, 5)[0]), pack_world(mission)
    generator, changed = np.random.default_rng(8), set()
    for k in (0, 50, 119):
        layer = SafetyLayer(mission, None, flight.predicted, k)
        for position in isotropic(generator, 40) * generator.uniform(17.0, 197.0, (40, 1)):
            state = np.concatenate([position, generator.normal(0.0, 0.05, 3)])
            requested = generator.normal(0.0, 0.1, 3)
            expected, words = layer.assured(state, requested)
            known = Three(*state[:3]), Three(*state[3:])
            cuts = np.zeros((MOST_CUTS, 4))
            force, limit = corrected_force(world, k, known, Three(*requested), (NO_SUN, NO_SUN), cuts)
            if words is None:
                assert limit == SAFE
                continue
            assert LIMITS[limit] == words
            np.testing.assert_allclose(force, expected, rtol=0.0, atol=1e-6)
            changed.add(limit)
    assert changed >= {KEEP_IN, PASSIVE_SAFETY}


@pytest.mark.parametrize("mass_kg", [12, 25])
@pytest.mark.parametrize("force_n", [-1.0, 1.0, -0.01])
@pytest.mark.parametrize("name", ORBITS)
def test_no_adversary_takes_a_deputy_out_of_the_limits_of_a_robust_layer(name, force_n, mass_kg):
    mission = mission_of(name, "safety=robust", f"deputy.mass_kg={mass_kg}")
    bounds = bounds_of(mission)
    assert bounds.does_close
    near, far = spheres_of(mission, bounds)
    beside = starts(near, far, 100, 12)
    outcomes = fly_all(mission, pushing(force_n), beside, 1)
    assert not outcomes.is_violated.any()
    off = replace(mission, safety=replace(mission.safety, kind="none"))
    assert fly_all(off, pushing(force_n), beside, 1).is_violated.mean() > 0.3
