"""What each rule adds to a push, compiled: shares by Shapley for rules that are edited on a page."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fis_tools.analysis.arrays import FIRED
from fis_tools.analysis.coalitions import by_level, weighted_coalitions
from fis_tools.analysis.shapley import conclude_subsets
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import packing
from fis_tools.engines.kernel import fuzzify
from fis_tools.model import FuzzySystem, Term, Triangular
from pipeline.player.arguments import Arguments

#: arguments of `rule_shares`
NAMES = ("values", "rules", "layout", "system", "scratch", "members", "weights", "shares")


@compiled(nogil=True, error_model="numpy")
def rule_shares(
    values: Any, rules: Any, layout: Any, index: int, scratch: Any, members: Any, weights: Any, shares: Any
) -> None:
    """Write what each packed rule of a system adds to its output for the inputs of the first lane.

    Parameters
    ----------
    members, weights : (k + 1, 2**k, k), (k + 1, k, 2**k)
        The coalitions of up to k players, and their weights in the players' shares.
    """
    system, room = layout[index], scratch[0]
    fuzzify(values, system, room)
    terms, bounds = system.output_terms, system.rules + system.output_terms
    slots, num_rules = bounds + terms + 1, rules[bounds + terms]
    strengths, strongest = np.ones(num_rules), 0.0
    for rule in range(num_rules):
        for column in range(system.num_inputs):
            slot = rules[slots + system.num_inputs * rule + column]
            strengths[rule] = min(strengths[rule], room.memberships[slot, 0])
        strongest = max(strongest, strengths[rule])
    always, firing = np.zeros((1, terms)), np.empty((1, num_rules))
    players, term_of, count = np.empty(num_rules, np.int64), np.empty((1, num_rules), np.int64), 0
    for term in range(terms):
        for rule in range(rules[bounds + term], rules[bounds + term + 1]):
            shares[rule] = 0.0
            if strengths[rule] > 0.0 and strengths[rule] >= min(FIRED, strongest):
                players[count], term_of[0, count], firing[0, count] = rule, term, strengths[rule]
                count += 1
            else:
                always[0, term] = max(always[0, term], strengths[rule])
    size = 1 << count
    worth, packed = np.empty((size, 1)), (values, rules, layout[index : index + 1])
    conclude_subsets(
        packed, (always, term_of[:, :count], firing[:, :count]), members[count, :size, :count], scratch, worth
    )
    worth[0] = values[system.output_values + packing.DEFAULT]
    for player in range(count):
        for coalition in range(size):
            shares[players[player]] += weights[count, player, coalition] * worth[coalition, 0]


def games(most: int) -> tuple[Any, Any]:
    """Return the coalitions of up to so many players, and their weights, as `rule_shares` takes them."""
    members, weights = np.zeros((most + 1, 2**most, most), np.bool_), np.zeros((most + 1, most, 2**most))
    for count in range(1, most + 1):
        some_members, some_weights = weighted_coalitions((by_level((1,)),) * count)
        members[count, : 2**count, :count] = some_members
        weights[count, :count, : 2**count] = some_weights
    return members, weights


def most_firing(systems: Sequence[FuzzySystem]) -> int:
    """Return how many rules of a system can fire together, wherever the peaks of its terms are moved."""
    most = 1
    for system in systems:
        overlaps = [
            max(sum(other.left <= shape.left < other.right for other in shapes) for shape in shapes)
            for shapes in ([triangle(term) for term in variable.terms] for variable in system.inputs)
        ]
        most = max(most, math.prod(overlaps))
    return most


def arguments_of_shares(to_fly: Arguments, systems: Sequence[FuzzySystem]) -> Arguments:
    """Return what `rule_shares` takes for the systems of flights, in arrays that the flights share."""
    flights, work = to_fly.named("flights"), to_fly.named("work")
    shares = np.zeros(max(len(system.rules) for system in systems))
    given = flights.values[0, 0], flights.rules[0], flights.law.layout, 0, work.scratch
    return Arguments(NAMES, (*given, *games(most_firing(systems)), shares))


def triangle(term: Term) -> Triangular:
    """Return the shape of a term, which must be a triangle."""
    if not isinstance(term.membership, Triangular):
        raise ValueError(f"term {term.name} is no triangle, which the page cannot change")
    return term.membership
