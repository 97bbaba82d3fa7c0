"""What plans of pushes are priced by: the rest of a flight, as deputies know it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from fis_tools.compiled.decorator import plain
from fis_tools.compiled.three import Three
from fis_tools.engines.kernel import LANES
from pipeline.array_types import Booleans, Bytes, Floats, Integers
from pipeline.flight.cases.actuators import thrusters_of
from pipeline.flight.cases.navigation import filter_of
from pipeline.flight.cases.starts import Cases, cases_of, starts_of
from pipeline.flight.control.controller import RuleController
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.aboard import (
    Confines,
    limits_of,
    margin_of,
    note_constants,
    note_doubts,
    note_products,
    num_needed,
    predict,
    spread_of,
    turn_covariance,
)
from pipeline.flight.fly.drift import Drift, drift_from, drift_tables, num_rows, tail_along, tail_stride
from pipeline.flight.fly.foresight import (
    NO_TAIL,
    Geometry,
    Outlook,
    Tail,
    by_steps,
    geometry_of,
    lit_at_samples,
    sight_along,
)
from pipeline.flight.fly.lesser_controllers import finishing
from pipeline.flight.fly.many import Results, fly_many
from pipeline.flight.fly.population import flights_of, fly_population
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.state.arrays import NUM_OUTCOMES, NUM_TRACKED, TRACK_BORESIGHT, World
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.state.signals import constant
from pipeline.flight.world.bounds import guard_of
from pipeline.flight.world.coasting import rows_after
from pipeline.flight.world.pack import pack_world
from pipeline.physics.transitions import follows_course
from pipeline.settings.equipment import RealActuators
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

#: time between the samples at which plans are priced, s, by the number of pushes
LOOK_S = {2: 30.0, 3: 20.0}
#: by how many standard deviations along the track, of the estimate and of what thrusters fire, what follows
#: plans stays within the limits
TAIL_SPREADS = 2.0
#: control periods before a plan begins in which a search on board knows where, and what is left to inspect
LEAD = 1
#: a component of a push smaller than this is not commanded, m/s, nor one that thrusters would not fire whose
#: scale is so many standard deviations too small
LEAST_M_S, LEAST_SPREADS = 3e-4, 2.0


@lru_cache(maxsize=8)
def _geometry(mission: Mission) -> Geometry:
    return geometry_of(mission, pack_world(mission))


@lru_cache(maxsize=32)
def _strided(mission: Mission, sample: int, step: int, *, is_bare: bool = False) -> Geometry:
    """Return the geometry at every `step`-th sample from `sample` on, where motion begins.

    On board, sums along a true course are those since the start.
    """
    geometry = _geometry(mission)
    ahead, after = slice(None, mission.num_controls + 1 - sample, step), slice(sample, None, step)
    if len(geometry.rows) > 0:
        rows = np.ascontiguousarray(geometry.rows[after])
        before = 0.0 if is_bare else geometry.sums[sample]
        sums = np.ascontiguousarray(geometry.sums[sample:] - before)
        geometry = geometry._replace(rows=rows, sums=sums)
        drift = rows @ geometry.back[sample]
    else:
        drift = np.ascontiguousarray(geometry.drift[ahead])
    return geometry._replace(
        drift=drift,
        gain=np.ascontiguousarray(geometry.gain[ahead]),
        points=np.ascontiguousarray(geometry.points[after]),
        normals=np.ascontiguousarray(geometry.normals[after]),
        held=by_steps(geometry.held, step),
    )


def rows_of_spread(mission: Mission, sample: int, seconds: float) -> Floats:
    """Return what leads from a state at a sample to the position a time after it, in free motion, (3, 6)."""
    world = pack_world(mission)
    periods = round(seconds / world.control_period)
    phi, course = np.linalg.matrix_power(world.motion.transition[0], periods)[:3], world.transitions
    if follows_course(course):
        phi = course.onward[min(sample + periods, len(course.onward) - 1), :3] @ course.back[sample]
    return np.ascontiguousarray(phi)


def spread_after(
    mission: Mission, sample: int, covariances: Floats, seconds: float, *, is_bare: bool = False
) -> Floats:
    """Return how far positions may be off a time after a sample, in free motion, (m,), m: a deviation.

    It is the largest along any direction, of covariances of position and velocity, (m, 6, 6); on board a
    number that is at least as great.
    """
    phi = rows_of_spread(mission, sample, seconds)
    if is_bare:
        return np.array([spread_of(phi, each.ravel()) for each in covariances])
    return np.asarray(np.sqrt(np.linalg.eigvalsh(phi @ covariances @ phi.T)[:, -1].clip(0.0)))


@dataclass(frozen=True)
class Deputies:
    """Deputies of a controller with foresight at a sample of their flights, m of them.

    Parameters
    ----------
    mission, known : Mission
        As it is, and as they know it.
    controller : RuleController
    believed : sequence of Scenario
        Their starts, with positions and velocities as they believe them to be now.
    spreads_m : (m,)
        How far these may be off by the next decision, standard deviations.
    covariances : (m, 6, 6)
        Of these now; zero where they are known.
    sample : int
    lit : sequence of (K+1, P)
        Which points are lit when in each flight.
    left : (m, P padded) or None
        1 for points still to be inspected; None at the start.
    lanes : int
    """

    mission: Mission
    known: Mission
    controller: RuleController
    believed: Sequence[Scenario]
    spreads_m: Floats
    covariances: Floats
    sample: int
    lit: Sequence[Booleans]
    left: Bytes | None = None
    lanes: int = LANES
    world: World = field(init=False)

    def __post_init__(self) -> None:
        """Pack the mission as the deputies know it, from their sample on, with their safety layer."""
        world = pack_world(self.known)._replace(
            first=self.sample, guard=guard_of(self.mission), after=rows_after(self.mission, self.after_s)
        )
        object.__setattr__(self, "world", world)

    def constant(self, name: str) -> float:
        """Return a constant of the controller."""
        return float(self.controller.constants[constant(name)])

    @property
    def num_pushes(self) -> int:
        """How many pushes they plan together."""
        return round(self.constant("foresight_pushes"))

    @property
    def after_s(self) -> float:
        """How long flights ahead must stay within the limits after their end, s."""
        return max(self.mission.after_s, self.constant("foresight_after_s"))

    @property
    def step(self) -> int:
        """The control periods between the samples at which plans are priced."""
        return max(1, round(LOOK_S[self.num_pushes] / self.mission.control_period_s))

    @property
    def least_force(self) -> float:
        """The least force along an axis that is worth commanding, N: thrusters that err still fire it."""
        thrusters, actuators = thrusters_of(self.mission), self.mission.actuators
        error = actuators.scale_error if isinstance(actuators, RealActuators) else 0.0
        fired = max(thrusters.least, 0.5 * thrusters.step) * (1.0 + LEAST_SPREADS * error)
        return max(fired, LEAST_M_S / self.world.delta_v_per_force)

    @property
    def most_force(self) -> float:
        """The greatest force along an axis that is fired as planned, N; larger pushes take longer."""
        guard = self.world.guard
        return min(self.world.max_force, guard.planned_force) if guard.is_on else self.world.max_force

    @property
    def is_bare(self) -> bool:
        """Whether they plan as on board: sum by sum, and ahead of what they see and estimate."""
        return self.constant("foresight_bare") > 0.0

    @property
    def is_certain(self) -> bool:
        """Whether the mission is as they know it, but for their camera: then plans are made once."""
        return replace(self.known, attitude=self.mission.attitude) == self.mission

    @property
    def geometry(self) -> Geometry:
        """The chief and the deputies' camera as they know them."""
        return _geometry(self.known)

    @property
    def bounds(self) -> Confines:
        """What limits their way."""
        world, guard, infinite = self.world, self.world.guard, float("inf")
        return Confines(
            nearest=world.min_distance,
            farthest=world.max_distance,
            inside=self.constant("coast_margin_m"),
            keep_out=guard.keep_out if guard.is_on else -infinite,
            keep_in=guard.keep_in if guard.is_on else infinite,
            # it stops whoever is faster along an axis than it can brake in a control period
            fastest=guard.braking_force * world.delta_v_per_force if guard.is_on else infinite,
            seconds=self.step * world.control_period,
            period=self.constant("foresight_period_s") or infinite,
        )

    def only(self, flights: Integers) -> "Deputies":
        """Return the deputies of these flights alone."""
        left = None if self.left is None else self.left[flights]
        believed, lit = ([of[flight] for flight in flights] for of in (self.believed, self.lit))
        spreads, covariances = self.spreads_m[flights], self.covariances[flights]
        return replace(
            self, believed=believed, spreads_m=spreads, covariances=covariances, lit=lit, left=left
        )

    def fly(
        self,
        controller: RuleController,
        openings: Floats | None = None,
        tracks: np.ndarray[tuple[int, int, int], np.dtype[np.float32]] | None = None,
    ) -> Outcomes:
        """Fly ahead from here to the end as they know the mission, and their safety layer; arrays (m,)."""
        ends = fly_population(
            self.world,
            law_of(controller, self.known),
            controller.numbers,
            cases_of(self.known, list(self.believed)),
            1,
            tracks,
            openings,
            self.lanes,
            wanted=self.left,
        )
        return ends.each(lambda values: values[0])

    def coasting(self) -> Floats:
        """Return openings that fire nothing, (m, K, 4)."""
        openings = np.zeros((len(self.believed), self.world.num_controls, 4))
        openings[..., 3] = 1.0
        return openings

    def outlooks(self) -> list[tuple[Outlook, int]]:
        """Return, for each flight, what prices its plans, and the number of points they must see."""
        return [self._outlook(flight, sight) for flight, sight in enumerate(self.sights())]

    def sights(self) -> Sequence[Floats]:
        """Return the distances from which each camera covers all, (K+1 - sample,), coasting from here."""
        count, num_samples = len(self.believed), self.world.num_controls + 1 - self.sample
        radius, half_angle = _geometry(self.known).radius, self.known.sensor.narrowest_deg
        if self.known.attitude.mode == "ideal":
            inward = np.tile([1.0, 0.0, 0.0], (num_samples, 1))
            return [sight_along(-inward, inward, radius, half_angle)] * count
        tracks = np.empty((count, num_samples, NUM_TRACKED), dtype=np.float32)
        self.fly(finishing(self.controller), self.coasting(), tracks)
        positions = tracks[..., :3].astype(np.float64)
        boresights = tracks[..., TRACK_BORESIGHT : TRACK_BORESIGHT + 3].astype(np.float64)
        return [sight_along(*each, radius, half_angle) for each in zip(positions, boresights, strict=True)]

    def _outlook(self, flight: int, sight: Floats) -> tuple[Outlook, int]:
        """Return the quantities that plans of a flight are priced by, and the points that one must see."""
        world, scenario, geometry = self.world, self.believed[flight], _geometry(self.known)
        parts = _strided(self.known, self.sample, self.step, is_bare=self.is_bare)
        is_lit, needed, required = self._points(flight)
        margin = plain(margin_of)(float(self.spreads_m[flight]))
        nearest, farthest, longest_way = plain(limits_of)(self.bounds, margin)
        outlook = Outlook(
            free=self._free(parts, np.r_[scenario.position_m, scenario.velocity_m_s]),
            gain=parts.gain,
            points=parts.points,
            normals=parts.normals,
            heights=geometry.heights + margin,
            is_lit=np.ascontiguousarray(is_lit[:: self.step]),
            sight=np.ascontiguousarray(sight[:: self.step] + margin),
            cos_incidence=geometry.cos_incidence,
            max_range=geometry.max_range - margin,
            nearest=nearest,
            farthest=farthest,
            longest_way=longest_way,
            least_force=self.least_force,
            delta_v_per_force=world.delta_v_per_force,
            required=required,
            most_force=world.max_force,
            held=parts.held,
            step=self.step,
            rows=parts.rows,
            sums=parts.sums,
            tail=self._tail(flight),
        )
        return outlook, needed

    def _free(self, parts: Geometry, state: Floats) -> Floats:
        """Return positions from a state on without force, (S, 3), m; on board by constants of free motion."""
        if not (self.is_bare and self.has_course):
            return self._product(parts.drift, state)
        return self._product(parts.rows, self._product(self.geometry.back[self.sample], state))

    @property
    def has_course(self) -> bool:
        """Whether they know the chief's true course."""
        return bool(follows_course(self.world.transitions))

    @property
    def drift(self) -> Floats:
        """What leads from a state to the samples of an outlook without force, (S, 3, 6)."""
        return _strided(self.known, self.sample, self.step).drift

    def _product(self, rows: Floats, state: Floats) -> Floats:
        """Return the products of rows of six numbers, (..., 6), with a state, (6,)."""
        if not self.is_bare:
            return np.asarray(rows @ state)
        products = np.empty(rows.shape[:-1])
        note_products(rows.reshape(-1, *rows.shape[-2:]), state, products.reshape(-1, rows.shape[-2]))
        return products

    @property
    def _drift_beyond(self) -> Drift:
        """Free motion to so long after the end as plans are priced by."""
        if self.has_tables:
            count = num_rows(self.mission, self.sample, self.beyond_s)
            tables = drift_tables(self.mission, self.beyond_s)
            return tables.from_sample(self.sample, tail_stride(self.mission), count)
        return drift_from(self.mission, self.sample, self.beyond_s)

    @property
    def beyond_s(self) -> float:
        """How long after the end plans are priced by, s."""
        return max(self.after_s, self.constant("foresight_passive_s"))

    @property
    def has_tables(self) -> bool:
        """Whether they plan on board by tables of motion along the chief's orbit."""
        return self.is_bare and isinstance(self.mission.dynamics, TwoBody)

    def _doubts(self, drift: Drift, covariance: Floats) -> Floats:
        """Return how far along the track the deputy may be off at these instants, squares, (T,), m^2."""
        factor = TAIL_SPREADS**2
        if not self.is_bare:
            ahead = drift.rows[:, 1] @ drift.constants
            return np.asarray(factor * np.einsum("ji,ik,jk->j", ahead, covariance, ahead))
        doubts, turned = np.empty(len(drift.rows)), covariance.ravel()
        if self.has_tables:
            given, turned = turned, np.empty(36)
            turn_covariance(drift.constants[np.newaxis], given, np.empty(36), turned)
        note_doubts(drift.rows, turned, factor, doubts)
        return doubts

    def _constants(self, drift: Drift, state: Floats) -> Floats:
        """Return the constants of free motion from a state on, (6,)."""
        if not self.has_tables:
            return self._product(drift.constants, state - drift.rest)
        constants = np.empty(6)
        note_constants(drift.constants[np.newaxis], drift.rest[np.newaxis], state, constants)
        return constants

    def _tail(self, flight: int) -> Tail:
        """Return what prices what follows pushes and the end, of a flight."""
        after, passive = self.after_s, self.constant("foresight_passive_s")
        if after == passive == 0.0:
            return NO_TAIL
        drift, start = self._drift_beyond, self.believed[flight]
        reach = self.constant("foresight_reach_m_s") / self.world.delta_v_per_force
        scale = tilt = 0.0
        if isinstance(actuators := self.mission.actuators, RealActuators):
            scale, tilt = actuators.scale_error, float(np.radians(actuators.misalignment_deg))
        constants = self._constants(drift, np.r_[start.position_m, start.velocity_m_s])
        return tail_along(self.mission, drift, constants, after_s=after, passive_s=passive)._replace(
            doubts=self._doubts(drift, self.covariances[flight]),
            scale_doubt=(TAIL_SPREADS * scale) ** 2,
            tilt_doubt=(TAIL_SPREADS * tilt) ** 2,
            doubt_price=self.constant("foresight_doubt_m_s"),
            most_force=self.most_force if self.most_force < reach else np.inf,
        )

    def _points(self, flight: int) -> tuple[Booleans, int, int]:
        """Return which points left are lit when, and how many of them a plan must see, at what price.

        Returns
        -------
        is_lit : (K+1 - sample, P)
        needed, required : int
            Points to see, and of these the ones whose shortfall costs more: where more are planned for than
            the controller needs before it coasts, those that it needs.
        """
        planned, accepted = self.constant("foresight_points"), self.constant("coast_below_points")
        is_lit = self.lit[flight]
        is_left = is_lit.any(axis=0)
        if self.left is not None:
            is_left &= self.left[flight, : is_lit.shape[1]] > 0
        is_lit = is_lit[self.sample :] & is_left
        num_left, num_lit = int(is_left.sum()), int(is_lit[:: self.step].any(axis=0).sum())

        def all_but(below: float) -> int:
            return int(num_needed(num_left, num_lit, num_missed(below)))

        return is_lit, all_but(planned or accepted), all_but(accepted) if planned else 0


def num_missed(below: float) -> int:
    """Return how many points may be missed where fewer than so many, not always a whole number, may."""
    return max(0, int(np.ceil(below)) - 1)


def later(
    deputies: Deputies, scenarios: list[Scenario], cases: Cases, openings: Floats, sample: int, period: int
) -> Deputies:
    """Return deputies at a later sample, with their cameras aimed by then.

    They fly from their starts, of which `cases` are made, with the openings so far, (m, K, 4); the next
    decision is due after so many control periods. On board it is known `LEAD` control periods before where
    they will be.
    """
    mission, flown = deputies.mission, finishing(deputies.controller)
    lead = min(LEAD, sample) if deputies.is_bare else 0
    known_at = sample - lead
    world, rows = pack_world(mission)._replace(last=known_at), room_for_known(mission, len(scenarios))
    fly_population(
        *(world, law_of(flown, mission), flown.numbers, cases, 1),
        openings=np.ascontiguousarray(openings[:, :known_at]),  # another memory layout would be compiled anew
        lanes=deputies.lanes,
        known=rows,
    )
    if lead:
        forces = _commanded(flown, mission, cases, openings, known_at, deputies.lanes)
        for row, force in zip(rows, forces, strict=True):
            predict(deputies.world, row[:6], Three(*force.tolist()), known_at, lead)
    return by_then(deputies, scenarios, rows, sample, period)


def room_for_known(mission: Mission, count: int) -> Floats:
    """Return room for what deputies know at a sample, see `fly_population`: with covariances, if by fixes."""
    num_points = pack_world(mission).num_points
    return np.empty((count, 6 + num_points + 36 * (mission.navigation.mode == "fixes")))


def by_then(
    deputies: Deputies, scenarios: list[Scenario], rows: Floats, sample: int, period: int
) -> Deputies:
    """Return deputies at a later sample by what they know then, as `fly_population` writes it, (m, 6+P...).

    The other parameters are those of `later`.
    """
    mission, num_points = deputies.mission, deputies.world.num_points
    left = np.zeros((len(scenarios), deputies.world.points.shape[2]), dtype=np.uint8)
    left[:, :num_points] = rows[:, 6 : 6 + num_points]
    believed = [
        replace(start, position_m=row[:3], velocity_m_s=row[3:6])
        for start, row in zip(scenarios, rows, strict=True)
    ]
    spreads, covariances = np.zeros(len(scenarios)), np.zeros((len(scenarios), 6, 6))
    if mission.navigation.mode == "fixes":
        covariances = rows[:, 6 + num_points :].reshape(-1, 6, 6)
        seconds = period * mission.control_period_s
        spreads = spread_after(mission, sample, covariances, seconds, is_bare=deputies.is_bare)
    known = replace(deputies.known, attitude=replace(mission.attitude, mode="ideal"))
    return replace(
        deputies,
        known=known,
        believed=believed,
        spreads_m=spreads,
        covariances=covariances,
        sample=sample,
        left=left,
    )


def _commanded(
    controller: RuleController, mission: Mission, cases: Cases, openings: Floats, sample: int, lanes: int
) -> Floats:
    """Return what flights with openings, (m, K, 4), command at a sample, (m, 3), N, Hill axes."""
    world, law = pack_world(mission)._replace(last=sample + 1), law_of(controller, mission)
    opened = np.ascontiguousarray(openings[:, : sample + 1])
    parts, flights, _ = flights_of(world, law, controller.numbers, cases, opened)
    state, work = make_state(world, parts[-1], lanes), make_workspace(world, lanes)
    results, forces = Results(np.empty((len(cases), NUM_OUTCOMES))), np.empty((len(cases), 3))
    for first in range(0, len(cases), lanes):
        last = min(first + lanes, len(cases))
        fly_many(*parts, flights, state, work, results, first, last)
        forces[first:last] = state.lanes.commanded[:, : last - first].T
    return forces


def at_start(
    mission: Mission,
    known: Mission,
    controller: RuleController,
    believed: list[Scenario],
    period: int,
    lanes: int,
) -> Deputies:
    """Return the deputies at some starts, as they believe them to be; `period` as for `later`."""
    spreads, world = np.zeros(len(believed)), pack_world(known)
    covariances = np.zeros((len(believed), 6, 6))
    if mission.navigation.mode == "fixes":
        covariances[:] = filter_of(mission).at_start
        spreads[:] = spread_after(mission, 0, covariances[:1], period * mission.control_period_s)
    work = make_workspace(world)
    lit = [lit_at_samples(world, starts_of([start]), work) for start in believed]
    return Deputies(mission, known, controller, believed, spreads, covariances, 0, lit, lanes=lanes)
