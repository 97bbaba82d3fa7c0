"""The input and the results of a flight, as arrays."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, Self, TypeVar

import numpy as np

from fis_tools.model.thrust import REASONS
from pipeline.array_types import Booleans, Floats, Integers
from pipeline.flight.state.arrays import allocated

#: the limit that the safety layer acted on at a sample, see `FlightLog.safety_limit`
SAFE, KEEP_OUT, KEEP_IN, SPEED, PASSIVE_SAFETY, APART, WAY_OUT, AXIS_SPEED, DELTA_V, SUN = range(10)
#: these limits in words
LIMITS = (
    *("safe", "keep-out", "keep-in", "speed", "passive safety", "another deputy", "way out"),
    *("speed along an axis", "delta-v", "Sun in view"),
)

#: what became of a component of the force, see `FlightLog.reason`; in the order of `REASONS`
FIRED, SILENT, DEAD_BAND, WAITING, COASTING, COMPLETE, CLIPPED, SAFETY, REHEARSED = range(9)
BELOW_LEAST_IMPULSE, DELAYED, EMPTY_TANK, PARKED = range(9, len(REASONS))
#: clip and safety layer count as changing a component above this, N; less is rounding
LEAST_CHANGE_N = 1e-9
#: of its greatest momentum, with which a wheel counts as full
FULL = 0.99


@dataclass(frozen=True)
class Scenario:
    """A start: position (m) and velocity (m/s), shape (3,), Hill axes, and where the Sun is at k = 0 (rad).

    The Sun's angle is in the orbit plane from +i towards +j, its elevation over that plane. `noise` is the
    seed, the stage and the case that errors of navigation and thrusters are drawn from; `settings` are given
    values of the dispersed keys, in the order of the sorted keys; without them they are drawn. `others` are
    the starts of the fleet's other deputies, under the same Sun.
    """

    position_m: Floats
    velocity_m_s: Floats
    sun_angle_rad: float
    sun_elevation_rad: float = 0.0
    noise: tuple[int, int, int] = (0, 0, 0)
    settings: tuple[float, ...] | None = None
    others: "tuple[Scenario, ...]" = ()

    @property
    def fleet(self) -> "tuple[Scenario, ...]":
        """The starts of all deputies, this one's first."""
        return self, *self.others

    def generator(self, what: int) -> np.random.Generator:
        """Return the random generator for one kind of errors in the flight from here."""
        seed, stage, case = self.noise
        return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stage, case, what)))


class FlightLog(NamedTuple):
    """Log of one flight of K control periods with S attitude steps each; every array says its shape.

    Samples run over k = 0 … K, controls over k = 0 … K-1. All axes are Hill's unless a name says otherwise.
    P is the number of inspection points, F the number of fuzzy systems. Attitudes are scalar last.
    """

    position_m: Annotated[Floats, "K+1", 3]
    velocity_m_s: Annotated[Floats, "K+1", 3]
    quaternion_b_from_h: Annotated[Floats, "K+1", 4]  # Hill to deputy body
    sensed_quaternion_b_from_h: Annotated[Floats, "K+1", 4]  # the same as the deputy senses it
    angular_velocity_b_rad_s: Annotated[Floats, "K+1", 3]  # of the deputy relative to Hill, in body axes
    quaternion_c_from_h: Annotated[Floats, "K+1", 4]  # Hill to chief body
    # at each instant of the attitude clock inside the control period that follows sample k
    attitude_quaternion: Annotated[Floats, "K", "S", 4]
    attitude_rate_b_rad_s: Annotated[Floats, "K", "S", 3]
    torque_b_n_m: Annotated[Floats, "K", "S", 3]  # as applied from that instant on
    # of the wheels along body axes, at that instant; zeros where it is not limited
    wheel_momentum_b_n_m_s: Annotated[Floats, "K", "S", 3]
    # commanded by the controller, before the clip, body axes (turned to them if it commands Hill axes)
    force_body_n: Annotated[Floats, "K", 3]
    force_hill_n: Annotated[Floats, "K", 3]  # as fired over the control period that follows
    force_commanded_n: Annotated[Floats, "K", 3]  # to the thrusters: after dead bands, clip and safety layer
    # commanded by the controller's systems or plan, in the controller's own axes, before dead bands, clip and
    # safety layer; zero without a command
    force_asked_n: Annotated[Floats, "K", 3]
    # why each of these components was, or was not, commanded: `FIRED` for as asked for, and so on. Clip
    # and safety layer act along Hill axes; if the controller's axes are the body's, they mark all three
    command_reason: Annotated[Integers, "K", 3]
    # of ideal thrusters the same; else why something was, or was not, fired along each of Hill's axes: the
    # reason of the command that was due or, where none was, of this period's; besides, `BELOW_LEAST_IMPULSE`,
    # `DELAYED` or `EMPTY_TANK`. A force that errors alone made is `FIRED`
    reason: Annotated[Integers, "K", 3]
    # basis of the decision to coast: points that coasting to the end would miss, least and greatest distance
    # on the way, m; NaN where not computed
    foreseen: Annotated[Floats, "K", 3]
    is_missed: Annotated[Booleans, "K", "P"]  # whether coasting to the end would miss a point; where foreseen
    # of which points signals were made, where decided: those lit and not inspected, and of the look at each
    # that `see_push_*` is fitted to the shortfall, m, and its slopes with the push, s; zeros for none
    is_candidate: Annotated[Booleans, "K", "P"]
    looks: Annotated[Floats, "K", "P", 4]
    last_light_s: Annotated[Floats, "P"]  # when it is lit for the last time; zeros where no signal asks
    num_candidates: Annotated[Integers, "K+1"]  # lit and not yet inspected, after the inspection of sample k
    target_m: Annotated[Floats, "K+1", 3]  # the point p_u; zeros without candidates
    lambda_u_rad: Annotated[Floats, "K+1"]
    eta_u_rad: Annotated[Floats, "K+1"]
    # before clipping; zero in unused places, and everywhere if `is_decided` is false
    fis_input: Annotated[Floats, "K", "F", 3]
    fis_output_n: Annotated[Floats, "K", "F"]
    is_decided: Annotated[Booleans, "K"]  # by inference: not while coasting, nor between two decisions
    sun_angle_rad: Annotated[Floats, "K+1"]
    sun_elevation_rad: Annotated[Floats, "K+1"]
    visible_sun_share: Annotated[Floats, "K+1"]  # of its disc, not hidden by the Earth; 1 without its shadow
    is_inspectable: Annotated[Booleans, "P"]  # whether a point is lit at some sample
    is_inspected: Annotated[Booleans, "K+1", "P"]
    delta_v_m_s: Annotated[Floats, "K+1"]  # spent by the forces 0 … k-1
    mass_kg: Annotated[Floats, "K+1"]  # of the deputy
    # for which the safety layer changed the force; `SAFE` if unchanged
    safety_limit: Annotated[Integers, "K"]
    safety_force_hill_n: Annotated[Floats, "K", 3]  # its change after the clip; part of `force_hill_n`
    # position (m) and velocity (m/s) as the deputy knew them, if it navigates by fixes
    estimate: Annotated[Floats, "K+1", 6]
    estimate_covariance: Annotated[Floats, "K+1", 6, 6]
    fix_m: Annotated[Floats, "K+1", 3]  # that comes into use; NaN where none does, like the next two
    innovation_m: Annotated[Floats, "K+1", 3]  # it minus the position that the filter expects
    innovation_square: Annotated[Floats, "K+1"]  # in standard deviations (NIS), of 3 degrees of freedom
    # costs by which the first push was chosen, and the tour in each rehearsal, m/s; none without a rehearsal
    push_costs_m_s: Annotated[Floats, "R"]
    tour_costs_m_s: Annotated[Floats, "R", "R"]
    # decisions of foresight, see `replanning.PlannedDecision`: sample, plans priced and points
    # that coasting would miss; plans, of pushes as sample and force; prices; and costs of flights ahead
    foresight_at: Annotated[Floats, "R", 3]
    foresight_plans: Annotated[Floats, "R", 5, 3, 4]
    foresight_prices_m_s: Annotated[Floats, "R", 5]
    foresight_ends_m_s: Annotated[Floats, "R", 4]


def empty_log(num_controls: int, num_attitude_steps: int, num_points: int, num_systems: int) -> FlightLog:
    """Allocate the log of a flight: zeros; NaN in `foreseen` and fixes, all of the Sun and points."""
    sizes = {"K": num_controls, "K+1": num_controls + 1, "S": num_attitude_steps}
    sizes |= {"P": num_points, "F": num_systems, "R": 0}
    log: FlightLog = allocated(FlightLog, sizes)
    log.visible_sun_share[:], log.is_inspectable[:] = 1.0, True
    for unknown in (log.foreseen, log.fix_m, log.innovation_m, log.innovation_square):
        unknown[:] = np.nan
    return log


#: the log of flights that are not logged: arrays without samples
NO_LOG = FlightLog._make(values[:0] for values in empty_log(0, 0, 0, 0))


@dataclass(frozen=True)
class Outcomes:
    """Results of flights, one entry per flight; controllers by scenarios for several controllers."""

    delta_v_m_s: Floats
    inspected_count: Integers
    inspectable_count: Integers  # points that are lit at some sample of the flight
    mean_distance_m: Floats  # over samples 0 … K, like the next two
    min_distance_m: Floats
    max_distance_m: Floats
    outside_m: Floats  # largest distance of samples 1 … K outside the distance limits; zero inside
    safety_periods: Integers  # in which the safety layer changed the force; zero where it is off
    # of its changes, ``sum |applied - asked| T/m`` over Hill components; their net effect on `delta_v_m_s`
    # may be less, or negative
    safety_delta_v_m_s: Floats
    # of pushes chosen ahead, before the safety layer; the rules command the rest of `delta_v_m_s`
    ahead_delta_v_m_s: Floats
    full_wheel_s: Floats  # time in which some wheel is full; zero where their momentum is not limited

    @property
    def is_violated(self) -> Booleans:
        """Whether a sample 1 … K was outside the distance limits."""
        return self.outside_m > 0.0

    def is_success(self, threshold_percent: float | Floats) -> Booleans:
        """Whether enough of the inspectable points are inspected, by one threshold or one for each flight."""
        return np.asarray(self.inspected_count >= points_needed(self.inspectable_count, threshold_percent))

    def each(self, change: Callable[[Any], Any]) -> Self:
        """Return outcomes with every array changed in the same way."""
        return type(self)(**{name: change(values) for name, values in vars(self).items()})


Kind = TypeVar("Kind", bound=Outcomes)


def combined(parts: Sequence[Kind], join: Callable[..., Any] = np.concatenate) -> Kind:
    """Return the outcomes of some flights, then those of others, as those of all."""
    names = vars(parts[0])
    return type(parts[0])(**{name: join([vars(part)[name] for part in parts]) for name in names})


def inspectable_rate(inspected: Any, inspectable: Any) -> Any:
    """Return the share of the inspectable points that are inspected, in %; 100 without any."""
    return np.where(np.equal(inspectable, 0), 100.0, 100.0 * inspected / np.maximum(inspectable, 1))[()]


def points_needed(num_points: Any, threshold_percent: float | Floats) -> Any:
    """Return the least number of points whose rate reaches the threshold, for a number or an array."""
    needed = np.ceil(num_points * threshold_percent / 100.0 - 1e-9)
    return int(needed) if np.ndim(needed) == 0 else needed.astype(np.int64)
