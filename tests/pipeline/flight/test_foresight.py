"""Pushes planned by geometry: their price as the reference defines it, and flights of what is chosen."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.compiled.decorator import plainly
from fis_tools.engines.kernel import LANES
from fis_tools.formats import serialize
from fis_tools.formats.c import source as c_source
from pipeline.command_line.config import compose_experiment
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import ControllerError, from_fuzzy, open_loop
from pipeline.flight.control.law import law_of
from pipeline.flight.fly import aboard, replanning
from pipeline.flight.fly.free_drift import num_doubts, outside_later
from pipeline.flight.fly.lesser_controllers import finishing, rehearsing
from pipeline.flight.fly.outlooks import TAIL_SPREADS, at_start, later
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.prices import price_pushes
from pipeline.flight.fly.pushes import Effort, search_pushes
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.replanning import COASTING, NUM_RECORDED, REHEARSED, foresee
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.reference.plans import price
from pipeline.flight.state.log import REHEARSED as CHOSEN_AHEAD
from pipeline.flight.world.pack import pack_world
from pipeline.physics.motion import state_transition
from pipeline.proof.verdict import NotProvable, system_of
from pipeline.settings.mission import TwoBody
from pipeline.settings.orbit import OrbitSettings
from tests import night
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.evaluation.propagated import Orbit, about_the_earth
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import SEEING, mission, random_starts, with_attributes

pytestmark = pytest.mark.slow

MISSION = mission(attitude={"mode": "ideal"})
NOISY = mission(attitude={"mode": "ideal"}, navigation={"mode": "fixes"}, actuators={"kind": "real"})
STARTS = random_starts(3, seed=4)
SHIPPED_FUZZY = {name: from_fuzzy(serialize.load(path)) for name, path in SHIPPED.items()}
PLANNING = {name: each for name, each in SHIPPED_FUZZY.items() if replanning.foresees(each)}
#: little effort, which is enough for what is tried here
QUICK = {"FIRST": Effort(16, 12), "AGAIN": (Effort(16, 4),), "HARDER": (Effort(16, 6),)}


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    for name, efforts in QUICK.items():
        monkeypatch.setattr(replanning, name, {2: efforts, 3: efforts})


def foreseeing(**changes):
    constants = {"foresight_pushes": "2", "foresight_coast_points": "4.5", "rehearsal_reach_m_s": "0.1"}
    return with_attributes(SEEING, **(constants | changes))


ELLIPSE = {
    "orbit": OrbitSettings(
        kind="elements", semi_major_axis_m=9.6e6, eccentricity=0.3, true_anomaly_deg=290.0
    ),
    "dynamics": TwoBody(j2=1.08e-3),
}


@pytest.mark.parametrize(
    ("changes", "after"),
    [
        ({}, (0.0, 0.0)),
        (
            {"sensor": {"max_incidence_deg": 70.0, "max_range_m": 90.0}, "light": {"shadow": "conical"}},
            (0.0, 0.0),
        ),
        ({"chief": {"initial_angular_velocity_rad_s": (0.01, 0.004, -0.006)}}, (0.0, 0.0)),
        # most pushes take several control periods
        ({"deputy": {"max_force_n": 0.03}}, (0.0, 0.0)),
        ({}, (12_000.0, 0.0)),
        ({}, (0.0, 5677.0)),
        ({}, (9_000.0, 3_000.0)),
        ({"navigation": {"mode": "fixes"}, "actuators": {"kind": "real"}}, (9_000.0, 3_000.0)),
        ({"deputy": {"max_force_n": 0.03}}, (9_000.0, 3_000.0)),
        pytest.param(ELLIPSE, (0.0, 0.0), marks=pytest.mark.slow),
    ],
    ids=[
        *("paper", "camera and shadow", "tumbling", "weak thrusters"),
        *("what follows the end", "failures", "both", "both, with errors", "both, weak thrusters", "ellipse"),
    ],
)
def test_a_plan_costs_what_the_reference_says(changes, after):
    flown, generator = mission(attitude={"mode": "ideal"}, **changes), np.random.default_rng(2)
    start, sample, count = replace(STARTS[0], sun_elevation_rad=0.2), 40, 5
    is_unsure, doubt_price = flown.navigation.mode == "fixes", 0.02
    constants = {"coast_margin_m": "4.0", "coast_below_points": "6", "foresight_points": "3"}
    constants["foresight_doubt_m_s"] = repr(doubt_price)
    constants |= {"foresight_after_s": repr(after[0]), "foresight_passive_s": repr(after[1])}
    controller = foreseeing(**constants)
    deputies = at_start(flown, flown, controller, [start], 0, 8)
    left = (generator.random(pack_world(flown).points.shape[2]) < 0.7).astype(np.uint8)
    believed = replace(
        start, position_m=np.array([40.0, -30.0, 20.0]), velocity_m_s=np.array([0.05, 0.0, 0.02])
    )
    errors = np.random.default_rng(3).normal(0.0, [1.0] * 3 + [0.002] * 3, (1, 9, 6))
    covariances = errors.transpose(0, 2, 1) @ errors * is_unsure
    deputies = replace(
        deputies, believed=[believed], spreads_m=np.ones(1), sample=sample, left=left[np.newaxis]
    )
    deputies = replace(deputies, covariances=covariances)
    ((outlook, needed),) = deputies.outlooks()
    genes, costs = np.empty((7, count)), np.empty(count)
    genes[:6], genes[6] = generator.normal(0.0, 0.08, (6, count)), generator.uniform(0.0, 80.0, count)
    genes[0, 0] = 0.5 * outlook.least_force
    longest_way = 6.0
    outlook = outlook._replace(longest_way=longest_way)
    price_pushes(genes, 2, needed, outlook, costs)
    flight = reference_of(flown, SEEING, start)
    margin, step = 0.3 + 1.0, 3
    nearest, farthest = flown.deputy.min_distance_m + 4.0 + margin, flown.deputy.max_distance_m - 4.0 - margin
    share, tilt = (0.05, np.radians(2.0)) if is_unsure else (0.0, 0.0)
    squares = (TAIL_SPREADS * share) ** 2, (TAIL_SPREADS * tilt) ** 2
    doubts = TAIL_SPREADS**2 * covariances[0], *squares, doubt_price
    sight = np.full(flown.num_controls + 1, 10.0 / np.sin(np.radians(flown.sensor.half_angle_deg)))
    for plan, cost in zip(genes.T, costs, strict=True):
        both = np.where(np.abs(plan[:6]) < outlook.least_force, 0.0, plan[:6]).reshape(2, 3)
        pushes = {}
        for begin, push in zip((sample, sample + step * int(plan[6])), both, strict=True):
            for axis, force in enumerate(push):
                num_periods = max(1, math.ceil(abs(force) / flown.deputy.max_force_n))
                for at in range(begin, begin + num_periods):
                    pushes.setdefault(at, np.zeros(3))[axis] += force / num_periods
        state, is_left = np.r_[believed.position_m, believed.velocity_m_s], left[: len(flight.points)] > 0
        counts, limits = (needed, outlook.required), (nearest, farthest, longest_way)
        expected = price(
            flight, sample, state, is_left, pushes, counts, margin, limits, step, sight, after, doubts
        )
        # two integrators of an orbit differ by a micrometre
        assert cost == pytest.approx(expected, rel=1e-7 if changes is ELLIPSE else 1e-9, abs=1e-9)
        assert 0 < outlook.required < needed < is_left.sum()


@pytest.mark.skipif(not night.IS_WHOLE, reason="half a minute for numba, for this alone: each night")
def test_what_a_safety_layer_passes_on_in_parts_counts_as_of_thrusters_so_weak():
    controller = foreseeing(foresight_passive_s="5677.0")
    layered = compose_experiment(["+experiment=evaluate", "world=leo", "safety=robust"]).experiment.mission
    ((outlook, _),) = at_start(layered, layered, controller, [STARTS[0]], 0, 8).outlooks()
    assert outlook.tail.most_force < outlook.most_force
    weak = outlook._replace(most_force=outlook.tail.most_force)
    free = outlook._replace(tail=outlook.tail._replace(most_force=np.inf))
    genes = np.random.default_rng(4).normal(0.0, 0.1, (50, 7))
    genes[:, 6] = np.random.default_rng(5).uniform(0.0, len(outlook.free), 50)
    constants, doubts = np.empty(6), np.empty((6, num_doubts(outlook.tail, 2)))
    in_parts, when_weak, at_once = (
        [outside_later(plan, 2, each, constants, doubts) for plan in genes] for each in (outlook, weak, free)
    )
    assert in_parts == when_weak
    assert in_parts != at_once


def test_what_follows_a_plan_about_the_earth_is_what_an_integrator_makes_of_it():
    circle = Orbit(6_878_137.0, np.radians(51.6), j2=1.08262668e-3, drag=3e-7)
    orbit = OrbitSettings(kind="elements", semi_major_axis_m=circle.axis, inclination_deg=51.6)
    dynamics = TwoBody(j2=circle.j2, drag_m_s2=circle.drag)
    flown = mission(attitude={"mode": "ideal"}, duration_s=1200.0, orbit=orbit, dynamics=dynamics)
    controller = foreseeing(foresight_after_s="6000.0", foresight_passive_s="3000.0")
    deputies = replace(at_start(flown, flown, controller, STARTS[:1], 0, 8), sample=30)
    ((outlook, _),) = deputies.outlooks()
    tail, times = outlook.tail, 60.0 * np.arange(len(outlook.tail.rows))
    assert times[-1] == 900.0 + 6000.0
    state = np.r_[STARTS[0].position_m, STARTS[0].velocity_m_s]
    distances = np.linalg.norm(tail.rows @ tail.constants + tail.offsets, axis=1)
    expected = about_the_earth(circle, state, times, 300.0)
    np.testing.assert_allclose(distances, expected, rtol=0, atol=0.1)
    free = [np.linalg.norm((state_transition(circle.rate, t) @ state)[:3]) for t in times.tolist()]
    assert np.abs(free - expected).max() > 10.0  # oblateness and drag count
    push = tail.rows[5:] @ tail.kicks[1, :, 1]  # of 1 N along the track from here on, 300 s later
    gain = pack_world(flown).motion.control[0]
    at = [state_transition(circle.rate, t - 10.0)[:3] @ gain[:, 1] for t in times[5:].tolist()]
    np.testing.assert_allclose(push, at, rtol=0, atol=0.01 * np.abs(at).max())


def test_a_search_has_the_same_bits_in_plain_python():
    deputies = at_start(MISSION, MISSION, foreseeing(), STARTS[:1], 0, 8)
    ((outlook, needed),) = deputies.outlooks()
    outlook = outlook._replace(
        **{name: np.ascontiguousarray(getattr(outlook, name)[::12]) for name in ("free", "gain", "sight")},
        **{
            name: np.ascontiguousarray(getattr(outlook, name)[::12])
            for name in ("points", "normals", "is_lit")
        },
    )

    def search():
        generator, last = np.random.default_rng(1), np.full(7, 0.01)
        return search_pushes(outlook, 2, needed, 0.2, Effort(8, 3), generator, last)

    compiled = search()
    with plainly("pipeline"):
        plain = search()
    np.testing.assert_array_equal(compiled.genes, plain.genes)
    np.testing.assert_array_equal(compiled.costs, plain.costs)
    genes, costs = compiled.distinct(4, outlook.delta_v_per_force, 360.0)
    assert costs[0] == compiled.cost == compiled.costs.min()
    np.testing.assert_array_equal(genes[0], compiled.best)
    assert np.all(np.diff(costs) >= 0.0)


def test_an_empty_plan_changes_no_bit():
    world, law, drawn = pack_world(MISSION), law_of(SEEING, MISSION), cases_of(MISSION, STARTS)
    plain = fly_population(world, law, SEEING.numbers, drawn, 1)
    openings = np.zeros((len(STARTS), MISSION.num_controls, 4))
    opened = fly_population(world, law, SEEING.numbers, drawn, 1, openings=openings)
    for name, values in vars(plain).items():
        np.testing.assert_array_equal(values, vars(opened)[name], err_msg=name)
    assert not opened.ahead_delta_v_m_s.any()


def test_what_is_chosen_flies_as_it_was_foreseen():
    controller = foreseeing()
    foreseen = foresee(MISSION, controller, STARTS[:1], records=True)
    (decision,) = foreseen.decisions
    log = fly_logged(MISSION, controller, STARTS[0])
    np.testing.assert_array_equal(log.foresight_plans[0], decision.plans)
    assert decision.plans.shape[0] == NUM_RECORDED
    forces = np.zeros((MISSION.num_controls, 3))
    for sample, *force in decision.plans[0]:
        if sample >= 0:
            forces[int(sample)] += force
    coasted = fly_all(MISSION, open_loop("plan", forces), STARTS[:1])
    missed = max(0, coasted.inspectable_count[0] - coasted.inspected_count[0] - 2)
    expected = coasted.delta_v_m_s[0] + 0.15 * missed + 1e4 * coasted.is_violated[0]
    assert decision.ends[COASTING] == pytest.approx(expected, rel=0, abs=1e-12)
    if not foreseen.is_rehearsed[0] and decision.ends[:2].argmin() == COASTING:
        np.testing.assert_allclose(log.force_hill_n, forces, rtol=0, atol=1e-15)
    is_ahead = (log.command_reason == CHOSEN_AHEAD).all(axis=1)
    fired = fly_all(MISSION, controller, STARTS[:1])
    share = np.abs(log.force_asked_n[is_ahead]).sum() * MISSION.control_period_s / MISSION.deputy.mass_kg
    assert fired.ahead_delta_v_m_s[0] == pytest.approx(share, rel=1e-12)
    assert fired.delta_v_m_s[0] == log.delta_v_m_s[-1]


def test_neither_threads_nor_company_nor_the_reference_change_it():
    controller = foreseeing(foresight_period_s="900.0", decision_period_s="30.0")
    starts = random_starts(40, seed=5)
    short = replace(NOISY, duration_s=1200.0)
    alone, shared = (fly_all(short, controller, starts, workers) for workers in (1, 2))
    for name, values in vars(alone).items():
        np.testing.assert_array_equal(values, vars(shared)[name], err_msg=name)
    log = fly_logged(short, controller, starts[35])
    assert log.delta_v_m_s[-1] == alone.delta_v_m_s[35]
    assert log.foresight_at[:, 0].tolist() == [0.0, 90.0]
    assert_as_written(replace(NOISY, duration_s=300.0), controller, starts[0])


def test_a_plan_is_flown_on_or_made_anew_by_what_it_falls_short(monkeypatch):
    controller = foreseeing(foresight_period_s="900.0", decision_period_s="30.0")
    short, flown = replace(NOISY, duration_s=1200.0), {}
    for slack_m_s in (np.inf, -np.inf):
        monkeypatch.setattr(aboard, "SLACK_M_S", slack_m_s)
        foreseen = foresee(short, controller, STARTS[:1], records=True)
        flown[slack_m_s] = foreseen.openings[0], foreseen.decisions[1]
    (openings, held), (_, anew) = flown.values()
    assert held.num_priced == 0 < replanning.AGAIN[2][0].num_priced <= anew.num_priced
    assert (np.isfinite(held.ends).sum(), np.isfinite(anew.ends).sum()) == (1, 2)
    # it fires what was chosen at the start
    monkeypatch.setattr(replanning, "range", lambda *_: [0], raising=False)
    np.testing.assert_array_equal(openings, foresee(short, controller, STARTS[:1]).openings[0])


def test_where_no_plan_sees_enough_it_flies_as_rehearsed():
    controller = foreseeing(foresight_reach_m_s="0.0001")
    foreseen = foresee(MISSION, controller, STARTS, records=True)
    assert foreseen.is_rehearsed.all()
    assert np.isfinite(foreseen.decisions[0].ends[REHEARSED])
    flown, expected = (fly_all(MISSION, each, STARTS) for each in (controller, rehearsing(controller)))
    for name, values in vars(flown).items():
        np.testing.assert_array_equal(values, vars(expected)[name], err_msg=name)
    log = fly_logged(MISSION, controller, STARTS[0])
    assert log.delta_v_m_s[-1] == flown.delta_v_m_s[0]
    assert len(log.foresight_at) == 1


def test_pushes_beyond_what_thrusters_fire_take_several_periods():
    weak = mission(attitude={"mode": "ideal"}, deputy={"max_force_n": 0.02})
    log = fly_logged(weak, foreseeing(rehearsal_reach_m_s=None), STARTS[0])
    forces = np.abs(log.force_asked_n).max(axis=1)
    assert forces.max() <= 0.02 * (1.0 + 1e-9)
    planned = np.abs(log.foresight_plans[0][log.foresight_plans[0][:, 0, 0] >= 0.0][:, :, 1:]).max()
    assert planned > 0.02
    if (log.command_reason == CHOSEN_AHEAD).all():
        chosen = log.foresight_plans[0][0]
        total = chosen[chosen[:, 0] >= 0.0][:, 1:].sum(axis=0)
        np.testing.assert_allclose(log.force_hill_n.sum(axis=0), total, rtol=1e-9, atol=1e-12)


def test_margins_follow_what_the_filter_knows():
    controller = foreseeing(foresight_period_s="600.0", decision_period_s="30.0")
    noisy = replace(NOISY, duration_s=1200.0)
    known = replace(noisy, navigation=MISSION.navigation, actuators=MISSION.actuators)
    first = at_start(noisy, known, controller, STARTS, 60, LANES)  # as other flights are compiled
    # a metre, and a millimetre a second for ten minutes
    assert np.all((first.spreads_m > np.hypot(1.0, 0.6)) & (first.spreads_m < 3.0))
    then = later(first, STARTS, cases_of(noisy, STARTS), first.coasting(), 60, 60)
    # rules that coast, whose flight is compiled for other tests too
    still = foreseeing(foresight_pushes=None, rehearsal_reach_m_s=None, coast_below_points="100.0")
    log = fly_logged(noisy, still, STARTS[0])
    assert not log.force_hill_n.any()
    phi = np.linalg.matrix_power(pack_world(noisy).motion.transition[0], 60)[:3]
    expected = np.sqrt(np.linalg.eigvalsh(phi @ log.estimate_covariance[60] @ phi.T)[-1])
    assert then.spreads_m[0] == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(then.believed[0].position_m, log.estimate[60, :3], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", PLANNING)
def test_after_its_plan_a_shipped_controller_is_that_of_its_rules(name):
    controller = PLANNING[name]
    assert not replanning.foresees(finishing(controller))
    assert not replanning.foresees(rehearsing(controller))
    assert finishing(controller).systems == rehearsing(controller).systems == controller.systems


@pytest.mark.parametrize("name", PLANNING)
def test_what_does_not_plan_refuses_a_shipped_controller_in_a_sentence(name):
    planning = PLANNING[name]
    slow = mission(guidance={"kind": "clusters", "engine": "sklearn"})
    with pytest.raises(ControllerError, match=r"flies ahead, .*; choose .*, or leave foresight_pushes, "):
        fly_all(slow, planning, STARTS)
    with pytest.raises(ValueError, match=r"plans its pushes ahead .*; write its rules alone with --bare"):
        c_source.write(planning.fuzzy)
    assert "double" in c_source.write(planning.fuzzy, bare=True)
    docking = SHIPPED_FUZZY["champion_docking"].fuzzy
    planned = {name: text for name, text in planning.fuzzy.attributes if name.startswith("foresight")}
    system_of(docking, 0)
    with pytest.raises(NotProvable, match="no constant but dead bands may be set"):
        system_of(replace(docking, attributes=(*docking.attributes, *planned.items())), 0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"foresight_pushes": "1"}, "foresight_pushes '1'; give 2 or 3"),
        ({"force_axes": "body", "rehearsal_reach_m_s": None}, "plans pushes with force_axes body"),
    ],
)
def test_what_cannot_be_planned_is_refused(changes, words):
    with pytest.raises(ControllerError, match=words):
        foreseeing(**changes)


def test_times_of_plans_are_those_of_decisions():
    controller = foreseeing(foresight_period_s="90.0", decision_period_s="60.0")
    with pytest.raises(ControllerError, match="foresight_period_s 90; give a multiple of the 60 s from one"):
        law_of(controller, MISSION)


def test_the_rules_are_flown_where_they_end_cheapest_also_where_none_was_rehearsed():
    choice = object.__new__(replanning._Choice)
    nothing = math.nan
    columns = [  # of a flight each: coasting and the rules after the best plan, the rules alone, rehearsed
        ((0.3, 0.4, 0.2, nothing), True),
        ((0.3, 0.4, 0.5, 0.2), True),
        ((0.3, 0.2, 0.25, nothing), False),
        ((0.3, 0.2, nothing, nothing), False),  # not flown ahead
    ]
    choice.ends = np.array([ends for ends, _ in columns]).T
    assert choice.is_rehearsed.tolist() == [is_cheapest for _, is_cheapest in columns]
