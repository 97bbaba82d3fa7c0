"""The linear-quadratic regulator that tracks the ring.

The error between the deputy's state and the ring's moves by the same linear laws as the deputy, so that the
force ``-K error`` is the one that minimises the sum over all control periods of ``error' Q error + f' R f``.
Q and R are diagonal by Bryson's rule: each entry is one over the square of what is tolerated (Bryson and Ho,
Applied Optimal Control, 1975). K follows from the discrete-time algebraic Riccati equation, solved by SciPy.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from fis_tools.engines.compiled import compiled
from pipeline.controllers.planned.free_motion import advance, elements_matrix, start_of
from pipeline.controllers.planned.ring import check_within_limits, ring_elements
from pipeline.flight.kernel.arrays import World
from pipeline.flight.log import Scenario
from pipeline.flight.world import pack_world
from pipeline.physics.motion import propagate
from pipeline.settings.checks import SettingError
from pipeline.settings.controllers import Lqr
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]


UNSOLVED = (
    "the Riccati equation of controller=lqr has no solution in floating point ({}); bring "
    "controller.position_tolerance_m, controller.height_tolerance_m and controller.force_tolerance_n nearer "
    "to 10 m, 20 m and 0.002 N"
)


def gain(settings: Lqr, transition: Floats, control: Floats) -> Floats:
    """Return K of shape (3, 6), N/m and N s/m.

    Parameters
    ----------
    settings : Lqr
    transition : (6, 6), control : (6, 3)
        Of a control period.

    Raises
    ------
    SettingError
        If the tolerances are so far apart that the Riccati equation cannot be solved.
    """
    plane, height = settings.position_tolerance_m, settings.height_tolerance_m
    tolerated = np.array([plane, plane, height, *[settings.velocity_tolerance_m_s] * 3])
    state_cost = np.diag(tolerated**-2.0)
    force_cost = np.eye(3) / settings.force_tolerance_n**2
    try:
        solution = solve_discrete_are(transition, control, state_cost, force_cost)
    except ValueError as error:  # of which LinAlgError is one
        raise SettingError(UNSOLVED.format(error)) from error
    weighted = control.T @ solution
    solved = np.linalg.solve(force_cost + weighted @ control, weighted @ transition)
    if not np.abs(np.linalg.eigvals(transition - control @ solved)).max() < 1.0:
        raise SettingError(UNSOLVED.format("what is found does not come to rest"))
    return np.asarray(solved, dtype=np.float64)


class LqrPlanner:
    """Runs the regulator beforehand for each start of a mission."""

    def __init__(self, settings: Lqr, mission: Mission) -> None:
        check_within_limits(settings, mission)
        self.settings, self.world = settings, pack_world(mission)
        motion = self.world.motion
        self.gain = gain(settings, motion.transition[0], motion.control[0])
        self.to_states = np.linalg.inv(elements_matrix(self.world.mean_motion))

    def __call__(self, scenario: Scenario) -> Floats:
        """Return the forces of a flight, shape (K, 3), N, Hill axes."""
        elements = ring_elements(self.settings, scenario, np.zeros(1))[0]
        forces = np.zeros((self.world.num_controls, 3))
        regulate(
            start_of(scenario),
            self.to_states @ elements,
            self.world,
            self.gain,
            self.settings.dead_band_n,
            forces,
        )
        return forces


@compiled(nogil=True)
def regulate(
    state: Floats,
    wanted: Floats,
    world: World,
    gain: Floats,
    dead_band: float,
    forces: Floats,
) -> None:
    """Fill the forces, shape (K, 3), N, that bring a state to a wanted one which moves freely."""
    no_force, max_force = np.zeros(3), world.max_force
    for k in range(len(forces)):
        error = state - wanted
        for axis in range(3):
            force = 0.0
            for place in range(6):
                force -= gain[axis, place] * error[place]
            forces[k, axis] = min(max(force, -max_force), max_force) if abs(force) >= dead_band else 0.0
        state = advance(world, state, forces[k])
        wanted = propagate(world.motion, wanted, no_force)
