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


class Answers(NamedTuple):
    """The tours that the deputies of m fleets follow, and the costs by which they were chosen."""

    # (m, D, tours) m/s, of the whole fleet: if a deputy follows a tour, and the others those that they follow
    costs: Floats
    followed: Integers  # (m, D) of each deputy the cheapest, the first of equals


def answers_in_turn(num_fleets: int, deputies: int, num_tours: int, fly: FlyAhead) -> Answers:
    """Return which tours deputies follow: all the same, the cheapest, and from there each its best answer.

    An answer makes its fleet cheaper, or as cheap by an earlier tour, so the answers end: at tours of which
    no deputy alone has a better one.
    """
    known: dict[tuple[int, ...], float] = {}

    def costs_of(fleets: Integers, tours: Integers) -> Floats:
        """Return what fleets cost, flying those that did not fly by these tours before."""
        keys = list(map(tuple, np.column_stack([fleets, tours]).tolist()))
        if new := [key for key in dict.fromkeys(keys) if key not in known]:
            rows = np.array(new)
            known.update(zip(new, fly(rows[:, 0], rows[:, 1:]).tolist(), strict=True))
        return np.array([known[key] for key in keys])

    def compared(fleets: Integers, tours: Integers) -> Floats:
        """Return what each fleet costs by each of some tours, (fleets, tours), from (tours, fleets, D)."""
        flat = tours.reshape(-1, deputies)
        return costs_of(np.tile(fleets, len(tours)), flat).reshape(len(tours), -1).T

    waiting = np.arange(num_fleets)
    alike = np.broadcast_to(np.arange(num_tours)[:, np.newaxis, np.newaxis], (num_tours, num_fleets, deputies))
    cheapest = compared(waiting, alike).argmin(axis=1)
    followed = np.repeat(cheapest[:, np.newaxis], deputies, axis=1)
    costs = np.empty((num_fleets, deputies, num_tours))
    while len(waiting):
        before = followed[waiting]
        for deputy in range(deputies):
            tours = np.repeat(followed[np.newaxis, waiting], num_tours, axis=0)
            tours[:, :, deputy] = np.arange(num_tours)[:, np.newaxis]
            costs[waiting, deputy] = compared(waiting, tours)
            followed[waiting, deputy] = costs[waiting, deputy].argmin(axis=1)
        waiting = waiting[(followed[waiting] != before).any(axis=1)]
    return Answers(costs, followed)
