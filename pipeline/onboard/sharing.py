"""What a deputy of a fleet tells on board, and which points it leaves: the flight's own, translated."""

from typing import Any

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.flight.period.decide import exchange as flown
from pipeline.flight.period.decide.exchange import Exchange
from pipeline.flight.period.decide.thrust import COAST_MARGIN
from pipeline.flight.state.arrays import Control, FullOptics, Moment, constant_of
from pipeline.flight.state.link import Link
from pipeline.onboard.members import Members
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression
from pipeline.settings.fleet import SHARING, Fleet


@compiled(error_model="numpy")
def promise(
    now: Moment,
    optics: FullOptics | None,
    exchange: Exchange,
    control: Control,
    missed: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
) -> None:
    """Note what coasting to the end would show; nothing where that leads near the limits."""
    margin = constant_of(control, COAST_MARGIN)
    flown.promise(now, optics, exchange, margin, missed, lit_marks, seen_marks)


@compiled(error_model="numpy")
def leave(now: Moment, exchange: Exchange, control: Control) -> None:
    """Note which points are left to whom."""
    flown.leave(now, exchange, constant_of(control, COAST_MARGIN))


def is_shared(fleet: Fleet) -> bool:
    """Return whether deputies of a fleet leave points to one another."""
    return fleet.deputies > 1 and fleet.sharing in SHARING[flown.LEAVE :]


def write_sharing(
    translator: Translator, now: Moment, work: Any, optics: FullOptics | None, control: Control, fleet: Fleet
) -> None:
    """Write as C what a deputy promises, and what it leaves to others by what it heard, if it leaves any."""
    if not is_shared(fleet):
        return
    sizes = {"L": 1, "F": 1, "P": now.world.points.shape[2], "D": fleet.deputies, "S": 1}
    link = Members(translator, Link, sizes, "fleet_")
    translator.member("fleet_deputy", (1,), "int")
    number = Expression("state->fleet_deputy", "int", range=(0, fleet.deputies - 1))
    others = {"deputies": fleet.deputies, "first": number, "sharing": SHARING.index(fleet.sharing)}
    exchange = Members(translator, Exchange, sizes, "fleet_", link=link, **others)
    marks = {"missed": work.ahead, "lit_marks": work.lit, "seen_marks": work.seen}
    given = {"now": now, "exchange": exchange, "control": control}
    translator.write("promise", promise, {**given, "optics": optics, **marks})
    translator.write("leave", leave, given)
