"""Hedges (very, somewhat, …) of other programs: each becomes a term of its own, made from the one it changes.

fuzzylite has formulas by name; MATLAB and Octave raise memberships to powers.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fis_tools.formats.exchange.antecedents import mentions
from fis_tools.model import Rule, Sampled, Term, Variable
from fis_tools.model.membership import sample

Floats = NDArray[np.float64]
Hedge = Callable[[Floats], Floats]

#: fuzzylite's, as in its version 6.
FUZZYLITES: Mapping[str, Hedge] = {
    "any": np.ones_like,
    "extremely": lambda m: np.where(m <= 0.5, 2.0 * m * m, 1.0 - 2.0 * (1.0 - m) ** 2),
    "not": lambda m: 1.0 - m,
    "seldom": lambda m: np.where(m <= 0.5, np.sqrt(0.5 * m), 1.0 - np.sqrt(0.5 * (1.0 - m))),
    "somewhat": np.sqrt,
    "very": np.square,
}
#: MATLAB's and Octave's; a tenth of the power stands behind the number of a term.
POWERS: Mapping[str, Hedge] = {
    "somewhat": np.sqrt,
    "very": np.square,
    "extremely": lambda m: m**3,
    "very very": lambda m: m**4,
}
FRACTIONS = {0.05: "somewhat", 0.2: "very", 0.3: "extremely", 0.4: "very very"}


def with_hedged_terms(
    variables: Iterable[Variable], rules: Sequence[Rule], hedges: Mapping[str, Hedge]
) -> tuple[Variable, ...]:
    """Give variables the terms that rules speak of with hedges before them, such as ``very low``."""
    spoken = dict.fromkeys(statement for rule in rules for statement in mentions(rule))
    found = []
    for variable in variables:
        known = {term.name: term for term in variable.terms}
        asked = [name for owner, name in spoken if owner == variable.name and name not in known]
        hedged = (_hedged(variable, name, known, hedges) for name in asked)
        terms = (*variable.terms, *(term for term in hedged if term is not None))
        found.append(replace(variable, terms=terms))
    return tuple(found)


def _hedged(
    variable: Variable, name: str, known: Mapping[str, Term], hedges: Mapping[str, Hedge]
) -> Term | None:
    """Make the term of a name that consists of hedges and a term; None if it does not."""
    words = name.split(" ")
    hedge_words = words if words[-1] == "any" else words[:-1]
    if words[-1] not in known and words[-1] != "any":
        return None
    degrees = np.ones(variable.num_points) if words[-1] == "any" else sample(variable, known[words[-1]])
    whole = " ".join(hedge_words)
    for word in [whole] if whole in hedges else hedge_words[::-1]:
        if word not in hedges:
            return None
        degrees = hedges[word](degrees)
    return Term(name, Sampled(tuple(degrees.tolist())))
