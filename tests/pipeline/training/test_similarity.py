"""Controllers scaled to other missions: rules by unit, the law of similarity, and what limits a mission."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.formats import serialize
from fis_tools.model import Term, Variable
from fis_tools.model.membership import SHAPES
from fis_tools.model.numbers import Constant, Formula, Linear, Number
from fis_tools.model.shapes import Polyline, Sampled
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.fitting import TEMPOS
from pipeline.flight.control.controller import ControllerError, from_fuzzy
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import CONSTANTS, SIGNALS
from pipeline.settings.keys import unit_of
from pipeline.settings.places import conf_folder
from pipeline.training.similarity import COUNTS, HOME, LOOKS_AHEAD, Similarity, limitations, scaled_variable
from tests.fis_tools.sample_controllers import SHIPPED

#: twice as large, half as fast, twice as heavy, with half as many forces
THERE = (
    *("orbit.mean_motion_rad_s=0.0005534", "duration_s=7200", "control_period_s=20", "attitude_period_s=20"),
    *("deputy.mass_kg=24", "chief.inspection_radius_m=20", "deputy.min_distance_m=30"),
    "deputy.max_distance_m=400",
)


def base(name: str = "champion_leo"):
    return serialize.load(conf_folder() / "controller" / f"{name}.yaml")


def mission(*overrides: str):
    return compose_experiment(["+experiment=evaluate", "attitude=ideal", *overrides]).experiment.mission


@pytest.mark.parametrize("name", CONSTANTS)
def test_every_constant_has_a_rule_by_its_unit(name):
    similarity = Similarity(HOME, size=2.0)
    assert name in COUNTS or unit_of(name).symbol in similarity.factors
    assert np.isfinite(similarity.constant(name, 100.0))


def test_what_a_champion_leaves_to_its_default_is_scaled_too():
    scaled = dict(Similarity(HOME, size=0.2).controller(base("champion_27")).attributes)
    assert [scaled[name] for name in ("see_near_m", "see_short_m")] == ["6.0", "0.2"]
    assert "see_near_m" not in dict(Similarity(HOME, size=0.2).controller(base("champion_leo")).attributes)


def test_pushes_that_are_planned_cross_a_mission_in_the_same_share_of_an_orbit():
    for there in (mission(), mission(*THERE), mission("deputy.max_distance_m=60")):
        room = there.deputy.max_distance_m * there.orbit.mean_motion_rad_s
        for size in (0.2, 2.0):  # however small the chief is
            reach = Similarity(there, size).constant("foresight_reach_m_s", 0.2)
            assert reach / room == pytest.approx(0.2 / (200.0 * 0.0011068), rel=2e-3)


def test_a_constant_without_a_rule_is_refused():
    with pytest.raises(KeyError, match="furlongs has no unit and no rule"):
        Similarity(HOME).constant("furlongs", 1.0)


def test_every_signal_has_a_factor():
    assert {signal.unit for signal in SIGNALS.values()} | {"N"} <= Similarity(HOME).factors.keys()


def test_nothing_changes_at_home():
    for name in ("champion_27", "champion_leo"):
        assert Similarity(HOME).controller(base(name)) == base(name)


@pytest.mark.parametrize(
    "name", [name for name in SHIPPED if set(LOOKS_AHEAD) & dict(base(name).attributes).keys()]
)
@pytest.mark.parametrize("decides_always", [False, True])
def test_what_looks_ahead_again_does_so_at_a_decision(name, decides_always):
    for tempo in TEMPOS:
        similarity = Similarity(mission(*THERE), 0.7, tempo, decides_always)
        scaled = similarity.controller(base(name))
        law_of(from_fuzzy(scaled), similarity.mission)  # raises where it looks ahead between decisions
        constants = dict(scaled.attributes)
        for period in LOOKS_AHEAD & constants.keys():
            assert float(constants[period]) % float(constants.get("decision_period_s", 10.0)) == 0.0


def test_scaled_flights_are_scaled():
    """Clohessy and Wiltshire's equations have no length, and their time is 1/n."""
    here, there = mission("attitude_period_s=10"), mission(*THERE)
    directions = np.random.default_rng(3).standard_normal((4, 3))
    positions = 70.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    starts = [Scenario(position, np.zeros(3), 0.7 * index, 0.1) for index, position in enumerate(positions)]
    follower = replace(  # without rehearsals, which are flown at the same similarity, but cost time
        base(), attributes=tuple(pair for pair in base().attributes if pair[0] != "rehearsal_tours")
    )
    flown = fly_all(here, from_fuzzy(follower), starts, 1)
    scaled = Similarity(there, size=2.0).controller(follower)
    again = [replace(start, position_m=2.0 * start.position_m) for start in starts]
    other = fly_all(there, from_fuzzy(scaled), again, 1)
    assert flown.delta_v_m_s.min() > 0.1
    np.testing.assert_array_equal(flown.inspected_count, other.inspected_count)
    np.testing.assert_allclose(other.delta_v_m_s, flown.delta_v_m_s, rtol=1e-6)
    np.testing.assert_allclose(other.min_distance_m, 2.0 * flown.min_distance_m, rtol=1e-6)


NUMBERED = [kind for kind in SHAPES.values() if kind.entry.kinds and not issubclass(kind, Number)]


@pytest.mark.parametrize("kind", NUMBERED, ids=lambda kind: kind.__name__)
def test_every_shape_stretches_with_its_variable(kind):
    values = {
        "location": iter((1.0, 2.0, 3.0, 4.0)),
        "width": iter((0.7, 0.9)),
        "deviation": iter((0.5, 0.8)),
    }
    values |= {"slope": iter((1.3, -1.1)), "exponent": iter((1.5, 2.5))}
    shape = kind(**{name: next(values[of]) for name, of in kind.entry.kinds.items()})
    # no point of the universe is a corner, where some shapes are vertical
    before = Variable("speed", "m/s", 0.0, 5.0, (Term("fast", shape),), num_points=198)
    after = scaled_variable(before, 0.4)
    assert after.maximum == 2.0
    degrees = shape.at(before.universe)
    np.testing.assert_allclose(after.terms[0].membership.at(after.universe), degrees, atol=1e-9)


def test_linear_conclusions_follow_the_units_of_their_inputs():
    terms = Term("steady", Constant(0.2)), Term("pulling", Linear((0.5, -3.0), 0.1))
    scaled = scaled_variable(Variable("force_x", "N", -1.0, 1.0, terms), 0.25, of_inputs=(2.0, 0.5)).terms
    assert scaled[0].membership.row(2) == (0.0, 0.0, 0.05)
    # of inputs 2 and 0.5 times as large a quarter of the force
    assert scaled[1].membership.row(2) == (0.0625, -1.5, 0.025)


def test_formulas_are_refused():
    terms = (Term("curved", Formula("force_x * 2")),)
    with pytest.raises(ControllerError, match="cannot be scaled to another mission"):
        scaled_variable(Variable("force_x", "N", -1.0, 1.0, terms), 0.25)


def test_shapes_of_points_stretch_too():
    drawn = Polyline((0.0, 2.0, 5.0), (0.0, 1.0, 0.25))
    terms = Term("drawn", drawn), Term("sampled", Sampled(tuple(np.linspace(0, 1, 11))))
    before = Variable("speed", "m/s", 0.0, 5.0, terms, num_points=11)
    after = scaled_variable(before, 3.0)
    for term, other in zip(before.terms, after.terms, strict=True):
        degrees = term.membership.at(before.universe)
        np.testing.assert_allclose(other.membership.at(after.universe), degrees, atol=1e-9)


def test_times_stay_below_half_an_orbit_and_on_the_clock():
    slow = mission("orbit.mean_motion_rad_s=0.001", "control_period_s=60", "duration_s=3600")
    attributes = dict(Similarity(slow, tempo=0.5).controller(base()).attributes)
    assert float(attributes["tour_wait_s"]) < math.pi / 0.001
    assert float(attributes["decision_period_s"]) == 120.0
    always = dict(Similarity(slow, decides_always=True).controller(base()).attributes)
    assert float(always["decision_period_s"]) == 60.0


def test_what_limits_a_mission_by_hand():
    weak = mission("deputy.max_force_n=0.01", "deputy.mass_kg=50", "actuators=real", "sensor.max_range_m=80")
    hold, radians, impulse, outside = limitations(weak, np.array([50.0, 100.0]))
    motion = 0.0011068
    assert hold.value == pytest.approx(0.01 / (3 * 50 * motion**2 * 100))
    assert not hold.is_kept
    assert hold.sentence.endswith("a start there cannot be held against the tide")
    assert radians.value == pytest.approx(motion * 3600)
    assert impulse.value == pytest.approx(0.04 / (50 * motion * 75))
    assert outside.value == 0.5
    assert radians.is_kept
    assert outside.is_kept
