"""AFRL's inspection with six degrees of freedom: the deputy pushes along its own axes and turns itself.

Hill's equations of motion and Euler's are joined by forces along body axes.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import exp
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fis_tools.compiled.decorator import compiled, plainly
from fis_tools.compiled.three import Three, three_of, times
from pipeline.array_types import Booleans, Floats
from pipeline.flight.fly.six_dof import (
    ATTITUDE,
    MOST_RATE,
    NUM_OBSERVED,
    POSITION,
    RATE,
    TIME_LEFT,
    VELOCITY,
    WEIGHT_INSPECTED,
    SixDofView,
)
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import optics_of
from pipeline.flight.world.surface import surface_of
from pipeline.gym.env import Started, checked_options, require_episode
from pipeline.gym.episodes import AFRL_WEIGHTED, Reward, nearest_in_orbit, obeyed, shares_of, task_of
from pipeline.physics.attitude import euler
from pipeline.physics.quaternion import dcm_b_from_h, derivative, normalised
from pipeline.physics.sight import is_resolved
from pipeline.scenarios import PRIORITY, direction_of

#: parts of a mission that this environment does not fly
LEFT_OUT: Final = ("safety", "navigation", "actuators", "dynamics")


@dataclass(frozen=True)
class SixDofReward(Reward):
    """A reward as AFRL's, with something for each step.

    Parameters
    ----------
    alive, alive_s : float
        For each step up to a time (s).
    facing, facing_width : float
        For each step, times ``exp(-(1 - c)^2 / width)``, with c the cosine from the camera to the chief, not
        negative.
    faces_by_angles : bool
        Whether the attitude's Euler angles, of any sign, stand for the camera's direction, as in AFRL's
        environment of several deputies.
    """

    alive: float = 0.001
    alive_s: float = 3000.0
    facing: float = 0.0005
    facing_width: float = 0.15
    faces_by_angles: bool = False


#: of AFRL's WeightedSixDofInspectionEnv (safe-autonomy-sims 4.2.3)
AFRL_SIX_DOF: Final = SixDofReward(**asdict(AFRL_WEIGHTED) | {"per_delta_v": 0.005, "too_far": 1.0})
#: of their WeightedSixDofMultiInspectionEnv
AFRL_SIX_DOF_FLEET: Final = replace(AFRL_SIX_DOF, per_delta_v=0.001, faces_by_angles=True)


@compiled
def write_slope(
    state: Floats,
    push: Floats,
    torque: Floats,
    inertia: Floats,
    inverse_inertia: Floats,
    most_rate: float,
    mean_motion: float,
    slope: Floats,
) -> None:
    """Write the time derivative of a state, shape (13,), as `POSITION` and the others divide it.

    The push is an acceleration by thrust, m/s^2, the torque in N m, inertia and its inverse in kg m^2, all in
    body axes. No component of the inertial rate grows beyond the greatest, rad/s. The system's part is
    rounded to single precision, as in AFRL's safe-autonomy-simulation (2.2.1), and so are Hill's equations,
    which `pipeline.physics.motion` has in closed form: that form would not follow their rounding.
    """
    x, z, u, v = state[0], state[2], state[3], state[4]
    rate = three_of(state[10:])
    attitude, hill_rate = state[6:10], Three(0.0, 0.0, mean_motion)
    dcm = dcm_b_from_h(attitude)
    # where a stage is not of unit length, AFRL's matrix differs from ours by this on its diagonal
    surplus = 1.0 - np.sum(attitude * attitude)
    relative = rate - times(dcm, hill_rate) - surplus * hill_rate
    change = euler(inertia, inverse_inertia, rate, three_of(torque))
    thrust = times(dcm.T, three_of(push))
    slope[0:3] = state[3:6]
    slope[3] = 3.0 * mean_motion * mean_motion * x + 2.0 * mean_motion * v
    slope[4] = -2.0 * mean_motion * u
    slope[5] = -mean_motion * mean_motion * z
    slope[6:10] = derivative(attitude, relative)
    for i in range(10):
        slope[i] = np.float32(slope[i])
    for i in range(3):
        slope[3 + i] += thrust[i]
        if rate[i] >= most_rate:
            slope[10 + i] = min(change[i], 0.0)
        elif rate[i] <= -most_rate:
            slope[10 + i] = max(change[i], 0.0)
        else:
            slope[10 + i] = change[i]


class SixDofInspectionEnv(gymnasium.Env[NDArray[np.float32], NDArray[Any]]):
    """Inspect the chief with a camera along +x of the body; see `pipeline.flight.fly.six_dof`.

    An action is six shares from -1 to 1, of the greatest force along each body axis and of the greatest
    torque about each, held for a control period. The deputy starts with its body along Hill axes, at rest
    among the stars. Episodes end as AFRL's.

    Parameters
    ----------
    overrides : sequence of str
        Of the world, as on the command line; its safety, navigation, actuators and dynamics stay.
    reward : SixDofReward
    max_rate_rad_s : float
        Greatest inertial rate about each body axis.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        overrides: Sequence[str] = ("world=afrl_six_dof",),
        reward: SixDofReward = AFRL_SIX_DOF,
        max_rate_rad_s: float = MOST_RATE,
    ) -> None:
        self.task = task_of(obeyed(overrides), reward)
        self._reward, self._max_rate = reward, max_rate_rad_s
        self._mission = mission = self.task.mission
        plain = task_of(["world=afrl_six_dof"]).mission
        changed = [part for part in LEFT_OUT if getattr(mission, part) != getattr(plain, part)]
        changed += ["sensor.rectangle_deg"] if mission.sensor.rectangle_deg is not None else []
        changed += ["chief.keep_out_m"] if mission.chief.keep_out_m else []
        changed += ["attitude.gravity_gradient"] if mission.attitude.gravity_gradient else []
        changed += ["deputy.max_momentum_n_m_s"] if mission.deputy.max_momentum_n_m_s is not None else []
        if changed or self.task.is_tilted:
            reason = ", ".join(changed) or "a Sun out of the orbit plane"
            raise ValueError(f"{reason}: this is not flown with six degrees of freedom; leave it out")
        self.observation_space = self._space()
        self.action_space = Box(-1.0, 1.0, (6,), np.float32)
        self._surface, self._optics, self._view = surface_of(mission), optics_of(mission), SixDofView(mission)
        self._inertia = np.array(mission.deputy.inertia_kg_m2)
        self._is_over: bool | None = None  # before the first episode

    def _space(self) -> "Box[np.float32]":
        """Return the space of observations; no flight can leave it."""
        widest = self.task.observation_space().high
        # numbers beside directions and quaternions, of which an integration leaves the length only about one
        high = np.full(NUM_OBSERVED, 2.0)
        high[POSITION], high[VELOCITY], high[TIME_LEFT] = widest[0], widest[3], widest[-1]
        high[RATE] = self._max_rate * (1.0 + 1e-6)
        low = -high
        low[WEIGHT_INSPECTED:] = 0.0
        return Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Started:
        """Start an episode: drawn, or ``options["scenario"]`` and ``options["priority"]``, (3,)."""
        options = checked_options(options, ("scenario", "priority"))
        super().reset(seed=seed)
        scenario: Scenario = options.get("scenario") or self.task.draw(self.np_random)
        priority = options.get("priority")
        self.priority = direction_of(scenario.generator(PRIORITY)) if priority is None else priority
        self._weights = self._view.weights(self.priority)
        self.scenario, self.num_flown, self._spent, self._paid = scenario, 0, 0.0, 0.0
        turned = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        self._state = np.concatenate((scenario.position_m, scenario.velocity_m_s, turned))
        self._is_inspected = np.zeros(len(self._weights), dtype=np.bool_)
        self._look()
        self._is_over = False
        return self._observed(), self._info()

    def step(self, action: NDArray[Any]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Fly a control period.

        Parameters
        ----------
        action : (6,) array
            Shares from -1 to 1 of the greatest force along each body axis, then of the greatest torque about
            each.

        Returns
        -------
        observation : (24,) array of float32
            See `pipeline.flight.fly.six_dof.NUM_OBSERVED`.
        reward : float
        terminated : bool
            In the chief, or enough of the weight is inspected.
        truncated : bool
            Too far away, or the time is over.
        info : dict
            ``delta_v_m_s``, ``num_inspected``, ``weight_inspected``; ``is_success``: whether enough of the
            weight is inspected inside the distance limits, whatever free flight would do after that.
        """
        require_episode(self._is_over)
        self.fly(action)
        reward, terminated, truncated = self.judge()
        return self._observed(), reward, terminated, truncated, self._info()

    def fly(self, action: NDArray[Any]) -> None:
        """Fly a control period under an action, (6,), and look; `judge` tells what that was worth."""
        mission, deputy = self._mission, self._mission.deputy
        shares = shares_of(action, (6,))
        force, torque = shares[:3] * deputy.max_force_n, shares[3:] * deputy.max_torque_n_m
        push, hill_rate = force / deputy.mass_kg, mission.orbit.mean_motion_rad_s
        settings = push, torque, self._inertia, np.linalg.inv(self._inertia), self._max_rate, hill_rate

        def slope_of(_time: float, state: Any) -> Any:  # SciPy's stubs ask for the number of dimensions
            slope = np.empty(13)
            write_slope(state, *settings, slope)
            return slope

        # RK45 with its tolerances, as AFRL's
        flown = solve_ivp(slope_of, (0.0, mission.control_period_s), self._state)
        self._state = flown.y[:, -1]
        self._state[RATE] = np.clip(self._state[RATE], -self._max_rate, self._max_rate)
        self.num_flown += 1
        self._look()
        per_force = mission.control_period_s / deputy.mass_kg
        self._spent += np.abs(force).sum() * per_force
        self._used = (np.abs(force).sum() + np.abs(torque).sum()) * per_force  # as AFRL counts it

    def judge(self) -> tuple[float, bool, bool]:
        """Return the reward of the last control period, and whether it terminated or truncated all."""
        mission, deputy, reward = self._mission, self._mission.deputy, self._reward
        distance = np.linalg.norm(self._state[POSITION])
        has_crashed, is_far = distance < deputy.min_distance_m, distance > deputy.max_distance_m
        gained = reward.per_point * (self.weight_inspected - self._paid)
        gained -= reward.per_delta_v * self._used
        gained += self._for_this_step() - reward.outside * has_crashed
        gained -= (reward.outside if reward.too_far is None else reward.too_far) * is_far
        if self._has_enough:
            nearest = nearest_in_orbit(mission.orbit, deputy, self._state[:6])
            gained += reward.success if nearest >= deputy.min_distance_m else -reward.success
        self._paid = self.weight_inspected
        terminated = bool(has_crashed or self._has_enough)
        truncated = bool(is_far or self.num_flown == mission.num_controls)
        self._is_over = terminated or truncated
        return float(gained), terminated, truncated

    @property
    def state(self) -> Floats:
        """Position (m), velocity (m/s), attitude from Hill to body axes, inertial rate (rad/s), (13,)."""
        return self._state.copy()

    @property
    def is_inspected(self) -> Booleans:
        """Which points are inspected, (P,); what others have seen may be added."""
        return self._is_inspected

    @property
    def observation(self) -> NDArray[np.float32]:
        """The observation now."""
        return self._observed()

    @property
    def facts(self) -> dict[str, Any]:
        """What is known beside it."""
        return self._info()

    @property
    def weight_inspected(self) -> float:
        """The share of the points, by weight, that has been inspected."""
        return float(self._weights[self._is_inspected].sum())

    @property
    def _has_enough(self) -> bool:
        return self.weight_inspected >= self._mission.inspection_threshold_percent / 100.0

    @property
    def _camera(self) -> Floats:
        """The direction in which the camera looks, Hill axes."""
        with plainly("pipeline"):
            return np.asarray(dcm_b_from_h(normalised(self._state[ATTITUDE]))[0])

    def _look(self) -> None:
        """Inspect what is lit and in view, in the chief's axes, by the formulas of every flight."""
        axes, optics = self._view.axes(self.num_flown), self._optics
        position, camera = axes @ self._state[POSITION], axes @ self._camera
        points, normals = self._surface.points, self._surface.normals
        apart, height = points - position, np.sum(normals * points, axis=1)
        is_lit = self._view.is_lit(self.num_flown, self.scenario.sun_angle_rad)
        with plainly("pipeline"):
            squared = np.sum(apart * apart, axis=1)
            seen = is_resolved(optics, normals @ position - height, apart @ camera, squared)
        self._is_inspected |= is_lit & np.asarray(seen)

    def _for_this_step(self) -> float:
        """Return the reward for being alive and for facing the chief."""
        reward, position = self._reward, self._state[POSITION]
        facing = -float(self._camera @ position) / np.linalg.norm(position)
        if reward.faces_by_angles:
            angles = Rotation.from_quat(self._state[ATTITUDE]).as_euler("XYZ")
            facing = -float(angles @ position) / np.linalg.norm(position)
        gained = reward.alive * (self.num_flown * self._mission.control_period_s <= reward.alive_s)
        if facing >= 0.0 or reward.faces_by_angles:
            gained += reward.facing * exp(-((1.0 - facing) ** 2) / reward.facing_width)
        return gained

    def _observed(self) -> NDArray[np.float32]:
        """Return the observation, see `pipeline.flight.fly.six_dof.NUM_OBSERVED`."""
        seen = self._view.seen(
            self.num_flown, self._state, self.scenario.sun_angle_rad, self._is_inspected, self.priority
        )
        return seen.astype(np.float32)

    def _info(self) -> dict[str, Any]:
        """Return facts beside the observation: delta-v, m/s, points and weight inspected, success."""
        deputy, distance = self._mission.deputy, np.linalg.norm(self._state[POSITION])
        is_inside = bool(deputy.min_distance_m <= distance <= deputy.max_distance_m)
        counts = {"delta_v_m_s": self._spent, "num_inspected": float(self._is_inspected.sum())}
        is_success = self._has_enough and is_inside
        return {**counts, "weight_inspected": self.weight_inspected, "is_success": is_success}
