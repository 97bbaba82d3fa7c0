"""One control period, written once: look, decide, act.

Whoever flies calls these: many flights, one logged flight, flights stepped by a learner, rehearsals and
policies. Up to L flights run side by side (`pipeline.flight.state.arrays`), so that vector units work on all
of them; a flight's result does not depend on the others.

Working arrays are arguments: what one function writes and a later one reads stands in the calls.

`optics` is None where light and camera are the paper's, `clusters` without guidance by clusters, and `errors`
where the deputies know their state, their thrusters are ideal and motion is linear: numba leaves out the code
that depends on them, which saves compiling, and passing by, what is not flown. What costs flights without it
no time, such as the safety layer, is always compiled, so that there are few variants.
"""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import load_three, store_three
from fis_tools.compiled.vectors import store
from pipeline.flight.period.act.actuators import burn, carry_out
from pipeline.flight.period.act.aim import aim_at_once, aim_over
from pipeline.flight.period.act.attitude import turn_deputies
from pipeline.flight.period.act.move import move, move_about_earth
from pipeline.flight.period.act.safety import assure
from pipeline.flight.period.act.way_out import keep_way_out
from pipeline.flight.period.decide.motion import sense_angles, sense_approach, sense_orbit, sense_position
from pipeline.flight.period.decide.parking import may_park, sense_parking
from pipeline.flight.period.decide.preview import preview
from pipeline.flight.period.decide.see_push import sense_push
from pipeline.flight.period.decide.thrust import command, decide_to_coast, is_decision, may_coast
from pipeline.flight.period.decide.tour import sense_tour
from pipeline.flight.period.decide.urgency import sense_urgency
from pipeline.flight.period.look.navigation import believe_truth, navigate, turn_by_sensing_error
from pipeline.flight.period.look.sight import see
from pipeline.flight.state.arrays import Control, FullOptics, Moment, Plans, Workspace
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.lanes import load_row
from pipeline.flight.state.signals import ANGLES, APPROACH, ORBIT, PREVIEW, SETTING, TOUR, URGENCY


@compiled(error_model="numpy", forceinline=True)
def look(
    now: Moment,
    work: Workspace,
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    plans: Plans,
) -> None:
    """Inspect what is lit and in view, choose targets, and learn what the deputies then believe."""
    if now.world.is_attitude_ideal:
        aim_at_once(now, work.aims, plans)
        if errors is not None and errors.fixes.is_on:
            turn_by_sensing_error(now, errors.fixes.errors)
    see(now, work, optics, clusters)
    if errors is not None:
        if errors.fixes.is_on:
            navigate(now, errors.fixes)
        else:
            believe_truth(now.state)


@compiled(error_model="numpy", forceinline=True)
def decide(now: Moment, work: Workspace, optics: FullOptics | None, control: Control) -> None:
    """Sense what the controller needs, and command a force."""
    law, signals, deadlines = control.law, work.signals, work.deadlines
    sense_position(now, signals)
    if law.needs & ANGLES:
        sense_angles(now, signals)
    if is_decision(law, now.k):
        if law.needs & ORBIT:
            sense_orbit(now, control, signals)
        if law.needs & APPROACH:
            sense_approach(now, signals)
        if may_park(control):  # before the preview, whose points are logged
            sense_parking(now, optics, control, work.ahead, work.lit, work.seen, signals)
        if law.needs & PREVIEW or may_coast(control):
            preview(now, optics, work.ahead, work.lit, work.seen, signals)
        if not law.has_plan:
            decide_to_coast(now, control, signals)
        if law.needs & URGENCY:  # before what leans towards the urgent direction
            sense_urgency(now, optics, control, deadlines, work.lit, signals)
        if law.needs & SETTING:
            setting, looks = work.setting, work.looks
            sense_push(now, optics, control, deadlines, setting, looks, work.lit, work.seen, signals)
        if law.needs & TOUR:
            sense_tour(now, control, signals)
    command(now, control, signals, work.outputs, work.scratch)


@compiled(error_model="numpy", forceinline=True)
def act(now: Moment, work: Workspace, errors: ModelErrors | None, plans: Plans) -> None:
    """Keep the commands safe, fire, turn and move over the control period that follows."""
    if now.world.guard.is_on:
        assure(now, work.cuts)
        if now.world.guard.way_out is not None:
            keep_way_out(now)
    move_on(now, work, errors, plans)


@compiled(error_model="numpy", forceinline=True)
def move_on(now: Moment, work: Workspace, errors: ModelErrors | None, plans: Plans) -> None:
    """Fire what is commanded, turn and move over the control period that follows."""
    world, state, lanes = now.world, now.state, now.state.lanes
    aim_over(now, work.aims, plans, state.belief, lanes.commanded, world.num_attitude_steps)
    force = load_three(lanes.commanded, 0)
    store_three(lanes.force, 0, force)
    if errors is not None:
        carry_out(now, work.aims, errors)
        force = load_three(lanes.force, 0)
    if not world.is_attitude_ideal:
        turn_deputies(now, work.aims, work.passed, plans)
    if errors is not None and errors.firing.is_on:
        force = burn(world, errors.firing, state)
    spent = (abs(force.x) + abs(force.y) + abs(force.z)) * world.delta_v_per_force
    store(lanes.spent, 0, load_row(lanes.spent) + spent)
    if errors is not None and errors.course.is_on:
        move_about_earth(now, errors.course, force)
    else:
        move(world, state, force)
