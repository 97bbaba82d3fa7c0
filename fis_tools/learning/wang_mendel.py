"""Mamdani rules from a table, by Wang and Mendel.

L.-X. Wang and J. M. Mendel, *Generating fuzzy rules by learning from examples*, IEEE Transactions on Systems,
Man, and Cybernetics 22 (1992): each row of the table gives the rule whose terms it belongs to most, of the
degree that is the product of its memberships. Of rules that contradict one another the paper keeps the one of
the highest degree, which one row decides. L.-X. Wang, *The WM method completed*, IEEE Transactions on Fuzzy
Systems 11 (2003), takes the mean of the rows instead, each weighed by its degree; noise then averages out.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.learning.partition import Partition, antecedent, strongest
from fis_tools.model import Consequent, FuzzySystem, Rule, Variable

Conflicts = Literal["mean", "strongest"]


def wang_mendel(
    name: str,
    inputs: Sequence[tuple[Variable, Partition]],
    output: tuple[Variable, Partition],
    rows: Floats,
    targets: Floats,
    conflicts: Conflicts = "mean",
) -> FuzzySystem:
    """Make the rules that the rows of a table ask for.

    Parameters
    ----------
    name : str
        What the system is called.
    inputs : sequence of (Variable, Partition)
        What rules ask for, and where its peaks are.
    output : (Variable, Partition)
        What they conclude.
    rows : (n, num_inputs)
    targets : (n,)
    conflicts : {"mean", "strongest"}
        What rules of the same antecedent come to: that of 2003 or that of 1992.

    Returns
    -------
    FuzzySystem
        A rule for each combination of terms that some row belongs to most, in the order of a rule table.
    """
    memberships = [partition.memberships(x) for (_, partition), x in zip(inputs, rows.T, strict=True)]
    cells, owner = np.unique(strongest(memberships), axis=0, return_inverse=True)
    owner = owner.ravel()
    degrees = np.prod([m.max(axis=1) for m in memberships], axis=0)
    concluded = output[1].memberships(targets)
    if conflicts == "strongest":
        degrees = degrees * concluded.max(axis=1)
        order = np.argsort(degrees, kind="stable")
        chosen = np.empty(len(cells), dtype=np.int64)
        chosen[owner[order]] = order  # what is assigned last stays
        words = concluded[chosen].argmax(axis=1)
    else:
        means = np.bincount(owner, degrees * targets) / np.bincount(owner, degrees)
        words = output[1].memberships(means).argmax(axis=1)
    variables = tuple(variable for variable, _ in inputs)
    rules = tuple(
        Rule(antecedent(variables, cell), (Consequent(output[0].name, output[0].terms[word].name),))
        for cell, word in zip(cells, words, strict=True)
    )
    return FuzzySystem(name, variables, (output[0],), rules)
