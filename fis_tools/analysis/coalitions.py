"""Coalitions of rules: how much each counts in the shares of the players, and what the system answers there.

Rules that cut terms of their own, which no others cut, are a block; the ways of the
blocks are combined. Many samples have the same structure: what follows from it is worked out once.
`Subsets` asks the compiled kernel for many coalitions of many samples, where it covers the system.
"""

import math
from collections.abc import Hashable, Iterator, Sequence
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from fis_tools.array_types import Booleans, Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import width_of
from fis_tools.engines.kernel import conclude, make_scratch
from fis_tools.engines.packing import Packed
from fis_tools.model import FuzzySystem
from fis_tools.model.operators import Operator

#: Places of terms, and how high a rule cuts each, or with what weight.
Cuts = list[tuple[int, float]]

#: To which state of its terms each player of a block leads, from each state that those before it can reach.
Leads = tuple[tuple[int, ...], ...]


class Block(NamedTuple):
    """Players that cut terms which no others cut, strongest first, and the ways in which they can cut them.

    Attributes
    ----------
    players : list of int
    after : Leads
        State 0 is the terms uncut. A state that nobody led to before has the next number.
    """

    players: list[int]
    after: Leads


def blocks(activations: Sequence[Cuts], accumulate: Operator | None, most: int) -> list[Block] | None:
    """Return how players cut terms, given how high each cuts which; None if in more than `most` ways."""
    joined: list[tuple[set[int], list[int]]] = []
    for player, cuts in enumerate(activations):
        terms, players = {term for term, _ in cuts}, [player]
        for others in [others for others in joined if others[0] & terms]:
            joined.remove(others)
            terms, players = terms | others[0], players + others[1]
        joined.append((terms, players))
    found: list[Block] = []
    room = most
    for _, players in joined:
        # where the highest cut counts, such blocks differ in nothing but their number of players
        players.sort(key=lambda player: -max(height for _, height in activations[player]))
        after = _after(players, activations, accumulate, room)
        if after is None:
            return None
        found.append(Block(players, after))
        room //= _num_states(after)
    return found


def _after(
    players: list[int], activations: Sequence[Cuts], accumulate: Operator | None, most: int
) -> Leads | None:
    """Return where the players of a block lead; None if they can cut its terms in more ways than `most`."""
    places: dict[Hashable, int] = {frozenset(): 0}
    states: list[tuple[dict[int, float], list[int]]] = [({}, [])]
    after: list[tuple[int, ...]] = []
    for player in players:
        leads = []
        for cuts, members in list(states):
            joined, joint = dict(cuts), [*members, player]
            for term, height in activations[player]:
                before = np.array(joined.get(term, 0.0))
                joined[term] = float(accumulate(np.array(height), before)) if accumulate else height
            key = frozenset(joined.items() if accumulate else joint)
            if key not in places:
                places[key] = len(states)
                states.append((joined, joint))
            leads.append(places[key])
        if len(states) > most:
            return None
        after.append(tuple(leads))
    return tuple(after)


@cache
def by_level(levels: tuple[int, ...]) -> Leads:
    """Return where players lead that cut one term, of which the highest cut counts.

    Their levels count from 1, the highest; those at one level bring about the same.
    """
    met = [0, *levels]
    return tuple((level, *range(1, before + 1)) for before, level in zip(met, levels, strict=False))


def _num_states(after: Leads) -> int:
    return 1 + max(map(max, after))


def num_coalitions(structure: tuple[Leads, ...]) -> int:
    """Return in how many ways the players of all blocks can cut their terms."""
    return math.prod(map(_num_states, structure))


def _members(after: Leads) -> Booleans:
    """Return players of a block that bring about each of its states, (num_states, num_players)."""
    states: list[list[int]] = [[]]
    for player, leads in enumerate(after):
        for before, state in enumerate(leads):
            if state == len(states):
                states.append([*states[before], player])
    table = np.zeros((len(states), len(after)), dtype=np.bool_)
    for state, players in enumerate(states):
        table[state, players] = True
    return table


@lru_cache(maxsize=256)
def weighted_coalitions(structure: tuple[Leads, ...]) -> tuple[Booleans, Floats]:
    """Return coalitions that cut the terms in all ways, and how much each counts in the players' shares.

    The share of a player is the integral over p of what it adds to a coalition that each other joins with
    probability p: a polynomial in p of a degree below the number of players.

    Returns
    -------
    members : (n, num_players)
        Players block by block.
    weights : (num_players, n)
        Shares are these times what the coalitions are worth.
    """
    tables = [_members(after) for after in structure]
    shape, num_players = [len(table) for table in tables], sum(map(len, structure))
    chances, integral = quadrature(num_players)
    spread = [_spread(after, chances) for after in structure]
    members, weights = np.zeros((*shape, num_players), np.bool_), np.zeros((num_players, *shape))
    first = 0
    for axis, (after, table) in enumerate(zip(structure, tables, strict=True)):
        along = [len(table) if other == axis else 1 for other in range(len(shape))]
        members[..., first : first + len(after)] = table.reshape(*along, len(after))
        others: Floats = integral
        for other, probable in enumerate(spread):
            chosen = np.ones((1, len(chances))) if other == axis else probable
            others = others[..., np.newaxis, :] * chosen
        for player, gain in enumerate(_gains(after, chances), first):
            weights[player] = (others * gain.reshape(*along, -1)).sum(axis=-1)
        first += len(after)
    return members.reshape(-1, num_players), weights.reshape(num_players, -1)


def quadrature(num_players: int) -> tuple[Floats, Floats]:
    """Return the chances and weights that integrate the shares of so many players, or fewer, exactly."""
    nodes, weights = np.polynomial.legendre.leggauss((num_players + 1) // 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def _spread(after: Leads, chances: Floats, sure: int = -1, joins: float = 0.0) -> Floats:
    """Return how probable each state is, (num_states, num_chances), if each player joins with a chance.

    The player at the place `sure` joins with the probability `joins` instead.
    """
    found = np.zeros((_num_states(after), len(chances)))
    found[0] = 1.0
    for place, leads in enumerate(after):
        joined = (joins if place == sure else chances) * found[: len(leads)]
        found[: len(leads)] -= joined
        np.add.at(found, np.array(leads), joined)
    return found


def _gains(after: Leads, chances: Floats) -> Iterator[Floats]:
    """Yield for each player by how much it makes each state more probable."""
    for place in range(len(after)):
        yield _spread(after, chances, place, 1.0) - _spread(after, chances, place, 0.0)


class Subsets:
    """Some samples of a packed system, in which rules fire always, or only as members of a subset.

    Parameters
    ----------
    system : FuzzySystem
    packed : Packed
        The same.
    firing : (n, num_rules)
        How strongly each rule fires, if it does.
    plays : (n, num_rules) bool
        Which rules may be left out; the others always fire.
    """

    def __init__(self, system: FuzzySystem, packed: Packed, firing: Floats, plays: Booleans):
        (output,) = system.outputs
        self._packed = packed
        self._firing = firing
        self._terms = np.array([output.term_index(rule.consequents[0].term) for rule in system.rules])
        always = np.where(plays, 0.0, firing)
        heights = [
            always[:, self._terms == term].max(axis=1, initial=0.0) for term in range(len(output.terms))
        ]
        self._always = np.stack(heights, axis=1)
        self._scratch = make_scratch()

    def conclude(self, samples: Integers, rules: Integers, members: Booleans) -> Floats:
        """Return outputs, (g, s), of some samples, (g,), for subsets, (s, k), of their rules, (g, k)."""
        out = np.empty((len(members), len(samples)))
        packed, strengths = self._packed, self._firing[samples[:, np.newaxis], rules]
        given = (self._always[samples], self._terms[rules], strengths, members)
        _conclude_subsets(packed.values[0], packed.rules[0], packed.layout, *given, self._scratch, out)
        return out.T


@compiled(nogil=True, error_model="numpy")
def _conclude_subsets(
    values: Floats,
    rules: Integers,
    layout: Any,
    always: Floats,
    terms: Integers,
    strengths: Floats,
    members: Booleans,
    scratch: Any,
    out: Floats,
) -> None:
    system, room = layout[0], scratch[0]
    num_samples, num_players = terms.shape
    joined, num_joined = np.empty(num_players, np.int64), 0
    subset, sample = -1, num_samples - 1
    # one subset for samples side by side, where that is possible: what all leave out costs little
    for first in range(0, out.size, width_of(room)):
        num_lanes = min(width_of(room), out.size - first)
        for lane in range(num_lanes):
            sample += 1
            if sample == num_samples:
                sample, subset, num_joined = 0, subset + 1, 0
                for player in range(num_players):
                    if members[subset, player]:
                        joined[num_joined] = player
                        num_joined += 1
            for term in range(system.output_terms):
                room.cuts[term, lane] = always[sample, term]
            for place in range(num_joined):
                term = terms[sample, joined[place]]
                room.cuts[term, lane] = max(room.cuts[term, lane], strengths[sample, joined[place]])
        conclude(values, rules, system, room)
        for lane in range(num_lanes):
            out.flat[first + lane] = room.output[lane]
