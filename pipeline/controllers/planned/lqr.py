"""The linear-quadratic regulator that tracks the ring.

The error between the deputy's state and the ring's follows the same linear dynamics as the deputy, so that
the force ``-K error`` minimises the sum over all control periods of ``error' Q error + f' R f``. Q and R are
diagonal by Bryson's rule: each entry is one over the square of the tolerance (Bryson and Ho, Applied Optimal
Control, 1975). K follows from the discrete-time algebraic Riccati equation, solved by SciPy. It is that of
the mean motion also on an ellipse, where the route is one of true motion and errors die out long before the
orbit's rate changes.
"""

import numpy as np
from scipy.linalg import solve_discrete_are

from pipeline.array_types import Floats
from pipeline.controllers.planned.paths import Routes, check_ring, elements_matrix, ring_elements
from pipeline.flight.control.controller import Controller, RegulatorController
from pipeline.flight.control.law import played
from pipeline.flight.state.arrays import Plans
from pipeline.flight.state.log import Scenario
from pipeline.physics.motion import motion_over
from pipeline.settings.checks import SettingError
from pipeline.settings.controllers import Lqr
from pipeline.settings.experiment import Mission

UNSOLVED = (
    "the Riccati equation of controller=lqr has no solution in floating point ({}); bring "
    "controller.position_tolerance_m, controller.height_tolerance_m and controller.force_tolerance_n nearer "
    "to 10 m, 20 m and 0.002 N"
)


def gain(settings: Lqr, transition: Floats, control: Floats) -> Floats:
    """Return the gain K, shape (3, 6), N/m and N s/m.

    Parameters
    ----------
    settings : Lqr
    transition : (6, 6), control : (6, 3)
        Of a control period.

    Raises
    ------
    SettingError
        If the tolerances are so different that the Riccati equation cannot be solved.
    """
    plane, height = settings.position_tolerance_m, settings.height_tolerance_m
    tolerated = np.array([plane, plane, height, *[settings.velocity_tolerance_m_s] * 3])
    state_cost = np.diag(tolerated**-2.0)
    force_cost = np.eye(3) / settings.force_tolerance_n**2
    try:
        solution = solve_discrete_are(transition, control, state_cost, force_cost)
    except ValueError as error:  # includes LinAlgError
        raise SettingError(UNSOLVED.format(error)) from error
    weighted = control.T @ solution
    solved = np.linalg.solve(force_cost + weighted @ control, weighted @ transition)
    if not np.abs(np.linalg.eigvals(transition - control @ solved)).max() < 1.0:
        raise SettingError(UNSOLVED.format("what is found does not come to rest"))
    return np.asarray(solved, dtype=np.float64)


def controller(settings: Lqr, mission: Mission) -> Controller:
    """Return the controller of this kind for a mission."""
    return RegulatorController("lqr", LqrRegulator(settings, mission))


class LqrRegulator:
    """Brings the deputy from any start of a mission to its ring, or keeps it on its route.

    Its force is ``forces - gain (state - path)``, without the components of the answer that are below
    `dead_band_n`, N.
    """

    def __init__(self, settings: Lqr, mission: Mission) -> None:
        self.routes = Routes(mission) if settings.follows == "route" else None
        if self.routes is None:
            check_ring(settings, mission)
        self.settings, self.dead_band_n = settings, settings.dead_band_n
        motion = motion_over(mission.orbit, mission.deputy, (mission.control_period_s,))
        self.gain = gain(settings, motion.transition[0], motion.control[0])
        mean_motion = mission.orbit.mean_motion_rad_s
        times = np.arange(mission.num_controls, dtype=np.float64) * mission.control_period_s
        self.turned: Floats = mean_motion * times
        self.to_states = np.linalg.inv(elements_matrix(mean_motion))

    def __call__(self, scenarios: list[Scenario]) -> Plans:
        """Return the plans of flights from some starts; see `Regulator`."""
        paths = np.array([self.path(scenario) for scenario in scenarios], dtype=np.float64)
        forces = np.array([self.forces(scenario) for scenario in scenarios], dtype=np.float64)
        return played(forces)._replace(paths=paths, gain=self.gain, least_answer=self.dead_band_n)

    def path(self, scenario: Scenario) -> Floats:
        """Return the states on ring or route at each decision, shape (K, 6), m and m/s, Hill axes."""
        if self.routes is not None:
            return self.routes(scenario).states[:-1]
        elements = ring_elements(self.settings, scenario, self.turned)
        return np.asarray(elements @ self.to_states.T)

    def forces(self, scenario: Scenario) -> Floats:
        """Return the forces that keep the deputy on its path, shape (K, 3), N, Hill axes: none on a ring."""
        return np.zeros((len(self.turned), 3)) if self.routes is None else self.routes(scenario).forces
