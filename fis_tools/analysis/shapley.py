"""The share of each rule in an output: Shapley values, which add up to the output's way from silence.

The players of the game are the rules that fire at `fis_tools.analysis.arrays.FIRED` or more; if none does,
the strongest. A coalition is worth what the system answers where only its rules fire, and those too weak to
play; the empty one is worth the output's default. So a rule at the edge of its terms has no share, though
alone it would lead to the middle of its consequent however weakly it fired.

Source: L. S. Shapley, A value for n-person games, 1953; as an integral over coalitions that each player joins
independently: G. Owen, Multilinear extensions of games, Management Science 18 (1972) 64-79.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis.arrays import FIRED
from fis_tools.engines.compiler import CompiledSystem
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


class _Block(NamedTuple):
    """Terms that no rule joins with others, and how the rules that conclude on them cut them.

    Attributes
    ----------
    players : list of int
    members : (num_states, num_players)
        For each distinct way of cutting the terms, players that do it.
    after : list of (num_states_before,)
        To which state each of the players leads from each that those before it can reach.
    """

    players: list[int]
    members: NDArray[np.bool_]
    after: list[NDArray[np.int64]]


def shares(compiled: CompiledSystem, inputs: Floats, num_orders: int = NUM_ORDERS) -> Shares:
    """Compute the share of each rule in each output.

    They are exact where rules can cut the output's terms in `MOST_COALITIONS` ways or fewer, as dozens of
    rules do under a maximum; else means over some orders of joining, which add up as well.

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
    for place in range(len(outputs)):
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
    # a silent rule makes a product zero: there it matters who is silent, and not only how the others cut
    accumulate = None if output.accumulation == "product" else ACCUMULATIONS[output.accumulation]
    blocks = _blocks(activations, accumulate)
    if blocks is None:
        values[rules], error = sampled(len(rules), worth, num_orders)
        return values, error
    values[rules] = _exact(blocks, len(rules), worth)
    return values, 0.0


def _blocks(activations: Sequence[_Cuts], accumulate: Operator | None) -> list[_Block] | None:
    """Return how the players cut the terms; None if there are too many ways."""
    joined: list[tuple[set[int], list[int]]] = []
    for player, cuts in enumerate(activations):
        terms, players = {term for term, _ in cuts}, [player]
        for others in [others for others in joined if others[0] & terms]:
            joined.remove(others)
            terms, players = terms | others[0], players + others[1]
        joined.append((terms, sorted(players)))
    found: list[_Block] = []
    room = MOST_COALITIONS
    for _, players in joined:
        block = _block(players, activations, accumulate, room)
        if block is None:
            return None
        found.append(block)
        room //= len(block.members)
    return found


def _block(
    players: list[int], activations: Sequence[_Cuts], accumulate: Operator | None, most: int
) -> _Block | None:
    places: dict[Hashable, int] = {frozenset(): 0}
    states: list[tuple[dict[int, float], list[int]]] = [({}, [])]
    after: list[list[int]] = []
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
        after.append(leads)
    table = np.zeros((len(states), len(activations)), dtype=np.bool_)
    for state, (_, members) in enumerate(states):
        table[state, members] = True
    return _Block(players, table, [np.array(leads) for leads in after])


def _exact(blocks: Sequence[_Block], num_players: int, worth: Worth) -> Floats:
    """Integrate over p what each player adds to a coalition that each other joins with probability p.

    The integrand is a polynomial of a degree below the number of players.
    """
    shape = [len(block.members) for block in blocks]
    members = np.zeros((*shape, num_players), dtype=np.bool_)
    for axis, block in enumerate(blocks):
        members |= block.members.reshape([-1 if a == axis else 1 for a in range(len(shape))] + [num_players])
    worths = worth(members.reshape(-1, num_players)).reshape(shape)
    chances, weights = quadrature(num_players)
    spread = [_spread(block, chances) for block in blocks]
    values = np.zeros(num_players)
    for axis, block in enumerate(blocks):
        expected = np.moveaxis(worths, axis, -1)[..., np.newaxis]
        for other, chance in enumerate(spread):
            if other != axis:
                expected = (expected * chance.reshape(len(chance), *[1] * (expected.ndim - 2), -1)).sum(
                    axis=0
                )
        for player, gain in zip(block.players, _gains(block, chances), strict=True):
            values[player] = (gain * expected).sum(axis=0) @ weights
    return values


def quadrature(num_players: int) -> tuple[Floats, Floats]:
    """Return the chances and weights that integrate the shares of so many players, or fewer, exactly."""
    nodes, weights = np.polynomial.legendre.leggauss((num_players + 1) // 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def _spread(block: _Block, chances: Floats, sure: int = -1, joins: float = 0.0) -> Floats:
    """Return how probable each state is, (num_states, num_chances), if each player joins with a chance.

    The player at the place `sure` joins with the probability `joins` instead.
    """
    found = np.zeros((len(block.members), len(chances)))
    found[0] = 1.0
    for place, after in enumerate(block.after):
        joined = (joins if place == sure else chances) * found[: len(after)]
        found[: len(after)] -= joined
        np.add.at(found, after, joined)
    return found


def _gains(block: _Block, chances: Floats) -> Iterator[Floats]:
    """Yield for each player by how much it makes each state more probable; players that cut alike once."""
    known: dict[bytes, Floats] = {}
    for place, after in enumerate(block.after):
        key = after.tobytes()
        if key not in known:
            known[key] = _spread(block, chances, place, 1.0) - _spread(block, chances, place, 0.0)
        yield known[key]


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
