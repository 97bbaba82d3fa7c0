"""Shapley values of the rules in a weighted output: an average or a sum of the numbers that rules conclude.

A sum adds up by itself. An average of the rules S is ``sum(w z) / sum(w)``, and 1 / W is the integral of
``exp(-t W)`` over t > 0; if each rule joins with probability p, the expectation of the integrand is a product
over the rules. So the share of a rule is an integral over p and t, whatever the number of rules:

* over p it is a polynomial, which Gauss and Legendre's quadrature integrates exactly;
* over the logarithm of t the trapezoidal rule converges exponentially in its step, since the integrand is
  analytic in a strip of half width pi/2 (Trefethen and Weideman, The exponentially convergent trapezoidal
  rule, SIAM Review 56 (2014) 385-458).

As an expectation over p: G. Owen, Multilinear extensions of games, Management Science 18 (1972) 64-79.
"""

from functools import cache
from math import comb

import numpy as np

from fis_tools.analysis.contribution import concluded_numbers
from fis_tools.analysis.quadrature import quadrature
from fis_tools.array_types import Booleans, Floats
from fis_tools.engines.codes import RAISED_WEIGHT, WEIGHTED_SUM
from fis_tools.engines.program import Program, Weighing

#: Step of the trapezoidal rule in the logarithm of t: its error is about ``exp(-pi^2 / STEP)``.
STEP = 0.3
#: Before ``exp(-FAR)``, and after ``FAR`` times the slowest decay, the integrand is below the last digit.
FAR = 38.0
#: Up to so many players all coalitions are enumerated, which is faster.
MOST_ENUMERATED = 10
#: So many numbers are integrated at a time.
MOST_NUMBERS = 2_000_000


def weighted_shares(
    program: Program, weighing: Weighing, firing: Floats, plays: Booleans, inputs: Floats
) -> Floats:
    """Compute the Shapley value of each rule in a weighted output.

    Parameters
    ----------
    program, weighing : Program, Weighing
        A system, and one of its outputs.
    firing : (n, num_rules)
        How far each antecedent holds, before weights.
    plays : (n, num_rules) bool
        Which rules may be left out; the others always fire. The empty coalition is worth the default.
    inputs : (n, num_inputs)

    Returns
    -------
    (n, num_rules)
        In the unit of the output; they add up to the output less its default. What a formula concludes from
        other outputs is taken as it is with all rules.
    """
    strengths = firing[:, weighing.rules] * weighing.weights
    numbers = concluded_numbers(program, weighing, firing, strengths, inputs)
    if weighing.defuzzifier != WEIGHTED_SUM:
        strengths = strengths * RAISED_WEIGHT  # as inference does
    products = np.where(strengths > 0.0, strengths * np.where(strengths > 0.0, numbers, 0.0), 0.0)
    weights, sums = np.zeros(firing.shape), np.zeros(firing.shape)
    for column, rule in enumerate(weighing.rules):
        weights[:, rule] += strengths[:, column]
        sums[:, rule] += products[:, column]
    default = 0.0 if np.isnan(weighing.default) else weighing.default
    plays = plays & (weights > 0.0)  # a faint strength times a weight may be nothing
    counts = np.count_nonzero(plays, axis=1)
    values = np.zeros(firing.shape)
    for count in np.unique(counts[counts > 0]).tolist():
        samples = np.flatnonzero(counts == count)
        players = np.nonzero(plays[samples])[1].reshape(len(samples), count)
        rows = samples[:, np.newaxis]
        fixed = (
            np.where(plays[samples], 0.0, weights[samples]).sum(axis=1),
            np.where(plays[samples], 0.0, sums[samples]).sum(axis=1),
        )
        if weighing.defuzzifier == WEIGHTED_SUM:
            even = (
                fixed[1] - default
            ) / count  # each player's part in going from no rule to those that always fire
            values[rows, players] = sums[rows, players] + even[:, np.newaxis]
        else:
            values[rows, players] = _of_averages(weights[rows, players], sums[rows, players], *fixed, default)
    return values


def _of_averages(
    weights: Floats, sums: Floats, fixed_weight: Floats, fixed_sum: Floats, default: float
) -> Floats:
    """Return the shares of players in a weighted average.

    Parameters
    ----------
    weights, sums : (g, c)
        Of each player: w and w z.
    fixed_weight, fixed_sum : (g,)
        The same of the rules that always fire.
    default : float
        The output without any player.

    Returns
    -------
    (g, c)
    """
    total = weights.sum(axis=1) + fixed_weight
    output = (sums.sum(axis=1) + fixed_sum) / total
    # numbers count from the output and weights from the largest: nothing that is integrated is large
    sums = (sums - weights * output[:, np.newaxis]) / weights.max(axis=1, keepdims=True)
    fixed_sum = (fixed_sum - fixed_weight * output) / weights.max(axis=1)
    fixed_weight = fixed_weight / weights.max(axis=1)
    weights = weights / weights.max(axis=1, keepdims=True)
    num_samples, num_players = weights.shape
    if num_players <= MOST_ENUMERATED:
        members, of_coalitions = coalitions(num_players)
        totals = weights @ members.T + fixed_weight[:, np.newaxis]
        worth = (sums @ members.T + fixed_sum[:, np.newaxis]) / np.where(totals > 0.0, totals, 1.0)
        worth[:, 0] = default - output
        return worth @ of_coalitions.T
    chances, of_chance = quadrature(num_players)
    slowest = np.log(FAR / weights.min())
    logarithms = np.arange(-FAR, slowest + STEP, STEP)
    times, of_time = np.exp(logarithms), STEP * np.exp(logarithms)
    shares = np.empty(weights.shape)
    at_once = max(1, MOST_NUMBERS // (len(chances) * len(times) * num_players))
    for first in range(0, num_samples, at_once):
        part = slice(first, first + at_once)
        # axes: samples, chances, times, players
        decay = np.exp(-times[:, np.newaxis] * weights[part, np.newaxis, np.newaxis, :])
        p = chances[:, np.newaxis, np.newaxis]
        factors = 1.0 - p + p * decay
        product = factors.prod(axis=3, keepdims=True) / factors
        gains = p * sums[part, np.newaxis, np.newaxis, :] * decay / factors
        always = fixed_sum[part, np.newaxis, np.newaxis, np.newaxis]
        others = always + gains.sum(axis=3, keepdims=True) - gains
        joined = decay * product * (others + sums[part, np.newaxis, np.newaxis, :])
        left = product * others - (1.0 - p) ** (num_players - 1) * always
        kept = np.exp(-times * fixed_weight[part, np.newaxis])[:, np.newaxis, :, np.newaxis]
        shares[part] = np.einsum("p,t,sptk->sk", of_chance, of_time, kept * (joined - left), optimize=True)
    # the empty coalition
    return shares + ((output - default) / num_players)[:, np.newaxis]


@cache
def coalitions(num_players: int) -> tuple[Floats, Floats]:
    """Return all coalitions, (2^c, c), the empty one first, and their weights in Shapley's sum, (c, 2^c)."""
    members = (np.arange(2**num_players)[:, np.newaxis] >> np.arange(num_players) & 1).astype(np.float64)
    sizes = members.sum(axis=1).astype(np.int64)
    orders = np.array([comb(num_players - 1, size) for size in range(num_players)], dtype=np.float64)
    joins = 1.0 / (num_players * orders)
    with_player = joins[np.maximum(sizes - 1, 0)]
    without = joins[np.minimum(sizes, num_players - 1)]
    return members, np.where(members.T > 0.0, with_player, -without)
