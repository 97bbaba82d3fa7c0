"""Whether flights are comparable with the paper's: the same world, limits and starts."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final

from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.monte_carlo import MonteCarlo
from pipeline.settings.training import OctantStarts

#: beginnings of keys that the paper leaves open; what goes with a controller; and what no case depends on
OPEN: Final = (
    *("attitude.proportional_gain", "attitude.derivative_gain", "attitude.pole_blending"),
    *("attitude_period_s", "coast_when_complete", "guidance."),
    *("safety.", "after_s", "flight", "deputy.initial_position_m", "deputy.initial_velocity_m_s"),
)
#: where test starts are drawn, and how they move; how many are drawn counts only for intervals
OF_STARTS: Final = (
    *("min_distance_m", "max_distance_m", "max_speed_m_s"),
    *("directions", "box", "parked", "table"),
)


def _settings(group: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each setting of a group, and of those in it, by its dotted key."""
    for field in fields(group):
        value = getattr(group, field.name)
        if is_dataclass(value):
            yield from _settings(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", value


def _stated(mission: Mission) -> Mapping[str, Any]:
    """Return the settings on which the paper's results depend, and which it states."""
    return {key: value for key, value in _settings(mission) if not key.startswith(OPEN)}


def is_papers_mission(mission: Mission) -> bool:
    """Return whether flights of a mission are in the paper's world and within its limits."""
    return _stated(mission) == _stated(Mission())  # the defaults are the paper's


def is_papers_test(experiment: Experiment) -> bool:
    """Return whether an evaluation's results are comparable with the paper's test; it states no Sun."""
    ours, theirs = experiment.monte_carlo, MonteCarlo()
    is_same = all(getattr(ours, name) == getattr(theirs, name) for name in OF_STARTS)
    return is_same and is_papers_mission(experiment.mission)


def is_papers_training(experiment: Experiment) -> bool:
    """Return whether flights from an experiment's training starts are comparable with the paper's."""
    return experiment.starts == OctantStarts() and is_papers_mission(experiment.mission)
