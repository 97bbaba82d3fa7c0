"""The share of each rule in an output: Shapley values, which add up to the output's way from silence.

The players of the game are the rules that fire at `fis_tools.analysis.arrays.FIRED` or more; if none does,
the strongest. A coalition is worth what the system answers where only its rules fire, and those too weak to
play; the empty one is worth the output's default. So a rule at the edge of its terms has no share, though
alone it would lead to the middle of its consequent however weakly it fired.

Source: L. S. Shapley, A value for n-person games, 1953; as an integral over coalitions that each player joins
independently: G. Owen, Multilinear extensions of games, Management Science 18 (1972) 64-79.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis.arrays import FIRED
from fis_tools.analysis.weighing import weighed_shares
from fis_tools.engines.compiler import CompiledSystem
from fis_tools.engines.program import Weighing
from fis_tools.model.operators import ACCUMULATIONS, Operator

Floats = NDArray[np.float64]
#: What coalitions are worth, (n,), from which rules are in them, (n, num_players).
Worth = Callable[[NDArray[np.bool_]], Floats]

#: Places of terms, and how high a rule cuts each, or with what weight.
_Cuts = list[tuple[int, float]]

#: More distinct coalitions than this are sampled.
MOST_COALITIONS = 4096
#: Orders in which rules join, drawn where coalitions are sampled; every second is the one before it reversed.
NUM_ORDERS = 200
SEED = 12
#: So many where shares are averaged over samples as well.
FEW_ORDERS = 10
#: The most samples over which shares are averaged; they are picked evenly.
MOST_SAMPLES = 1000


class Shares(NamedTuple):
    """The shares of the rules in the outputs.

    Attributes
    ----------
    values : (n, num_rules, num_outputs)
        In units of the outputs; their sum over the rules is the output less its default.
    error : (n, num_outputs)
        The largest standard error of these values; 0 where they are exact.
    """

    values: Floats
    error: Floats


#: To which state of its terms each player of a block leads, from each state that those before it can reach.
_Leads = tuple[tuple[int, ...], ...]


class _Block(NamedTuple):
    """Players that cut terms which no others cut, strongest first, and the ways in which they can cut them.

    Attributes
    ----------
    players : list of int
    after : _Leads
        State 0 is the terms uncut. A state that nobody led to before has the next number.
    """

    players: list[int]
    after: _Leads


def shares(compiled: CompiledSystem, inputs: Floats, num_orders: int = NUM_ORDERS) -> Shares:
    """Compute the share of each rule in each output.

    They are exact where rules can cut the output's terms in `MOST_COALITIONS` ways or fewer, as dozens of
    rules do under a maximum, and where the output is weighed; else means over some orders of joining, which
    add up as well.

    Parameters
    ----------
    compiled : CompiledSystem
        Made by `fis_tools.engines.compiler.compile`.
    inputs : (n, num_inputs)
        One row per sample.
    num_orders : int
        How many orders are drawn where coalitions are too many; an even number.
    """
    firing = compiled.firing_strengths(inputs)
    outputs = compiled.system.outputs
    values = np.zeros((*firing.shape, len(outputs)))
    error = np.zeros((len(firing), len(outputs)))
    for place, conclusion in enumerate(compiled.program.conclusions):
        if isinstance(conclusion, Weighing):
            values[:, :, place] = weighed_shares(compiled.program, conclusion, firing, np.asarray(inputs))
            continue
        conclusions = _conclusions(compiled, place)
        for sample, strengths in enumerate(firing):
            found = _of_one(compiled, place, conclusions, strengths, num_orders)
            values[sample, :, place], error[sample, place] = found
    return Shares(values, error)


def _conclusions(compiled: CompiledSystem, place: int) -> list[_Cuts]:
    """Return for each rule with what weights it concludes on the terms of an output."""
    output = compiled.system.outputs[place]
    return [
        [
            (output.term_index(c.term), c.weight)
            for c in rule.consequents
            if c.variable == output.name and c.weight
        ]
        for rule in compiled.system.rules
    ]


def _of_one(
    compiled: CompiledSystem, place: int, conclusions: list[_Cuts], strengths: Floats, num_orders: int
) -> tuple[Floats, float]:
    output = compiled.system.outputs[place]
    concludes = np.array([bool(weights) for weights in conclusions])
    strongest = strengths[concludes].max(initial=0.0)
    plays = concludes & (strengths >= min(FIRED, strongest)) & (strengths > 0.0)
    rules = np.flatnonzero(plays)
    values = np.zeros(len(strengths))
    if not len(rules):
        return values, 0.0

    def worth(members: NDArray[np.bool_]) -> Floats:
        rows = np.tile(np.where(plays, 0.0, strengths), (len(members), 1))
        rows[:, rules] = members * strengths[rules]
        return np.where(members.any(axis=1), compiled.conclude(rows)[:, place], output.default or 0.0)

    activations = [[(term, weight * strengths[rule]) for term, weight in conclusions[rule]] for rule in rules]
    # a silent rule makes a product zero, and where rules add up each counts: there it matters who is silent,
    # and not only how the others cut
    by_player = output.accumulation == "product" or output.aggregation != "max"
    accumulate = None if by_player else ACCUMULATIONS[output.accumulation]
    blocks = _blocks(activations, accumulate)
    if blocks is None:
        values[rules], error = sampled(len(rules), worth, num_orders)
        return values, error
    blocks.sort(key=lambda block: block.after)  # so that those of other samples are often met again
    order = [player for block in blocks for player in block.players]
    members, weights = _weights(tuple(block.after for block in blocks))
    values[rules[order]] = weights @ worth(members[:, np.argsort(order)])
    return values, 0.0


def _blocks(activations: Sequence[_Cuts], accumulate: Operator | None) -> list[_Block] | None:
    """Return how the players cut the terms; None if there are too many ways."""
    joined: list[tuple[set[int], list[int]]] = []
    for player, cuts in enumerate(activations):
        terms, players = {term for term, _ in cuts}, [player]
        for others in [others for others in joined if others[0] & terms]:
            joined.remove(others)
            terms, players = terms | others[0], players + others[1]
        joined.append((terms, players))
    found: list[_Block] = []
    room = MOST_COALITIONS
    for _, players in joined:
        # where the highest cut counts, such blocks differ in nothing but their number of players
        players.sort(key=lambda player: -max(height for _, height in activations[player]))
        after = _after(players, activations, accumulate, room)
        if after is None:
            return None
        found.append(_Block(players, after))
        room //= _num_states(after)
    return found


def _after(
    players: list[int], activations: Sequence[_Cuts], accumulate: Operator | None, most: int
) -> _Leads | None:
    """Return where the players of a block lead; None if they can cut its terms in more ways than `most`."""
    heights = [activations[player][0][1] for player in players if len(activations[player]) == 1]
    is_of_one_term = accumulate is ACCUMULATIONS["max"] and len(heights) == len(players) < most
    if is_of_one_term and all(higher > lower for higher, lower in pairwise(heights)):
        return _after_one_another(len(players))
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
def _after_one_another(num_players: int) -> _Leads:
    """Return where players lead that cut one term, each lower than those before: the highest counts."""
    return tuple((player + 1, *range(1, player + 1)) for player in range(num_players))


def _num_states(after: _Leads) -> int:
    return 1 + max(map(max, after))


def _members(after: _Leads) -> NDArray[np.bool_]:
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
def _weights(structure: tuple[_Leads, ...]) -> tuple[NDArray[np.bool_], Floats]:
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


def _spread(after: _Leads, chances: Floats, sure: int = -1, joins: float = 0.0) -> Floats:
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


def _gains(after: _Leads, chances: Floats) -> Iterator[Floats]:
    """Yield for each player by how much it makes each state more probable."""
    for place in range(len(after)):
        yield _spread(after, chances, place, 1.0) - _spread(after, chances, place, 0.0)


def importance(compiled: CompiledSystem, inputs: Floats) -> Floats:
    """Compute how far each rule moves each output over some samples, at least one.

    Returns
    -------
    (num_rules, num_outputs)
        The mean size of its shares, in parts of the output's range; of many samples `MOST_SAMPLES` are taken.
    """
    some = inputs[:: -(-len(inputs) // MOST_SAMPLES)]
    ranges = np.array([variable.maximum - variable.minimum for variable in compiled.system.outputs])
    moved: Floats = np.abs(shares(compiled, some, FEW_ORDERS).values).mean(axis=0) / ranges
    return moved


def sampled(num_players: int, worth: Worth, num_orders: int) -> tuple[Floats, float]:
    """Return the mean of what each player adds when it joins, over some orders, and the largest error.

    Orders are drawn by a linear congruential generator of 32 bits, so that the review page draws the same.
    The standard error is estimated from pairs of an order and its reverse.
    """
    state = SEED
    added = np.zeros((num_orders, num_players))
    order = list(range(num_players))
    for number in range(num_orders):
        if number % 2:
            order.reverse()
        else:
            for last in range(num_players - 1, 0, -1):
                state = (1664525 * state + 1013904223) % 2**32
                chosen = state * (last + 1) // 2**32
                order[last], order[chosen] = order[chosen], order[last]
        members = np.zeros((num_players + 1, num_players), dtype=np.bool_)
        for size, player in enumerate(order):
            members[size + 1 :, player] = True
        added[number, order] = np.diff(worth(members))
    pairs = added.reshape(-1, 2, num_players).mean(axis=1)
    return added.mean(axis=0), float((pairs.std(axis=0, ddof=1) / np.sqrt(len(pairs))).max())
