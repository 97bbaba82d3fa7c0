"""The input and the results of a flight, as arrays."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.model.thrust import REASONS
from pipeline.array_types import Floats

#: the limit that the safety layer acted on at a sample, see `FlightLog.safety_limit`
SAFE, KEEP_OUT, KEEP_IN, SPEED, PASSIVE_SAFETY = range(5)

#: what became of a component of the force, see `FlightLog.reason`; in the order of `REASONS`
FIRED, SILENT, DEAD_BAND, WAITING, COASTING, COMPLETE, CLIPPED, SAFETY, REHEARSED, *_LATER = range(
    len(REASONS)
)
BELOW_LEAST_IMPULSE, DELAYED, EMPTY_TANK = _LATER
#: clip and safety layer count as changing a component above this, N; less is rounding
LEAST_CHANGE_N = 1e-9


@dataclass(frozen=True)
class Scenario:
    """A start: position (m) and velocity (m/s), shape (3,), Hill axes, and where the Sun is at k = 0 (rad).

    The Sun's angle is in the orbit plane from +i towards +j, its elevation over that plane. `noise` is the
    seed, the stage and the case that errors of navigation and thrusters are drawn from; `settings` are given
    values of the dispersed keys, in the order of the sorted keys; without them they are drawn.
    """

    position_m: Floats
    velocity_m_s: Floats
    sun_angle_rad: float
    sun_elevation_rad: float = 0.0
    noise: tuple[int, int, int] = (0, 0, 0)
    settings: tuple[float, ...] | None = None

    def generator(self, what: int) -> np.random.Generator:
        """Return the random generator for one kind of errors in the flight from here."""
        seed, stage, case = self.noise
        return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stage, case, what)))


class FlightLog(NamedTuple):
    """Log of one flight of K control periods with S attitude steps each.

    Samples run over k = 0 … K, controls over k = 0 … K-1. All axes are Hill's unless a name says otherwise.
    P is the number of inspection points, F the number of fuzzy systems.

    Attributes
    ----------
    position_m, velocity_m_s : (K+1, 3)
    quaternion_b_from_h : (K+1, 4)
        Hill to deputy body, scalar last.
    sensed_quaternion_b_from_h : (K+1, 4)
        The same as the deputy senses it.
    angular_velocity_b_rad_s : (K+1, 3)
        Of the deputy relative to Hill, in body axes.
    quaternion_c_from_h : (K+1, 4)
        Hill to chief body, scalar last.
    attitude_quaternion : (K, S, 4), attitude_rate_b_rad_s : (K, S, 3)
        At each instant of the attitude clock inside the control period that follows sample k.
    torque_b_n_m : (K, S, 3)
        As applied from that instant on.
    force_body_n : (K, 3)
        Commanded by the controller, before the clip, body axes (Hill axes turned to body if the
        controller commands Hill axes).
    force_hill_n : (K, 3)
        As fired over the control period that follows.
    force_commanded_n : (K, 3)
        As the thrusters are told: after dead bands, clip and safety layer.
    force_asked_n : (K, 3)
        Commanded by the controller's systems or plan, in the controller's own axes, before dead bands,
        clip and safety layer; zero without a command.
    command_reason : (K, 3) int
        Why each of these components was, or was not, commanded: `FIRED` for as it was asked for, `SILENT`,
        `DEAD_BAND`, `WAITING`, `COASTING`, `COMPLETE`, `CLIPPED`, `SAFETY` or `REHEARSED`. Clip and safety
        layer act along Hill axes; if the controller's axes are the body's, they mark all three.
    reason : (K, 3) int
        Of ideal thrusters the same; else why something was, or was not, fired along each of Hill's axes: the
        reason of the command that was due or, where none was, of this period's; besides,
        `BELOW_LEAST_IMPULSE`, `DELAYED` or `EMPTY_TANK`. A force that errors alone made is `FIRED`.
    foreseen : (K, 3)
        Basis of the decision to coast: points that coasting to the end would miss, least and greatest
        distance on the way, m; NaN where not computed.
    num_candidates : (K+1,) int
        Points lit and not yet inspected, after the inspection of sample k.
    target_m : (K+1, 3)
        The point p_u; zeros without candidates.
    lambda_u_rad, eta_u_rad : (K+1,)
    fis_input : (K, F, 3)
        Before clipping; zero in unused places, and everywhere if `is_decided` is false.
    fis_output_n : (K, F)
    is_decided : (K,) bool
        Whether inference decided the force at sample k: not while coasting, nor between two decisions.
    sun_angle_rad : (K+1,)
    sun_elevation_rad : (K+1,)
    visible_sun_share : (K+1,)
        Share of the Sun's disc not hidden from the chief by the Earth; 1 without the Earth's shadow.
    is_inspectable : (P,) bool
        Whether a point is lit at some sample.
    is_inspected : (K+1, P) bool
    delta_v_m_s : (K+1,)
        Spent by the forces 0 … k-1.
    mass_kg : (K+1,)
        Of the deputy.
    safety_limit : (K,) int
        The limit for which the safety layer changed the force: `KEEP_OUT`, `KEEP_IN`, `SPEED` or
        `PASSIVE_SAFETY`; `SAFE` if unchanged.
    safety_force_hill_n : (K, 3)
        Change of the force after the clip; part of `force_hill_n`.
    estimate : (K+1, 6), estimate_covariance : (K+1, 6, 6)
        Position (m) and velocity (m/s) as the deputy knew them, if it navigates by fixes.
    """

    position_m: Floats
    velocity_m_s: Floats
    quaternion_b_from_h: Floats
    sensed_quaternion_b_from_h: Floats
    angular_velocity_b_rad_s: Floats
    quaternion_c_from_h: Floats
    attitude_quaternion: Floats
    attitude_rate_b_rad_s: Floats
    torque_b_n_m: Floats
    force_body_n: Floats
    force_hill_n: Floats
    force_commanded_n: Floats
    force_asked_n: Floats
    command_reason: NDArray[np.int64]
    reason: NDArray[np.int64]
    foreseen: Floats
    num_candidates: NDArray[np.int64]
    target_m: Floats
    lambda_u_rad: Floats
    eta_u_rad: Floats
    fis_input: Floats
    fis_output_n: Floats
    is_decided: NDArray[np.bool_]
    sun_angle_rad: Floats
    sun_elevation_rad: Floats
    visible_sun_share: Floats
    is_inspectable: NDArray[np.bool_]
    is_inspected: NDArray[np.bool_]
    delta_v_m_s: Floats
    mass_kg: Floats
    safety_limit: NDArray[np.int64]
    safety_force_hill_n: Floats
    estimate: Floats
    estimate_covariance: Floats


def empty_log(num_controls: int, num_attitude_steps: int, num_points: int, num_systems: int) -> FlightLog:
    """Allocate the log of a flight: zeros, and NaN in `foreseen`.

    Parameters
    ----------
    num_controls, num_attitude_steps, num_points, num_systems : int
        K, S, P and F of `FlightLog`.
    """
    samples, controls = num_controls + 1, num_controls
    return FlightLog(
        position_m=np.zeros((samples, 3)),
        velocity_m_s=np.zeros((samples, 3)),
        quaternion_b_from_h=np.zeros((samples, 4)),
        sensed_quaternion_b_from_h=np.zeros((samples, 4)),
        angular_velocity_b_rad_s=np.zeros((samples, 3)),
        quaternion_c_from_h=np.zeros((samples, 4)),
        attitude_quaternion=np.zeros((controls, num_attitude_steps, 4)),
        attitude_rate_b_rad_s=np.zeros((controls, num_attitude_steps, 3)),
        torque_b_n_m=np.zeros((controls, num_attitude_steps, 3)),
        force_body_n=np.zeros((controls, 3)),
        force_hill_n=np.zeros((controls, 3)),
        force_commanded_n=np.zeros((controls, 3)),
        force_asked_n=np.zeros((controls, 3)),
        command_reason=np.zeros((controls, 3), dtype=np.int64),
        reason=np.zeros((controls, 3), dtype=np.int64),
        foreseen=np.full((controls, 3), np.nan),
        num_candidates=np.zeros(samples, dtype=np.int64),
        target_m=np.zeros((samples, 3)),
        lambda_u_rad=np.zeros(samples),
        eta_u_rad=np.zeros(samples),
        fis_input=np.zeros((controls, num_systems, 3)),
        fis_output_n=np.zeros((controls, num_systems)),
        is_decided=np.zeros(controls, dtype=np.bool_),
        sun_angle_rad=np.zeros(samples),
        sun_elevation_rad=np.zeros(samples),
        visible_sun_share=np.ones(samples),
        is_inspectable=np.ones(num_points, dtype=np.bool_),
        is_inspected=np.zeros((samples, num_points), dtype=np.bool_),
        delta_v_m_s=np.zeros(samples),
        mass_kg=np.zeros(samples),
        safety_limit=np.zeros(controls, dtype=np.int64),
        safety_force_hill_n=np.zeros((controls, 3)),
        estimate=np.zeros((samples, 6)),
        estimate_covariance=np.zeros((samples, 6, 6)),
    )


def no_log() -> FlightLog:
    """Return the log of flights that are not logged: arrays without samples."""
    return FlightLog._make(values[:0] for values in empty_log(0, 0, 0, 0))


@dataclass(frozen=True)
class Outcomes:
    """Results of flights, one entry per flight; controllers by scenarios for several controllers.

    Parameters
    ----------
    delta_v_m_s : array of float
    inspected_count : array of int
    inspectable_count : array of int
        Points that are lit at some sample of the flight.
    mean_distance_m, min_distance_m, max_distance_m : array of float
        Over samples 0 … K.
    outside_m : array of float
        Largest distance of samples 1 … K outside the distance limits; zero inside.
    safety_periods : array of int
        Number of control periods in which the safety layer changed the force; zero where it is off.
    safety_delta_v_m_s : array of float
        Delta-v of its changes, ``sum |applied - asked| T/m`` over Hill components; their net effect on
        `delta_v_m_s` may be less, or negative.
    """

    delta_v_m_s: Floats
    inspected_count: NDArray[np.int64]
    inspectable_count: NDArray[np.int64]
    mean_distance_m: Floats
    min_distance_m: Floats
    max_distance_m: Floats
    outside_m: Floats
    safety_periods: NDArray[np.int64]
    safety_delta_v_m_s: Floats

    @property
    def is_violated(self) -> NDArray[np.bool_]:
        """Whether a sample 1 … K was outside the distance limits."""
        return self.outside_m > 0.0

    def is_success(self, threshold_percent: float) -> NDArray[np.bool_]:
        """Whether enough of the inspectable points are inspected."""
        return np.asarray(self.inspected_count >= points_needed(self.inspectable_count, threshold_percent))


def inspectable_rate(inspected: Any, inspectable: Any) -> Any:
    """Return the share of the inspectable points that are inspected, in %; 100 without any."""
    return np.where(np.equal(inspectable, 0), 100.0, 100.0 * inspected / np.maximum(inspectable, 1))[()]


def points_in_words(log: FlightLog, sample: int = -1) -> str:
    """Return the numbers of points inspected at a sample, inspectable, and in all, in words."""
    count, inspectable = int(log.is_inspected[sample].sum()), int(log.is_inspectable.sum())
    num_points = len(log.is_inspectable)
    if inspectable == num_points:
        return f"{count} of {num_points} points"
    return f"{count} of the {inspectable} points that can be inspected ({num_points} in all)"


def points_needed(num_points: Any, threshold_percent: float) -> Any:
    """Return the least number of points whose rate reaches the threshold, for a number or an array."""
    needed = np.ceil(num_points * threshold_percent / 100.0 - 1e-9)
    return int(needed) if np.ndim(needed) == 0 else needed.astype(np.int64)
