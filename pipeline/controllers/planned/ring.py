"""The ring that tracking controllers follow: an ellipse of free motion that follows the Sun.

Free motion and the Sun turn at the same rate, so that a deputy on the ring stays in phase with the Sun
without force. Across the orbit plane the deputy keeps its own oscillation, limited in amplitude, because from
high above one pole the other is out of sight for long; a lead brings it to the other side sooner.
"""

import math

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.state.log import Scenario
from pipeline.settings.controllers import Ring
from pipeline.settings.experiment import Mission, SettingError


def check_within_limits(ring: Ring, mission: Mission) -> None:
    """Raise SettingError for a ring that leaves the distance limits.

    Raises
    ------
    SettingError
    """
    deputy = mission.deputy
    farthest = math.hypot(2.0 * ring.ring_size_m, ring.max_height_m)
    if not (deputy.min_distance_m <= ring.ring_size_m and farthest <= deputy.max_distance_m):
        raise SettingError(
            f"controller.ring_size_m is {ring.ring_size_m:g} and controller.max_height_m "
            f"{ring.max_height_m:g}, a ring from {ring.ring_size_m:g} to {farthest:.4g} m from the chief; "
            f"it must stay within deputy.min_distance_m={deputy.min_distance_m:g} and deputy.max_distance_m="
            f"{deputy.max_distance_m:g} (m): choose another size or less height"
        )


def ring_elements(ring: Ring, scenario: Scenario, angles: Floats) -> Floats:
    """Return the elements of free motion on the ring.

    Parameters
    ----------
    ring : Ring
    scenario : Scenario
        Gives the Sun that the ring follows, and the oscillation that it keeps.
    angles : (n,)
        By which the Sun has turned, mean motion times time, rad.

    Returns
    -------
    (n, 6) array
        ``x_c, y_c, X, Y, z, z'/n`` in m.
    """
    phase = scenario.sun_angle_rad - ring.ring_lead_rad - angles
    amplitude = np.clip(scenario.position_m[2], -ring.max_height_m, ring.max_height_m)
    zeros = np.zeros(len(angles))
    return np.column_stack(
        [
            zeros,
            zeros,
            ring.ring_size_m * np.cos(phase),
            ring.ring_size_m * np.sin(phase),
            amplitude * np.cos(angles + ring.height_lead_rad),
            -amplitude * np.sin(angles + ring.height_lead_rad),
        ]
    )
