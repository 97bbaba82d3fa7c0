"""The tasks that results are compared on: what each is, as which environment, and its held-out starts.

A version fixes them. ``gymnasium.make("pipeline.gym:Inspection/paper-v1")`` makes a task's environment, to
train in, ``pipeline.gym.parallel.parallel_env("fleet")`` that of a fleet; `pipeline.gym.judge` flies the
held-out starts.
"""

import hashlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import gymnasium

from pipeline.gym.episodes import AFRL, AFRL_WEIGHTED, Reward

FAMILY: Final = "Inspection"
NUMBER: Final = "v1"
VERSION: Final = f"{FAMILY}-{NUMBER}"
#: three orbits of AFRL's chief, s
THREE_ORBITS_S: Final = 18_360
#: deputies of a fleet, and how near two of them collide, m, as AFRL's do
NUM_DEPUTIES, COLLISION_M = 2, 10.0
#: the tasks of fleets, by what each of their deputies flies in; at rest and parked, and as AFRL's deputies
FLEETS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "fleet": ("sun=random",),
        "fleet_parked": ("sun=random", "monte_carlo.parked=true"),
        "fleet_afrl": ("world=afrl",),
    }
)
#: how they fly together: each knows at once which points any has seen, and no more, as in environments
TOGETHER: Final = (f"fleet.deputies={NUM_DEPUTIES}", "fleet.sharing=mask")
#: what each task is, as on the command line
TASKS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "paper": ("sun=random",),
        "parked": ("sun=random", f"after_s={THREE_ORBITS_S}"),
        "satellite": ("sun=random", "chief=satellite", "light=shadow"),
        "leo": ("world=leo",),
        "leo_real": ("world=leo", "navigation=fixes", "actuators=real"),
        "afrl": ("world=afrl",),
        "afrl_weighted": ("world=afrl_weighted",),
        "docking": ("problem=docking",),
        **{task: (*words, *TOGETHER) for task, words in FLEETS.items()},
    }
)
#: rewards of tasks that have one of their own
REWARDS: Final[Mapping[str, Reward]] = MappingProxyType(
    {"afrl": AFRL, "afrl_weighted": AFRL_WEIGHTED, "fleet_afrl": AFRL}
)


def seed_of(task: str) -> int:
    """Return the seed of a task's starts: the first 31 bits of the SHA-256 of its name and version."""
    return int.from_bytes(hashlib.sha256(f"{VERSION} {task}".encode()).digest()[:4]) >> 1


def id_of(task: str) -> str:
    """Return the id of a task's environment in Gymnasium's registry, which has none of fleets."""
    return f"{FAMILY}/{task}-{NUMBER}"


def register() -> None:
    """Register the environments of all tasks of one deputy."""
    for task, overrides in TASKS.items():
        if task in FLEETS:
            continue
        kwargs: dict[str, Any] = {"overrides": overrides}
        if any(word.startswith("problem=") for word in overrides):
            gymnasium.register(id_of(task), entry_point="pipeline.gym.env:ReachEnv", kwargs=kwargs)
            continue
        if task in REWARDS:
            kwargs["reward"] = REWARDS[task]
        gymnasium.register(
            id_of(task),
            entry_point="pipeline.gym.env:InspectionEnv",
            vector_entry_point="pipeline.gym.vector:InspectionVectorEnv",
            kwargs=kwargs,
        )
