"""Fuzzy systems, controllers made of them, and rule bases as numbers: rule tables and conjunctions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from fis_tools.array_types import Integers
from fis_tools.model.operators import WEIGHING, AndOperator, Defuzzifier, OrOperator
from fis_tools.model.rules import And, Consequent, Expression, Is, Rule
from fis_tools.model.variables import Variable
from fis_tools.plain_text import plain


@dataclass(frozen=True)
class FuzzySystem:
    """A fuzzy inference system: each output of Mamdani, Takagi-Sugeno or Tsukamoto type.

    A Mamdani output has rules that conclude fuzzy sets, which are aggregated and defuzzified. An output is
    weighted if its defuzzifier is ``weighted_average`` or ``weighted_sum``: each rule then concludes a
    number, weighted by its firing strength. The number is a term itself (Takagi-Sugeno: `Constant`,
    `Linear`), or the point where a term's degree equals the strength (Tsukamoto: a `MonotoneFunction`).

    Parameters
    ----------
    name : str
        The system's name.
    inputs, outputs : tuple of Variable
        In the order in which values are passed and returned.
    rules : tuple of Rule
        In the order in which firing strengths are reported.
    and_operator, or_operator : str
        How statements combine, in rules without their own operators.
    defuzzifier : str
        How an aggregated output becomes a number, by scikit-fuzzy's names, unless the output has its own.
    implication : str
        How a rule's strength shapes the term that it concludes: ``min`` cuts it, ``product`` scales it;
        no effect on weighted outputs.
    """

    name: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    and_operator: AndOperator = "min"
    or_operator: OrOperator = "max"
    defuzzifier: Defuzzifier = "centroid"
    implication: AndOperator = "min"

    def cuts(self, output: Variable) -> bool:
        """Return whether an output's terms are cut and aggregated by the maximum."""
        return self.implication == "min" and output.aggregation == "max" and not self.weighs(output)

    def weighs(self, output: Variable) -> bool:
        """Return whether an output is a weighted average or sum (Takagi-Sugeno or Tsukamoto)."""
        return self.defuzzifier_of(output) in WEIGHING

    @property
    def weighed(self) -> tuple[Variable, ...]:
        """The outputs that are weighted averages or sums."""
        return tuple(output for output in self.outputs if self.weighs(output))

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
    """A set of fuzzy systems, with further data for their user.

    Parameters
    ----------
    name : str
        The controller's name.
    systems : tuple of FuzzySystem
        In the order in which they are shown.
    attributes : tuple of (str, str)
        Facts for the controller's user; passed on without interpretation, sorted by key.
    provenance : tuple of (str, str)
        Origin of the controller; passed on without interpretation, sorted by key.
    purpose : str
        What it is for and how it acts, in sentences for the person who uses it.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    attributes: tuple[tuple[str, str], ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()
    purpose: str = ""

    def __post_init__(self) -> None:
        """Clean the facts."""
        object.__setattr__(self, "attributes", plain(self.attributes))
        object.__setattr__(self, "provenance", plain(self.provenance))


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
        Variable of the conclusions.
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


def rule_table(system: FuzzySystem) -> Integers | None:
    """Return the consequents of a full rule table as output term indices, or None for any other rule base.

    A full table has one output and one rule for each combination of input terms, in the order of
    `table_antecedents`, each with weight one and without its own operators.

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


def table_cells(inputs: Sequence[Variable]) -> Integers:
    """Return the cells of a full table as input term indices, (cells, inputs), the last input fastest."""
    counts = [len(variable.terms) for variable in inputs]
    return np.indices(counts, dtype=np.int64).reshape(len(counts), -1).T.copy()


def conjunctions(system: FuzzySystem) -> tuple[Integers, Integers] | None:
    """Return the rules of a system as numbers if each is a plain conjunction, else None.

    Such a rule base has one output, and each rule uses at most one term of each input, concludes one
    term with weight one and has no operators of its own. Full rule tables are included, as are tables with
    missing cells.

    Returns
    -------
    cells : (rules, inputs) int
        The term of each input that a rule uses; -1 for none.
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
