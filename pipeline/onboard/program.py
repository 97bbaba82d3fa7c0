"""The flight's own `decide`, and what comes before it, translated for a mission and a controller."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fis_tools.compiled import elementary
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Three, least, load, width_of
from fis_tools.engines import kernel, packing
from fis_tools.engines.kernel import LANES
from pipeline.array_types import Integers
from pipeline.flight.cases.navigation import as_believed
from pipeline.flight.control.controller import Controller, RuleController
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.lesser_controllers import bare, finishing
from pipeline.flight.fly.outlooks import at_start
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.tours import tour_images, tour_names
from pipeline.flight.fly.workspace import optics_in_use
from pipeline.flight.period import steps
from pipeline.flight.period.act.safety import MOST_CUTS, assure
from pipeline.flight.period.decide.thrust import command_given
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.look import optics as look_optics
from pipeline.flight.period.look.guidance import num_clusters
from pipeline.flight.period.look.optics import Beam, Eye
from pipeline.flight.period.look.sight import choose_cluster, inspect
from pipeline.flight.state.arrays import Control, FlightState, FullOptics, Law, Moment, Workspace, World
from pipeline.flight.state.signals import CONSTANTS, SETTING, URGENCY
from pipeline.flight.world.pack import pack_world
from pipeline.flight.world.surface import surface_of
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.arrays import Record
from pipeline.onboard.fields import InterfaceField
from pipeline.onboard.free_cells import FreeCells
from pipeline.onboard.kept_apart import is_kept_apart, write_apart
from pipeline.onboard.law_values import Values
from pipeline.onboard.members import Members, record_of
from pipeline.onboard.messages import STEP, STEP_AND_COVARIANCE, of_others
from pipeline.onboard.operations import OPERATIONS
from pipeline.onboard.planner import ANYWHERE, PushPlanner, ranges_of, write_planner
from pipeline.onboard.restart import write_restart
from pipeline.onboard.sharing import is_shared, write_sharing
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression
from pipeline.onboard.writer import Setting
from pipeline.physics.sight import is_free
from pipeline.settings.experiment import Mission
from pipeline.settings.fleet import Fleet

#: signals of the target, which is the mean of the points that are lit and not inspected
OF_TARGET = frozenset(
    {*("lambda_u", "eta_u", "target_setting"), *("target_radial", "target_along_track", "target_cross_track")}
)
#: arrays into which only finite numbers are written, zero for NaN: what inference is given, the force, and
#: the safety layer's half-spaces and multipliers
GUARDED = frozenset({"scratch_inputs", "commanded", "cuts", "fleet_cuts", "zeros"})
#: no fleet
ALONE = Fleet()
#: loops over terms of which `Values` must know which term it is
UNROLLED = frozenset({("find_crossings", "term")})


@compiled(error_model="numpy")
def strongest_rule(rules: Integers, layout: Any, index: int, scratch: Any) -> int:
    """Return which rule of a system fires most strongly, in the order of `Packed.rules`; -1 for none."""
    system, work = layout[index], scratch[0]
    terms, inputs = system.output_terms, system.num_inputs
    bounds = system.rules + terms
    slots = bounds + terms + 1
    strongest, leading = 0.0, -1
    for rule in range(rules[bounds + terms]):
        strength = load(work.memberships, rules[slots + inputs * rule], width_of(work))
        for column in range(1, inputs):
            membership = load(work.memberships, rules[slots + inputs * rule + column], width_of(work))
            strength = least(membership, strength)
        if strength > strongest:
            strongest, leading = strength, rule
    return leading


def without_camera(
    _: Translator,
    world: World,
    optics: FullOptics | None,
    beam: Beam,
    position: Three,
    boresight: Three,
    up: Three,
) -> Eye:
    """Return a camera that sees nothing: on board the controller receives which points are inspected."""
    return Eye(position, boresight, up, beam, 0.0, 0.0, 0.0, False, True)


@dataclass(frozen=True)
class OnboardProgram:
    """A controller's on-board function as C.

    Parameters
    ----------
    translator : Translator
        With the functions `start_deadlines`, `find_target` (each if needed) and `decide`.
    controller, mission, world, law
        What it is of; the controller plans as on board.
    designed : RuleController
        The controller as it was given.
    parameters : sequence of str
        Constants that it reads and that may be changed.
    choices : sequence of (str, mapping of str to float)
        What may be chosen in flight: what it is called, and its constants; first what it was designed with.
    is_sun_in_plane : bool
        Whether it takes the Sun to stand in the orbit plane, without reading its elevation.
    planner : PushPlanner or None
        What plans its pushes, with foresight.
    fleet : Fleet
        Of which it is one deputy's.
    """

    translator: Translator
    controller: RuleController
    mission: Mission
    world: World
    law: Law
    parameters: Sequence[str]
    choices: Sequence[tuple[str, Mapping[str, float]]]
    is_sun_in_plane: bool
    designed: RuleController
    planner: PushPlanner | None = None
    fleet: Fleet = ALONE

    @property
    def is_shared(self) -> bool:
        """Whether it leaves points to other deputies."""
        return is_shared(self.fleet)

    @property
    def has_covariance(self) -> bool:
        """Whether it takes how far the estimate may be off."""
        again = self.planner.again if self.planner else None
        return again is not None and again.has_covariance

    @property
    def is_kept_apart(self) -> bool:
        """Whether it is kept apart from other deputies."""
        return is_kept_apart(self.fleet)

    @property
    def inputs(self) -> Sequence[InterfaceField]:
        """What each step is given."""
        inputs = STEP_AND_COVARIANCE if self.has_covariance else STEP
        return (*inputs, *of_others(self.fleet)) if self.is_kept_apart else inputs


def bounds(world: World) -> dict[tuple[str, str], Any]:
    """Return how often those loops run at most whose length is not known."""
    return {
        ("coast_along", "while"): lambda names: -(-world.num_controls // world.preview_stride) + 1,
        ("note_deadlines", "while"): lambda names: world.num_controls,
        ("arrival", "while"): lambda names: len(world.transitions.onward),
        ("count_ranks", "while"): _most_ranks,
        ("grid_sums", "rank"): lambda names: int(names["system"].output_terms),
        ("cut_terms", "rule"): lambda names: int(names["rules"].at(names["bounds"] + names["terms"]).known),
        ("neighbours", "other"): lambda names: 2 * 16,
        ("choose_cluster", "filled"): lambda names: world.points.shape[2] - 1,
        ("crossing_triangles", "flank"): _num_flanks,
    }


def _num_flanks(names: Mapping[str, Any]) -> int:
    """Return how many flanks the terms of an output have: on each side of a peak that is not at the edge."""
    system, rules = names["system"], names["rules"]
    peaks = (rules.at(system.rules + term).known for term in range(system.output_terms))
    return sum(int(peak > 0) + int(peak < system.output_points - 1) for peak in peaks)


def _most_ranks(names: Mapping[str, Any]) -> int:
    """Return how many of the highest terms determine a height at most: in no piece are more above zero."""
    system, values = names["system"], names["values"]
    terms, num_pieces = int(system.output_terms), packing.num_pieces(int(system.output_points))
    first = int(system.pieces)
    highest = (
        [values.known(first + 2 * (terms * piece + rank)) > 0.0 for rank in range(1, terms)]
        for piece in range(num_pieces)
    )
    return 1 + max(([*are_above, False].index(False) for are_above in highest), default=0)


def translate(
    mission: Mission,
    controller: Controller,
    *,
    is_tilted: bool = False,
    rules_alone: bool = False,
    fleet: Fleet = ALONE,
) -> OnboardProgram:
    """Return the on-board function of a controller in a mission.

    Parameters
    ----------
    mission : Mission
    controller : Controller
    is_tilted : bool
        Whether the Sun may stand out of the orbit plane in a world of the paper's light and camera.
    rules_alone : bool
        Whether a controller with foresight takes its plan as an input, from the ground.
    fleet : Fleet
        Of which it is one deputy's.

    Raises
    ------
    NotTranslatableError
        If it has no rules, senses what is not known on board, or something has no translation.
    """
    if not isinstance(controller, RuleController):
        raise NotTranslatableError(f"{controller.name!r} has no rules; choose a controller that has")
    if mission.safety.kind == "filter" and mission.safety.keep_way_out:
        raise NotTranslatableError(
            "safety.keep_way_out is true, which needs the period and is not flown on board; leave it out"
        )
    if mission.safety.kind == "filter" and mission.safety.min_sun_angle_deg > 0.0:
        raise NotTranslatableError(
            f"safety.min_sun_angle_deg is {mission.safety.min_sun_angle_deg:g}, which is not flown on board; "
            "leave it out"
        )
    designed, flown, plans = controller, controller, foresees(controller) and not rules_alone
    if plans and fleet.deputies > 1:
        raise NotTranslatableError(
            f"{controller.name!r} plans on board for one deputy, and fleet.deputies is {fleet.deputies}; add "
            "--bare, with which each takes its part of the fleet's plans as an input, or leave "
            "fleet.deputies out"
        )
    if plans:
        flown, controller = bare(designed), finishing(designed)
    world, law = pack_world(mission), law_of(controller, mission)
    sensed = {variable.name for system in controller.systems for variable in system.inputs}
    # where no target is sensed, none is chosen
    world = world._replace(has_clusters=world.has_clusters and bool(sensed & OF_TARGET))
    if world.has_clusters and mission.navigation.mode != "perfect":
        raise NotTranslatableError(
            f"{controller.name!r} senses the cluster nearest to where the deputy truly is, which is not "
            "known on board; set navigation=perfect or guidance.kind=centroid"
        )
    numbers, optics = controller.numbers, optics_in_use(world, is_tilted)
    images = dict(zip(tour_names(controller), tour_images(controller), strict=False))
    choices = images or {"as designed": controller}
    constants = [choice.constants for choice in choices.values()]
    parameters = Values(numbers.values[0], law, constants)
    operations: dict[Any, Callable[..., Any]] = {
        **OPERATIONS,
        kernel.infer: _infer_and_note,
        elementary.exponential: _exponential,
    }
    if world.occlusion.edge > 0:
        operations[is_free] = FreeCells(surface_of(mission))
    ranges: dict[str, tuple[int, int]] = {
        "num_candidates": (0, world.num_points),
        "num_centres": (0, num_clusters(world.num_points)),
    }
    if plans:
        ranges |= ranges_of(mission, flown)
    translator = Translator(
        Setting(
            operations,
            bounds=bounds(world),
            unrolled=UNROLLED,
            ranges=ranges,
            guarded=GUARDED,
            is_proved_apart=True,
        )
    )
    now, work = moment(translator, world)
    control = Control(law, parameters, numbers.rules[0])  # type: ignore[arg-type]
    if law.needs & (URGENCY | SETTING):
        translator.write(
            "note_deadlines",
            note_deadlines,
            {"now": now, "optics": optics, "deadlines": work.deadlines, "lit_marks": work.lit},
        )
    if sensed & OF_TARGET:
        translator.write(
            "inspect",
            inspect,
            {
                **{"now": now, "optics": optics, "lane": 0, "candidate_marks": work.candidate_marks},
                **{"lit_marks": work.lit, "seen_marks": work.seen},
            },
            {look_optics.eye_at: without_camera},
        )
    if world.has_clusters:
        given = {"now": now, "lane": 0, "candidate_marks": work.candidate_marks}
        given |= {name: getattr(work, name) for name in ("candidates", "labels", "distances", "sums")}
        translator.write("choose_cluster", choose_cluster, given)
    pushes = True if law.needs & SETTING else None
    arguments = {"now": now, "work": work, "optics": optics, "pushes": pushes, "control": control}
    translator.write("decide", steps.decide, arguments)
    _write_commands(translator, mission, fleet, now, work)
    planner = None
    if plans:
        planner = _planner(translator, mission, flown, now, work, optics, law)
    write_sharing(translator, now, work, optics, control, fleet)
    write_restart(translator, now, is_in_plane=optics is None)
    named = [
        (name, dict(zip(CONSTANTS, choice.constants.tolist(), strict=True)))
        for name, choice in choices.items()
    ]
    return OnboardProgram(
        *(translator, flown, mission, world, law, parameters.used, named, optics is None),
        *(designed, planner, fleet),
    )


def _write_commands(translator: Translator, mission: Mission, fleet: Fleet, now: Moment, work: Any) -> None:
    """Write what commands a given force, and the safety layer, where it is on."""
    force = Three(*(Expression(f"force_{axis}", is_name=True) for axis in "xyz"))  # type: ignore[arg-type]
    translator.write("command_given", command_given, {"now": now, "force": force})
    if is_kept_apart(fleet):
        write_apart(translator, now, mission, fleet)
    elif now.world.guard.is_on:
        translator.write("assure", assure, {"now": now, "cuts": work.cuts})


def _planner(
    translator: Translator,
    mission: Mission,
    controller: RuleController,
    now: Moment,
    work: Any,
    optics: FullOptics | None,
    law: Law,
) -> PushPlanner:
    """Write what plans the pushes of a controller with foresight."""
    known, (start,) = as_believed(mission, [ANYWHERE])
    known = replace(known, attitude=replace(mission.attitude, mode="ideal"))
    deputies = at_start(mission, known, controller, [start], 0, LANES)
    return write_planner(translator, deputies, now, work, optics, law)


def moment(translator: Translator, world: World) -> tuple[Moment, Any]:
    """Return a flight at a sample that is known on board, as deputies know it, and its workspace."""
    sizes = {
        "L": 1,
        "P": world.points.shape[2],
        "C": num_clusters(world.num_points),
        "S": world.num_attitude_steps,
        "cuts": MOST_CUTS,
    }
    scratch = record_of(translator, "scratch_", {**kernel.SCRATCH, "cut_terms": (2 * packing.MAX_TERMS,)})
    state = Members(translator, FlightState, sizes)
    state._others["truth"] = state.belief
    work = Members(translator, Workspace, sizes, scratch=Rooms(scratch))
    k = Expression("k", "int", True, (0, world.num_controls - 1))
    return Moment(world, state, 0, 1, k), work  # type: ignore[arg-type]


@dataclass(frozen=True)
class Rooms:
    """The working space of inference: one record."""

    room: Record

    def __getitem__(self, _: int) -> Record:
        """Return the record."""
        return self.room


def _exponential(translator: Translator, x: Any) -> Any:
    """Write the exponential of what is limited to where it is finite; in flight, it is."""
    limited = OPERATIONS[least](translator, x, -elementary.LEAST_EXPONENT)
    return translator.invoked(elementary.exponential, [limited], {})


def _infer_and_note(
    translator: Translator, values: Any, rules: Any, layout: Any, index: int, scratch: Any
) -> None:
    """Write inference, and which rule fires most strongly."""
    translator.invoked(kernel.infer, [values, rules, layout, index, scratch], {})
    leading = translator.invoked(strongest_rule, [rules, layout, index, scratch], {})
    translator.put(translator.member("leading", (3,), "int"), index, leading)
