"""How a deputy of a fleet is kept apart from the others on board: the flight's own, translated.

On board a deputy is the first of its fleet; the others follow in the order of their numbers.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, write_three
from pipeline.flight.fly.fleets import apart_of
from pipeline.flight.period.act import apart as flown
from pipeline.flight.period.act.apart import Apart
from pipeline.flight.state.arrays import Moment
from pipeline.flight.state.link import Link, arrives
from pipeline.onboard.members import Members
from pipeline.onboard.translator import Translator
from pipeline.settings.experiment import Mission
from pipeline.settings.fleet import Fleet


@compiled(error_model="numpy")
def begin(now: Moment, apart: Apart) -> None:
    """Begin to be kept apart where the deputy would stop now, without a bound on where others may stop."""
    if apart.back > 0.0:
        belief = now.state.belief
        known = lane_of(belief.position, 0, 0), lane_of(belief.velocity, 0, 0)
        write_three(apart.plans[0], flown.stop_of(now.world, known))
    for deputy in range(apart.deputies):
        apart.gaps[0, deputy] = 0.0
        apart.planes[0, deputy, 3] = np.inf


@compiled(error_model="numpy")
def told_stop(now: Moment, apart: Apart) -> Three:
    """Return what a deputy tells at a sample: where it would stop, or plans to, m."""
    return flown.stop_of_lane(now, apart, 0)


def is_kept_apart(fleet: Fleet) -> bool:
    """Return whether deputies of a fleet are kept apart."""
    return fleet.deputies > 1 and fleet.keep_apart_m > 0.0


def write_apart(translator: Translator, now: Moment, mission: Mission, fleet: Fleet) -> None:
    """Write as C what keeps a deputy within all limits and apart from the others, by what it heard."""
    made: Any = apart_of(replace(mission, fleet=fleet))
    size = len(made.stops)
    heard = translator.member("fleet_hears", (fleet.deputies,), "int")
    numbers = {name: getattr(made, name) for name in ("deputies", "distance", "back", "forces")}
    apart = Members(
        translator,
        Apart,
        {"L": 1, "D": fleet.deputies, "N": len(made.cuts)},
        "fleet_",
        **numbers,
        stops=translator.member("fleet_stops", (size, fleet.deputies, 3), "double"),
    )
    link = Members(translator, Link, {}, "fleet_", delay=fleet.delay_periods)

    def hears(writer: Translator, link: Any, now: Any, lane: Any, sender: Any, deputies: Any) -> Any:
        """Return whether anything due was heard of another deputy: on board that is an input."""
        return writer.element(heard, sender) != 0

    given = {"now": now, "apart": apart}
    translator.write("assure", flown.assure_apart, {**given, "link": link}, {arrives: hears})
    translator.write("begin_apart", begin, given)
    translator.write("told_stop", told_stop, given)
