"""A flight ahead on board: the flight's own look, decision and motion, in the world as the deputy knows it.

It is flown on the state that the control periods use, which is exchanged for its own between two calls.
"""

from typing import Any

import numpy as np

from pipeline.flight.fly.many import note_after
from pipeline.flight.period import steps
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.state.arrays import FullOptics, Law, Moment, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.signals import SETTING, URGENCY
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.arrays import leaves, map_leaves
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression

#: members of the state that a flight carries on, and so does the flight ahead
EXCHANGED = ("belief_position", "belief_velocity", "unseen", "num_unseen", "coasts", "parks")
#: and what goes with them where the course of the chief turns the Sun otherwise than a deputy knows it
DEADLINES = "deadlines"


def _with_arrays_of(world: World, other: World) -> World:
    """Return a world with the arrays of another one where they are equal, so that C has them once."""
    others = iter(leaves(other))

    def shared(leaf: Any, _: str) -> Any:
        theirs = next(others)
        is_array = isinstance(leaf, np.ndarray) and isinstance(theirs, np.ndarray)
        return theirs if is_array and np.array_equal(leaf, theirs) else leaf

    return World(*map_leaves(world, shared))


def _is_same(world: World, other: World) -> bool:
    pairs = zip(leaves(world), leaves(other), strict=True)
    return all(a is b or (not isinstance(a, np.ndarray) and a == b) for a, b in pairs)


def write_flight(
    translator: Translator,
    now: Moment,
    work: Any,
    optics: FullOptics | None,
    law: Law,
    known: World,
    errors: ModelErrors | None,
) -> bool:
    """Write how a flight ahead looks and moves: it decides and keeps safe as the deputy does.

    Parameters
    ----------
    translator, now, work, optics, law
        As `decide` was written with.
    known : World
        As the deputy knows it, with its safety layer.
    errors : ModelErrors or None
        By which it takes motion to differ from that of a circle: that along the chief's true course.

    Returns
    -------
    bool
        Whether its points go dark for good at times of its own.

    Raises
    ------
    NotTranslatableError
        If it would decide in another world.
    """
    known = _with_arrays_of(known, now.world)._replace(has_clusters=now.world.has_clusters)
    # neither decisions nor the safety layer read these
    unread = "is_attitude_ideal", "first", "course", "after", "turns_by_thrust"
    theirs = {name: getattr(now.world, name) for name in unread}
    flown = known._replace(**theirs)
    if not _is_same(flown, now.world):
        raise NotTranslatableError(
            "a flight ahead would decide in another world than the deputy, which is not exported yet; add "
            "--bare: then its plan is an input"
        )
    num_controls = known.num_controls
    begun = known._replace(first=Expression("first", "int", True, (0, num_controls - 1)))  # type: ignore[arg-type]
    until: Any = Expression("k", "int", True, (0, num_controls))
    looking, moving = Moment(begun, *now[1:4], until), now._replace(world=begun)
    parts = {"clusters": None, "errors": None, "plans": law.plans}
    looked = {"now": looking, "work": work, "optics": optics, **parts}
    translator.write("see_ahead", steps.look, looked)
    moved = {"now": moving, "work": work, "errors": errors, "plans": law.plans}
    translator.write("move_ahead", steps.move_on, moved)
    if len(known.after) > 0:
        translator.write("note_after", note_after, {"now": now._replace(world=known, k=0)})
    is_own = known.course.is_on != now.world.course.is_on and bool(law.needs & (URGENCY | SETTING))
    if is_own:
        noted = {"now": now._replace(world=known), "optics": optics, "deadlines": work.deadlines}
        translator.write("note_deadlines_ahead", note_deadlines, {**noted, "lit_marks": work.lit})
    return is_own
