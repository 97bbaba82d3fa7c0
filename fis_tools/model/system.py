"""The fuzzy nouns: what a fuzzy inference system is made of, as frozen and comparable data.

Nothing here computes an inference; `fis_tools.engines.kernel` and `fis_tools.scikit_fuzzy.build` do.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Defuzzifier = Literal["centroid", "bisector", "mom", "som", "lom"]
AndOperator = Literal[
    "min",
    "product",
    "bounded_difference",
    "einstein_product",
    "hamacher_product",
    "drastic_product",
    "nilpotent_minimum",
]
OrOperator = Literal[
    "max",
    "probabilistic_sum",
    "bounded_sum",
    "einstein_sum",
    "hamacher_sum",
    "drastic_sum",
    "nilpotent_maximum",
]
Accumulation = Literal[OrOperator, "product"]


@dataclass(frozen=True, slots=True)
class Gaussian:
    """``exp(-(x - mean)^2 / (2 standard_deviation^2))``, in units of the variable."""

    mean: float
    standard_deviation: float


@dataclass(frozen=True, slots=True)
class Triangular:
    """Zero at `left` and `right`, one at `peak`."""

    left: float
    peak: float
    right: float


@dataclass(frozen=True, slots=True)
class Trapezoidal:
    """Zero at `left` and `right`, one from `left_top` to `right_top`."""

    left: float
    left_top: float
    right_top: float
    right: float


@dataclass(frozen=True, slots=True)
class TwoSidedGaussian:
    """A Gaussian up to `left_mean`, one from there to `right_mean`, another Gaussian beyond."""

    left_mean: float
    left_standard_deviation: float
    right_mean: float
    right_standard_deviation: float


@dataclass(frozen=True, slots=True)
class GeneralizedBell:
    """``1 / (1 + |(x - centre) / width|^(2 slope))``: one half at `width` from the `centre`."""

    width: float
    slope: float
    centre: float


@dataclass(frozen=True, slots=True)
class Sigmoid:
    """``1 / (1 + exp(-slope (x - inflection)))``: 1/2 at the `inflection`; a negative `slope` falls."""

    inflection: float
    slope: float


@dataclass(frozen=True, slots=True)
class SigmoidDifference:
    """The first sigmoid less the second, each as in `Sigmoid`; the first must be the higher one."""

    first_inflection: float
    first_slope: float
    second_inflection: float
    second_slope: float


@dataclass(frozen=True, slots=True)
class SigmoidProduct:
    """The product of two sigmoids, each as in `Sigmoid`."""

    first_inflection: float
    first_slope: float
    second_inflection: float
    second_slope: float


@dataclass(frozen=True, slots=True)
class SShape:
    """Two parabolas that rise from zero at `foot` over one half in the middle to one at `top`."""

    foot: float
    top: float


@dataclass(frozen=True, slots=True)
class ZShape:
    """Two parabolas that fall from one at `top` over one half in the middle to zero at `foot`."""

    top: float
    foot: float


@dataclass(frozen=True, slots=True)
class PiShape:
    """An S from `left` to `left_top`, one to `right_top`, a Z from there to `right`."""

    left: float
    left_top: float
    right_top: float
    right: float


@dataclass(frozen=True, slots=True)
class Sampled:
    """Any shape: one membership value in [0, 1] for each point of the variable's universe."""

    values: tuple[float, ...]


MembershipFunction = (
    Gaussian
    | Triangular
    | Trapezoidal
    | TwoSidedGaussian
    | GeneralizedBell
    | Sigmoid
    | SigmoidDifference
    | SigmoidProduct
    | SShape
    | ZShape
    | PiShape
    | Sampled
)


@dataclass(frozen=True, slots=True)
class Term:
    """A word and what it means: the membership function of a linguistic value."""

    name: str
    membership: MembershipFunction


@dataclass(frozen=True)
class Variable:
    """A linguistic variable over a universe of discourse.

    Parameters
    ----------
    name : str
        What the variable is called in rules.
    unit : str
        The unit of its values; empty where it has none.
    minimum, maximum : float
        The ends of the universe, in `unit`.
    terms : tuple of Term
        From the lowest to the highest.
    num_points : int
        Points of the universe, evenly spaced from `minimum` to `maximum`.
    points : tuple of float, optional
        The universe itself, where it is not evenly spaced; `num_points` is then its length.
    default : float, optional
        For an output: the value when no rule fires.
    description : str
        What the variable means, in a sentence.
    defuzzifier : str, optional
        For an output: how it becomes a number; None for the way of its system.
    accumulation : str
        For an output: how the strengths of several rules that conclude one term become the height it is cut
        at, one rule after the other. Different terms always combine by their maximum.
    """

    name: str
    unit: str
    minimum: float
    maximum: float
    terms: tuple[Term, ...]
    num_points: int = 101
    points: tuple[float, ...] | None = None
    default: float | None = None
    description: str = ""
    defuzzifier: Defuzzifier | None = None
    accumulation: Accumulation = "max"

    @cached_property
    def universe(self) -> NDArray[np.float64]:
        """The points on which membership functions are sampled, ascending, shape (num_points,)."""
        if self.points is not None:
            return np.array(self.points, dtype=np.float64)
        return np.linspace(self.minimum, self.maximum, self.num_points)

    def term_index(self, name: str) -> int:
        """Return the position of the term called `name`.

        Raises
        ------
        KeyError
            If there is none.
        """
        for index, term in enumerate(self.terms):
            if term.name == name:
                return index
        known = ", ".join(term.name for term in self.terms)
        raise KeyError(f"variable {self.name!r} has no term {name!r}; its terms are {known}")


@dataclass(frozen=True, slots=True)
class Is:
    """The statement ``variable is term``."""

    variable: str
    term: str


@dataclass(frozen=True, slots=True)
class Not:
    """The complement of a statement."""

    operand: "Expression"


@dataclass(frozen=True, slots=True)
class And:
    """The conjunction of statements, combined from left to right."""

    operands: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Or:
    """The disjunction of statements, combined from left to right."""

    operands: tuple["Expression", ...]


Expression = Is | Not | And | Or


@dataclass(frozen=True, slots=True)
class Consequent:
    """What a rule concludes: ``variable is term``, its strength multiplied by `weight`."""

    variable: str
    term: str
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Rule:
    """If `antecedent` then all of `consequents`.

    A rule has operators of its own where it departs from its system.
    """

    antecedent: Expression
    consequents: tuple[Consequent, ...]
    label: str = ""
    and_operator: AndOperator | None = None
    or_operator: OrOperator | None = None

    @property
    def has_own_operators(self) -> bool:
        """Whether it says itself how its statements combine."""
        return self.and_operator is not None or self.or_operator is not None


@dataclass(frozen=True)
class FuzzySystem:
    """A Mamdani fuzzy inference system.

    Parameters
    ----------
    name : str
        What the system is called.
    inputs, outputs : tuple of Variable
        In the order in which values are passed and returned.
    rules : tuple of Rule
        In the order in which firing strengths are reported.
    and_operator, or_operator : str
        How statements combine, in rules that do not say it themselves.
    defuzzifier : str
        How an aggregated output becomes a number, by scikit-fuzzy's names, unless it says so itself.
    """

    name: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    and_operator: AndOperator = "min"
    or_operator: OrOperator = "max"
    defuzzifier: Defuzzifier = "centroid"

    def variable(self, name: str) -> Variable:
        """Return the input or output called `name`.

        Raises
        ------
        KeyError
            If there is none.
        """
        for variable in (*self.inputs, *self.outputs):
            if variable.name == name:
                return variable
        known = ", ".join(v.name for v in (*self.inputs, *self.outputs))
        raise KeyError(f"system {self.name!r} has no variable {name!r}; its variables are {known}")

    def and_operator_of(self, rule: Rule) -> AndOperator:
        """Return how `and` combines in one of its rules."""
        return rule.and_operator or self.and_operator

    def or_operator_of(self, rule: Rule) -> OrOperator:
        """Return how `or` combines in one of its rules."""
        return rule.or_operator or self.or_operator

    def defuzzifier_of(self, output: Variable) -> Defuzzifier:
        """Return how one of its outputs becomes a number."""
        return output.defuzzifier or self.defuzzifier


@dataclass(frozen=True)
class FuzzyController:
    """Fuzzy systems that belong together, with what their user needs to know besides.

    Parameters
    ----------
    name : str
        What the controller is called.
    systems : tuple of FuzzySystem
        In the order in which they are shown.
    attributes : tuple of (str, str)
        Facts for whoever flies the controller; they are carried along unread, sorted by key.
    provenance : tuple of (str, str)
        Where the controller comes from; carried along unread, sorted by key.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    attributes: tuple[tuple[str, str], ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()


def table_antecedents(inputs: Sequence[Variable]) -> Iterator[Expression]:
    """Yield the antecedent of every cell of a full rule table, the last input changing fastest."""
    for terms in product(*(variable.terms for variable in inputs)):
        statements = tuple(Is(v.name, t.name) for v, t in zip(inputs, terms, strict=True))
        yield statements[0] if len(statements) == 1 else And(statements)


def table_rules(inputs: Sequence[Variable], output: Variable, consequents: Sequence[str]) -> tuple[Rule, ...]:
    """Build a full rule table.

    Parameters
    ----------
    inputs : sequence of Variable
        The table's axes.
    output : Variable
        What the rules conclude on.
    consequents : sequence of str
        The output term of each cell, the last input changing fastest.

    Raises
    ------
    ValueError
        If the number of consequents is not the number of cells.
    """
    num_cells = prod(len(variable.terms) for variable in inputs)
    if num_cells != len(consequents):
        raise ValueError(
            f"a full table over {len(inputs)} inputs has {num_cells} rules, but {len(consequents)} "
            "consequents are given; give one output term for each combination of input terms"
        )
    return tuple(
        Rule(antecedent, (Consequent(output.name, term),))
        for antecedent, term in zip(table_antecedents(inputs), consequents, strict=True)
    )


def rule_table(system: FuzzySystem) -> NDArray[np.int64] | None:
    """Return the consequents of a full rule table as output term indices, or None for any other rule base.

    A full table has one output, one rule for each combination of input terms, in the order of
    `table_antecedents`, each of weight one and without operators of its own.

    Returns
    -------
    array or None
        Shape (number of cells,), the last input changing fastest.
    """
    if len(system.outputs) != 1:
        return None
    output = system.outputs[0]
    if prod(len(variable.terms) for variable in system.inputs) != len(system.rules):
        return None
    table = np.empty(len(system.rules), dtype=np.int64)
    cells = table_antecedents(system.inputs)
    term_indices = {term.name: index for index, term in enumerate(output.terms)}
    for index, (cell, rule) in enumerate(zip(cells, system.rules, strict=True)):
        if rule.antecedent != cell or len(rule.consequents) != 1 or rule.has_own_operators:
            return None
        consequent = rule.consequents[0]
        if consequent.variable != output.name or consequent.weight != 1.0:
            return None
        table[index] = term_indices[consequent.term]
    return table


def table_cells(inputs: Sequence[Variable]) -> NDArray[np.int64]:
    """Return the cells of a full table as input term indices, (cells, inputs), the last input fastest."""
    counts = [len(variable.terms) for variable in inputs]
    return np.indices(counts, dtype=np.int64).reshape(len(counts), -1).T.copy()


def conjunctions(system: FuzzySystem) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return the rules of a system as numbers where each is a plain conjunction, or None.

    Such a rule base has one output, and each rule asks for at most one term of each input, concludes one
    term with weight one and has no operators of its own. A full rule table is one, a table with cells missing
    too.

    Returns
    -------
    cells : (rules, inputs) int
        The term that a rule asks for of each input; -1 where it asks for none.
    consequents : (rules,) int
        The output term that it concludes.
    """
    if len(system.outputs) != 1:
        return None
    places = {variable.name: place for place, variable in enumerate(system.inputs)}
    cells = np.full((len(system.rules), len(system.inputs)), -1, dtype=np.int64)
    consequents = np.empty(len(system.rules), dtype=np.int64)
    for index, rule in enumerate(system.rules):
        statements = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
        for statement in statements:
            if not isinstance(statement, Is) or cells[index, places[statement.variable]] != -1:
                return None
            place = places[statement.variable]
            cells[index, place] = system.inputs[place].term_index(statement.term)
        consequent = rule.consequents[0]
        if len(rule.consequents) != 1 or consequent.weight != 1.0 or rule.has_own_operators:
            return None
        consequents[index] = system.outputs[0].term_index(consequent.term)
    return cells, consequents
