"""The safety layer's limit on the delta-v: what is left of it pays the push onto a closed ellipse, always."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fis_tools.compiled.three import Three
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.assurance.open_starts import start_without_way_out
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.fly.stepping import SPENT, SteppedFlights
from pipeline.flight.period.act.way_out import is_open
from pipeline.flight.state.log import DELTA_V
from pipeline.flight.world.pack import pack_world
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import SettingError
from tests import night
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import isotropic
from tests.pipeline.flight.guarded import (
    EARLY,
    LAST_MOMENT,
    SPHERES,
    guarded,
    hostile,
    pushing,
    starts_at_rest,
)
from tests.pipeline.flight.test_way_out import ORBIT_S, coasted

LIMIT_M_S = 0.4
KEPT = replace(LAST_MOMENT, keep_way_out=True, delta_v_limit_m_s=LIMIT_M_S)
MISSIONS = {
    "at the last moment": guarded(KEPT),
    "early": guarded(replace(EARLY, keep_way_out=True, delta_v_limit_m_s=LIMIT_M_S)),
    "slow": guarded(replace(KEPT, axis_speed_limit_m_s=0.05)),
}

HOSTILE = hostile(
    53,
    to_and_fro=np.resize([[0.0, 0.02, 0.0], [0.0, -0.02, 0.0]], (360, 3)),
    across_the_track=np.tile([0.0, 0.0, -1.0], (360, 1)),
    at_the_end=np.repeat([[0.0] * 3, [-1.0, 1.0, 1.0]], [330, 30], axis=0),
) | {"slowly towards the chief": pushing(-0.01)}


def flying(position):
    return Three(*np.asarray(position, dtype=np.float64).tolist()), Three(0.0, 0.0, 0.0)


@cache
def starts():
    """Starts at rest anywhere between the spheres that can pay a way out."""
    world = pack_world(MISSIONS["at the last moment"])
    kept = [start for start in starts_at_rest(60, 59) if is_open(world, 0, flying(start.position_m), 0.0)]
    assert len(kept) >= 20
    return kept[:20]


@pytest.mark.parametrize("mission", MISSIONS)
@pytest.mark.parametrize("name", night.by_day([*HOSTILE], 2))
def test_whatever_is_asked_for_no_flight_spends_more_and_each_ends_on_an_ellipse(name, mission):
    what, controller = MISSIONS[mission], HOSTILE[name]
    outcomes = fly_all(what, controller, starts(), 1)
    assert outcomes.delta_v_m_s.max() <= LIMIT_M_S
    assert outcomes.min_distance_m.min() >= SPHERES[0]
    assert outcomes.max_distance_m.max() <= SPHERES[1]
    for start in starts()[:2]:
        log = fly_logged(what, controller, start)
        assert log.delta_v_m_s[-1] <= LIMIT_M_S
        after = coasted(np.r_[log.position_m[-1], log.velocity_m_s[-1]], 3.0 * ORBIT_S)
        assert SPHERES[0] <= after.min() <= after.max() <= SPHERES[1]


def test_without_the_limit_they_would_spend_more():
    unlimited = guarded(replace(KEPT, delta_v_limit_m_s=0.0))
    for name in ("towards the chief", "weak noise", "long pushes", "to and fro"):
        assert fly_all(unlimited, HOSTILE[name], starts(), 1).delta_v_m_s.min() > LIMIT_M_S


def test_what_is_spent_counts_in_flights_that_a_learner_steps_too():
    mission, generator = MISSIONS["at the last moment"], np.random.default_rng(61)
    flights = SteppedFlights(mission, 4, is_tilted=False)
    for flight, start in enumerate(starts()[:4]):
        flights.start(flight, start)
    for _ in range(mission.num_controls):
        flights.step(generator.normal(0.0, 0.5, (4, 3)))
    spent = flights.observed[:, SPENT]
    assert spent.max() <= LIMIT_M_S
    assert spent.min() > 0.5 * LIMIT_M_S


def test_a_limit_that_is_never_met_changes_no_bit():
    wide, none = (
        fly_all(guarded(replace(KEPT, delta_v_limit_m_s=limit)), HOSTILE["weak noise"], starts()[:8], 1)
        for limit in (100.0, 0.0)
    )
    for name, values in vars(wide).items():
        assert np.array_equal(values, getattr(none, name)), name


@pytest.mark.slow
@pytest.mark.parametrize("strength_n", [0.01, 0.3])
def test_the_reference_decides_alike(strength_n):
    noise = open_loop("noise", np.random.default_rng(3).normal(0.0, strength_n, (40, 3)))
    scarce = guarded(replace(KEPT, delta_v_limit_m_s=0.2), duration_s=400.0)
    world = pack_world(scarce)
    start = next(start for start in starts() if is_open(world, 0, flying(start.position_m), 0.0))
    log = assert_as_written(scarce, noise, start)
    assert (log.safety_limit == DELTA_V).any()
    assert log.delta_v_m_s[-1] <= 0.2


@pytest.mark.parametrize(("limit_m_s", "is_enough"), [(0.1, False), (0.4, True)])
def test_a_shell_is_open_only_if_all_starts_in_it_can_pay(limit_m_s, is_enough):
    world = pack_world(guarded(replace(KEPT, delta_v_limit_m_s=limit_m_s)))
    assert (start_without_way_out(world, (60.0, 62.0, 0.0)) is None) == is_enough
    positions = 61.0 * np.vstack([isotropic(np.random.default_rng(67), 200), np.eye(3)])
    assert all(is_open(world, 0, flying(position), 0.0) for position in positions) == is_enough


def test_a_good_controller_flies_on_for_less():
    words = "safety=filter", "safety.keep_way_out=true", "sun=random", "monte_carlo.num_cases=12"
    composed = compose_experiment(
        ["+experiment=evaluate", "controller=champion_27", *words, "monte_carlo.max_distance_m=94"]
    ).experiment
    limited = replace(composed.mission, safety=replace(composed.mission.safety, delta_v_limit_m_s=0.45))
    controller, cases = source.named("champion_27", composed.mission), evaluation_scenarios(composed)
    any_, most = (fly_all(mission, controller, cases, 1) for mission in (composed.mission, limited))
    assert any_.delta_v_m_s.max() > 0.45
    assert most.delta_v_m_s.max() <= 0.45
    cheap = any_.delta_v_m_s < 0.2
    assert most.inspected_count[cheap].tolist() == any_.inspected_count[cheap].tolist()


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (("safety.delta_v_limit_m_s=0.4",), "held in place by thrust for ever"),
        (("safety.delta_v_limit_m_s=-1", "safety.keep_way_out=true"), "must be at least 0"),
        (("safety.delta_v_limit_m_s=0.4", "safety.keep_way_out=true", "navigation=fixes"), "choose perfect"),
        (("safety=none", "safety.delta_v_limit_m_s=0.4"), "counts only with safety.kind=filter"),
    ],
)
def test_where_no_end_is_free_it_is_refused(words, fault):
    with pytest.raises(SettingError, match=fault):
        compose_experiment(["+experiment=evaluate", "safety=filter", *words])
