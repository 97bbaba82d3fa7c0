"""Genes and the systems that they stand for, there and back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.engines.packing import Packed, pack
from fis_tools.formats import serialize
from fis_tools.genes.parameters import Bounds, SystemEncoding
from fis_tools.model import FuzzySystem, Gaussian, Term, Triangular, Variable, rule_table
from fis_tools.model.validate import problems
from tests.fis_tools.sample_controllers import SHIPPED, gaussian_terms, table_system, with_input

PAPER = serialize.load(SHIPPED["paper"]).systems
BOUNDS = Bounds(mean_window=0.9, standard_deviation=(0.04, 0.3), output_reach=(0.01, 0.3))


def variable(
    name: str, low: float, high: float, num_terms: int, num_points: int, **fields: float
) -> Variable:
    names = tuple(f"t{index}" for index in range(num_terms))
    terms = gaussian_terms(names, low, high, 0.2 * (num_terms - 1))
    return Variable(name, "", low, high, terms, num_points=num_points, **fields)


def table(name: str, inputs: tuple[Variable, ...], output: Variable) -> FuzzySystem:
    cells = int(np.prod([len(v.terms) for v in inputs]))
    words = [output.terms[(7 * cell) % len(output.terms)].name for cell in range(cells)]
    return table_system(name, inputs, output, words)


#: of one to three inputs, with two to seven terms, and grids that do not fill whole vectors
UNEVEN = (
    table("one", (variable("a", -3.0, 5.0, 2, 11),), variable("y", -0.1, 0.1, 3, 13, default=0.0)),
    table(
        "three",
        (variable("a", 0.0, 1.0, 3, 8), variable("b", -1.0, 0.0, 2, 17), variable("c", 10.0, 1e4, 4, 9)),
        variable("y", -2.0, 2.0, 7, 101, default=0.05),
    ),
)
SMALL = SystemEncoding(UNEVEN, BOUNDS)


def test_the_papers_structure_has_150_genes_each_with_a_name():
    """Of each system: 2 x (3 means + 5 standard deviations), 3 + 5 + 1 of the output, 25 rules."""
    encoding = SystemEncoding(PAPER, BOUNDS)
    assert encoding.num_genes == 150
    names = encoding.gene_names()
    assert len(set(names)) == 150
    assert names[0] == "force_x.distance.near.mean"
    assert names[3] == "force_x.distance.very_near.standard_deviation"
    assert names[24:26] == ["force_x.force_x.reach", "force_x.rule_0"]
    assert names[149] == "force_z.rule_24"


def assert_same(ours: Packed, theirs: Packed, row: int) -> None:
    np.testing.assert_array_equal(ours.layout, theirs.layout)
    np.testing.assert_array_equal(ours.values[row], theirs.values[0])
    np.testing.assert_array_equal(ours.rules[row], theirs.rules[0])


@pytest.mark.parametrize("systems", [PAPER, UNEVEN], ids=["paper", "uneven"])
def test_a_population_is_packed_as_its_decoded_systems_are_bit_for_bit(systems):
    encoding = SystemEncoding(systems, BOUNDS)
    genomes = np.random.default_rng(1).random((6, encoding.num_genes))
    genomes[1], genomes[2] = 0.0, 1.0
    genomes[3] = np.round(genomes[3])
    packed = encoding.pack(genomes)
    assert len(packed.values) == len(packed.rules) == 6
    for row, genome in enumerate(genomes):
        assert_same(packed, pack(*encoding.decode(genome)), row)


genes = st.floats(0.0, 1.0) | st.sampled_from([0.0, 1.0, 0.5])
genomes_of_small = st.lists(genes, min_size=SMALL.num_genes, max_size=SMALL.num_genes).map(np.array)


@settings(max_examples=25, deadline=None)
@given(genomes_of_small)
def test_any_genome_stands_for_sound_systems(genome):
    for before, after in zip(UNEVEN, SMALL.decode(genome), strict=True):
        assert problems(after) == []
        for old, new in zip((*before.inputs, *before.outputs), (*after.inputs, *after.outputs), strict=True):
            assert [term.name for term in new.terms] == [term.name for term in old.terms]
            means = np.array([term.membership.mean for term in new.terms])
            widths = np.array([term.membership.standard_deviation for term in new.terms])
            spacing = (new.maximum - new.minimum) / (len(means) - 1)
            # windows of 0.9 of the spacing leave a tenth of it between neighbours
            assert np.diff(means).min() > 0.0999 * spacing
            assert (means[0], means[-1]) == (new.minimum, new.maximum)
            evenly = np.linspace(new.minimum, new.maximum, len(means))
            assert np.abs(means - evenly).max() <= 0.4501 * spacing
            shares = widths / (new.maximum - new.minimum)
            assert 0.04 - 1e-12 <= shares.min() <= shares.max() <= 0.3 + 1e-12
        for old, new in zip(before.inputs, after.inputs, strict=True):
            assert (new.minimum, new.maximum) == (old.minimum, old.maximum)
        output = after.outputs[0]
        assert output.minimum == -output.maximum
        assert 0.01 * (1 - 1e-12) <= output.maximum <= 0.3 * (1 + 1e-12)
        assert output.default == before.outputs[0].default


@settings(max_examples=25, deadline=None)
@given(genomes_of_small)
def test_decoded_genomes_are_encoded_back_up_to_the_cells_of_rules(genome):
    again = SMALL.encode(SMALL.decode(genome))
    is_rule = np.array([".rule_" in name for name in SMALL.gene_names()])
    np.testing.assert_allclose(again[~is_rule], genome[~is_rule], rtol=0, atol=1e-9)
    for before, after in zip(SMALL.decode(genome), SMALL.decode(again), strict=True):
        np.testing.assert_array_equal(rule_table(after), rule_table(before))


def test_genes_by_hand():
    """One input from -3 to 5 m with two terms; an output with three, of which the middle one moves."""
    encoding = SystemEncoding(UNEVEN[:1], BOUNDS)
    widths = [f"one.{name}.standard_deviation" for name in ("a.t0", "a.t1", "y.t0", "y.t1", "y.t2")]
    of_output = ["one.y.t1.mean", *widths[2:], "one.y.reach"]
    assert encoding.gene_names() == [*widths[:2], *of_output, "one.rule_0", "one.rule_1"]
    (system,) = encoding.decode(np.array([0.0, 1.0, 1.0, 0.5, 0.0, 1.0, 0.5, 0.0, 1.0]))
    (first, second), (output,) = system.inputs[0].terms, system.outputs
    assert first.membership == Gaussian(-3.0, pytest.approx(0.04 * 8.0))
    assert second.membership == Gaussian(5.0, pytest.approx(0.3 * 8.0))
    # half way between 0.01 and 0.3 on a logarithmic scale
    reach = np.sqrt(0.01 * 0.3)
    assert output.maximum == pytest.approx(reach, rel=1e-14)
    # the window reaches 0.45 of the spacing, which is the reach itself
    assert output.terms[1].membership.mean == pytest.approx(0.45 * reach, rel=1e-13)
    assert output.terms[0].membership.standard_deviation == pytest.approx(0.17 * 2 * reach, rel=1e-13)
    np.testing.assert_array_equal(rule_table(system), [0, 2])


@pytest.mark.parametrize(
    ("gene", "term"),
    [(0.0, 0), (0.199999, 0), (0.2, 1), (0.4, 2), (0.6, 3), (0.8, 4), (0.999999, 4), (1.0, 4)],
)
def test_a_rule_is_the_term_of_its_cell(gene, term):
    encoding = SystemEncoding(PAPER[:1], BOUNDS)
    genome = np.full(encoding.num_genes, 0.5)
    genome[-1] = gene
    table_of_terms = rule_table(encoding.decode(genome)[0])
    assert table_of_terms is not None
    assert table_of_terms[-1] == term
    assert set(table_of_terms[:-1].tolist()) == {2}


def test_what_lies_outside_the_bounds_is_brought_to_them():
    wide = with_terms((Term("t0", Gaussian(-3.0, 40.0)), Term("t1", Gaussian(5.0, 1e-3))))
    genome = SystemEncoding(UNEVEN[:1], BOUNDS).encode((wide,))
    np.testing.assert_array_equal(genome[:2], [1.0, 0.0])


def with_terms(terms: tuple[Term, ...], **changes: object) -> FuzzySystem:
    changed = with_input(UNEVEN[0], terms=terms, **changes)
    (output,) = changed.outputs
    return table_system("odd", changed.inputs, output, [output.terms[0].name] * len(terms))


GAUSSIANS = UNEVEN[0].inputs[0].terms


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (replace(PAPER[0], rules=PAPER[0].rules[:-1]), r"'force_x' is not a full rule table; only those"),
        (replace(PAPER[0], outputs=(replace(PAPER[0].outputs[0], minimum=-0.2),)), r"make it symmetric"),
        (with_terms((Term("t0", Triangular(-3.0, -3.0, 5.0)), GAUSSIANS[1])), r"terms that are not Gaussian"),
        (with_terms(GAUSSIANS[:1]), r"'a' has 1 term; give it two or more"),
        (with_terms(GAUSSIANS, points=(-3.0, 0.0, 5.0), num_points=3), r"'a' has a universe that is not"),
    ],
)
def test_systems_without_such_genes_are_refused(system, message):
    with pytest.raises(ValueError, match=message):
        SystemEncoding((system,), BOUNDS)


def test_systems_and_genomes_of_another_structure_are_refused():
    encoding = SystemEncoding(PAPER, BOUNDS)
    gap = (replace(PAPER[0], rules=PAPER[0].rules[1:]), *PAPER[1:])
    for use, wrong, sentence in (
        (encoding.encode, PAPER[:2], "have 100 tunable numbers, this encoding has 150; encode systems"),
        (encoding.encode, gap, "'force_x' is not a full rule table; it has no genome"),
        (encoding.decode, np.zeros(149), r"genomes have shape \(149,\) each, this encoding has 150"),
        (encoding.pack, np.zeros((2, 151)), r"genomes have shape \(151,\) each, this encoding has 150"),
    ):
        with pytest.raises(ValueError, match=sentence):
            use(wrong)


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({"mean_window": 1.0}, "mean_window is 1.0; choose a fraction between 0 and 1"),
        ({"mean_window": float("nan")}, "mean_window is nan"),
        ({"standard_deviation": (0.0, 0.3)}, r"standard_deviation is \[0.0, 0.3\]; give a positive lower"),
        ({"output_reach": (0.3, 0.01)}, r"output_reach is \[0.3, 0.01\]; give a positive lower and a"),
        ({"output_reach": (0.3, float("inf"))}, r"output_reach is \[0.3, inf\]"),
    ],
)
def test_bounds_between_which_there_is_nothing_are_refused(bounds, message):
    with pytest.raises(ValueError, match=message):
        Bounds(**bounds)
