"""Rules ranked by importance, for every format that lists them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fis_tools.model import FuzzySystem, Rule
from fis_tools.typing import Floats


@dataclass(frozen=True)
class RankedRule:
    """A rule with its place.

    Parameters
    ----------
    number : int
        From 1, in the order of the system, as in every listing.
    rule : Rule
    importance : float or None
        How far it moves an output on average, as a share of the output's range; None if not asked for.
    """

    number: int
    rule: Rule
    importance: float | None

    @property
    def importance_words(self) -> str:
        """The importance in percent."""
        if self.importance is None:
            return ""
        words = f"{100 * self.importance:.2f}"
        return "< 0.01 %" if words == "0.00" and self.importance > 0 else f"{words} %"


def ranked(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> list[RankedRule]:
    """Return the rules of a system, the most important first; in their own order without `importance`.

    Parameters
    ----------
    system : FuzzySystem
    importance : mapping of str to (num_rules,) or (num_rules, num_outputs), optional
        By the system's name, such as `fis_tools.analysis.contribution.importance` returns; of several outputs
        the one on which the rule has the largest effect counts. A system that is missing keeps its order.

    Raises
    ------
    ValueError
        If there are not as many numbers as rules.
    """
    given = None if importance is None else importance.get(system.name)
    if given is None:
        return [RankedRule(number, rule, None) for number, rule in enumerate(system.rules, start=1)]
    shares = np.asarray(given, dtype=np.float64)
    if shares.ndim not in (1, 2) or len(shares) != len(system.rules):
        raise ValueError(
            f"importance of {system.name!r} has shape {shares.shape}; give one number for each of its "
            f"{len(system.rules)} rules"
        )
    shares = shares if shares.ndim == 1 else shares.max(axis=1)
    order = np.argsort(-shares, kind="stable")
    return [RankedRule(int(place) + 1, system.rules[place], float(shares[place])) for place in order]
