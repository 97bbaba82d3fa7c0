"""Rule bases as numbers: full rule tables, and plain conjunctions."""

from collections.abc import Iterator, Sequence
from itertools import product
from math import prod

import numpy as np

from fis_tools.array_types import Integers
from fis_tools.model.expressions import And, Expression, Is
from fis_tools.model.systems import Consequent, FuzzySystem, Rule
from fis_tools.model.variables import Variable


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
    if prod(len(variable.terms) for variable in system.inputs) != len(system.rules):
        return None
    cells_of = conjunctions(system)
    cells = table_antecedents(system.inputs)
    is_full = all(rule.antecedent == cell for rule, cell in zip(system.rules, cells, strict=True))
    return None if cells_of is None or not is_full else cells_of[1]


def table_cells(inputs: Sequence[Variable]) -> Integers:
    """Return the cells of a full table as input term indices, (cells, inputs), the last input fastest."""
    counts = [len(variable.terms) for variable in inputs]
    return np.indices(counts, dtype=np.int64).reshape(len(counts), -1).T.copy()


def conjunction(antecedent: Expression) -> dict[str, str] | None:
    """Return the term that an antecedent asks for of each input; None where it is no plain conjunction."""
    statements = antecedent.operands if isinstance(antecedent, And) else (antecedent,)
    terms = {statement.variable: statement.term for statement in statements if isinstance(statement, Is)}
    return terms if len(terms) == len(statements) else None


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
    columns = {variable.name: column for column, variable in enumerate(system.inputs)}
    cells = np.full((len(system.rules), len(system.inputs)), -1, dtype=np.int64)
    consequents = np.empty(len(system.rules), dtype=np.int64)
    for index, rule in enumerate(system.rules):
        terms = conjunction(rule.antecedent)
        if terms is None:
            return None
        for name, term in terms.items():
            cells[index, columns[name]] = system.inputs[columns[name]].term_index(term)
        if len(rule.consequents) != 1 or rule.consequents[0].weight != 1.0 or rule.has_own_operators:
            return None
        consequent = rule.consequents[0]
        consequents[index] = system.outputs[0].term_index(consequent.term)
    return cells, consequents
