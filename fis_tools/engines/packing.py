"""Fuzzy systems as numbers in flat arrays, for the compiled kernel: one row per controller.

Supported are one output, unimodal terms on evenly spaced universes, rules that are conjunctions of at
most one term of each input, minimum and maximum, centroid. Anything else is an error.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.vectors import ROW
from fis_tools.model import TOOLS, FuzzySystem, Variable, conjunctions, is_unimodal
from fis_tools.model.validate import validate

Layout = NDArray[np.void]

MAX_INPUTS = 3
MAX_TERMS = 16

#: Index of the membership one, for inputs that a rule does not use: after those of all inputs.
ANY = MAX_INPUTS * MAX_TERMS

#: Positions of one system's numbers. For each input and the output: the numbers of terms and points, and
#: where in a row of values its data begin. Where in a row of values the maxima and minima of the output's
#: terms in each piece of the grid are, and where in a row of rules the order of these terms is (`ranks_of`).
#: Where in a row of rules the peaks of the output's terms begin, followed by the rules.
LAYOUT = np.dtype(
    [
        ("num_inputs", np.int64),
        ("input_terms", np.int64, MAX_INPUTS),
        ("input_points", np.int64, MAX_INPUTS),
        ("input_values", np.int64, MAX_INPUTS),
        ("output_terms", np.int64),
        ("output_points", np.int64),
        ("output_values", np.int64),
        ("pieces", np.int64),
        ("ranks", np.int64),
        ("rules", np.int64),
    ],
    align=True,
)

# The data of an input are these, then its memberships, point by point.
MINIMUM, MAXIMUM, STEP, STEPS_A_UNIT = range(4)
# The data of the output are these, then its memberships term by term, then the same point by point.
CENTRE, WIDTH_OF_STEP, DEFAULT = range(3)
HEADER = 4

#: points per piece of the grid; the same terms are evaluated throughout a piece
PIECE = 8


@dataclass(frozen=True)
class Packed:
    """Fuzzy systems of one controller, or of many controllers of one structure, as arrays.

    Parameters
    ----------
    layout : (F,) records of `LAYOUT`
        Positions of the numbers of each of F systems.
    values : (n, V) float
        One row per controller: universes, sampled memberships, and their bounds in pieces of
        the output's grid.
    rules : (n, R) int
        One row per controller: for each system, the output's terms in the order of these bounds; the peak of
        each output term as an index of the universe, the bounds of each output term's rules, then the rules
        sorted by output term, each as the positions of its memberships in the concatenated input terms.
    """

    layout: Layout
    values: Floats
    rules: Integers


class NotCompilable(ValueError):  # noqa: N818
    """A system that the compiled kernel does not support; the text says why."""


def layout_of(systems: tuple[FuzzySystem, ...]) -> tuple[Layout, int, int]:
    """Return the positions of the numbers of some systems, one after the other.

    Returns
    -------
    layout : (F,) records of `LAYOUT`
    num_values, num_rule_entries : int
        Lengths of a row of `values` and of `rules`.

    Raises
    ------
    NotCompilable
        If the kernel does not support a system.
    """
    layout = np.zeros(len(systems), dtype=LAYOUT).view(np.recarray)
    value, entry = 0, 0
    for row, system in zip(layout, systems, strict=True):
        _require_compilable(system)
        row.num_inputs = len(system.inputs)
        for index, variable in enumerate(system.inputs):
            terms, points = len(variable.terms), variable.num_points
            row.input_terms[index], row.input_points[index], row.input_values[index] = terms, points, value
            value += HEADER + terms * points
        output = system.outputs[0]
        terms, points = len(output.terms), output.num_points
        row.output_terms, row.output_points, row.output_values = terms, points, value
        row.pieces = value + HEADER + 2 * terms * points
        value = int(row.pieces) + 2 * terms * num_pieces(points)
        row.ranks, row.rules = entry, entry + terms * num_pieces(points)
        entry = int(row.rules) + 2 * terms + 1 + len(system.rules) * len(system.inputs)
    return layout, value + ROW, entry


def num_pieces(points: int) -> int:
    """Return the number of pieces of a grid with a number of points."""
    return -(-points // PIECE)


def _require_compilable(system: FuzzySystem) -> None:
    """Raise NotCompilable for a system that the kernel does not cover."""

    def refuse(fact: str) -> None:
        raise NotCompilable(
            f"system {system.name!r} cannot be compiled: {fact}; evaluate it with fis_tools.engines.inference"
        )

    if system.is_sampled:
        refuse(f"it is inferred as {TOOLS[system.semantics].title} does, and the kernel as scikit-fuzzy does")
    if not 1 <= len(system.inputs) <= MAX_INPUTS:
        refuse(f"it has {len(system.inputs)} inputs, 1 to {MAX_INPUTS} are covered")
    if conjunctions(system) is None:
        refuse(
            "its rules are not plain conjunctions that conclude one term of one output with weight 1, "
            "without operators of their own"
        )
    output = system.outputs[0]
    methods = (system.and_operator, system.or_operator, output.accumulation, system.defuzzifier_of(output))
    if methods != ("min", "max", "max", "centroid") or not system.cuts(output):
        refuse("only minimum, maximum and centroid are covered")
    for variable in system.variables:
        if len(variable.terms) > MAX_TERMS:
            refuse(f"{variable.name!r} has {len(variable.terms)} terms, at most {MAX_TERMS} are covered")
        if variable.points is not None:
            refuse(f"the universe of {variable.name!r} is not evenly spaced")


def pack(*systems: FuzzySystem) -> Packed:
    """Return systems as the arrays that the kernel reads, as one controller.

    Raises
    ------
    fis_tools.model.validate.InvalidSystem
        If a system is invalid.
    NotCompilable
        If the kernel does not support one.
    """
    for system in systems:
        validate(system)
    layout, num_values, num_entries = layout_of(systems)
    values = np.zeros((1, num_values))
    rules = np.zeros((1, num_entries), dtype=np.int64)
    for row, system in zip(layout, systems, strict=True):
        for index, variable in enumerate(system.inputs):
            fill_input(values, row, index, *_ends(variable), variable.memberships[np.newaxis])
        output = system.outputs[0]
        for term, sampled in zip(output.terms, output.memberships, strict=True):
            if not is_unimodal(sampled):
                raise NotCompilable(
                    f"system {system.name!r} cannot be compiled: output term {term.name!r} has more than "
                    "one peak; evaluate it with fis_tools.engines.inference"
                )
        default = 0.0 if output.default is None else output.default
        fill_output(values, rules, row, *_ends(output), np.array([default]), output.memberships[np.newaxis])
        rule_base = conjunctions(system)
        assert rule_base is not None  # noqa: S101 - others are rejected by layout_of
        fill_rules(rules, row, rule_base[0], rule_base[1][np.newaxis])
    return Packed(layout, values, rules)


def _ends(variable: Variable) -> tuple[Floats, Floats]:
    return np.array([variable.minimum]), np.array([variable.maximum])


def fill_input(values: Floats, row: Any, index: int, low: Floats, high: Floats, terms: Floats) -> None:
    """Fill in one input of n controllers: ends of shape (n,), memberships of shape (n, terms, points)."""
    num_points, at = int(row.input_points[index]), int(row.input_values[index])
    step = (high - low) / (num_points - 1)
    values[:, at : at + HEADER] = np.stack([low, high, step, 1.0 / step], axis=-1)
    _write(values, at + HEADER, terms.transpose(0, 2, 1))


def fill_output(
    values: Floats, rules: Integers, row: Any, low: Floats, high: Floats, default: Floats, terms: Floats
) -> None:
    """Fill in the output of n controllers: ends and default of shape (n,), memberships (n, terms, points)."""
    num_terms, num_points = int(row.output_terms), int(row.output_points)
    rules[:, row.rules : row.rules + num_terms] = terms.argmax(axis=2)
    ranks, ends = ranks_of(terms)
    _write(rules, int(row.ranks), ranks)
    _write(values, int(row.pieces), ends)
    at = int(row.output_values)
    values[:, at + CENTRE] = 0.5 * (low + high)
    values[:, at + WIDTH_OF_STEP] = (high - low) / (num_points - 1)
    values[:, at + DEFAULT] = default
    _write(values, at + HEADER, terms)
    _write(values, at + HEADER + num_terms * num_points, terms.transpose(0, 2, 1))


def ranks_of(terms: Floats) -> tuple[Integers, Floats]:
    """Order terms, shape (n, terms, points), in each piece of the grid by their maximum there.

    Returns
    -------
    ranks : (n, pieces, terms) int
        The highest first.
    ends : (n, pieces, terms, 2)
        In this order, the maximum and the minimum of each.
    """
    firsts = np.arange(0, terms.shape[2], PIECE)
    most, least = (np.swapaxes(end.reduceat(terms, firsts, axis=2), 1, 2) for end in (np.maximum, np.minimum))
    ranks = np.argsort(-most, axis=2, kind="stable")
    return ranks, np.stack([np.take_along_axis(end, ranks, axis=2) for end in (most, least)], axis=3)


def _write(values: NDArray[Any], at: int, table: NDArray[Any]) -> None:
    """Write a table for each controller, shape (n, ...), into its row."""
    flat = table.reshape(len(table), -1)
    values[:, at : at + flat.shape[1]] = flat


def fill_rules(rules: Integers, row: Any, cells: Integers, consequents: Integers) -> None:
    """Write the rules of n controllers: common cells (rules, inputs), and consequents (n, rules)."""
    num_terms = int(row.output_terms)
    at = int(row.rules) + num_terms
    counts = row.input_terms[: row.num_inputs]
    slots = np.where(cells < 0, ANY, cells + np.cumsum(counts) - counts)
    order = np.argsort(consequents, axis=1, kind="stable")
    bounds = [(consequents < term).sum(axis=1) for term in range(num_terms + 1)]
    rules[:, at : at + num_terms + 1] = np.stack(bounds, axis=1)
    sorted_slots = slots[order].reshape(len(consequents), -1)
    rules[:, at + num_terms + 1 : at + num_terms + 1 + sorted_slots.shape[1]] = sorted_slots
