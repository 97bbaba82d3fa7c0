"""How often a deputy looks ahead at what coasting would show it."""

from pipeline.settings.experiment import Mission

#: seconds between the places at which coasting is foreseen; the Sun turns by 8 deg
PREVIEW_PERIOD_S = 120.0
#: the same for the push that shows what sets; the Sun turns by 4 deg
LOOK_PERIOD_S = 60.0
#: nearer to the chief's centre than 30 m its rim is out of the camera's view: no look from there is sure,
#: each falls short by 1 m at least
SQUARED_NEAR_M2, LEAST_SHORT_M = 900.0, 1.0


def preview_stride(mission: Mission) -> int:
    """Return the control periods between the places at which coasting is foreseen."""
    return max(1, round(PREVIEW_PERIOD_S / mission.control_period_s))


def look_stride(mission: Mission) -> int:
    """Return the control periods between the places from which a push may show a point that sets."""
    return max(1, round(LOOK_PERIOD_S / mission.control_period_s))
