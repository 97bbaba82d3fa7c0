"""One control period, written once: look, decide, act.

Whoever flies calls these: many flights, one logged flight, flights stepped by a learner, rehearsals and
policies. Up to L flights run side by side (`pipeline.flight.state.arrays`), so that vector units work on all
of them; a flight's result does not depend on the others.

`optics` is None where light and camera are the paper's, `guard` without the safety layer, `clusters` without
guidance by clusters, `pushes` where no controller senses a push that shows setting points, and `errors` where
the deputies know their state, their thrusters are ideal and motion is linear: numba leaves out the code that
depends on them, which saves compiling what is not flown. With `optics` or `errors`, `guard` and `pushes` may
be present but off, so that fewer variants are compiled.
"""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import load_three, store_three
from pipeline.array_types import Floats, Integers
from pipeline.flight.period.act.actuators import burn, carry_out
from pipeline.flight.period.act.aim import aim_at_once, aim_deputies
from pipeline.flight.period.act.attitude import turn_deputies
from pipeline.flight.period.act.move import move, move_about_earth, spend
from pipeline.flight.period.act.safety import assure
from pipeline.flight.period.decide.motion import sense_angles, sense_approach, sense_orbit, sense_place
from pipeline.flight.period.decide.preview import preview
from pipeline.flight.period.decide.see_push import sense_push
from pipeline.flight.period.decide.thrust import command, decide_to_coast, is_decision, may_coast
from pipeline.flight.period.decide.tour import sense_tour
from pipeline.flight.period.decide.urgency import sense_urgency
from pipeline.flight.period.look.navigation import know_all, navigate, point_beside
from pipeline.flight.period.look.sight import see
from pipeline.flight.state.arrays import Beyond, Guard, Law, Plans, State, Workspace, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.signals import ANGLES, APPROACH, ORBIT, PREVIEW, SETTING, TOUR, URGENCY


@compiled(error_model="numpy", forceinline=True)
def look(
    world: World,
    optics: Beyond | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    plans: Plans,
    state: State,
    work: Workspace,
    first: int,
    num_lanes: int,
    k: int,
) -> None:
    """Inspect what is lit and in view at sample k, choose targets, and learn what the deputies then believe.

    Parameters
    ----------
    world, plans, state, work
    optics, clusters, errors
        See above.
    first : int
        The lanes are flights from this one on.
    num_lanes : int
        Of these, so many are flown; the others repeat the last.
    k : int
    """
    if world.is_attitude_ideal:
        aim_at_once(world, plans, state, work, num_lanes, k)
        if errors is not None and errors.fixes.is_on:
            point_beside(errors.fixes, state, first, num_lanes, k)
    see(world, optics, clusters, state, work, num_lanes, k)
    if errors is not None:
        if errors.fixes.is_on:
            navigate(world, errors.fixes, state, first, num_lanes, k)
        else:
            know_all(state)


@compiled(error_model="numpy", forceinline=True)
def decide(
    world: World,
    optics: Beyond | None,
    pushes: bool | None,
    law: Law,
    values: Floats,
    rules: Integers,
    state: State,
    work: Workspace,
    first: int,
    num_lanes: int,
    k: int,
) -> None:
    """Sense what the controller needs at sample k, and command a force.

    Parameters
    ----------
    world, law, state, work, first, num_lanes, k
        As in `look`.
    optics, pushes
        See above.
    values, rules : arrays
        Of one controller: rows of `fis_tools.engines.packing.Packed`.
    """
    sense_place(state, work)
    if law.needs & ANGLES:
        sense_angles(state, work)
    if is_decision(law, k):
        if law.needs & ORBIT:
            sense_orbit(world, law, values, state, work)
        if law.needs & APPROACH:
            sense_approach(world, state, work)
        if law.needs & PREVIEW or may_coast(law, values):
            preview(world, optics, state, work, num_lanes, k)
        if not law.has_plan:
            decide_to_coast(world, law, values, state, work)
        if law.needs & URGENCY:
            sense_urgency(world, optics, law, values, state, work, num_lanes, k)
        if pushes is not None and law.needs & SETTING:
            sense_push(world, optics, law, values, state, work, num_lanes, k)
        if law.needs & TOUR:
            sense_tour(world, law, values, state, work)
    command(world, law, values, rules, state, work, first, num_lanes, k)


@compiled(error_model="numpy", forceinline=True)
def act(
    world: World,
    guard: Guard | None,
    errors: ModelErrors | None,
    plans: Plans,
    state: State,
    work: Workspace,
    first: int,
    num_lanes: int,
    k: int,
) -> None:
    """Keep the commands safe, fire, turn and move over the control period that follows sample k.

    Parameters
    ----------
    world, plans, state, work, first, num_lanes, k
        As in `look`.
    guard, errors
        See above.
    """
    lanes = state.lanes
    if guard is not None and guard.is_on:
        assure(world, state, work, num_lanes)
    aim_deputies(world, plans, state, work, num_lanes, k)
    force = load_three(lanes.commanded, 0)
    store_three(lanes.force, 0, force)
    if errors is not None:
        carry_out(world, errors, state, work, first, num_lanes, k)
        force = load_three(lanes.force, 0)
    if not world.is_attitude_ideal:
        turn_deputies(world, plans, state, work, num_lanes, k)
    if errors is not None and errors.firing.is_on:
        force = burn(world, errors.firing, state)
    spend(world, state, force)
    if errors is not None and errors.course.is_on:
        move_about_earth(world, errors.course, state, force, first, num_lanes, k)
    else:
        move(world, state, force)
