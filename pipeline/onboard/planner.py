"""A planner on board: which functions it has, and what the entries of the C that call them must know."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import RuleController
from pipeline.flight.control.law import ahead_stride
from pipeline.flight.fly.drift import tail_stride
from pipeline.flight.fly.outlooks import Deputies, num_missed
from pipeline.flight.fly.replanning import AGAIN_ON_BOARD, FIRST, first_searches
from pipeline.flight.state.arrays import FullOptics, Law, Moment, Workspace
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import constant
from pipeline.flight.world.pack import pack_world
from pipeline.onboard.ahead import DEADLINES, EXCHANGED, write_flight
from pipeline.onboard.search import OnboardSearch, num_tried
from pipeline.onboard.translator import Translator
from pipeline.settings.experiment import Mission

#: whole numbers of a state that only the entries of the source read and write
COUNTERS = (
    *("stage", "period", "search", "generation", "tried", "needed", "required", "num_lit", "last", "lead"),
)
#: and of those that are planned again, with numbers of the flights ahead and of the plan that is flown
MORE_COUNTERS = ("flies", "flown", "flown_samples", "is_again", "end", "now", "coasts")
#: control periods of a flight ahead that a call flies at least
STRETCH = 30
#: the state that an outlook's tables are read with: any will do
ANYWHERE = Scenario(np.array([30.0, 0.0, 0.0]), np.zeros(3), 0.0, 0.0)


class Replanning(NamedTuple):
    """What the source says of plans that are made again in flight, and flown ahead before.

    Attributes
    ----------
    period : int
        Control periods from one plan to the next; 0 where one is made at the start alone.
    num_generations, num_searches : int
        Of a search from what is left of the last plan; of these the first generation is one.
    stretch : int
        Control periods of a flight ahead that are flown at once.
    accepted, price : float
        Points that a flight may leave, and what others cost, m/s.
    limits : sequence of str
        Of the C, that a search is given.
    has_covariance : bool
        Whether the estimate may be off.
    notes_deadlines : bool
        Whether in flights ahead points go dark for good at other times.
    exchanged : sequence of str
        Members of the state that flights ahead have of their own.
    """

    period: int
    num_generations: int
    num_searches: int
    stretch: int
    accepted: float
    price: float
    limits: tuple[str, ...]
    has_covariance: bool
    notes_deadlines: bool
    exchanged: tuple[str, ...]


@dataclass(frozen=True)
class PushPlanner:
    """What the source says of a search that is translated.

    Parameters
    ----------
    num_pushes, num_plans, num_generations, num_searches : int
        Of these the first generation is one.
    num_tried : int
        Plans of a part of a generation.
    step, stride : int
        Control periods between the samples of an outlook, and between the rows of what follows it.
    num_beyond : float
        Control periods beyond the flight's end at which limits count.
    most_lead : int
        Control periods from a decision of the rules to the next one.
    missed, missed_of_required : int
        Points that a plan may miss, and at a price of their own; the latter is -1 where all cost the same.
    num_controls : int
        Control periods of a flight.
    has_tail : bool
    follows_course : bool
        Whether motion follows the chief's true course.
    functions : tuple of str
        Of the C, that the search alone calls.
    ranges : mapping of str to (int, int)
        Least and greatest of members of the state that are whole numbers, as the search keeps them.
    members : mapping of str to (shape, kind)
        Of the state, that the entries alone use.
    again : Replanning or None
        None where a plan is as good as the flight: it is made once, and not flown ahead.
    """

    num_pushes: int
    num_plans: int
    num_generations: int
    num_searches: int
    num_tried: int
    step: int
    stride: int
    num_beyond: float
    most_lead: int
    missed: int
    missed_of_required: int
    num_controls: int
    has_tail: bool
    follows_course: bool
    functions: tuple[str, ...]
    ranges: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    members: Mapping[str, tuple[tuple[int, ...], str]] = field(default_factory=dict)
    again: Replanning | None = None

    @property
    def num_parts(self) -> int:
        """Parts of the first search, flights ahead among them, of which `controller_plan` tries some."""
        parts = self.num_generations * self.num_searches * (self.num_plans // self.num_tried)
        return parts + self.num_flown

    @property
    def num_flown(self) -> int:
        """Parts of flights ahead from the start, of which there are two."""
        return 2 * -(-self.num_controls // self.again.stretch) if self.again else 0


def ranges_of(mission: Mission, controller: RuleController) -> dict[str, tuple[int, int]]:
    """Return least and greatest of the members of the state that hold points, samples and plans."""
    first = FIRST[round(controller.constants[constant("foresight_pushes")])]
    num_points = pack_world(mission).num_points
    return {
        "plan_points": (0, num_points - 1),
        "plan_seen_at": (0, mission.num_controls),
        "plan_top": (0, first.num_plans - 1),
    }


def write_planner(
    translator: Translator,
    deputies: Deputies,
    now: Moment,
    work: Workspace,
    optics: FullOptics | None,
    law: Law,
) -> PushPlanner:
    """Write the functions of a search as C, and return what their callers must know."""
    search, num_before = OnboardSearch(translator, deputies), len(translator.functions)
    entries = {**search.of_outlooks(now, work, optics), **search.of_constants(), **search.of_plans()}
    if not deputies.is_certain:
        entries |= search.of_later_plans()
    for name, (function, arguments) in entries.items():
        translator.write(name, function, arguments)
    constant_of, num_pushes = deputies.constant, deputies.num_pushes
    again, num_genes = None, 4 * num_pushes - 1
    if not deputies.is_certain:
        cases = cases_of(deputies.known, list(deputies.believed))
        errors = cases.model_errors(deputies.world.course)
        is_own = write_flight(translator, now, work, optics, law, deputies.world, errors)
        again = _replanning(deputies, search, notes_deadlines=is_own)
    (first, *others), planned = first_searches(deputies.controller), constant_of("foresight_points")
    num_after = max(deputies.after_s, constant_of("foresight_passive_s"))
    return PushPlanner(
        num_pushes=num_pushes,
        num_plans=first.num_plans,
        num_generations=first.num_generations + 1,
        num_searches=1 + len(others),
        num_tried=num_tried(first.num_plans),
        step=deputies.step,
        stride=tail_stride(deputies.mission),
        num_beyond=num_after / deputies.world.control_period,
        most_lead=law.decision_stride,
        missed=num_missed(planned or constant_of("coast_below_points")),
        missed_of_required=num_missed(constant_of("coast_below_points")) if planned else -1,
        num_controls=deputies.world.num_controls,
        has_tail=search.has_tail,
        follows_course=search.follows_course,
        functions=tuple(function.name for function in translator.functions[num_before:]),
        ranges=search.ranges,
        members={
            "plan_draws": ((8,), "unsigned int"),
            **{f"plan_{name}": ((1,), "int") for name in COUNTERS},
            "plan_price": ((1,), "double"),
            "plan_force": ((3,), "double"),
            **(_members_again(num_genes) if again else {}),
        },
        again=again,
    )


def _members_again(num_genes: int) -> dict[str, tuple[tuple[int, ...], str]]:
    """Return the members of a state that the entries use where plans are made again."""
    return {
        **{f"plan_{name}": ((1,), "int") for name in MORE_COUNTERS},
        **{f"plan_{name}": ((num_genes,), "double") for name in ("next", "left")},
        "plan_ends": ((2,), "double"),
    }


def _replanning(deputies: Deputies, search: OnboardSearch, *, notes_deadlines: bool) -> Replanning:
    efforts, mission = AGAIN_ON_BOARD[deputies.num_pushes], deputies.mission
    return Replanning(
        period=ahead_stride(deputies.controller, mission, "foresight_period_s"),
        num_generations=efforts[0].num_generations + 1,
        num_searches=len(efforts),
        stretch=STRETCH,
        accepted=float(np.ceil(max(1.0, deputies.constant("coast_below_points")))) - 1.0,
        price=deputies.constant("rehearsal_point_m_s"),
        limits=search.limits,
        has_covariance=search.has_covariance,
        notes_deadlines=notes_deadlines,
        exchanged=(*EXCHANGED, *[DEADLINES] * notes_deadlines),
    )
