"""Systems of MATLAB, fuzzylite and jFuzzyLogic: published numbers, fractions, engines beside one another."""

from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from fis_tools.analysis.bounds import output_ranges
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.findings import explanation
from fis_tools.findings.audit import audit
from fis_tools.findings.difference import difference
from fis_tools.findings.simplification import simplify
from fis_tools.formats import serialize
from fis_tools.formats.serialize import loads
from fis_tools.model import (
    ALL_SEMANTICS,
    Consequent,
    Constant,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Polyline,
    Rule,
    Term,
    Triangular,
    Variable,
    memberships_at,
)
from fis_tools.model.membership import SHAPES
from fis_tools.model.semantics import sampling_points
from fis_tools.words.text import explain, summary
from tests.fis_tools import step_by_step
from tests.fis_tools.engines import random_systems
from tests.places import PROJECT

AGGREGATIONS = ("max", "bounded_sum", "probabilistic_sum", "unbounded_sum", "einstein_sum")
TOOLS = [tool for tool in ALL_SEMANTICS if tool != "scikit-fuzzy"]


def ramps(outputs: dict[str, Triangular | Polyline], low: float, high: float, **methods: str) -> FuzzySystem:
    """One input from 0 to 1 with a falling and a rising term, each of which concludes a term of y."""
    x = Variable(
        "x", "", 0.0, 1.0, (Term("a", Triangular(-1.0, 0.0, 1.0)), Term("b", Triangular(0.0, 1.0, 2.0)))
    )
    y = Variable("y", "", low, high, tuple(Term(*each) for each in outputs.items()), default=low)
    first, *others = outputs
    rules = [Rule(Is("x", "a"), (Consequent("y", first),))]
    rules += [Rule(Is("x", "b"), (Consequent("y", other),)) for other in others]
    return FuzzySystem("ramps", (x,), (y,), tuple(rules), semantics="matlab", **methods)  # type: ignore[arg-type]


def outputs_of(system: FuzzySystem, *rows: float | tuple[float, ...]) -> list[float]:
    """The first output of samples, by all engines for arrays and single samples."""
    inputs = np.array([np.atleast_1d(row) for row in rows], dtype=np.float64)
    compiled = compile(system)
    outputs = compiled(inputs)
    np.testing.assert_array_equal([compiled.prepare()(*row) for row in inputs], outputs)
    step_by_step.assert_near(outputs, step_by_step.evaluate(system, inputs), system)
    return [float(value) for value in outputs[:, 0]]


def test_the_tipper_gives_what_matlab_publishes():
    """The documentation of `evalfis`, to all digits that it prints."""
    (tipper,) = serialize.load(PROJECT / "docs" / "examples" / "tipper.fis").systems
    values = outputs_of(tipper, (2.0, 1.0), (4.0, 5.0), (7.0, 8.0))
    assert [f"{value:.4f}" for value in values] == ["7.0169", "14.4585", "20.3414"]


def test_matlab_takes_the_maxima_by_magnitude():
    """MATLAB Answers 368956: of heights .1 .8 .8 .8 .1 on -1:.5:1."""
    heights = Polyline((-1.0, -0.5, 0.0, 0.5, 1.0), (0.1, 0.8, 0.8, 0.8, 0.1))
    for method, expected in (("som", 0.0), ("lom", -0.5), ("mom", 0.0)):
        system = ramps({"set": heights, "none": Triangular(-1.0, -1.0, -1.0)}, -1.0, 1.0, defuzzifier=method)
        (y,) = system.outputs
        assert outputs_of(replace(system, outputs=(replace(y, num_points=5),)), 0.0) == [expected]


def test_a_rule_that_fires_faintly_stays_inside_the_range_of_the_output():
    mild, hot = Triangular(40.0, 50.0, 60.0), Triangular(70.0, 80.0, 90.0)
    q = Variable("q", "", 0.0, 10.0, (Term("low", Gaussian(0.0, 0.5)), Term("high", Gaussian(10.0, 0.5))))
    heat = Variable("heat", "", 40.0, 90.0, (Term("mild", mild), Term("hot", hot)), default=65.0)
    rules = (
        Rule(Is("q", "low"), (Consequent("heat", "mild"),)),
        Rule(Is("q", "high"), (Consequent("heat", "hot"),)),
    )
    system = FuzzySystem("faint", (q,), (heat,), rules, semantics="matlab")
    assert outputs_of(system, 4.6, 5.0, -3.0, -16.9) == pytest.approx([50.0, 65.0, 50.0, 50.0])
    assert min(outputs_of(replace(system, semantics="scikit-fuzzy"), 4.6)) < 40.0
    (heated,) = output_ranges(system)
    assert 49.99 <= heated.outer.low <= 50.0
    assert 80.0 <= heated.outer.high <= 80.01
    assert (heated.inner.low, heated.inner.high) == pytest.approx((50.0, 80.0), abs=0.1)
    assert "numbers are those of MATLAB" in heated.sentence
    (beyond,) = output_ranges(system, "q in [0, 20]")
    assert "q beyond its range of 0 to 10 is taken as it is" in beyond.sentence


def test_every_conclusion_names_the_program_that_it_holds_for():
    system = ramps({"lo": Triangular(-0.5, 0.0, 0.5), "hi": Triangular(0.5, 1.0, 1.5)}, 0.0, 1.0)
    other = replace(system, rules=system.rules[:1])
    for semantics, is_named in (("matlab", True), ("scikit-fuzzy", False)):
        original, changed = (replace(each, semantics=semantics) for each in (system, other))
        conclusions = (
            summary(original),
            audit(original).summary(),
            explanation.explain(original, [0.3]).text(),
            difference(original, changed).text(),
            simplify(original).summary,
            output_ranges(original)[0].sentence,
        )
        assert [("MATLAB" in words) for words in conclusions] == [is_named] * len(conclusions)


def test_singletons_between_and_at_the_ends_are_numbers():
    ends = {"lo": Triangular(0.0, 0.0, 0.0), "hi": Triangular(1.0, 1.0, 1.0)}
    assert outputs_of(ramps(ends, 0.0, 1.0), 0.0, 0.2, 0.5, 0.9, 1.0) == pytest.approx(
        [0.0, 0.2, 0.5, 0.9, 1.0], abs=1e-15
    )


def test_corners_of_lower_terms_are_no_maxima():
    """Three triangles above a plateau: the mean of their tops, not of corners below."""
    terms = {
        "wide": Triangular(0.0, 50.0, 100.0),
        **{f"t{x}": Triangular(x - 2.0, x, x + 2.0) for x in (92, 94, 96)},
    }
    assert outputs_of(ramps(terms, 0.0, 100.0, defuzzifier="mom"), 1.0) == [94.0]


@pytest.mark.parametrize("tool", TOOLS)
def test_inputs_beyond_their_range_are_used_unless_they_are_clipped(tool):
    terms = {"lo": Triangular(0.0, 0.0, 1.0), "hi": Triangular(0.0, 1.0, 1.0)}
    system = replace(ramps(terms, 0.0, 1.0), semantics=tool)
    clipped = replace(system, inputs=(replace(system.inputs[0], is_clipped=True),))
    at_the_end, beyond = outputs_of(system, 1.0, 1.5)
    assert outputs_of(clipped, 1.5, 7.0) == [at_the_end] * 2
    assert beyond == pytest.approx(at_the_end, abs=0.1)
    assert beyond != at_the_end


def test_where_no_rule_fires_an_output_may_be_no_number():
    system = ramps({"lo": Triangular(0.0, 0.0, 1.0), "hi": Triangular(0.0, 1.0, 1.0)}, 0.0, 1.0)
    (y,) = system.outputs
    silent = replace(system, semantics="fuzzylite", outputs=(replace(y, default=None),))
    assert np.isnan(outputs_of(silent, 9.0)).all()
    (bounds,) = output_ranges(silent, "x in [0, 9]")
    assert 0.0 <= bounds.outer.low < bounds.outer.high <= 1.0


@pytest.mark.parametrize("tool", TOOLS)
def test_points_are_those_of_the_program(tool):
    """From -1 to 2 in three steps, by hand."""
    expected = {"matlab": [-1.0, 0.0, 1.0, 2.0], "fuzzylite": [-0.5, 0.5, 1.5], "fcl": [-1.0, 0.0, 1.0]}
    assert sampling_points(tool, -1.0, 2.0, 4).tolist() == expected[tool]


@pytest.mark.parametrize("tool", TOOLS)
def test_a_centroid_is_the_fraction_that_its_points_and_heights_make(tool):
    terms = {"lo": Triangular(0.0, 0.25, 0.75), "hi": Triangular(0.125, 0.75, 1.0)}
    system = replace(ramps(terms, 0.0, 1.0), semantics=tool)
    (y,) = system.outputs
    points = system.points_of(y)
    for x in (0.0, 0.125, 0.5, 0.9375):
        heights = []
        for point in points:
            memberships = [Fraction(float(memberships_at(y, term, np.array([point]))[0])) for term in y.terms]
            cuts = [max(1 - Fraction(x), 0), Fraction(x)]
            heights.append(max(map(min, cuts, memberships)))
        exact = sum(Fraction(p) * h for p, h in zip(points, heights, strict=True)) / sum(heights)
        assert outputs_of(system, x) == pytest.approx([float(exact)], rel=1e-14)


def test_all_engines_agree_on_systems_of_every_program():
    """Also beyond the ranges; C and the page are tested beside their own."""
    shapes, methods, ways = set(), set(), product(("min", "product", "einstein_product"), AGGREGATIONS)
    for number, system in enumerate(random_systems.sampled_systems(61, 45)):
        if number % 3 == 0 and (way := next(ways, None)) and not any(map(system.weighs, system.outputs)):
            system = random_systems.otherwise(system, *way)  # noqa: PLW2901
        rows = random_systems.inputs_beyond(system, np.random.default_rng([62, number]), 40)
        expected, firing = step_by_step.inferred(system, rows)
        compiled = compile(system)
        step_by_step.assert_near(compiled(rows), expected, system)
        np.testing.assert_allclose(compiled.firing_strengths(rows), firing, rtol=0, atol=1e-13)
        sets = (output for output in system.outputs if not system.weighs(output))
        for output in sets:
            column = expected[:, system.outputs.index(output)]
            assert (
                (column >= output.minimum) & (column <= output.maximum) | (column == output.default)
            ).all()
            methods.add((system.semantics, system.defuzzifier_of(output)))
        shapes |= {type(term.membership) for variable in system.inputs for term in variable.terms}
    assert {tool for tool, _ in methods} == set(TOOLS)
    assert len(methods) > 10
    assert len(shapes) > len(SHAPES) / 2


def test_numbers_of_jfuzzylogic_that_are_equal_join_by_the_accumulation():
    """Two rules conclude 1, by 0.25 and 0.75, one 3 by 0.75: joined by the maximum, 1 counts 0.75."""
    system = ramps({"lo": Triangular(0.0, 0.0, 1.0), "hi": Triangular(0.0, 1.0, 1.0)}, 0.0, 4.0)
    terms = (Term("one", Constant(1.0)), Term("same", Constant(1.0)), Term("three", Constant(3.0)))
    y = replace(system.outputs[0], terms=terms, defuzzifier="weighted_average", aggregation="unbounded_sum")
    rules = tuple(
        Rule(Is("x", a), (Consequent("y", b),)) for a, b in (("a", "one"), ("b", "same"), ("b", "three"))
    )
    base = replace(system, rules=rules, semantics="fcl")
    summed = replace(base, outputs=(replace(y, accumulation="unbounded_sum"),))
    assert outputs_of(summed, 0.75) == pytest.approx([(1.0 * 1.0 + 3.0 * 0.75) / 1.75])
    joined = replace(base, outputs=(replace(y, accumulation="max"),))
    assert outputs_of(joined, 0.75) == pytest.approx([(1.0 * 0.75 + 3.0 * 0.75) / 1.5])


def test_semantics_are_kept_and_told():
    system = ramps({"lo": Triangular(0.0, 0.0, 1.0), "hi": Triangular(0.0, 1.0, 1.0)}, 0.0, 1.0)
    clipped = replace(system, inputs=(replace(system.inputs[0], is_clipped=True),))
    controller = FuzzyController("c", (clipped,))
    for write, kind in ((serialize.dump_json, "json"), (serialize.dump_yaml, "yaml")):
        assert loads(write(controller), kind) == controller
    assert "inferred as MATLAB does" in summary(system)
    assert "MATLAB" in explain(infer(system, np.array([0.5])))
