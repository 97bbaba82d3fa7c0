"""How often a deputy looks ahead at what coasting would show it."""

from pipeline.settings.experiment import Mission

#: seconds between the places at which coasting is foreseen; the Sun turns by 8 deg
PREVIEW_PERIOD_S = 120.0


def preview_stride(mission: Mission) -> int:
    """Return the control periods between the places at which coasting is foreseen."""
    return max(1, round(PREVIEW_PERIOD_S / mission.control_period_s))
