"""Which columns of a table rules ask for."""

from collections.abc import Sequence

import numpy as np

from fis_tools.learning import consequents
from fis_tools.learning.columns import Column
from fis_tools.learning.consequents import Kind
from fis_tools.learning.partition import even
from fis_tools.typing import Floats


def chosen_columns(
    columns: Sequence[Column], rows: Floats, targets: Floats, *, terms: int, most: int, kind: Kind
) -> list[int]:
    """Choose columns one after the other, each time the one that lowers the expected error most.

    Parameters
    ----------
    columns : sequence of Column
    rows : (n, num_columns)
    targets : (n, num_targets)
    terms, most : int
        Terms of each column, and how many are chosen at most.
    kind : {"constants", "linear", "shares"}
        What rules would conclude; see `fis_tools.learning.consequents.fit`, whose error is taken.

    Returns
    -------
    list of int
        Their places, in the order of the table; one at least, even if none lowers the error.
    """
    partitions = [even(column.low, column.high, terms) for column in columns]
    waiting = [place for place in range(len(columns)) if np.ptp(rows[:, place]) > 0.0] or [0]
    chosen: list[int] = []
    lowest = np.inf
    while waiting and len(chosen) < most:
        scores = []
        for place in waiting:
            tried = [*chosen, place]
            fit = consequents.fit([partitions[p] for p in tried], rows[:, tried], targets, kind)
            scores.append(fit.score)
        best = int(np.argmin(scores))
        if chosen and not scores[best] < lowest:
            break
        lowest = scores[best]
        chosen.append(waiting.pop(best))
    return sorted(chosen)
