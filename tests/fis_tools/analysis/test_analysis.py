"""Measures against closed forms, and surfaces against scikit-fuzzy."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf
from scipy.stats import qmc

from fis_tools.analysis.arrays import coverage, distinguishability, rule_usage, spread_inputs, surface
from fis_tools.analysis.contribution import contributions, importance
from fis_tools.analysis.domain import as_mapping, box_of, departures, from_mapping
from fis_tools.engines.compiler import compile
from fis_tools.errors import ControllerFileError
from fis_tools.model import FuzzySystem, Gaussian, Triangular, Variable
from tests.fis_tools import step_by_step
from tests.fis_tools.control_systems import ReferenceEngine
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL, ROOM, ramp_system, terms


def test_a_surface_is_what_scikit_fuzzy_computes_at_its_grid_points() -> None:
    result = surface(FORCE_X, num_points=5)
    engine = ReferenceEngine(FORCE_X)
    np.testing.assert_array_equal(result.x, [0, 50, 100, 150, 200])
    np.testing.assert_allclose(result.y, [-0.3, -0.15, 0, 0.15, 0.3], rtol=0, atol=1e-15)
    for row, column in ((0, 0), (1, 4), (3, 2)):
        expected = engine.compute(np.array([result.x[column], result.y[row]]))[0]
        assert result.values[row, column] == pytest.approx(expected, abs=1e-13)
    assert result.x_variable.name == "distance"
    assert result.values.shape == (5, 5)


def test_axes_can_be_swapped_and_inputs_held() -> None:
    one = surface(FORCE_Z, x="distance", y="eta_u", fixed={"velocity_body_z": 0.1}, num_points=4)
    other = surface(FORCE_Z, x="eta_u", y="distance", fixed={"velocity_body_z": 0.1}, num_points=4)
    np.testing.assert_array_equal(one.values, other.values.T)
    expected = ReferenceEngine(FORCE_Z).compute(np.array([one.y[1], 0.1, one.x[3]]))[0]
    assert one.values[1, 3] == pytest.approx(expected, abs=1e-13)
    assert one.fixed == {"velocity_body_z": 0.1}
    assert surface(FORCE_Z, num_points=2).fixed == {"distance": 100.0}


def test_a_system_the_kernel_does_not_cover_has_surfaces_too() -> None:
    result = surface(ROOM, output="vent", num_points=3)
    expected = ReferenceEngine(ROOM).compute(np.array([20.0, 16.0]))[1]
    assert result.values[2, 1] == expected
    assert result.output.name == "vent"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"x": "distanse"}, "no input 'distanse'; did you mean 'distance'"),
        ({"fixed": {"speed": 1.0}}, "no input 'speed'"),
        ({"x": "distance", "y": "distance"}, "two different inputs"),
        ({"x": "distance", "fixed": {"distance": 1.0}}, "is an axis and is held"),
        ({"fixed": {"distance": 1.0}}, "two free inputs"),
        ({"output": "force_y"}, "no output 'force_y'; did you mean 'force_x'"),
    ],
)
def test_wrong_axes_are_refused_with_a_sentence(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        surface(FORCE_X, **arguments)  # type: ignore[arg-type]


def test_coverage_of_two_gaussians_is_their_crossing() -> None:
    pair = terms(a=Gaussian(0.0, 1.0), b=Gaussian(4.0, 1.0))
    found = coverage(Variable("x", "", 0.0, 4.0, pair, 4001))
    assert found.at == pytest.approx(2.0, abs=1e-9)
    assert found.least == pytest.approx(np.exp(-2.0), abs=1e-9)


def test_coverage_between_the_points_of_the_universe() -> None:
    """Two lines cross half way between the only two points."""
    pair = terms(a=Triangular(0.0, 0.0, 1.0), b=Triangular(0.0, 1.0, 1.0))
    found = coverage(Variable("x", "", 0.0, 1.0, pair, 2))
    assert (found.least, found.at) == (0.5, 0.5)


def test_likeness_of_triangles_has_a_closed_form() -> None:
    """Two triangles of half width 2, peaks 2 apart: they share a triangle of base 2 and height 1/2."""
    pair = terms(a=Triangular(0.0, 2.0, 4.0), b=Triangular(2.0, 4.0, 6.0))
    # the universe misses the crossing at 3
    found = distinguishability(Variable("x", "", 0.0, 6.0, pair, 4))
    np.testing.assert_allclose(found.similarity, [[1, 0.5 / 3.5], [0.5 / 3.5, 1]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.possibility, [[1, 0.5], [0.5, 1]], rtol=0, atol=1e-15)


def test_likeness_of_gaussians_has_a_closed_form() -> None:
    """Equal Gaussians d apart cross half way: the shared area is 2 Phi(-d / 2 sigma) of one of them."""
    sigma, apart = 0.5, 1.2
    pair = terms(a=Gaussian(5.0, sigma), b=Gaussian(5.0 + apart, sigma))
    found = distinguishability(Variable("x", "", 0.0, 12.0, pair, 6001))
    shared = 1.0 - erf(apart / (2.0 * sigma) / np.sqrt(2.0))
    assert found.similarity[0, 1] == pytest.approx(shared / (2.0 - shared), abs=1e-6)
    assert found.possibility[0, 1] == pytest.approx(np.exp(-((apart / 2 / sigma) ** 2) / 2), abs=1e-6)


def test_a_term_that_is_never_above_zero_is_like_no_other() -> None:
    pair = terms(a=Gaussian(0.5, 1e-6), b=Gaussian(0.0, 1.0))
    found = distinguishability(Variable("x", "", 0.0, 1.0, pair, 2))
    np.testing.assert_array_equal(found.similarity, [[0, 0], [0, 1]])


def test_rule_usage_counts() -> None:
    strengths = np.array([[0.9, 0.1, 0.0], [0.2, 0.2, 0.0], [0.0, 0.0, 0.0], [0.04, 0.6, 0.0]])
    usage = rule_usage(strengths, threshold=0.1)
    np.testing.assert_array_equal(usage.fired, [0.5, 0.75, 0.0])
    np.testing.assert_array_equal(usage.leading, [0.5, 0.5, 0.0])
    np.testing.assert_array_equal(usage.max_strength, [0.9, 0.6, 0.0])
    with pytest.raises(ValueError, match="at least one"):
        rule_usage(np.empty((0, 3)))


@pytest.mark.parametrize("num_inputs", [1, 3, 12])
def test_spread_inputs_are_scipys_halton_sequence(num_inputs: int) -> None:
    one = replace(FORCE_Z.inputs[0], minimum=-2.0, maximum=6.0)
    inputs = tuple(replace(one, name=f"input_{number}") for number in range(num_inputs))
    sequence = qmc.Halton(num_inputs, scramble=False)
    sequence.fast_forward(1)
    expected = qmc.scale(sequence.random(3000), [-2.0] * num_inputs, [6.0] * num_inputs)
    found = spread_inputs(replace(FORCE_Z, inputs=inputs), 3000)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


SYSTEM = FORCE_X
MET = np.random.default_rng(1).uniform(-1.0, 1.0, (50, len(SYSTEM.inputs)))
BOX = box_of(SYSTEM, MET)


def test_the_box_holds_what_was_met_and_no_more():
    assert BOX.low == tuple(MET.min(axis=0))
    assert BOX.high == tuple(MET.max(axis=0))
    assert BOX.num_samples == 50
    assert not BOX.beyond(MET).any()
    just = np.array(BOX.high)
    just[1] = np.nextafter(just[1], np.inf)
    assert (BOX.beyond(just[np.newaxis]) > 0.0).tolist() == [[False, True] + [False] * (len(just) - 2)]


def test_each_stretch_outside_is_a_departure_with_its_farthest_value():
    inputs = np.zeros((8, len(SYSTEM.inputs)))
    inputs[2:5, 0] = [1.5, 3.0, 2.0]
    inputs[7, 0] = -4.0
    inputs[0, 1] = 9.0
    found = departures(BOX, 10.0 * np.arange(8), inputs)
    names = [variable.name for variable in SYSTEM.inputs]
    expected = [(names[1], 0.0, 0.0, 9.0), (names[0], 20.0, 40.0, 3.0), (names[0], 70.0, 70.0, -4.0)]
    assert [(one.name, one.first_s, one.last_s, one.value) for one in found] == expected
    assert (found[1].low, found[1].high) == (BOX.low[0], BOX.high[0])
    assert departures(BOX, np.empty(0), np.empty((0, len(names)))) == ()


def test_a_domain_is_what_its_file_says():
    told = json.loads(json.dumps(as_mapping([BOX])))
    assert from_mapping(told, "domain.json") == (BOX,)


@pytest.mark.parametrize("told", [{}, [], {"schema": "operational-domain", "schema_version": 2}, None])
def test_something_else_is_refused(told):
    with pytest.raises(ControllerFileError, match=r"that\.json holds no operational domain"):
        from_mapping(told, "that.json")


def without(system: FuzzySystem, index: int) -> FuzzySystem:
    """The same system, one rule's conclusions weighted with zero."""
    rule = system.rules[index]
    silent = replace(rule, consequents=tuple(replace(c, weight=0.0) for c in rule.consequents))
    return replace(system, rules=(*system.rules[:index], silent, *system.rules[index + 1 :]))


def adding_room() -> FuzzySystem:
    outputs = tuple(replace(output, accumulation="bounded_sum") for output in ROOM.outputs)
    return replace(ROOM, outputs=outputs)


@pytest.mark.parametrize("system", [FORCE_X, *GENERAL.systems, adding_room()])
def test_a_contribution_is_what_silencing_the_rule_takes_away(system: FuzzySystem) -> None:
    inputs = spread_inputs(system, 20)
    found = contributions(compile(system), inputs)
    outputs = step_by_step.evaluate(system, inputs)
    assert found.shape == (20, len(system.rules), len(system.outputs))
    for index in range(len(system.rules)):
        expected = outputs - step_by_step.evaluate(without(system, index), inputs)
        np.testing.assert_allclose(found[:, index], expected, rtol=0, atol=1e-14)
    assert np.count_nonzero(found) > 20


def test_importance_by_hand() -> None:
    found = importance(compile(ramp_system()), np.array([[0.0], [0.5], [1.0]]))
    np.testing.assert_allclose(found, [[6.5 / 3 / 10], [5.5 / 3 / 10]], rtol=0, atol=1e-15)


def test_many_samples_come_out_as_few_do() -> None:
    compiled = compile(FORCE_Z)
    inputs = spread_inputs(FORCE_Z, 1500)
    whole = contributions(compiled, inputs)
    np.testing.assert_array_equal(whole[700:720], contributions(compiled, inputs[700:720]))


def test_importance_needs_samples() -> None:
    with pytest.raises(ValueError, match="there are no samples"):
        importance(compile(ramp_system()), np.empty((0, 1)))
