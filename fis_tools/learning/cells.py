"""The combinations of terms that a table's rows belong to: each becomes a rule."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fis_tools.model import And, Expression, Is, Variable
from fis_tools.typing import Floats

Places = NDArray[np.int64]


def strongest(memberships: Sequence[Floats]) -> Places:
    """Return the term that each row belongs to most of each input, (n, num_inputs); of equals the lower.

    Parameters
    ----------
    memberships : sequence of (n, num_terms)
        Of each input.
    """
    return np.stack([degrees.argmax(axis=1) for degrees in memberships], axis=1)


def held(memberships: Sequence[Floats]) -> Places:
    """Return the combinations that some row belongs to most, (rules, num_inputs), the last input fastest."""
    return np.unique(strongest(memberships), axis=0)


def firing(memberships: Sequence[Floats], cells: Places) -> Floats:
    """Return how far each row belongs to each combination, by the product: (n, rules)."""
    strengths = memberships[0][:, cells[:, 0]]
    for degrees, terms in zip(memberships[1:], cells.T[1:], strict=True):
        strengths = strengths * degrees[:, terms]
    return strengths


def antecedent(inputs: Sequence[Variable], cell: Places) -> Expression:
    """Return what a combination says, as a rule does."""
    said = tuple(Is(v.name, v.terms[int(term)].name) for v, term in zip(inputs, cell, strict=True))
    return said[0] if len(said) == 1 else And(said)
