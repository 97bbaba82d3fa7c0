"""The search for pushes on board: the flight's own, translated, with the tables that its outlook takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fis_tools.compiled.three import Three
from pipeline.array_types import Floats
from pipeline.flight.control.controller import RuleController
from pipeline.flight.fly import aboard
from pipeline.flight.fly.drift import tail_stride
from pipeline.flight.fly.foresight import Outlook, samples_coarsely
from pipeline.flight.fly.free_drift import num_doubts
from pipeline.flight.fly.outlooks import Deputies, num_missed
from pipeline.flight.fly.prices import Pricing, list_lit
from pipeline.flight.fly.pushes import NUM_DRAWS, PlanSearch, breed, num_best, select_cheaper
from pipeline.flight.fly.replanning import FIRST, first_searches
from pipeline.flight.state.arrays import FullOptics, Moment, Workspace
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import constant
from pipeline.flight.world.pack import pack_world
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Array, Begun, Expression
from pipeline.settings.experiment import Mission

#: a function, and its arguments
Entry = tuple[Any, dict[str, Any]]
#: whole numbers of a state that only the entries of the source read and write
COUNTERS = (
    *("stage", "period", "search", "generation", "tried", "needed", "required", "num_lit", "last", "lead"),
)
#: of how many plans a part of a generation has at most: what a call tries at least
MOST_TRIED = 8
#: the state that an outlook's tables are read with: any will do
ANYWHERE = Scenario(np.array([30.0, 0.0, 0.0]), np.zeros(3), 0.0, 0.0)


class Draws:
    """Rows of numbers from 0 to 1, each drawn when it is read.

    Parameters
    ----------
    length : int
        Of a row.
    most : int
        Of the longest row that is drawn into the same room.
    """

    ndim = 2

    def __init__(self, length: int, most: int) -> None:
        self.used: list[str] = []
        self._length, self._most = length, most

    def at(self, translator: Translator, _: Any) -> Any:
        """Draw a row, and return it."""
        translator.member("drawn", (self._most,), "double")
        translator.emit(f"draw_numbers(state, {self._length});")
        return Array("state->drawn", (self._length,))


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
    has_tail : bool
    functions : tuple of str
        Of the C, that the search alone calls.
    members : mapping of str to (shape, kind)
        Of the state, that the entries alone use.
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
    has_tail: bool
    functions: tuple[str, ...]
    members: Mapping[str, tuple[tuple[int, ...], str]] = field(default_factory=dict)


def ranges_of(mission: Mission, controller: RuleController) -> dict[str, tuple[int, int]]:
    """Return least and greatest of the members of the state that hold points, samples and plans."""
    first = FIRST[round(controller.constants[constant("foresight_pushes")])]
    num_points = pack_world(mission).num_points
    return {
        "plan_points": (0, num_points - 1),
        "plan_seen_at": (0, mission.num_controls),
        "plan_top": (0, first.num_plans - 1),
    }


def num_tried(num_plans: int) -> int:
    """Return how many plans each part of a generation has, all parts alike."""
    return max(count for count in range(1, MOST_TRIED + 1) if num_plans % count == 0)


def check(mission: Mission, known: Mission, controller: RuleController, num_rows: int) -> None:
    """Refuse a mission in which a flight with foresight is not what is translated.

    Raises
    ------
    NotTranslatableError
        With the fact and the cure.
    """
    name, cure = controller.name, "or add --bare: then its plan is an input"
    if known != mission:
        raise NotTranslatableError(
            f"{name!r} plans again in flight where navigation, thrusters or motion have errors, which is not "
            f"exported yet; set navigation=perfect, actuators=ideal and dynamics=cw, {cure}"
        )
    if mission.has_true_course or mission.dynamics.model != "cw":
        raise NotTranslatableError(
            f"{name!r} would plan along the chief's own orbit, whose tables are not exported yet; set "
            f"dynamics=cw, {cure}"
        )
    if num_rows > 1:
        raise NotTranslatableError(
            f"{name!r} would plan about a chief that turns in Hill axes, whose tables are not exported yet; "
            f"leave chief.initial_angular_velocity_rad_s out, {cure}"
        )


def write_planner(
    translator: Translator,
    deputies: Deputies,
    now: Moment,
    work: Workspace,
    optics: FullOptics | None,
    lead: int,
) -> PushPlanner:
    """Write the functions of a search as C, and return what their callers must know."""
    search, num_before = _Written(translator, deputies), len(translator.functions)
    for name, (function, arguments) in {**search.of_outlooks(now, work, optics), **search.of_plans()}.items():
        translator.write(name, function, arguments)
    constant_of, num_pushes = deputies.constant, deputies.num_pushes
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
        most_lead=lead,
        missed=num_missed(planned or constant_of("coast_below_points")),
        missed_of_required=num_missed(constant_of("coast_below_points")) if planned else -1,
        has_tail=search.has_tail,
        functions=tuple(function.name for function in translator.functions[num_before:]),
        members={
            "plan_draws": ((8,), "unsigned int"),
            **{f"plan_{name}": ((1,), "int") for name in COUNTERS},
            "plan_price": ((1,), "double"),
            "plan_force": ((3,), "double"),
        },
    )


class _Written:
    """The members of a state that a search works on, and the functions that do.

    Parameters
    ----------
    translator : Translator
    deputies : Deputies
        One, anywhere: its outlook has the tables.
    """

    def __init__(self, translator: Translator, deputies: Deputies) -> None:
        ((self._known, _),) = deputies.outlooks()
        self._translator, self._deputies = translator, deputies
        self._num_pushes, self._num_points = deputies.num_pushes, self._known.is_lit.shape[1]
        self.has_tail = len(self._known.tail.rows) > 0
        self._reach = deputies.constant("foresight_reach_m_s") / self._known.delta_v_per_force
        self._state = self._member("state", 6)
        num_samples = len(self._known.free)
        self._free = self._counted(self._member("free", num_samples, 3), "samples")
        lit = self._member("lit", num_samples, self._num_points, kind="unsigned char")
        self._is_lit = self._counted(lit, "samples")
        self._pricing = self._pricing_of(num_samples)
        self._search = self._search_of(4 * self._num_pushes - 1, FIRST[self._num_pushes].num_plans)

    def _member(self, name: str, *shape: int, kind: str = "double") -> Any:
        return self._translator.member(f"plan_{name}", shape, kind)

    def _counted(self, array: Array, name: str) -> Any:
        """Return an array of which only so many rows are in use as a member counts."""
        self._translator.member(f"plan_{name}", (1,), "int")
        count = Expression(f"state->plan_{name}", "int", range=(1, array.shape_whole[0]))
        return Begun(array.name, array.shape_whole, array.kind, array.data, count=count)

    def _table(self, name: str, data: Floats) -> Any:
        return self._counted(Array(f"plan_{name}", data.shape, "double", np.ascontiguousarray(data)), name)

    def _number(self, name: str, least: int, most: int) -> Any:
        """Return a whole number that a function is given."""
        return Expression(name, "int", True, (least, most))

    def _pricing_of(self, num_samples: int) -> Pricing:
        return Pricing(
            effects=np.ascontiguousarray(self._known.gain.transpose(2, 0, 1)).reshape(3, -1),
            samples=samples_coarsely(num_samples),
            is_weak=bool(self._reach > self._known.most_force),
            points=self._member("points", self._num_points, kind="int"),
            seen_at=self._member("seen_at", self._num_points, kind="int"),
            path=self._member("path", 3 * num_samples),
            room=self._member("room", num_samples),
            shortfalls=self._member("shortfalls", self._num_points),
            constants=self._member("drift", 6),
            doubts=self._doubts(num_doubts(self._known.tail, self._num_pushes)),
        )

    def _doubts(self, count: int) -> Any:
        """Return where deviations of pushes are noted; C has no array without elements."""
        return self._member("doubts", 6, count) if count else Array("state->no_doubts", (6, 0))

    def _search_of(self, num_genes: int, num_plans: int) -> PlanSearch:
        return PlanSearch(
            lowest=self._member("lowest", num_genes),
            highest=self._member("highest", num_genes),
            plans=self._member("plans", num_plans, num_genes),
            prices=self._member("prices", num_plans),
            mutants=self._member("mutants", num_plans, num_genes),
            costs=self._member("costs", num_plans),
            top=self._member("top", num_best(num_plans), kind="int"),
            best=self._member("best", num_genes),
            cost=self._member("cost", 1),
        )

    def _part(self) -> PlanSearch:
        """Return the search with the plans alone that are tried in a call."""
        num_plans = self._search.plans.shape[0]
        count = num_tried(num_plans)
        begins = Expression("state->plan_tried", "int", range=(0, num_plans - count))
        parts: dict[str, Any] = {
            name: Begun(array.name, array.shape_whole, array.kind, count=count, begins=begins)
            for name, array in self._search._asdict().items()
            if name in ("plans", "prices", "mutants", "costs")
        }
        return self._search._replace(**parts)

    def _outlook(self, required: Any) -> Outlook:
        tail: Any = self._known.tail
        if self.has_tail:  # of a circle's motion the constants are the state in which it begins
            rows, kicks = self._table("rows", tail.rows), self._table("kicks", tail.kicks)
            tail = tail._replace(rows=rows, kicks=kicks, constants=self._state)
        return self._known._replace(
            free=self._free,
            points=self._known.points[:1],
            normals=self._known.normals[:1],
            is_lit=self._is_lit,
            required=required,
            tail=tail,
        )

    def of_outlooks(self, now: Moment, work: Workspace, optics: FullOptics | None) -> dict[str, Entry]:
        """Return the functions that look ahead, each with its arguments, by name."""
        world, lanes, points = self._deputies.world, now.state.lanes, (0, self._num_points)
        held: Any = [Expression(f"held_{axis}", is_name=True) for axis in "xyz"]
        begins = self._number("begins", 0, world.num_controls - 1)
        light = {
            **{"world": world, "optics": optics, "lit_marks": work.lit, "ever": work.ahead},
            **{"sun_at_start": lanes.sun_at_start, "height_at_start": lanes.height_at_start},
            **{"wanted": self._member("wanted", world.points.shape[2]), "first": begins},
            **{"step": self._known.step, "is_lit": self._is_lit},
        }
        counted = {name: self._number(name, *points) for name in ("num_left", "num_lit", "missed")}
        motion = {"rows": self._deputies.drift, "state": self._state, "products": self._free}
        drift = {"world": world, "state": self._state, "force": Three(*held)}
        listed = {"points": self._pricing.points, "seen_at": self._pricing.seen_at}
        return {
            "predict": (aboard.predict, {**drift, "periods": self._number("periods", 0, world.num_controls)}),
            "note_free_motion": (aboard.note_products, motion),
            "note_light": (aboard.note_light, light),
            "list_lit": (list_lit, {"is_lit": self._is_lit, **listed}),
            "num_needed": (aboard.num_needed, counted),
        }

    def of_plans(self) -> dict[str, Entry]:
        """Return the functions that search for plans and fire them, each with its arguments, by name."""
        num_plans, num_genes = self._search.plans.shape
        longest = max(NUM_DRAWS + num_genes, num_plans)
        search = {"search": self._search, "num_pushes": self._num_pushes}
        required = self._number("required", 0, self._num_points)
        has_prices = self._deputies.constant("foresight_points") > 0.0
        selection = {
            **{**search, "search": self._part()},
            **{name: self._number(name, 0, self._num_points) for name in ("num_lit", "needed")},
            **{"outlook": self._outlook(required if has_prices else 0), "pricing": self._pricing},
            "is_exact": False,
        }
        fired = {"genes": self._member("chosen", num_genes), "num_pushes": self._num_pushes}
        return {
            "note_bounds": (
                aboard.note_bounds,
                {
                    **{**search, "reach": self._reach, "num_samples": self._free.count},
                    "is_tailed": bool(self._known.tail.num_after),
                },
            ),
            "scatter": (aboard.scatter, {"search": self._search, "draws": Draws(num_plans, longest)}),
            "breed": (breed, {"search": self._search, "draws": Draws(NUM_DRAWS + num_genes, longest)}),
            "select_cheaper": (select_cheaper, selection),
            "give": (
                aboard.give,
                {
                    **{**fired, "outlook": self._outlook(0), "most_force": self._deputies.most_force},
                    "period": self._number("period", 0, self._deputies.world.num_controls - 1),
                    "given": self._member("given", 4),
                },
            ),
        }
