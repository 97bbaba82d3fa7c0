"""The tours of fleets: each deputy in turn answers the others' with its cheapest, until nobody changes.

All tours are closed paths around the chief (`pipeline.flight.fly.tours`). What a deputy's is worth depends on
which the others follow, since they share what is to be seen.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats, Integers

#: flies q fleets, given by their indices, (q,), by the tours of their deputies, (q, D); returns costs, (q,)
FlyAhead = Callable[[Integers, Integers], Floats]


class FleetTours(NamedTuple):
    """The tours that the deputies of m fleets follow, and the costs by which they were chosen."""

    # (m, D, tours) m/s, of the whole fleet: if a deputy follows a tour, and the others those that they follow
    costs: Floats
    followed: Integers  # (m, D) of each deputy the cheapest, the first of equals


#: answers begin at so many tours that all deputies follow, the cheapest
NUM_FIRST = 4


def answers_in_turn(num_fleets: int, deputies: int, num_tours: int, fly: FlyAhead) -> FleetTours:
    """Return which tours deputies follow: at first all the same, then each its best answer in turn.

    An answer makes its fleet cheaper, or as cheap by an earlier tour, so the answers end: at tours of which
    no deputy alone has a better one. Of the ends from several first tours the cheapest is taken.
    """
    known: dict[tuple[int, ...], float] = {}

    def costs_of(fleets: Integers, tours: Integers) -> Floats:
        """Return what fleets, (q,), cost by tours, (q, D), flying those that did not fly so before."""
        keys = list(map(tuple, np.column_stack([fleets, tours]).tolist()))
        if new := [key for key in dict.fromkeys(keys) if key not in known]:
            rows = np.array(new)
            known.update(zip(new, fly(rows[:, 0], rows[:, 1:]).tolist(), strict=True))
        return np.array([known[key] for key in keys])

    def compared(fleets: Integers, tours: Integers, deputy: int) -> Floats:
        """Return what fleets, (q,), cost by each tour of a deputy, beside the others' tours, (q, tours)."""
        tried = np.tile(tours, (num_tours, 1, 1))
        tried[:, :, deputy] = np.arange(num_tours)[:, np.newaxis]
        costs = costs_of(np.tile(fleets, num_tours), tried.reshape(-1, deputies))
        return np.ascontiguousarray(costs.reshape(num_tours, -1).T)

    each, every = np.arange(num_fleets), np.arange(num_tours)
    same = np.repeat(every, num_fleets)[:, np.newaxis].repeat(deputies, axis=1)
    alike = costs_of(np.tile(each, num_tours), same)
    firsts = np.argsort(alike.reshape(num_tours, -1).T, axis=1, kind="stable")[:, :NUM_FIRST]
    fleets = np.repeat(each, firsts.shape[1])
    followed = np.repeat(firsts.reshape(-1, 1), deputies, axis=1)
    costs, waiting = np.empty((len(fleets), deputies, num_tours)), np.arange(len(fleets))
    while len(waiting):
        before = followed[waiting]
        for deputy in range(deputies):
            costs[waiting, deputy] = compared(fleets[waiting], followed[waiting], deputy)
            followed[waiting, deputy] = costs[waiting, deputy].argmin(axis=1)
        waiting = waiting[(followed[waiting] != before).any(axis=1)]
    ends = costs_of(fleets, followed).reshape(num_fleets, -1).argmin(axis=1)
    rows = each * firsts.shape[1] + ends
    return FleetTours(costs[rows], followed[rows])
