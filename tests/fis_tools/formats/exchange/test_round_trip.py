"""What is written and read back is equal: all of it with our comment, all that the format holds without."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fis, fll
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.formats.exchange.dialect import express
from fis_tools.formats.exchange.writing import EDITED
from fis_tools.formats.serialize import ControllerFileError
from fis_tools.model import And, Consequent, FuzzyController, FuzzySystem, Hedged, Is, Not, Or, Rule, Term
from fis_tools.model.shapes import Gaussian, Polyline, Sampled
from fis_tools.model.systems import with_variables
from tests.fis_tools.agreement import drawn
from tests.fis_tools.engines.random_systems import hedged, otherwise, random_general_system
from tests.fis_tools.formats.exchange.systems import DENIED, FLAT, NESTED, alone, without_comment
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z
from tests.fis_tools.step_by_step import assert_near

pytestmark = pytest.mark.slow


@pytest.fixture(params=[fis, fll])
def form(request):
    return request.param


def own_words(system: FuzzySystem) -> FuzzySystem:
    """A system with names that no format takes as they are, and an uneven universe with a sampled term."""
    first, second = system.inputs
    terms = (*second.terms, Term("été, très sûr", Sampled((1.0, 0.25, 0.5, 0.0, 0.125))))
    sampled = replace(second, points=(0.0, 0.5, 2.0, 9.5, 25.0), num_points=5, terms=terms)
    concluded = (Consequent("heat", "some", 1 / 3),)
    rule = Rule(Is("wind", "été, très sûr"), concluded, label="a 'label' -- \"here\"")
    return replace(system, inputs=(first, sampled), rules=(*system.rules, rule))


@pytest.mark.parametrize("controller", [alone(FORCE_Z), alone(DENIED), alone(own_words(FLAT))])
def test_files_hold_what_they_can_and_carry_the_rest(form, controller):
    written = form.write(controller)
    reading = form.read(written.text)
    assert reading.controller == controller
    assert reading.assumptions == ()
    shown = form.read(without_comment(written.text)).controller
    assert shown.systems[0] == express(controller.systems[0], form.DIALECT).system
    assert shown.attributes == ()
    assert form.write(reading.controller) == written


def with_rules(*rules: Rule, **changes: str) -> FuzzySystem:
    return replace(FLAT, rules=rules, **changes)


HEAT, FLAP = FLAT.outputs
STEP = Polyline((2.0, 2.0, 2.0, 4.0, 6.0), (0.0, 0.7, 1.0, 0.75, 0.25))
SOME_HEAT = (Consequent("heat", "some"),)
CALM = Is("wind", "calm")
STORM = Is("wind", "storm")
NESTED_BY_PRODUCT = replace(NESTED, and_operator="product")
#: with ways of their own, which an .fll file can say
OWN_WAYS = {
    "an output": replace(FLAT, outputs=(HEAT, replace(FLAP, defuzzifier="bisector"))),
    "a rule": with_rules(*FLAT.rules[:3], replace(FLAT.rules[3], and_operator="product"), *FLAT.rules[4:]),
    "twice": with_rules(Rule(And((CALM, Not(STORM))), SOME_HEAT)),
}


@pytest.mark.parametrize(
    ("form", "hedged", "words"),
    [
        (fll, Not(Hedged("very", CALM)), "wind is not very calm"),
        (fll, Hedged("intensely", And((Is("temperature", "warm"), CALM))), "is extremely some"),
    ],
)
def test_hedges_are_said_in_the_words_of_a_format(form, hedged, words):
    system = with_rules(*FLAT.rules, Rule(hedged, SOME_HEAT))
    written = form.write(alone(system))
    assert words in written.text
    (shown,) = serialize.loads(without_comment(written.text), form.__name__.rpartition(".")[2]).systems
    rows = np.random.default_rng(3).uniform((-10.0, 0.0), (40.0, 25.0), (40, 2))
    assert_near(compile(shown)(rows), compile(system)(rows), system, 2e-3)


def test_implications_and_aggregations_survive(form):
    pairs = (("product", "probabilistic_sum"), ("nilpotent_minimum", "unbounded_sum"))
    for implication, aggregation in pairs:
        system = otherwise(FLAT, implication, aggregation)
        text = form.write(alone(system)).text
        shown = form.read(without_comment(text)).controller.systems[0]
        assert (shown.implication, shown.outputs[0].aggregation) == (implication, aggregation)
        assert form.read(text).controller == alone(system)


def test_random_systems_survive_or_are_refused(form):
    refused = 0
    for seed in range(30):
        generator = np.random.default_rng(seed)
        system = random_general_system(generator)
        system = hedged(system, generator) if seed % 2 else system
        controller = FuzzyController("random", (system,))
        try:
            text = form.write(controller).text
        except NotExpressible:
            refused += 1
            continue
        assert form.read(text).controller == controller
        assert form.read(without_comment(text)).controller.systems[0] == express(system, form.DIALECT).system
    assert refused < 28


@pytest.mark.parametrize("kind", serialize.FORMS)
def test_what_can_be_written_comes_back_as_it_was(kind):
    """Systems of everything that is registered, with operators that no rule uses, and jumps of tables."""
    num_written = 0
    for seed in range(200):
        controller = alone(drawn.system(np.random.default_rng([3, seed])))
        try:
            text = serialize.writer(kind)(controller).text
        except NotExpressible:
            continue
        assert serialize.loads(text, kind) == controller
        num_written += 1
    assert num_written > 10


def test_a_jump_is_written_as_a_slope_up_to_the_next_number(form):
    system = replace(
        FLAT,
        inputs=(replace(FLAT.inputs[0], terms=(*FLAT.inputs[0].terms, Term("step", STEP))), FLAT.inputs[1]),
    )
    text = without_comment(form.write(alone(system)).text)
    shown = form.read(text).controller.systems[0].inputs[0].terms[-1].membership
    around = np.array([-1.0, 2.0, np.nextafter(2.0, 3.0), 3.0, 5.0, 6.0])
    np.testing.assert_array_equal(shown.at(around), STEP.at(around))


@pytest.mark.parametrize("and_operator", ["min", "product", "einstein_product"])
def test_rules_written_otherwise_mean_the_same(form, and_operator):
    system = replace(DENIED, and_operator=and_operator)
    if and_operator != "min":
        system = replace(system, rules=(system.rules[0], *system.rules[2:]))
    expressed = express(system, form.DIALECT).system
    assert len(expressed.rules) > len(system.rules) or form is fll

    def as_before(variable):
        before = system.variable(variable.name)
        return replace(variable, num_points=before.num_points, default=before.default, is_clipped=False)

    # what the other program makes of the same rules is tested with its numbers
    expressed = replace(with_variables(expressed, as_before), semantics=system.semantics)
    inputs = spread_inputs(system, 500)
    np.testing.assert_allclose(compile(expressed)(inputs), compile(system)(inputs), rtol=0, atol=1e-12)


def test_not_before_a_conjunction_moves_inwards():
    hot = Is("temperature", "hot")
    rule = Rule(Not(And((hot, Or((CALM, Not(STORM)))))), SOME_HEAT)
    expressed = express(with_rules(rule), fll.DIALECT).system.rules
    assert [rule.antecedent for rule in expressed] == [Or((Not(hot), And((Not(CALM), STORM))))]


@pytest.mark.parametrize(
    ("form", "system", "words"),
    [
        (fis, NESTED, r"rule 1 cannot be said in a \.fis file: 'and' and 'or' are nested"),
        (fll, NESTED_BY_PRODUCT, r"rule 2 cannot be said in an \.fll file: 'not' stands before"),
        (fis, with_rules(Rule(Hedged("very", CALM), SOME_HEAT)), "no word for 'very'"),
        (fll, with_rules(Rule(Hedged("extremely", CALM), SOME_HEAT)), "no word for 'extremely'"),
        (fis, OWN_WAYS["an output"], "knows one way for all"),
        (fis, OWN_WAYS["a rule"], "combine their statements"),
        (fis, OWN_WAYS["twice"], "two things of one input"),
        (fis, replace(FLAT, outputs=(replace(HEAT, accumulation="bounded_sum"), FLAP)), "bounded_sum"),
    ],
)
def test_what_would_change_its_meaning_is_refused(form, system, words):
    with pytest.raises(NotExpressible, match=words):
        form.write(alone(system))


def test_losses_are_sentences_about_what_is_missing():
    notes = "\n".join(fis.write(alone(own_words(DENIED))).losses)
    for words in (
        "'été, très sûr' is ete_tres_sur",
        "temperature in degC, wind in m/s",
        "temperature 101",
        "heat 1.5, flap -1",
        "rules are written otherwise, with the same meaning: 1 as",
        "keep warm, everyday",
        "attributes are left out: axis, note",
        "provenance is left out: made_by",
        "controller's name is left out: exchanged",
        "inside the range: wind calm, wind été, très sûr, heat none, heat much and 1 more",
        "fis_tools reads it back",
    ):
        assert words in notes


# Files that were changed by hand after they were written.


@pytest.mark.parametrize(
    ("form", "old", "new"),
    [
        (fis, "MF2='some':'gaussmf',[1.4 5.0]", "MF2='some':'gaussmf',[1.4 6.0]"),
        (fll, "some Gaussian 5.0 1.4", "some Gaussian 6.0 1.4"),
    ],
)
def test_of_a_file_that_was_changed_what_it_shows_counts(form, old, new):
    text = form.write(alone(own_words(FLAT))).text
    head, mark, rest = text.partition("[System]" if form is fis else "Engine:")
    assert rest.count(old) == 1
    reading = form.read(head + mark + rest.replace(old, new))
    controller = reading.controller
    assert any("changed after it was written" in sentence for sentence in reading.assumptions)
    assert EDITED in controller.provenance
    assert controller.systems[0].variable("heat").terms[1].membership == Gaussian(6.0, 1.4)
    assert controller.attributes == ()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("carries 1:", "carries 2:", "is not of version"),
        ('"schema":"fuzzy-controller"', '"schema":"x"', "the comment is damaged"),
        ('"schema_version":1', '"schema_version":1,"schema_version":1', "appears twice"),
        ('"name":"climate"', '"name":NaN', "contains NaN"),
    ],
)
def test_a_comment_that_cannot_be_believed_is_refused(form, old, new, words):
    text = form.write(alone(FLAT)).text
    with pytest.raises(ControllerFileError, match=words) as refusal:
        form.read(text.replace(old, new, 1))
    assert "delete this comment" in str(refusal.value)
    lines = text.splitlines()
    comment = next(line for line in lines if "carries" in line)
    with pytest.raises(ControllerFileError, match="a second comment"):
        form.read(text.replace(comment, f"{comment}\n{comment}", 1))


def test_the_comment_of_another_file_gives_nothing_that_is_seen():
    """A comment is believed only where the file shows the same."""
    first, other = fis.write(alone(FLAT)).text, fis.write(alone(FORCE_X)).text
    swapped = first.splitlines()[0] + other[other.index("\n") :]
    (system,) = fis.read(swapped).controller.systems
    assert system == fis.read(without_comment(other)).controller.systems[0]
