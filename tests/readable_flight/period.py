"""One control period: look, decide, act."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.readable_flight import actuators, navigation, two_body
from tests.readable_flight.camera import seen_points
from tests.readable_flight.guidance import chosen_target
from tests.readable_flight.motion import pushed
from tests.readable_flight.pointing import looking, next_y, turn_through_period
from tests.readable_flight.safety import Layer
from tests.readable_flight.state import State
from tests.readable_flight.thrust import decide, reasons


@dataclass
class Look:
    """What is known at a sample.

    Attributes
    ----------
    attitude, sensed
        The true attitude, and as the deputy senses it.
    is_lit, is_inspected : (P,)
    candidates : (m, 3)
        Points lit and not yet inspected, m.
    target : (3,)
        p_u, m; zeros without candidates.
    known, covariance : (6,), (6, 6)
        The state as the deputy knows it.
    y : (3,)
        The desired second body axis for where it believes to be.
    """

    attitude: Rotation
    sensed: Rotation
    is_lit: np.ndarray
    is_inspected: np.ndarray
    candidates: np.ndarray
    target: np.ndarray
    known: np.ndarray
    covariance: np.ndarray
    y: np.ndarray


@dataclass
class Act:
    """What is done in a control period: the decision, the safety layer's change of it, and what follows."""

    decision: Any
    limit: str | None
    change: np.ndarray
    reasons: np.ndarray
    thrust: Any
    instants: list


def start(flight):
    """The state at the start."""
    mission, scenario = flight.mission, flight.scenario
    truth = np.concatenate((scenario.position_m, scenario.velocity_m_s)).astype(np.float64)
    return State(
        truth,
        Rotation.from_quat(mission.deputy.initial_quaternion),
        np.array(mission.rate_at_start_rad_s),
        None,
        np.zeros(len(flight.points), dtype=bool),
        np.empty((0, 3)),
        navigation.first_belief(flight, truth) if mission.navigation.mode == "fixes" else None,
        [],
        mission.deputy.mass_kg,
        0.0,
    )


def look(flight, k, state):
    """Inspect, choose where to look next, and navigate; the state's belief and centres go on from here."""
    mission, position, attitude = flight.mission, state.truth[:3], state.attitude
    y = next_y(mission, position, state.y)
    if mission.attitude.mode == "ideal":
        played, _ = flight.played(k)
        attitude = (looking(position, y) if played is None else played) * flight.tilt(k).inv()
        state.rate = np.zeros(3)
    boresight = attitude.apply(mission.sensor.boresight)
    is_lit = flight.is_lit[k]
    is_inspected = state.is_inspected | (is_lit & seen_points(flight, k, position, boresight, flight.suns[k]))
    candidates = flight.surface_at(k)[0][is_lit & ~is_inspected]
    target, state.centres = chosen_target(mission, candidates, position, state.centres)
    known, covariance, sensed = state.truth, np.zeros((6, 6)), attitude * flight.tilt(k)
    if state.belief is not None:
        measured = navigation.fix(flight, k, position, attitude)
        known, covariance = navigation.estimate(flight, k, state.belief, measured, sensed)
        y = next_y(mission, known[:3], state.y)
    return Look(attitude, sensed, is_lit, is_inspected, candidates, target, known, covariance, y)


def remember(flight, k, state, seen, commanded):
    """Note a command for the thrusters, which turn with the body whatever it senses, and for the filter."""
    mission, meant = flight.mission, commanded
    if state.belief is not None:
        acts = k + (flight.periods(mission.actuators.delay_s) if mission.actuators.kind == "real" else 0)
        if acts < mission.num_controls:
            state.belief.acting[acts] = commanded
        meant = seen.attitude.apply(seen.sensed.inv().apply(commanded))
        meant = np.clip(meant, -mission.deputy.max_force_n, mission.deputy.max_force_n)
    state.commands.append(meant)


def hear(flight, k, state, fired):
    """Note for the filter what thrusters tell of what they fired."""
    belief = state.belief
    if belief is not None:
        belief.acting[k], belief.has_fired[k] = actuators.believed(flight, belief.acting[k], fired)


def act(flight, k, state, seen, decision):
    """Keep the limits, fire, turn and move: return what was done and the next state."""
    mission = flight.mission
    commanded, limit = np.clip(decision.wanted, -mission.deputy.max_force_n, mission.deputy.max_force_n), None
    asked = commanded
    if mission.safety.kind == "filter":
        commanded, limit = Layer(mission, flight.errors.margins).assured(seen.known, asked)
    remember(flight, k, state, seen, commanded)
    thrust = actuators.fired(flight, k, commanded, state.commands, seen.attitude, state.mass)
    hear(flight, k, state, thrust.fired)
    state.attitude = seen.attitude
    turn = turn_through_period(flight, k, state, seen.known, seen.y, thrust)
    state.attitude, state.rate, state.y, instants = turn
    mass = actuators.mass_after(flight, thrust, state.mass)
    mean_mass, period = 0.5 * (state.mass + mass), mission.control_period_s
    if mission.dynamics.model == "two_body":
        more_drag = flight.errors.more_drag[k] if len(flight.errors.more_drag) else 0.0
        state.truth = two_body.moved(flight, k, state.truth, thrust.fired / mean_mass, more_drag)
    else:
        force = thrust.fired * mission.deputy.mass_kg / mean_mass
        state.truth = pushed(mission, state.truth, force, period)
    state.spent += thrust.total * period / mean_mass
    state.mass, state.is_inspected = mass, seen.is_inspected
    change, is_hill = commanded - asked, flight.controller.force_axes == "hill"
    why = reasons(decision, is_hill, mission.deputy.max_force_n, change)
    return Act(decision, limit, change, why, thrust, instants), state


def period(flight, k, state):
    """What is seen at a sample, what is done in the control period that follows, and the next state.

    The last two are None at the last sample. The given state is left as it is.
    """
    state = deepcopy(state)
    seen = look(flight, k, state)
    if k == flight.mission.num_controls:
        return seen, None, None
    return seen, *act(flight, k, state, seen, decide(flight, k, seen))
