"""The link between the deputies of a fleet: what each tells at a sample, and what the others have heard.

What is told at a sample arrives some control periods later, or not at all. A deputy goes by the last that it
heard. Points that it knows to be seen it tells on, whoever saw them.
"""

from typing import Annotated, NamedTuple

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Bytes, Floats
from pipeline.flight.state.arrays import Moment


class Link(NamedTuple):
    """What is under way between the D deputies of fleets side by side; L lanes and P points, padded.

    S = delay + 1 samples are kept, the latest in place of the oldest.
    """

    delay: int  # control periods between telling and hearing
    # (m, K+1, D, D) 1 where the first does not hear at a sample what is then due of the second; or empty
    lost: Bytes
    unseen: Annotated[Floats, "S", "L", "P"]  # told: 1 where a deputy knows a point as unseen
    ahead: Annotated[Floats, "S", "L", "P"]  # told: 1 where its coasting would not show such a point either
    positions: Annotated[Floats, "S", "L", 3]  # told: where it believes to be, m
    heard_ahead: Annotated[Floats, "L", "D", "P"]  # the last that each lane heard of each deputy
    heard_positions: Annotated[Floats, "L", "D", 3]


@compiled(error_model="numpy")
def arrives(link: Link, now: Moment, lane: int, sender: int, deputies: int) -> bool:
    """Return whether a lane hears at a sample what a deputy of its fleet, by number, told a delay before."""
    if len(link.lost) > 0 and link.lost[(now.first + lane) // deputies, now.k, lane % deputies, sender]:
        return False
    return now.k >= link.delay


@compiled(error_model="numpy")
def tell_seen(now: Moment, link: Link) -> None:
    """Tell at a sample what each deputy knows as unseen, and where it believes to be."""
    slot = now.k % len(link.unseen)
    for lane in range(now.num_lanes):
        link.unseen[slot, lane] = now.state.unseen[lane]
        for axis in range(3):
            link.positions[slot, lane, axis] = now.state.belief.position[axis, lane]


@compiled(error_model="numpy")
def hear_seen(now: Moment, link: Link, lane: int, deputies: int, known: Floats) -> None:
    """Strike from what a lane knows as unseen what it hears to be seen."""
    slot, first = (now.k - link.delay) % len(link.unseen), lane - lane % deputies
    for sender in range(deputies):
        if arrives(link, now, lane, sender, deputies):
            for j in range(now.world.num_points):
                known[j] = min(known[j], link.unseen[slot, first + sender, j])


@compiled(error_model="numpy")
def hear_promises(now: Moment, link: Link, lane: int, deputies: int) -> None:
    """Take over what a lane hears of the others' coasting and places; their starts are known to it."""
    slot, first = (now.k - link.delay) % len(link.unseen), lane - lane % deputies
    for sender in range(deputies):
        if arrives(link, now, lane, sender, deputies):
            link.heard_ahead[lane, sender] = link.ahead[slot, first + sender]
            link.heard_positions[lane, sender] = link.positions[slot, first + sender]
        elif now.k == 0:
            link.heard_ahead[lane, sender] = 1.0
            link.heard_positions[lane, sender] = link.positions[0, first + sender]
