"""Inputs and operators at which one engine once answered something else: faint rules, jumps, ends."""

import re
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from fis_tools.analysis import branch_and_bound
from fis_tools.analysis.bounds import ask, output_ranges
from fis_tools.engines import bounded_trees
from fis_tools.engines.codes import OPERATORS, combine
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.engines.interval import NotBounded
from fis_tools.engines.outward import combine_bounds
from fis_tools.findings.audit import audit
from fis_tools.findings.explanation import explain, flips
from fis_tools.model import FuzzyController, operators
from fis_tools.source import read_controller
from tests.fis_tools.engines import extremes
from tests.fis_tools.sample_controllers import TIPPER


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a text as a file of some kind."""

    def reading(text: str, suffix: str):
        path = tmp_path / f"case{suffix}"
        path.write_text(text)
        return read_controller(path).systems[0]

    return reading


def test_the_centroid_of_denormal_heights_is_exact(read):
    """Strengths of 5e-314 have no reciprocal; sums of fractions are exact."""
    system = read(extremes.DENORMAL, ".fis")
    x = np.linspace(3.0, 4.0, 101)
    heights = infer(system, [0.0, 0.0]).outputs[0].aggregated
    assert 0.0 < heights.max() < 1.0 / np.finfo(np.float64).max
    counts = [Fraction(height) for height in heights.tolist()]
    mean = sum(c * Fraction(v) for c, v in zip(counts, x.tolist(), strict=True)) / sum(counts)
    for value in (infer(system, [0.0, 0.0]).values[0], compile(system)(np.zeros((3, 2)))[1, 0]):
        assert value == pytest.approx(float(mean), abs=1e-12)
    explanation = explain(system, [0.0, 0.0]).outputs[0]
    assert explanation.moves[0].share == pytest.approx(float(mean) - explanation.variable.default)


def test_a_walk_that_sums_nothing_leaves_the_default(read):
    """jFuzzyLogic's centre of area starts behind the first point: 3 by its own run, at level 2."""
    system = read(extremes.FIRST_POINT, ".fcl")
    inferred = infer(system, [2.0]).outputs[0]
    assert (inferred.value, inferred.is_default) == (3.0, True)
    assert compile(system)(np.array([[2.0]]))[0, 0] == 3.0
    assert "finds none" in str(explain(system, [2.0]))
    (bounds,) = output_ranges(system, "level < 4")
    assert (bounds.outer.low, bounds.outer.high) == (3.0, 3.0)


def test_a_rounded_strength_does_not_fall_from_a_jump(read):
    system = read(extremes.DRASTIC, ".fll")
    at_top = infer(system, [0.32, 0.32]).values[0]
    assert at_top == pytest.approx(0.75)
    assert ask(system, "z > 0.1").verdict == "yes"
    (bounds,) = output_ranges(system, max_boxes=500)
    assert bounds.outer.low <= 0.0
    assert bounds.outer.high >= at_top


@pytest.mark.parametrize("name", sorted({*operators.AND_OPERATORS, *operators.OR_OPERATORS}))
def test_operators_never_fall(name):
    """On degrees next to all their jumps, also those that rounding takes beyond one."""
    eps = np.finfo(np.float64).eps
    degrees = sorted({*np.linspace(0.0, 1.0, 9), 5e-324, eps, 0.5 - eps, 0.5 + eps, 1.0 - eps, 1.0 + eps})
    table = {**operators.AND_OPERATORS, **operators.OR_OPERATORS}
    code = OPERATORS[name]
    for b in degrees:
        values = [float(table[name](np.array(a), np.array(b))) for a in degrees]
        assert values == [combine(code, a, b) for a in degrees]
        assert all(first <= second * (1.0 + 4.0 * eps) + 1e-323 for first, second in pairwise(values))


@pytest.mark.parametrize("name", sorted({*operators.AND_OPERATORS, *operators.OR_OPERATORS}))
def test_bounds_of_operators_hold_next_to_their_jumps(name):
    generator = np.random.default_rng(5)
    special = [0.0, 5e-324, 1e-162, 1e-155, 0.25, 0.5, np.nextafter(0.5, 1), 0.75, np.nextafter(1, 0), 1.0]
    code = OPERATORS[name]
    for _ in range(4000):
        ends = [
            np.sort(generator.choice(special, 2)) * generator.choice([1.0, generator.random()]) for _ in "ab"
        ]
        bounds = combine_bounds(code, tuple(ends[0]), tuple(ends[1]))
        points = [low + (high - low) * generator.choice([0.0, 1.0, generator.random()]) for low, high in ends]
        value = combine(code, *np.clip(points, [e[0] for e in ends], [e[1] for e in ends]))
        assert bounds[0] <= value <= bounds[1]


def test_what_is_attained_beyond_a_bound_ends_the_search(read, monkeypatch):
    """Bounds that do not hold are not printed beside what was attained."""
    system = read(extremes.DRASTIC, ".fll")
    bound = bounded_trees.bound

    def narrow(program, low, high):
        least, greatest, variation = bound(program, low, high)
        return least, 0.7 * greatest, variation

    monkeypatch.setattr(branch_and_bound.bounded_trees, "bound", narrow)
    for asking in (lambda: output_ranges(system), lambda: ask(system, "z > 0.6")):
        with pytest.raises(NotBounded, match=re.escape("beyond what was bounded")):
            asking()


@pytest.mark.parametrize(
    ("text", "suffix", "at", "value", "crossed"),
    # y = 2 x by the only rule; z = 2 x and x^2 + 1 with strengths 0.8 and 0.2
    [(extremes.SUGENO, ".fis", 2.0, 4.0, 1.5), (extremes.TAKAGI, ".fll", 3.0, 0.8 * 6.5 + 0.2 * 10.0, None)],
    ids=["matlab", "fuzzylite"],
)
def test_inputs_beyond_ranges_are_explained_as_they_are_inferred(read, text, suffix, at, value, crossed):
    system = read(text, suffix)
    explained = explain(system, [at], 3.0)
    (output,) = explained.outputs
    assert output.value == pytest.approx(value)
    shares = sum(move.share for move in output.moves)
    assert shares == pytest.approx(value - (output.variable.default or 0.0))
    assert "nothing can" not in str(explained)
    change = flips(system, [at], 3.0)[0]
    assert compile(system)(np.array([[change.first]]))[0, 0] == pytest.approx(3.0, abs=1e-6)
    assert crossed is None or change.first == pytest.approx(crossed)


def test_a_claim_names_its_region(read):
    system = read(extremes.SUGENO, ".fis")
    assert "nothing is said beyond x from 0 to 1" in ask(system, "y > 3").sentence
    assert ask(system, "y > 3", "x in [2, 2]").verdict == "yes"


# a square that overflows is an infinite distance, of degree zero; where kernels are plain Python, NumPy tells
@pytest.mark.filterwarnings("ignore:overflow encountered in multiply:RuntimeWarning")
def test_a_search_from_far_beyond_a_range_ends(read):
    system = read(extremes.SUGENO, ".fis")
    for far in (1e12, -1e300):
        assert flips(system, [far], 1.0)


def test_all_gaps_are_told(read):
    """Ends are where triangles have 0.2, by hand."""
    audited = audit(FuzzyController("c", (read(extremes.GAPS, ".fis"),)))
    findings = [finding for finding in audited.findings if finding.id == "coverage"]
    ends = {f.variable: re.findall(r"from ([0-9.]+) to ([0-9.]+)", f.sentence) for f in findings}
    assert ends["b"] == [("0", "26.04"), ("26.36", "28.12"), ("28.76", "29.36"), ("29.84", "30")]
    assert ends["a"] == [("0", "8"), ("87.2", "101.2"), ("123.6", "129.6"), ("153.6", "160")]


def test_an_output_without_a_default_is_not_said_to_have_one(read):
    words = str(explain(read(extremes.TAKAGI, ".fll"), [0.5]))
    assert "from 0, from which shares count, as there is no output where no rule fires" in words


def test_rules_too_weak_to_have_a_share_are_named():
    words = str(explain(read_controller(TIPPER).systems[0], [3.8, 4.3]))
    assert re.search(r"rules? [0-9, and]+ fires? at less than 0.05 and so ha(s|ve) no share", words)
