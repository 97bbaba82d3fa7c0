"""What a system answers where only some of its rules fire: many samples, and many subsets of the rules.

For systems that `fis_tools.engines.kernel` covers, whose rules each cut one term of the output.
"""

from typing import Any

import numpy as np

from fis_tools.array_types import Booleans, Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import width_of
from fis_tools.engines.kernel import conclude, make_scratch
from fis_tools.engines.packing import Packed
from fis_tools.model import FuzzySystem


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
        _conclude_subsets(
            self._packed.values[0],
            self._packed.rules[0],
            self._packed.layout,
            self._always[samples],
            self._terms[rules],
            self._firing[samples[:, np.newaxis], rules],
            members,
            self._scratch,
            out,
        )
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
