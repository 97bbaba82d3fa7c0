"""Values that follow from a mission: from where the chief is seen, and, by default, starts and the Sun."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from pipeline.settings.equipment import Sensor
from pipeline.settings.keys import value_at
from pipeline.settings.mission import ChiefSettings, DeputySettings
from pipeline.settings.orbit import OrbitSettings

#: the paper's starts, m, and the least distance from which its whole chief is in view
PAPER_M: Final = (50.0, 100.0)
PAPER_NEAR_M: Final = 10.0 / math.sin(math.radians(15.0))
PAPER_FAR_M: Final = 200.0
#: significant digits of distances that are computed, and decimal places of the Sun's angles
DIGITS, SUN_DIGITS = 3, 6
#: keys that may be left to the orbit's epoch
OF_EPOCH: Final = ("sun.angle_deg", "sun.elevation_deg")
#: and to the mission: starts of the evaluation, of training, and of a single flight
FOLLOWING: Final = (
    *(f"{group}.{end}_distance_m" for group in ("monte_carlo", "starts") for end in ("min", "max")),
    *("deputy.initial_position_m", *OF_EPOCH),
)


def sight_shell(deputy: DeputySettings, sensor: Sensor, radius_m: float) -> tuple[float, float]:
    """Return the least and the greatest distance, m, from which a deputy sees a whole chief of a radius.

    Nearer the rim is out of the camera's view, or the deputy outside its limits; farther points are not
    resolved. Where there is no such distance, the limits themselves.
    """
    near = deputy.min_distance_m
    if sensor.narrowest_deg < 90.0:
        near = max(near, radius_m / math.sin(math.radians(sensor.narrowest_deg)))
    near = max(near, sensor.min_range_m + radius_m if sensor.min_range_m > 0.0 else 0.0)
    far = min(deputy.max_distance_m, sensor.max_range_m or math.inf)
    return (near, far) if near < far else (deputy.min_distance_m, deputy.max_distance_m)


def start_shell(deputy: DeputySettings, sensor: Sensor, radius_m: float) -> tuple[float, float]:
    """Return the least and the greatest distance, m, of starts: the paper's, or what fits the mission.

    Those of the paper stand in its sight shell at 1.29 of the least and half of the greatest distance. Where
    they are inside the limits and outside the chief they are kept; else others stand like this.
    """
    low, high = PAPER_M
    if max(deputy.min_distance_m, radius_m) < low and high <= deputy.max_distance_m:
        return low, high
    near, far = sight_shell(deputy, sensor, radius_m)
    middle = math.sqrt(max(near, radius_m, 1e-3) * far)
    low, high = low / PAPER_NEAR_M * near, high / PAPER_FAR_M * far
    return _rounded(min(max(low, near), middle)), _rounded(max(high, middle))


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def following(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that a configuration leaves to its mission, by dotted key.

    Raises
    ------
    SettingError
        If the limits, the camera or the orbit, on which they depend, are not allowed.
    """
    left = [key for key in FOLLOWING if value_at(config, key, "") is None]
    groups = [value_at(config, name) for name in ("deputy", "sensor", "chief", "orbit")]
    if not left or not all(isinstance(group, Mapping) for group in groups):
        return {}
    of_deputy, of_sensor, of_chief, of_orbit = groups
    deputy = DeputySettings(**{key: value for key, value in of_deputy.items() if value is not None})
    chief = ChiefSettings(**of_chief)
    radius_m = chief.inspection_radius_m if chief.shape == "sphere" else 0.0
    low, high = start_shell(deputy, Sensor(**of_sensor), radius_m)
    middle = 0.5 * (low + high)
    of_training = (middle, middle) if value_at(config, "starts.kind") == "octants" else (low, high)
    orbit: Callable[..., OrbitSettings] = OrbitSettings  # a call returns the variant that the tag names
    angles = (round(angle, SUN_DIGITS) for angle in orbit(**of_orbit).sun_at_epoch_deg or (0.0, 0.0))
    values = (low, high, *of_training, [middle / math.sqrt(3.0)] * 3, *angles)
    return {key: value for key, value in zip(FOLLOWING, values, strict=True) if key in left}
