"""How often a deputy previews what coasting would show."""

from pipeline.settings.experiment import Mission

#: seconds between previewed places; the Sun turns by 8 deg
PREVIEW_PERIOD_S = 120.0
#: the same for the push that shows what sets; the Sun turns by 4 deg
LOOK_PERIOD_S = 60.0
#: closer to the chief's centre than 30 m its rim is out of the camera's view: no look from there is certain,
#: each falls short by at least 1 m
SQUARED_NEAR_M2, LEAST_SHORT_M = 900.0, 1.0


def preview_stride(mission: Mission) -> int:
    """Return the control periods between previewed places."""
    return max(1, round(PREVIEW_PERIOD_S / mission.control_period_s))


def look_stride(mission: Mission) -> int:
    """Return the control periods between the places from which a push may show a setting point."""
    return max(1, round(LOOK_PERIOD_S / mission.control_period_s))
