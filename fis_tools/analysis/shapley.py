"""The share of each rule in an output: Shapley values, which add up to the output's way from silence.

The players of the game are the rules that fire at `fis_tools.analysis.arrays.FIRED` or more; if none does,
the strongest. A coalition is worth what the system answers where only its rules fire, and those too weak to
play; the empty one is worth the output's default. What a formula concludes from other outputs is taken as it
is with all rules. So a rule at the edge of its terms has no share, though
alone it would lead to the middle of its consequent however weakly it fired.

Rules that cut terms of their own, which no others cut, are a block; the ways of the
blocks are combined. Many samples have the same structure: what follows from it is worked out once.
`by_kernel` asks the compiled kernel for many coalitions of many samples, where it covers the system.

Source: L. S. Shapley, A value for n-person games, 1953; as an integral over coalitions that each player joins
independently: G. Owen, Multilinear extensions of games, Management Science 18 (1972) 64-79.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fis_tools.analysis.arrays import FIRED
from fis_tools.analysis.coalitions import Cuts, Leads, blocks, by_level, num_coalitions, weighted_coalitions
from fis_tools.analysis.weighted_shares import weighted_shares
from fis_tools.array_types import Booleans, Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import width_of
from fis_tools.engines.codes import UNBOUNDED_SUM
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.engines.kernel import conclude, make_scratch
from fis_tools.engines.packing import Packed
from fis_tools.engines.program import IntervalOutput, Weighing
from fis_tools.model import FuzzySystem, Rule
from fis_tools.model.operators import ACCUMULATIONS

#: From samples, (g,), rules, (g, k), and subsets of these rules, (s, k), to outputs, (g, s).
Concluding = Callable[[Integers, Integers, Booleans], Floats]


def by_kernel(system: FuzzySystem, packed: Packed, firing: Floats, plays: Booleans) -> Concluding:
    """Return a function that infers from subsets of the rules of a packed system.

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
    (output,) = system.outputs
    term_of = np.array([output.term_index(rule.consequents[0].term) for rule in system.rules])
    left = np.where(plays, 0.0, firing)
    heights = [left[:, term_of == term].max(axis=1, initial=0.0) for term in range(len(output.terms))]
    always, scratch = np.stack(heights, axis=1), make_scratch()
    arrays = (packed.values[0], packed.rules[0], packed.layout)

    def concluding(samples: Integers, rules: Integers, members: Booleans) -> Floats:
        """Return the outputs, (samples, subsets), of subsets of rules, see `Concluding`."""
        out = np.empty((len(members), len(samples)))
        players = (always[samples], term_of[rules], firing[samples[:, np.newaxis], rules])
        conclude_subsets(arrays, players, members, scratch, out)
        return out.T

    return concluding


def _by_program(
    compiled: CompiledSystem, output: int, firing: Floats, plays: Booleans, inputs: Floats
) -> Concluding:
    """Return a function that infers one output of any system from subsets of its rules.

    Of interval type-2 systems `firing` has the lower strengths of all rules, then the upper ones.
    """
    num_rules, asks = plays.shape[1], compiled.program.asks_for_inputs
    inferring, may_leave, always = compiled, [*range(num_rules)], list[int]()
    if asks and len(compiled.system.outputs) > 1:
        system, may_leave, always = _apart(compiled.system, output)
        inferring = compile(system)
    columns = np.zeros(num_rules, np.int64)
    columns[may_leave] = np.arange(len(may_leave))
    strengths = firing.reshape(len(firing), firing.shape[1] // max(1, num_rules), num_rules)
    silent = np.where(plays[:, np.newaxis], 0.0, strengths)
    left = np.concatenate((silent[:, :, may_leave], strengths[:, :, always]), axis=2)

    def concluding(samples: Integers, rules: Integers, members: Booleans) -> Floats:
        """Return the outputs, (samples, subsets), of subsets of rules, see `Concluding`."""
        rows = np.repeat(left[samples, np.newaxis], len(members), axis=1)
        for half in range(rows.shape[2]):
            joined = members * strengths[samples[:, np.newaxis], half, rules][:, np.newaxis]
            np.put_along_axis(rows[:, :, half], columns[rules][:, np.newaxis], joined, axis=2)
        given = np.repeat(inputs[samples], len(members), axis=0) if asks else None
        concluded = inferring.conclude(rows.reshape(-1, rows.shape[2] * rows.shape[3]), given)
        return concluded[:, output].reshape(rows.shape[:2])

    return concluding


def _apart(system: FuzzySystem, output: int) -> tuple[FuzzySystem, list[int], list[int]]:
    """Return a system whose rules conclude on an output or on others, and from which rules these come.

    The rules on the output come first. So they can be silent there alone, where formulas ask for the others.
    """
    name, rules, sources = system.outputs[output].name, list[Rule](), (list[int](), list[int]())
    for is_other, come in enumerate(sources):
        for index, rule in enumerate(system.rules):
            kept = tuple(each for each in rule.consequents if (each.variable != name) == is_other)
            if kept:
                rules.append(replace(rule, consequents=kept))
                come.append(index)
    return replace(system, rules=tuple(rules)), *sources


@compiled(nogil=True, error_model="numpy")
def conclude_subsets(packed: Any, players: Any, members: Booleans, scratch: Any, out: Floats) -> None:
    """Write what the first system of a pack answers where only some of its players fire, (c, n).

    Parameters
    ----------
    packed : values, rules and layout
    players : (n, num_terms), (n, k), (n, k)
        How high each term is cut whoever fires, and of the players the terms and strengths.
    members : (c, k)
    scratch : working space of `make_scratch`
    out : (c, n)
    """
    (values, rules, layout), (always, terms, strengths) = packed, players
    system, work = layout[0], scratch[0]
    num_samples, num_players = terms.shape
    joined, num_joined = np.empty(num_players, np.int64), 0
    subset, sample = -1, num_samples - 1
    # neighbouring lanes have the same subset where possible: a rule that no lane has costs little
    for first in range(0, out.size, width_of(work)):
        num_lanes = min(width_of(work), out.size - first)
        for lane in range(num_lanes):
            sample += 1
            if sample == num_samples:
                sample, subset, num_joined = 0, subset + 1, 0
                for player in range(num_players):
                    if members[subset, player]:
                        joined[num_joined] = player
                        num_joined += 1
            for term in range(system.output_terms):
                work.cuts[term, lane] = always[sample, term]
            for index in range(num_joined):
                term = terms[sample, joined[index]]
                work.cuts[term, lane] = max(work.cuts[term, lane], strengths[sample, joined[index]])
        conclude(values, rules, system, work)
        for lane in range(num_lanes):
            out.flat[first + lane] = work.output[lane]


#: What coalitions are worth, (n,), from which rules are in them, (n, num_players).
Worth = Callable[[Booleans], Floats]
#: More distinct coalitions than this are sampled.
MOST_COALITIONS = 4096
#: Orders in which rules join, drawn where coalitions are sampled; every second is the one before it reversed.
NUM_ORDERS = 200
SEED = 12
#: So many where shares are averaged over samples as well.
FEW_ORDERS = 10
#: The most samples over which shares are averaged; they are picked evenly.
MOST_SAMPLES = 1000
#: So many firing strengths of coalitions are concluded from at a time.
MOST_NUMBERS = 2_000_000


class RuleShares(NamedTuple):
    """The share of each rule in each output.

    Attributes
    ----------
    values : (n, num_rules, num_outputs)
        In units of the outputs; their sum over the rules is the output less its default.
    error : (n, num_outputs)
        The largest standard error of these values; 0 where they are exact.
    """

    values: Floats
    error: Floats


class _Match(NamedTuple):
    """Samples of one output: the conclusions of each rule, how strongly it fires, and whether it plays.

    Attributes
    ----------
    compiled : CompiledSystem
    output_index : int
    conclusions : list of Cuts
    firing, plays : (n, num_rules)
    concluding : Concluding
    """

    compiled: CompiledSystem
    output_index: int
    conclusions: list[Cuts]
    firing: Floats
    plays: Booleans
    concluding: Concluding


class _Game(NamedTuple):
    """Samples whose players, which may be other rules in each, cut terms in the same ways.

    Attributes
    ----------
    structure : tuple of Leads, or None
        Of the blocks; None if there are too many ways.
    samples : (g,)
    rules : (g, num_players)
        The players, block by block.
    """

    structure: tuple[Leads, ...] | None
    samples: Integers
    rules: Integers


def shares(
    compiled: CompiledSystem, inputs: Floats, num_orders: int = NUM_ORDERS, firing: Floats | None = None
) -> RuleShares:
    """Compute the share of each rule in each output.

    They are exact where rules can cut the output's terms in `MOST_COALITIONS` ways or fewer, as dozens of
    rules do under a maximum, and where the output is weighted; else means over some orders of joining, which
    add up as well.

    Parameters
    ----------
    compiled : CompiledSystem
        Made by `fis_tools.engines.compiler.compile`.
    inputs : (n, num_inputs)
        One row per sample.
    num_orders : int
        How many orders are drawn where coalitions are too many; an even number.
    firing : (n, num_rules), optional
        The firing strengths at these inputs, if they are known, as `CompiledSystem.firing_strengths` returns.
    """
    if firing is None:
        firing = compiled.firing_strengths(inputs)
    count = len(compiled.system.rules)
    values = np.zeros((len(firing), count, len(compiled.system.outputs)))
    error = np.zeros((len(firing), values.shape[2]))
    for index, conclusion in enumerate(compiled.program.conclusions):
        match = _match(compiled, index, firing, np.asarray(inputs))
        # where rules that conclude one number join their strengths, a rule's part depends on the others
        if isinstance(conclusion, Weighing) and conclusion.accumulation == UNBOUNDED_SUM:
            values[:, :, index] = weighted_shares(
                compiled.program, conclusion, firing, match.plays, np.asarray(inputs)
            )
            continue
        for game in _games(match):
            if game.structure is None:
                worth = partial(_one_worth, match, game)
                values_of_players, error[game.samples, index] = sampled(
                    game.rules.shape[1], worth, num_orders
                )
            else:
                values_of_players = _exact(match, game)
            values[game.samples[:, np.newaxis], game.rules, index] = values_of_players
    return RuleShares(values, error)


def _match(compiled: CompiledSystem, index: int, both: Floats, inputs: Floats) -> _Match:
    """Return the data of the games for one output: which rules play at each sample, and a way to infer."""
    firing = both[:, -len(compiled.system.rules) :]
    variable = compiled.system.outputs[index]
    conclusions: list[Cuts] = [[] for _ in compiled.system.rules]
    for rule, c in compiled.system.conclusions_on(variable):
        if c.weight:
            conclusions[rule].append((variable.term_index(c.term), c.weight))
    concludes = np.array([bool(weights) for weights in conclusions])
    strongest = firing.max(axis=1, keepdims=True, initial=0.0, where=concludes)
    plays = concludes & (firing >= np.minimum(FIRED, strongest)) & (firing > 0.0)
    concluding = _by_program(compiled, index, both, plays, inputs)
    if compiled.packed is not None:
        concluding = by_kernel(compiled.system, compiled.packed, firing, plays)
    return _Match(compiled, index, conclusions, firing, plays, concluding)


def _games(match: _Match) -> Iterator[_Game]:
    """Yield the games of all samples at which a rule plays."""
    output = match.compiled.system.outputs[match.output_index]
    # a silent rule makes a product zero, and where rules add up each counts: there it matters who is silent,
    # and not only how the others cut
    by_player = output.accumulation == "product" or output.aggregation != "max"
    by_player |= isinstance(match.compiled.program.conclusions[match.output_index], IntervalOutput)
    accumulate = None if by_player else ACCUMULATIONS[output.accumulation]
    left: Booleans = np.asarray(match.plays.any(axis=1))
    if accumulate is ACCUMULATIONS["max"] and all(len(cuts) <= 1 for cuts in match.conclusions):
        for game in _games_by_level(match):
            left[game.samples] = False
            yield game
    for sample in np.flatnonzero(left):
        rules, strengths = np.flatnonzero(match.plays[sample]), match.firing[sample]
        cuts = [
            [(term, weight * strengths[rule]) for term, weight in match.conclusions[rule]] for rule in rules
        ]
        player_blocks = blocks(cuts, accumulate, MOST_COALITIONS)
        if player_blocks is None:
            yield _Game(None, np.array([sample]), rules[np.newaxis])
            continue
        player_blocks.sort(
            key=lambda block: block.after
        )  # so that those of other samples are often met again
        order = [player for block in player_blocks for player in block.players]
        yield _Game(
            tuple(block.after for block in player_blocks), np.array([sample]), rules[order][np.newaxis]
        )


def _games_by_level(match: _Match) -> Iterator[_Game]:
    """Yield games of samples in which each rule cuts one term: one game for all of equal structure.

    What `blocks` finds for them is known: of each term the highest cut counts, and rules that cut it at the
    same height, as those that share their weakest statement do, bring about the same.
    """
    terms, weights = np.array([cuts[0] if cuts else (0, 0.0) for cuts in match.conclusions]).T
    term_of = terms.astype(np.int64)
    num_terms = len(match.compiled.system.outputs[match.output_index].terms)
    sample, rule = np.nonzero(match.plays)
    counts = np.bincount(num_terms * sample + term_of[rule], minlength=num_terms * len(match.plays))
    counts = counts.reshape(-1, num_terms)
    # blocks with fewer players first, so that structures are met again
    rank = np.argsort(np.argsort(counts, axis=1, kind="stable"), axis=1)
    block, heights = rank[sample, term_of[rule]], (match.firing * weights)[sample, rule]
    # complex numbers are in order of their real, then their imaginary parts; `lexsort` takes much longer
    keys = np.empty(len(rule), np.complex128)
    keys.real, keys.imag = num_terms * sample + block, -heights
    order = np.argsort(keys, kind="stable")
    rule, block, keys = rule[order], block[order], keys[order]
    is_lower = np.ones(len(rule), np.bool_)
    is_lower[1:] = keys[1:] != keys[:-1]
    # twice the block of each rule, plus one where a level begins
    pattern = (2 * block + is_lower).tobytes()
    ends = np.cumsum(np.count_nonzero(match.plays, axis=1))
    met: dict[bytes, list[int]] = defaultdict(list)
    for number, (start, end) in enumerate(pairwise([0, *(block.itemsize * ends).tolist()])):
        if end > start:
            met[pattern[start:end]].append(number)
    for key, numbers in met.items():
        structure, num_players = _structure(key)
        if num_coalitions(structure) <= MOST_COALITIONS:
            samples = np.array(numbers)
            columns = ends[samples, np.newaxis] + np.arange(-num_players, 0)
            yield _Game(structure, samples, rule[columns])


@lru_cache(maxsize=256)
def _structure(pattern: bytes) -> tuple[tuple[Leads, ...], int]:
    """Return where players lead, block by block, and their number; see `pattern` in `_games_by_level`."""
    block, begins = np.divmod(np.frombuffer(pattern, np.int64), 2)
    levels = [np.cumsum(begins[block == number]).tolist() for number in np.unique(block)]
    return tuple(by_level(tuple(each)) for each in levels), len(block)


def _exact(match: _Match, game: _Game) -> Floats:
    """Return the shares of the players of a game, (g, num_players)."""
    assert game.structure is not None  # noqa: S101 - any other is sampled
    members, weights = weighted_coalitions(game.structure)
    at_once = max(1, MOST_NUMBERS // (len(members) * match.firing.shape[1]))
    worths = [
        _worth(match, game.samples[first : first + at_once], game.rules[first : first + at_once], members)
        for first in range(0, len(game.samples), at_once)
    ]
    return np.concatenate(worths) @ weights.T


def _one_worth(match: _Match, game: _Game, members: Booleans) -> Floats:
    """Return the outputs of coalitions of a game at one sample, (c,)."""
    return np.asarray(_worth(match, game.samples, game.rules, members)[0])


def _worth(match: _Match, samples: Integers, rules: Integers, members: Booleans) -> Floats:
    """Return the outputs, (g, c), of coalitions, (c, num_players), of rules that play, (g, num_players)."""
    concluded = match.concluding(samples, rules, members)
    default = match.compiled.system.outputs[match.output_index].default
    if default is None:  # also where what rules conclude comes to nothing
        concluded = np.nan_to_num(concluded, nan=0.0, posinf=np.inf, neginf=-np.inf)
    return np.where(members.any(axis=1), concluded, default or 0.0)


def importance(compiled: CompiledSystem, inputs: Floats) -> Floats:
    """Compute how far each rule moves each output over some samples, at least one.

    Returns
    -------
    (num_rules, num_outputs)
        The mean size of its shares, in parts of the output's range; of many samples `MOST_SAMPLES` are taken.
        Samples without an output are left out.
    """
    some = inputs[:: -(-len(inputs) // MOST_SAMPLES)]
    ranges = np.array([variable.span for variable in compiled.system.outputs])
    moved = np.abs(shares(compiled, some, FEW_ORDERS).values)
    is_known = np.isfinite(moved)
    total = np.where(is_known, moved, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(is_known.sum(axis=0), 1) / ranges)


def sampled(num_players: int, worth: Worth, num_orders: int) -> tuple[Floats, float]:
    """Return estimated Shapley values, from random orders of joining, and the largest standard error.

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
