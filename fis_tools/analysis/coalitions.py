"""Coalitions of rules: the ways in which those that fire can cut an output's terms, and the ways' weights.

Rules that cut terms which no others cut are a block; the ways of the blocks are combined.
"""

import math
from collections.abc import Hashable, Iterator, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from fis_tools.analysis.quadrature import quadrature
from fis_tools.array_types import Booleans, Floats
from fis_tools.model.operators import Operator

#: Indices of the terms that a rule cuts, each with the height of the cut or the rule's weight.
Cuts = list[tuple[int, float]]
#: For each player of a block, the state after it joins, from each state that earlier players reach.
Leads = tuple[tuple[int, ...], ...]


class PlayerBlock(NamedTuple):
    """Rules that cut terms which no others cut, strongest first, and the ways in which they can.

    Attributes
    ----------
    players : list of int
    after : Leads
        State 0 is the terms uncut. A state that nobody led to before has the next number.
    """

    players: list[int]
    after: Leads


def blocks(activations: Sequence[Cuts], accumulate: Operator | None, most: int) -> list[PlayerBlock] | None:
    """Divide players into blocks that share no term; None if all can cut terms in more than `most` ways."""
    joined: list[tuple[set[int], list[int]]] = []
    for player, cuts in enumerate(activations):
        terms, players = {term for term, _ in cuts}, [player]
        for others in [others for others in joined if others[0] & terms]:
            joined.remove(others)
            terms, players = terms | others[0], players + others[1]
        joined.append((terms, players))
    separate: list[PlayerBlock] = []
    room = most
    for _, players in joined:
        # where the highest cut counts, sorted blocks differ in their number of players only
        players.sort(key=lambda player: -max(height for _, height in activations[player]))
        after = _after(players, activations, accumulate, room)
        if after is None:
            return None
        separate.append(PlayerBlock(players, after))
        room //= _num_states(after)
    return separate


def _after(
    players: list[int], activations: Sequence[Cuts], accumulate: Operator | None, most: int
) -> Leads | None:
    """Return each player's transitions: the state to which it leads from every state before it."""
    state_of: dict[Hashable, int] = {frozenset(): 0}
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
            if key not in state_of:
                state_of[key] = len(states)
                states.append((joined, joint))
            leads.append(state_of[key])
        if len(states) > most:
            return None
        after.append(tuple(leads))
    return tuple(after)


@cache
def by_level(levels: tuple[int, ...]) -> Leads:
    """Return the transitions of players that all cut the same term, where only the highest cut counts.

    Their levels count from 1, the highest; those at one level bring about the same.
    """
    previous = [0, *levels]
    return tuple((level, *range(1, before + 1)) for before, level in zip(previous, levels, strict=False))


def _num_states(after: Leads) -> int:
    """Return the number of states that transitions lead to."""
    return 1 + max(map(max, after))


def num_coalitions(structure: tuple[Leads, ...]) -> int:
    """Return in how many ways the players of all blocks can cut their terms."""
    return math.prod(map(_num_states, structure))


def _members(after: Leads) -> Booleans:
    """Return for each state players that bring it about, (num_states, num_players)."""
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
    """Return coalitions that cut the terms in all possible ways, and their weights in the players' shares.

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


def _spread(after: Leads, chances: Floats, fixed_player: int = -1, fixed_chance: float = 0.0) -> Floats:
    """Return the probability of each state, (num_states, num_chances), if every player joins with a chance.

    The player with the index `fixed_player` joins with the probability `fixed_chance` instead.
    """
    probabilities = np.zeros((_num_states(after), len(chances)))
    probabilities[0] = 1.0
    for player, leads in enumerate(after):
        joined = (fixed_chance if player == fixed_player else chances) * probabilities[: len(leads)]
        probabilities[: len(leads)] -= joined
        np.add.at(probabilities, np.array(leads), joined)
    return probabilities


def _gains(after: Leads, chances: Floats) -> Iterator[Floats]:
    """Yield for each player how much more probable its joining makes each state."""
    for player in range(len(after)):
        yield _spread(after, chances, player, 1.0) - _spread(after, chances, player, 0.0)
