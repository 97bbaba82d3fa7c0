"""The safety layer's limit on the speed along each axis, which a deputy at rest keeps: the proof stands."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.assurance.proofs import are_safe, safety_proof
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.reference.safety import STANDING, SafetyLayer
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.flight.state.log import AXIS_SPEED, Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.player.flown import flown_in_page
from pipeline.player.runs import PlayedRun
from pipeline.settings.experiment import SettingError
from tests import night
from tests.pipeline.flight import afrl_limits
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import STEERING, isotropic
from tests.pipeline.flight.guarded import EARLY, LAST_MOMENT, SPHERES, guarded, hostile, starts_at_rest

LIMIT_M_S = 0.05
SAFETIES = {
    name: replace(safety, axis_speed_limit_m_s=LIMIT_M_S)
    for name, safety in {"at the last moment": LAST_MOMENT, "early": EARLY}.items()
}

HOSTILE = hostile(41, radially=np.tile([1.0, 0.0, 0.0], (360, 1)))


def fastest(safety, controller, starts):
    """The greatest speed along any axis at any sample, m/s, and the outcomes."""
    tracks = np.empty((len(starts), 361, NUM_TRACKED), dtype=np.float32)
    outcomes = fly_all(guarded(safety), controller, starts, 1, tracks)
    return np.abs(tracks[..., 3:6]).max(), outcomes


@pytest.mark.parametrize("safety", SAFETIES)
@pytest.mark.parametrize("name", night.by_day([*HOSTILE], 2))
def test_nothing_is_faster_along_an_axis_nor_out_of_its_limits(name, safety):
    starts = starts_at_rest(24, 43)
    speed, outcomes = fastest(SAFETIES[safety], HOSTILE[name], starts)
    assert speed <= LIMIT_M_S + 1e-6
    assert outcomes.min_distance_m.min() > SPHERES[0] - 1e-4
    assert outcomes.max_distance_m.max() < SPHERES[1] + 1e-4
    without, _ = fastest(replace(SAFETIES[safety], axis_speed_limit_m_s=0.0), HOSTILE[name], starts)
    assert without > 1.5 * LIMIT_M_S


def test_at_rest_a_deputy_keeps_any_limit_and_moves_by_no_more():
    speed, _ = fastest(
        replace(LAST_MOMENT, axis_speed_limit_m_s=1e-4), HOSTILE["strong noise"], starts_at_rest(8, 5)
    )
    assert 0.5e-4 < speed <= 1.0001e-4


def test_a_limit_that_is_never_met_changes_no_bit():
    starts = starts_at_rest(8, 7)
    wide, none = (
        fly_all(guarded(replace(EARLY, axis_speed_limit_m_s=limit)), STEERING, starts, 1)
        for limit in (100.0, 0.0)
    )
    for name, values in vars(wide).items():
        assert np.array_equal(values, getattr(none, name)), name


@pytest.mark.slow
@pytest.mark.parametrize("strength_n", [0.1, 0.4])
def test_the_reference_decides_alike(strength_n):
    noise = open_loop("noise", np.random.default_rng(3).normal(0.0, strength_n, (40, 3)))
    start = starts_at_rest(2, 47)[1]
    log = assert_as_written(guarded(SAFETIES["early"], duration_s=400.0), noise, start)
    assert (log.safety_limit == AXIS_SPEED).any()


@pytest.mark.parametrize(("state", "_", "left", "__"), afrl_limits.STATES)
def test_the_limit_is_afrls(state, _, left, __):
    limit = afrl_limits.LIMIT_M_S
    layer = SafetyLayer(guarded(replace(LAST_MOMENT, axis_speed_limit_m_s=limit)))
    excesses = layer.excesses(np.array(state), STANDING)[-3:] / (layer.metres_per_newton * layer.braking)
    np.testing.assert_allclose(
        excesses, np.sqrt(limit**2 - np.array(left)) / limit - 1.0, rtol=1e-9, atol=1e-9
    )


def test_a_start_that_is_too_fast_along_an_axis_is_no_safe_state_and_is_braked():
    at_once = Scenario(np.array([0.0, 60.0, 0.0]), np.array([0.1, 0.0, 0.0]), 0.0)
    mission = guarded(SAFETIES["at the last moment"])
    assert safety_proof(mission, [at_once], (60.0, 60.0, 0.1)).num_safe == 0
    log = fly_logged(mission, open_loop("none", np.zeros((0, 3))), at_once)
    assert log.safety_limit[0] == AXIS_SPEED
    assert np.abs(log.velocity_m_s[1:]).max() <= LIMIT_M_S + 1e-6


def test_a_shell_of_starts_is_told_safe_up_to_the_limit_alone():
    guard = pack_world(guarded(SAFETIES["at the last moment"])).guard
    assert are_safe(guard, 50.0, 100.0, 0.999 * LIMIT_M_S)
    assert not are_safe(guard, 50.0, 100.0, 1.001 * LIMIT_M_S)
    layer = SafetyLayer(guarded(SAFETIES["at the last moment"]))
    for axis in range(3):
        state = np.zeros(6)
        state[:3], state[3 + axis] = 75.0 * isotropic(np.random.default_rng(axis), 1)[0], 1.001 * LIMIT_M_S
        assert layer.excesses(state, STANDING).max() > 0.0


def test_pages_show_such_flights_as_recorded():
    mission = guarded(SAFETIES["early"])
    why = flown_in_page(PlayedRun("a", "a", mission, STEERING, starts_at_rest(1, 5)))
    assert why == "pages know no limit on the speed along each axis"


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (("safety.axis_speed_limit_m_s=-1",), "must be at least 0"),
        (("safety=none", "safety.axis_speed_limit_m_s=0.1"), "counts only with safety.kind=filter"),
    ],
)
def test_what_is_no_limit_is_refused(words, fault):
    with pytest.raises(SettingError, match=fault):
        compose_experiment(["+experiment=evaluate", "safety=filter", *words])
