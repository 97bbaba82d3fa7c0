"""One control period: look, decide, act. The first thing to read of a flight."""

from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.array_types import Floats
from pipeline.flight.reference import actuators, navigation, two_body
from pipeline.flight.reference.actuators import Thrust
from pipeline.flight.reference.camera import held, seen_points
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.guidance import chosen_target
from pipeline.flight.reference.light import later, sun_direction
from pipeline.flight.reference.motion import pushed
from pipeline.flight.reference.pointing import Instant, looking, next_y, turn_through_period
from pipeline.flight.reference.safety import SafetyLayer
from pipeline.flight.reference.state import Look, ReferenceState
from pipeline.flight.reference.thrust import Decision, decide, reasons
from pipeline.flight.reference.way_out import WayOut
from pipeline.flight.reference.wheels import momentum_at_start


@dataclass
class Act:
    """What is done in a control period: the decision, the safety layer's change of it, and what follows."""

    decision: Decision
    limit: str | None
    change: Floats
    reasons: NDArray[np.str_]
    thrust: Thrust
    instants: list[Instant]


def start(flight: ReferenceFlight) -> ReferenceState:
    """Return the state at the start."""
    mission, scenario = flight.mission, flight.scenario
    truth = np.concatenate((scenario.position_m, scenario.velocity_m_s)).astype(np.float64)
    return ReferenceState(
        truth=truth,
        attitude=Rotation.from_quat(mission.deputy.initial_quaternion),
        rate=np.array(mission.rate_at_start_rad_s),
        momentum=momentum_at_start(mission, flight.hill_rates[0]),
        y=None,
        is_inspected=np.zeros(len(flight.points), dtype=np.bool_),
        centres=np.empty((0, 3)),
        belief=navigation.first_belief(flight, truth) if mission.navigation.mode == "fixes" else None,
        mass=mission.deputy.mass_kg,
    )


def period(
    flight: ReferenceFlight, k: int, state: ReferenceState
) -> tuple[Look, Act | None, ReferenceState | None]:
    """Fly a control period; return the look at its sample, the act that follows, and the next state.

    The last two are None at the last sample. The given state is left as it is.
    """
    state = deepcopy(state)
    seen = look(flight, k, state)
    if k == flight.mission.num_controls:
        return seen, None, None
    return seen, *act(flight, k, state, seen, decide(flight, k, seen, state))


def look(flight: ReferenceFlight, k: int, state: ReferenceState) -> Look:
    """Inspect, choose where to look next, and navigate; update the belief and cluster centres of `state`."""
    mission, position, attitude = flight.mission, state.truth[:3], state.attitude
    y = next_y(mission, position, state.y)
    if mission.attitude.mode == "ideal":
        played, _ = flight.played(k)
        attitude = (looking(position, y) if played is None else played) * flight.tilt(k).inv()
        state.rate = np.zeros(3)
    camera, is_lit = held(attitude, mission.sensor), flight.is_lit[k]
    is_inspected = state.is_inspected | (is_lit & seen_points(flight, k, position, camera, flight.suns[k]))
    candidates = flight.surface_at(k)[0][is_lit & ~is_inspected]
    target, state.centres = chosen_target(mission, candidates, position, state.centres)
    known, covariance, sensed = state.truth, np.zeros((6, 6)), attitude * flight.tilt(k)
    if state.belief is not None:
        measured = navigation.fix(flight, k, position, attitude)
        known, covariance = navigation.estimate(flight, k, state.belief, measured, sensed)
        y = next_y(mission, known[:3], state.y)
    innovation = state.belief.innovation if state.belief is not None else None
    return Look(attitude, sensed, is_lit, is_inspected, candidates, target, known, covariance, y, innovation)


def act(
    flight: ReferenceFlight, k: int, state: ReferenceState, seen: Look, decision: Decision
) -> tuple[Act, ReferenceState]:
    """Keep the limits, fire, turn and move: return what was done and the next state."""
    mission = flight.mission
    requested = np.clip(decision.wanted, -mission.deputy.max_force_n, mission.deputy.max_force_n)
    commanded, limit = requested, None
    if mission.safety.kind == "filter":
        layer = SafetyLayer(mission, flight.errors.margins, flight.predicted, k)
        now, ahead = (sun_direction(*later(mission, flight.suns[k], periods)) for periods in (0.0, 1.0))
        commanded, limit = layer.assured(seen.known, requested, (now, ahead))
        if mission.safety.keep_way_out:
            left = (mission.safety.delta_v_limit_m_s or np.inf) - state.spent
            way_out = WayOut(layer, mission.orbit.mean_motion_rad_s, k, mission.num_controls, left)
            safe = commanded
            commanded, lost = way_out.admitted(seen.known, safe)
            limit = lost if np.any(commanded != safe) else limit
    remember_command(flight, k, state, seen, commanded)
    thrust = actuators.fired(flight, k, commanded, state.commands, seen.attitude, state.mass)
    remember_fired(flight, k, state, seen, thrust, state.mass)
    state.attitude = seen.attitude
    state.y, instants = turn_through_period(flight, k, state, seen.known, seen.y, thrust)
    mass = actuators.mass_after(flight, thrust, state.mass)
    mean_mass, duration = 0.5 * (state.mass + mass), mission.control_period_s
    if flight.earth is not None and flight.orbit is not None:
        more_drag = float(flight.errors.more_drag[k]) if len(flight.errors.more_drag) else 0.0
        sun = flight.fixed_suns[k]
        push = thrust.fired / mean_mass
        state.truth = two_body.moved(
            flight.earth, mission, flight.orbit[k], sun, state.truth, push, more_drag
        )
    else:
        force = thrust.fired * mission.deputy.mass_kg / mean_mass
        state.truth = pushed(mission, state.truth, force, duration)
    state.spent += thrust.total * duration / mean_mass
    state.mass, state.is_inspected = mass, seen.is_inspected
    change, is_hill = commanded - requested, flight.controller.force_axes == "hill"
    why = reasons(decision, is_hill, mission.deputy.max_force_n, change)
    return Act(decision, limit, change, why, thrust, instants), state


def remember_command(
    flight: ReferenceFlight, k: int, state: ReferenceState, seen: Look, commanded: Floats
) -> None:
    """Store a command for the filter; and for thrusters, turned as the true body is from the sensed one."""
    mission, meant = flight.mission, commanded
    if state.belief is not None:
        acts = k + actuators.delay_periods(flight)
        if acts < mission.num_controls:
            state.belief.acting[acts] = commanded
        meant = seen.attitude.apply(seen.sensed.inv().apply(commanded))
        meant = np.clip(meant, -mission.deputy.max_force_n, mission.deputy.max_force_n)
    state.commands.append(meant)


def remember_fired(
    flight: ReferenceFlight, k: int, state: ReferenceState, seen: Look, thrust: actuators.Thrust, mass: float
) -> None:
    """Note for the filter what thrusters report of what they fired; `mass` is that before."""
    belief = state.belief
    if belief is not None:
        sensed = seen.sensed * seen.attitude.inv()
        force = actuators.believed(flight, belief.acting[k], thrust, sensed, mass)
        belief.acting[k], belief.has_fired[k] = force
