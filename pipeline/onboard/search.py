"""A search for pushes on board: the members of a state that it works on, and the functions that do."""

from dataclasses import replace
from typing import Any

import numpy as np

from fis_tools.compiled.three import Three
from pipeline.array_types import Floats
from pipeline.flight.fly import aboard
from pipeline.flight.fly.drift import drift_tables, tail_stride
from pipeline.flight.fly.foresight import Outlook, Tail, samples_coarsely
from pipeline.flight.fly.free_drift import num_doubts
from pipeline.flight.fly.outlooks import TAIL_SPREADS, Deputies, rows_of_spread
from pipeline.flight.fly.prices import Pricing, list_lit
from pipeline.flight.fly.pushes import (
    NEAR_M_S,
    NEAR_SAMPLES,
    NEAR_SHARE,
    NUM_DRAWS,
    NUM_NEAR_DRAWS,
    PlanSearch,
    breed,
    num_best,
    select_cheaper,
)
from pipeline.flight.fly.replanning import FIRST
from pipeline.flight.state.arrays import FullOptics, Moment, Workspace
from pipeline.onboard.arrays import Array, Begun, Strided
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression

#: a function, and its arguments
Entry = tuple[Any, dict[str, Any]]
#: limits of plans that depend on how far the estimate may be off, as `aboard.note_limits` writes them
NEAREST, FARTHEST, LONGEST_WAY, SIGHT, MAX_RANGE = range(5)
#: of how many plans a part of a generation has at most: what a call tries at least
MOST_TRIED = 4


def num_tried(num_plans: int) -> int:
    """Return how many plans each part of a generation has, all parts alike."""
    return max(count for count in range(1, MOST_TRIED + 1) if num_plans % count == 0)


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


class Uniform:
    """A row of numbers that are all the same: a member of the state."""

    ndim = 1

    def __init__(self, array: Array, index: int) -> None:
        self.used: list[str] = []
        self._array, self._index = array, index

    def at(self, translator: Translator, _: Any) -> Any:
        """Return the number."""
        return translator.element(self._array, self._index)


class OnboardSearch:
    """A search on board: its arrays are members of a state, the tables of its outlook constants of the C.

    Parameters
    ----------
    translator : Translator
    deputies : Deputies
        One, anywhere: its outlook has the tables.
    """

    def __init__(self, translator: Translator, deputies: Deputies) -> None:
        #: least and greatest of members of the state that are whole numbers, as the search keeps them
        self.ranges: dict[str, tuple[int, int]] = {}
        ((self._known, _),) = deputies.outlooks()
        self._translator, self._deputies = translator, deputies
        self._num_pushes, self._num_points = deputies.num_pushes, self._known.is_lit.shape[1]
        self.has_tail = len(self._known.tail.rows) > 0
        self.has_covariance = deputies.mission.navigation.mode == "fixes"
        is_tabled = self.has_tail and deputies.has_tables
        self._tables = drift_tables(deputies.mission, deputies.beyond_s) if is_tabled else None
        self._reach = deputies.constant("foresight_reach_m_s") / self._known.delta_v_per_force
        self._state = self._member("state", 6)
        num_samples = len(self._known.free)
        self._free = self._counted(self._member("free", num_samples, 3), "samples")
        lit = self._member("lit", num_samples, self._num_points, kind="unsigned char")
        self._is_lit = self._counted(lit, "samples")
        self._pricing = self._pricing_of(num_samples)
        self._limits = self._member("limits", 5) if self.has_covariance else None
        self._search = self._search_of(4 * self._num_pushes - 1, FIRST[self._num_pushes].num_plans)

    def _member(self, name: str, *shape: int, kind: str = "double") -> Any:
        return self._translator.member(f"plan_{name}", shape, kind)

    def _counted(self, array: Array, name: str) -> Any:
        """Return an array of which only so many rows are in use as a member counts."""
        self._translator.member(f"plan_{name}", (1,), "int")
        count = self._count(name, 1, array.shape_whole[0])
        return Begun(array.name, array.shape_whole, array.kind, array.data, count=count)

    def _count(self, name: str, least: int, most: int) -> Expression:
        """Return a member that counts, and note its range."""
        self.ranges[f"plan_{name}"] = 0, most  # 0 until a search begins
        return Expression(f"state->plan_{name}", "int", range=(least, most))

    def _table(self, name: str, data: Floats) -> Any:
        return self._counted(Array(f"plan_{name}", data.shape, "double", np.ascontiguousarray(data)), name)

    def _number(self, name: str, least: int, most: int) -> Any:
        """Return a whole number that a function is given."""
        return Expression(name, "int", True, (least, most))

    def _pricing_of(self, num_samples: int) -> Pricing:
        self.ranges["plan_seen_at"] = 0, num_samples - 1
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
        begins = self._count("tried", 0, num_plans - count)
        parts: dict[str, Any] = {
            name: Begun(array.name, array.shape_whole, array.kind, count=count, begins=begins)
            for name, array in self._search._asdict().items()
            if name in ("plans", "prices", "mutants", "costs")
        }
        return self._search._replace(**parts)

    def _outlook(self, required: Any, samples: Any = None) -> Outlook:
        """Return an outlook from where a search begins, or with so many samples as are left of a plan."""
        tail: Any = self._tail if self.has_tail else self._known.tail
        outlook = self._known._replace(
            free=self._free if samples is None else replace(self._free, count=samples),
            is_lit=self._is_lit,
            required=required,
            tail=tail,
            **self._surface,
        )
        if not self.follows_course:
            return outlook
        sums: Any = self._from_now("sums", self._deputies.geometry.sums)
        return outlook._replace(rows=self._course, sums=sums)

    @property
    def _surface(self) -> dict[str, Any]:
        """The points and normals of an outlook; of a chief that turns, those of every sample."""
        known, geometry = self._known, self._deputies.geometry
        if len(self._deputies.world.points) == 1:
            return {"points": known.points[:1], "normals": known.normals[:1]}
        return {
            name: self._at_samples(f"{name}_of_chief", data, len(known.free))
            for name, data in (("points", geometry.points), ("normals", geometry.normals))
        }

    @property
    def follows_course(self) -> bool:
        """Whether motion follows the chief's true course."""
        return self._deputies.has_course

    @property
    def _course(self) -> Any:
        """What leads from constants of free motion along the chief's course to the samples of an outlook."""
        return self._at_samples("course", self._deputies.geometry.rows, self._free.count)

    def _at_samples(self, name: str, data: Floats, count: Any) -> Any:
        """Return the rows of a table at the samples of an outlook."""
        table = Strided(f"plan_{name}", data.shape, "double", data, count=count, stride=self._known.step)
        return replace(table, begins=self._begins)

    @property
    def _tail(self) -> Tail:
        """What follows a plan; of a circle's motion the constants are the state in which it begins."""
        tail: Any = self._known.tail
        if self._tables is None:
            rows, kicks = self._table("rows", tail.rows), self._table("kicks", tail.kicks)
            tail = tail._replace(rows=rows, kicks=kicks, constants=self._state)
        else:
            rows = self._strided("rows", self._tables.rows, len(tail.rows))
            offsets = self._strided("offsets", self._tables.offsets, len(tail.rows))
            kicks, constants = self._from_now("kicks", self._tables.sums), self._member("constants", 6)
            tail = tail._replace(rows=rows, offsets=offsets, kicks=kicks, constants=constants)
        return tail._replace(doubts=self._spreads) if self.has_covariance else tail

    @property
    def _spreads(self) -> Any:
        return self._member("spreads", len(self._known.tail.rows))

    def _from_now(self, name: str, data: Floats) -> Any:
        """Return the rows of a table from where a search begins on."""
        self._translator.member(f"plan_{name}", (1,), "int")
        count = self._count(name, 1, len(data))
        return Begun(f"plan_{name}", data.shape, "double", data, count=count, begins=self._begins)

    def _strided(self, name: str, data: Floats, most: int) -> Any:
        """Return rows of a table from where a search begins on, as far apart as those of a tail."""
        self._translator.member("plan_rows", (1,), "int")
        count = self._count("rows", 1, most)
        stride = tail_stride(self._deputies.mission)
        table = Strided(f"plan_{name}", data.shape, "double", data, count=count, stride=stride)
        return replace(table, begins=self._begins)

    @property
    def _begins(self) -> Expression:
        return self._count("period", 0, self._deputies.world.num_controls - 1)

    def _priced(self, required: Any) -> Outlook:
        """Return the outlook that plans are priced by: its limits depend on how far the estimate is off."""
        outlook = self._outlook(required)
        if self._limits is None:
            return outlook
        limits: dict[str, Any] = {
            name: Expression(text) for name, text in zip(self._limit_names, self.limits, strict=True)
        }
        limits |= {
            "heights": self._member("heights", self._num_points),
            "sight": Uniform(self._limits, SIGHT),
        }
        return outlook._replace(**limits)

    @property
    def _limit_names(self) -> tuple[str, ...]:
        """The limits of an outlook that the estimate's error changes, in its own order."""
        known = self._known
        names = "max_range", "nearest", "farthest", "longest_way"
        return tuple(name for name in names if getattr(known, name) < np.inf)

    @property
    def limits(self) -> tuple[str, ...]:
        """The same limits as C, in the same order."""
        rows = {"max_range": MAX_RANGE, "nearest": NEAREST, "farthest": FARTHEST, "longest_way": LONGEST_WAY}
        return tuple(f"state->plan_limits[{rows[name]}]" for name in self._limit_names if self.has_covariance)

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
        first = self._number("first", 0, world.num_controls - 1) if self.follows_course else 0
        drift = {"world": world, "state": self._state, "force": Three(*held), "first": first}
        listed = {"points": self._pricing.points, "seen_at": self._pricing.seen_at}
        return {
            "predict": (aboard.predict, {**drift, "periods": self._number("periods", 0, world.num_controls)}),
            **self._of_motion(),
            "note_light": (aboard.note_light, light),
            "list_lit": (list_lit, {"is_lit": self._is_lit, **listed}),
            "num_needed": (aboard.num_needed, counted),
        }

    def _of_motion(self) -> dict[str, Entry]:
        """Return the functions that lead a state on without force, each with its arguments, by name."""
        rows, state, entries = self._deputies.drift, self._state, dict[str, Entry]()
        if self.follows_course:
            back = self._from_now("back", self._deputies.geometry.back)
            state = self._member("free_constants", 6)
            to_constants = {"rows": replace(back, count=1), "state": self._state}
            to_constants["products"] = replace(state, shape_whole=(1, 6))
            entries["note_free_constants"] = aboard.note_products, to_constants
            rows = self._course
        motion = {"rows": rows, "state": state, "products": self._free}
        return {**entries, "note_free_motion": (aboard.note_products, motion)}

    def of_plans(self) -> dict[str, Entry]:
        """Return the functions that search for plans and fire them, each with its arguments, by name."""
        num_plans, num_genes = self._search.plans.shape
        longest = self._longest
        search = {"search": self._search, "num_pushes": self._num_pushes}
        required = self._number("required", 0, self._num_points)
        has_prices = self._deputies.constant("foresight_points") > 0.0
        selection = {
            **{**search, "search": self._part()},
            **{name: self._number(name, 0, self._num_points) for name in ("num_lit", "needed")},
            **{"outlook": self._priced(required if has_prices else 0), "pricing": self._pricing},
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
                    **{**fired, "outlook": self._flown, "most_force": self._deputies.most_force},
                    "period": self._number("period", 0, self._deputies.world.num_controls - 1),
                    "given": self._member("given", 4),
                },
            ),
        }

    @property
    def _longest(self) -> int:
        """The longest row of random numbers."""
        num_plans, num_genes = self._search.plans.shape
        near = 0 if self._deputies.is_certain else (NUM_NEAR_DRAWS + 1) * num_genes
        return max(NUM_DRAWS + num_genes, num_plans, near)

    @property
    def _flown(self) -> Outlook:
        """The outlook of the plan that is flown, while another one may be searched for."""
        if self._deputies.is_certain:
            return self._outlook(0)
        return self._outlook(0, self._count("flown_samples", 1, int(self._free.shape_whole[0])))

    def of_later_plans(self) -> dict[str, Entry]:
        """Return the functions that plan again, and fly ahead, each with its arguments, by name."""
        num_plans, num_genes = self._search.plans.shape
        last, num_controls = self._member("left", num_genes), self._deputies.world.num_controls
        chosen, periods = self._member("chosen", num_genes), self._number("period", 0, num_controls - 1)
        fired: dict[str, Any] = {"num_pushes": self._num_pushes, "most_force": self._deputies.most_force}
        given = self._member("given", 4)
        near = {
            **{"search": self._search, "last": last, "num_near": int(num_plans * NEAR_SHARE)},
            "spread_n": NEAR_M_S / self._known.delta_v_per_force,
            "spread_samples": NEAR_SAMPLES,
            "draws": Draws((NUM_NEAR_DRAWS + 1) * num_genes, self._longest),
        }
        left = {**fired, "genes": chosen, "outlook": self._flown, "num_controls": num_controls}
        left |= {"begun": self._number("begun", 0, num_controls - 1), "given": given, "left": last}
        ahead = {**fired, "genes": self._member("next", num_genes), "outlook": self._outlook(0)}
        held = {"genes": last, "num_pushes": self._num_pushes, "cost": Expression("cost", is_name=True)}
        names = "spent", "beyond", "num_left", "accepted", "price"
        costs: dict[str, Any] = {name: Expression(name, is_name=True) for name in names}
        entries: dict[str, Entry] = {
            "scatter_near": (aboard.scatter_near, near),
            "note_left": (aboard.note_left, left),
            "is_held": (aboard.is_held, {**held, "delta_v_per_force": self._known.delta_v_per_force}),
            "give_ahead": (aboard.give, {**ahead, "period": periods, "given": given}),
            "cost_ahead": (aboard.cost_ahead, costs),
        }
        if self._limits is not None:
            entries["note_limits"] = (aboard.note_limits, self._limiting())
        if self._limits is not None and self.has_tail:
            entries |= self._doubting()
        return entries

    def _doubting(self) -> dict[str, Entry]:
        """Return the functions that note how far what follows a plan may be off."""
        covariance, entries = self._member("covariance", 36), dict[str, Entry]()
        if self._tables is not None:
            turned = {"turns": self._from_now("turns", self._tables.turns), "covariance": covariance}
            turned |= {"half": self._member("half", 36), "turned": self._member("turned", 36)}
            entries["turn_covariance"] = (aboard.turn_covariance, turned)
            covariance = turned["turned"]
        doubted = {"rows": self._tail.rows, "covariance": covariance}
        doubted |= {"factor": TAIL_SPREADS**2, "doubts": self._spreads}
        return {**entries, "note_doubts": (aboard.note_doubts, doubted)}

    def of_constants(self) -> dict[str, Entry]:
        """Return the function that begins free motion along the chief's orbit, if it takes tables."""
        if self._tables is None:
            return {}
        from_state = {
            "turns": self._from_now("turns", self._tables.turns),
            "rests": self._from_now("rests", self._tables.rests),
            **{"state": self._state, "constants": self._member("constants", 6)},
        }
        return {"note_constants": (aboard.note_constants, from_state)}

    @property
    def _spread(self) -> Any:
        """What leads from a state where a plan begins to the position a time after it."""
        mission, seconds = self._deputies.mission, self._deputies.constant("foresight_period_s")
        if not self.follows_course:
            return rows_of_spread(mission, 0, seconds)
        rows = [rows_of_spread(mission, sample, seconds) for sample in range(mission.num_controls)]
        return Array("plan_spread", (len(rows), 3, 6), "double", np.array(rows)).at(self._begins)

    def _limiting(self) -> dict[str, Any]:
        """Return what `aboard.note_limits` is given."""
        deputies, geometry = self._deputies, self._deputies.geometry
        return {
            "bounds": deputies.bounds,
            "rows": self._spread,
            "covariance": self._member("covariance", 36),
            "heights_of_points": geometry.heights,
            "sight": float(deputies.sights()[0][0]),
            "max_range": geometry.max_range,
            "heights": self._member("heights", self._num_points),
            "limits": self._limits,
        }
