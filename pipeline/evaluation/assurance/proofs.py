"""What the safety layer proves of a requirement."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fis_tools.compiled.three import Three
from pipeline.evaluation.assurance.conditions import shell_in_words
from pipeline.evaluation.assurance.formula import (
    NEAREST_PAIR,
    OF_COASTING,
    Always,
    Conjunction,
    Disjunction,
    Eventually,
    Formula,
    Negation,
    Predicate,
    Window,
    kind_of,
)
from pipeline.evaluation.assurance.open_starts import start_without_way_out
from pipeline.flight.period.act.safety import NUM_BRAKING, STANDING, TOLERANCE, most_exceeded
from pipeline.flight.period.act.way_out import is_open
from pipeline.flight.state.arrays import Guard, World
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.bounds import ROUNDING_M, SafetyBounds, bounds_of, is_exact, norm, spheres_of
from pipeline.flight.world.pack import pack_world
from pipeline.flight.world.thrust_bounds import capacity_of
from pipeline.settings.equipment import RangeBearingFixes, RealActuators
from pipeline.settings.experiment import Mission

#: quantities that are speeds along the axes
ALONG_AXES = ("velocity_radial", "velocity_along_track", "velocity_cross_track")


@dataclass(frozen=True)
class SafetyProof:
    """The premises of the safety layer's proof for some flights, and whether they hold.

    Parameters
    ----------
    is_on : bool
        Whether the layer is active.
    failing : tuple of str
        Premises that do not hold, each said in words; none if all do.
    assumed : tuple of str
        Those that are taken for granted, in words.
    probability : float
        With which a flight's errors, or those of a whole fleet, are within the bounds that the proof takes
        for them; 1 if all is exact.
    keep_out_m, keep_in_m : float
        Radii of the spheres between which the layer keeps the deputy: at samples if everything is exact,
        else at all times.
    num_starts, num_safe : int
        Starts that were drawn, and how many of them are safe states, the base case of the induction.
    starts : str
        The set from which starts are drawn, in words.
    are_all_safe : bool
        Whether every start in that set is certainly a safe state.
    exception : str
        If not, and it is known, one that need not be, in words.
    stays : bool
        Whether flights end on a closed ellipse between the spheres (`safety.keep_way_out`).
    axis_speed_m_s, delta_v_m_s : float, optional
        The greatest speed along each axis at samples, and the greatest delta-v of a flight, where the proof
        is about them.
    keep_apart_m, start_apart_m : float
        How far the layer keeps deputies of a fleet apart at samples, and how far apart they must start for
        it; 0 without.
    """

    is_on: bool
    keep_out_m: float
    keep_in_m: float
    num_starts: int
    num_safe: int
    starts: str = ""
    are_all_safe: bool = True
    failing: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    probability: float = 1.0
    exception: str = ""
    stays: bool = False
    axis_speed_m_s: float | None = None
    delta_v_m_s: float | None = None
    keep_apart_m: float = 0.0
    start_apart_m: float = 0.0

    def proves(self, formula: Formula) -> bool:
        """Return whether the layer's proof implies a formula, for all flights at their samples."""
        are_safe = self.are_all_safe and self.num_safe == self.num_starts
        return self.is_on and not self.failing and are_safe and self.implies(formula)

    def implies(self, formula: Formula) -> bool:
        """Return whether a formula follows from what the layer keeps, if its premises hold."""
        if self.keep_apart_m > 0.0 and _keeps_apart(formula, self.start_apart_m, self.keep_apart_m):
            return True
        kept = {"distance": (self.keep_out_m, self.keep_in_m)}
        if (fastest := self.axis_speed_m_s) is not None:
            kept |= dict.fromkeys(ALONG_AXES, (-fastest, fastest))
        if self.delta_v_m_s is not None:
            kept["delta_v"] = 0.0, self.delta_v_m_s
        return _follows(formula, kept, stays=self.stays)

    def is_continuous(self, formula: Formula) -> bool:
        """Return whether the proof is about all times, not only about samples, as of pairs."""
        of_pairs = self.keep_apart_m > 0.0 and _keeps_apart(formula, self.start_apart_m, self.keep_apart_m)
        return self.probability < 1.0 and not of_pairs

    def words(self) -> str:
        """Return what the layer keeps, in words."""
        times = "all samples" if self.probability == 1.0 else "flights at all times"
        words = f"{times} from {self.keep_out_m:g} to {self.keep_in_m:g} m"
        if self.axis_speed_m_s is not None:
            words += f" and at most {self.axis_speed_m_s:g} m/s fast along each axis"
        if self.stays:
            words += ", and ends on an ellipse between them"
        if self.delta_v_m_s is not None:
            words += f" for {self.delta_v_m_s:g} m/s at most"
        if self.keep_apart_m > 0.0:
            words += (
                f", and at samples deputies {self.keep_apart_m:g} m apart that start "
                f"{self.start_apart_m:.4g} m apart"
            )
        return words


def _follows(formula: Formula, kept: Mapping[str, tuple[float, float]], *, stays: bool) -> bool:
    """Return whether a formula holds wherever some quantities are between two values; False if unclear.

    The distance in free motion from the last sample is, too, if a flight stays.
    """
    match formula:
        case Conjunction(left, right):
            return _follows(left, kept, stays=stays) and _follows(right, kept, stays=stays)
        case Always(_, Predicate(((name, factor),), constant)) if name in kept:
            return _is_positive(factor, constant, kept[name])
        case Eventually(Window(0.0, math.inf), Always(Window(0.0, math.inf), part)):  # at the last sample
            return stays and _follows_at_end(part, kept["distance"])
    return False


def _follows_at_end(formula: Formula, distances_m: tuple[float, float]) -> bool:
    """Return whether a formula holds where free motion stays between two distances; False if unclear."""
    match formula:
        case Conjunction(left, right):
            return _follows_at_end(left, distances_m) and _follows_at_end(right, distances_m)
        case Predicate(((name, factor),), constant) if kind_of(name) in ("distance", *OF_COASTING):
            return _is_positive(factor, constant, distances_m)
    return False


def _keeps_apart(formula: Formula, start_m: float, kept_m: float) -> bool:
    """Return whether deputies that start so far apart, and stay so far apart, meet a formula.

    False if unclear. Whatever is drawn, two deputies may start nearer, so the start is its premise.
    """
    match formula:
        case Disjunction(
            Negation(Predicate(((start, of_start),), least)),
            Always(_, Predicate(((name, factor),), constant)),
        ) if start == name == NEAREST_PAIR and of_start > 0.0 and factor > 0.0:
            return of_start * start_m + least <= 0.0 and factor * kept_m + constant >= 0.0
    return False


def _is_positive(factor: float, constant: float, ends: tuple[float, float]) -> bool:
    """Return whether a linear function is positive between two values: if it is at both of them."""
    return all(factor * end + constant > 0.0 for end in ends)


def premises(mission: Mission, bounds: SafetyBounds) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return, in words, the failing premises of the proof for inexact flights, and the assumed ones."""
    errors, is_fixed, navigation = bounds.errors, mission.navigation.mode == "fixes", mission.filtered
    real = mission.actuators if isinstance(mission.actuators, RealActuators) else None
    failing = {
        "no bounds are asked for (safety.probability)": mission.safety.probability is None,
        "settings are dispersed": bool(mission.dispersions),
        "commands are late (actuators.delay_s)": bool(real and real.delay_s > 0.0),
        "a thruster fails (actuators.failed_thruster)": bool(real and real.failed_thruster is not None),
        "fixes have outliers (navigation.outlier_share)": is_fixed and navigation.outlier_share > 0.0,
        _too_weak(mission, bounds): not bounds.does_close,
    }
    if real is not None:
        failing |= _failing_thrusters(mission, real, bounds)
    estimate = f"the filter's errors stay within {errors.position_m:.3g} m and {errors.speed_m_s:.2g} m/s"
    sight = "errors of bearings stand still in Hill axes"
    motion = "neglected accelerations stay below their estimate"
    is_tilted = isinstance(navigation, RangeBearingFixes) and navigation.attitude_bias_deg > 0.0
    assumed = {estimate: is_fixed, sight: is_fixed and is_tilted, motion: mission.dynamics.model != "cw"}
    return tuple(premise for premise in failing if failing[premise]), tuple(
        premise for premise in assumed if assumed[premise]
    )


def _too_weak(mission: Mission, bounds: SafetyBounds) -> str:
    """Return, in words, that thrusters cannot make good for errors, and what would do."""
    words, needed = "the thrusters cannot make good for such errors", bounds.needed_force_n
    if not math.isfinite(needed):
        return f"{words}, however strong: lower the errors of navigation or thrusters"
    return (
        f"{words}: for {mission.deputy.mass_kg:g} kg that may take {needed:.4g} N along an axis, and "
        f"deputy.max_force_n is {mission.deputy.max_force_n:g}; raise it, or lower safety.planned_force_n "
        f"({mission.safety.planned_force_n:g}) or safety.planned_braking_n "
        f"({mission.safety.planned_braking_n:g})"
    )


def _failing_thrusters(mission: Mission, real: RealActuators, bounds: SafetyBounds) -> dict[str, bool]:
    """Return, in words, premises about a layout's least force and a tank's reserve, and whether they fail."""
    failing, needed, used = {}, bounds.greatest_force_n, bounds.propellant_kg
    if real.thrusters is not None:
        least = min(capacity_of(real.thrusters).least_force_n, mission.deputy.max_force_n)
        words = (
            f"the layer may command {needed:.3g} N, and in its weakest direction the layout gives "
            f"{least:.3g} N (actuators.thrusters, deputy.max_force_n): make the thrusters stronger, or lower "
            "safety.planned_force_n or safety.planned_braking_n"
        )
        failing[words] = not needed <= least
    # what is used falls at least as fast as the specific impulse grows
    enough = math.ceil((real.specific_impulse_s or 0.0) * used / real.propellant_kg)
    words = (
        f"the layer may use up {used:.3g} kg of propellant, and the tank holds {real.propellant_kg:g} kg "
        f"(actuators.propellant_kg): actuators.specific_impulse_s={enough} would do; raise either, or "
        "shorten the flight"
    )
    failing[words] = real.specific_impulse_s is not None and not used <= real.propellant_kg
    return failing


def are_safe(guard: Guard, near_m: float, far_m: float, speed_m_s: float) -> bool:
    """Return whether every state between two distances, and up to a speed, is certainly safe.

    Norms bound the force that a stop needs and where it leads, so a set may be safe although this says no.
    """
    strayed = strayed_m(guard, far_m, speed_m_s)
    gain, speeds = guard.stop[:NUM_BRAKING], guard.stop[NUM_BRAKING:, 3:]
    force = norm(gain[:, :3]) * far_m + norm(gain[:, 3:]) * speed_m_s
    is_between = guard.keep_out <= near_m - strayed and far_m + strayed <= guard.keep_in
    is_slow = speed_m_s <= guard.speed_at_chief + guard.speed_slope * near_m
    is_slow &= speed_m_s * speeds.max(initial=0.0) <= guard.braking_force
    return is_between and is_slow and force <= guard.braking_force


def kept_along_axes(world: World) -> float | None:
    """Return the greatest speed along an axis that the layer admits, m/s; None where it is not limited."""
    guard = world.guard
    if len(guard.stop) == NUM_BRAKING or guard.stop[NUM_BRAKING, 3] == 0.0:
        return None
    admitted = guard.braking_force + TOLERANCE / world.motion.control[0, 2, 2]
    return float(admitted / guard.stop[NUM_BRAKING, 3])


def strayed_m(guard: Guard, far_m: float, speed_m_s: float) -> float:
    """Return how far from a state its stop is at most, m, for states so far away and up to a speed."""
    stop = guard.checks.transition[1, :3]  # the position after the stop
    return norm(stop[:, :3] - np.eye(3)) * far_m + norm(stop[:, 3:]) * speed_m_s


def safety_proof(
    mission: Mission, scenarios: Sequence[Scenario], shell: tuple[float, float, float]
) -> SafetyProof:
    """Check the premises of the safety layer's proof.

    Parameters
    ----------
    mission : Mission
    scenarios : sequence of Scenario
        The starts of some flights; of fleets, those of all deputies count.
    shell : (float, float, float)
        Bounds of all starts: the least and the greatest distance, m, and the greatest speed, m/s.
    """
    is_on = mission.safety.kind == "filter"
    bounds, probability = bounds_of(mission), 1.0
    failing: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    spheres = mission.keep_out_m, mission.keep_in_m
    if is_on and not is_exact(mission):
        failing, assumed = premises(mission, bounds)
        probability = mission.safety.probability or 0.0
        # the limits themselves, and half of what is kept for rounding: all margins are for errors
        (out, far), spare = spheres_of(mission, bounds), 0.5 * ROUNDING_M
        spheres = out - bounds.keep_out_m - spare, far + bounds.keep_in_m + spare
    axis_speed = None
    num_safe, is_whole, exception, stays = 0, False, "", is_on and mission.safety.keep_way_out
    kept, start_apart, (near, far, speed) = 0.0, 0.0, shell
    if mission.has_fleet:
        # of all deputies together: each has errors of its own
        probability = max(0.0, 1.0 - mission.fleet.deputies * (1.0 - probability))
        scenarios = [start for scenario in scenarios for start in scenario.fleet]
    if is_on:
        world = pack_world(mission.of_each)
        flying = ((Three(*scenario.position_m), Three(*scenario.velocity_m_s)) for scenario in scenarios)
        known = shell
        if (kept := mission.fleet.keep_apart_m) > 0.0:
            # plans begin with what is estimated
            off_m, off_m_s = bounds.errors.position_m, bounds.errors.speed_m_s
            known = near - off_m, far + off_m, speed + off_m_s
            start_apart = kept + 2.0 * (bounds.astray_m + off_m + strayed_m(world.guard, *known[1:]))
        if stays:
            outside = start_without_way_out(world, shell)
            is_whole = outside is None
            exception = "" if outside is None else f"near ({', '.join(f'{x:g}' for x in outside)}) m"
            num_safe = sum(is_open(world, 0, scenario, 0.0) for scenario in flying)
        else:
            is_whole = are_safe(world.guard, *known)
            axis_speed = kept_along_axes(world) if is_exact(mission) else None
            num_safe = sum(most_exceeded(world, 0, scenario, STANDING)[2] <= 0.0 for scenario in flying)
    counts, starts = (len(scenarios), num_safe), shell_in_words(near, far, speed)
    return SafetyProof(
        *(is_on, *spheres, *counts, starts, is_whole, failing, assumed, probability),
        exception=exception,
        stays=stays,
        axis_speed_m_s=axis_speed,
        delta_v_m_s=mission.safety.delta_v_limit_m_s or None if stays else None,
        keep_apart_m=kept,
        start_apart_m=start_apart,
    )
