"""The names in a recording: topics, frames, colours and units."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final, TypeVar

import numpy as np

Record = TypeVar("Record")

TRANSFORMS: Final = "/tf"
DEPUTY_POSE: Final = "/deputy/pose"
CHIEF_POINTS: Final = "/chief/points"
#: only where inputs of the controller are made of points
CHIEF_PULLS: Final = "/chief/pulls"
DEPUTY_STATE: Final = "/deputy/state"
DEPUTY_ATTITUDE: Final = "/deputy/attitude"
DEPUTY_CONTROL: Final = "/deputy/control"
GUIDANCE: Final = "/guidance"
#: only where the deputy navigates by fixes
NAVIGATION: Final = "/navigation"
MISSION: Final = "/mission"
LOG: Final = "/log"
#: in a second
NANOSECONDS: Final = 1_000_000_000
#: topics of every recording; each fuzzy system adds one
FIXED_TOPICS: Final = (
    *(TRANSFORMS, DEPUTY_POSE, CHIEF_POINTS),
    *(DEPUTY_STATE, DEPUTY_ATTITUDE, DEPUTY_CONTROL),
    *(GUIDANCE, MISSION, LOG),
)
FIS_PREFIX: Final = "/fis/"

#: how many numbers a field holds, of the attitude clock for each instant; others hold what they are given
LENGTHS: Final = {
    **dict.fromkeys(("position_m", "velocity_m_s", "angular_velocity_rad_s", "torque_n_m"), 3),
    **dict.fromkeys(("position_deviation_m", "velocity_deviation_m_s", "fix_m", "innovation_m"), 3),
    **dict.fromkeys(("force_body_n", "force_hill_n", "force_asked_n", "force_commanded_n"), 3),
    **dict.fromkeys(("reason", "command_reason", "target_direction"), 3),
    "quaternion": 4,
}

#: rerun's name for the frame of its root entity, which its default 3D view shows
VIEWER_ROOT_FRAME: Final = "tf#/"
HILL_FRAME: Final = "hill"
DEPUTY_FRAME: Final = "deputy"
CHIEF_FRAME: Final = "chief"

EPISODE_METADATA: Final = "episode"
FIS_METADATA_PREFIX: Final = "fis."
CONSTANTS_METADATA: Final = "constants"
#: what was flown ahead before the flight, by what it chose
REHEARSAL_METADATA_PREFIX: Final = "rehearsal."
#: the inputs that are made of points, with their units
PULLS_METADATA: Final = "pulls"
#: the chief's triangles, where it is no sphere: an STL file in its axes, m
CHIEF_ATTACHMENT: Final = "chief.stl"
RECOVERY_METADATA: Final = "recovery"


class PointState(IntEnum):
    """The state of an inspection point; if several apply, the highest counts."""

    DARK = 0
    LIT = 1
    IN_VIEW_BUT_DARK = 2
    INSPECTED = 3


#: components of the force that a fuzzy system's output may be named after, in the order of `Reason`s
FORCE_COMPONENTS: Final = ("force_x", "force_y", "force_z")


class Reason(IntEnum):
    """The outcome of a force component in a control period; recorded as these words in lower case."""

    UNKNOWN = 0
    FIRED = 1
    SILENT = 2
    DEAD_BAND = 3
    WAITING = 4
    COASTING = 5
    COMPLETE = 6
    CLIPPED = 7
    SAFETY = 8
    REHEARSED = 9
    BELOW_LEAST_IMPULSE = 10
    DELAYED = 11
    EMPTY_TANK = 12
    PARKED = 13


#: what was asked for was commanded or fired, as far as the thruster goes, or may have been
FIRED: Final = tuple(reason.name.lower() for reason in (Reason.FIRED, Reason.CLIPPED, Reason.UNKNOWN))
#: what was asked for was not fired, or nothing was
NOT_FIRED: Final = tuple(reason.name.lower() for reason in (Reason.SILENT, Reason.DEAD_BAND))
#: something was fired, but not what was asked for by inference
NOT_AS_ASKED: Final = tuple(
    reason.name.lower() for reason in (Reason.SAFETY, Reason.REHEARSED, Reason.PARKED)
)

COLOUR_CHANNELS: Final = ("red", "green", "blue", "alpha")
#: of each `PointState`; distinguishable by colour-blind readers (after Okabe and Ito)
POINT_COLOURS_RGBA: Final = np.array(
    [(86, 88, 102, 255), (240, 228, 66, 255), (204, 121, 167, 255), (0, 190, 130, 255)], dtype=np.uint8
)

# longest first: "rate_rad_s" ends in "_s" as well
_UNIT_OF_SUFFIX: Final = (
    ("_percent", "%"),
    ("_rad_s", "rad/s"),
    ("_m_s", "m/s"),
    ("_n_m", "N m"),
    ("_rad", "rad"),
    ("_deg", "deg"),
    ("_kg", "kg"),
    ("_m", "m"),
    ("_n", "N"),
    ("_s", "s"),
)


def under(prefix: str, metadata: Mapping[str, Record]) -> dict[str, Record]:
    """Return the metadata records under a prefix, by the rest of their names."""
    return {name.removeprefix(prefix): entry for name, entry in metadata.items() if name.startswith(prefix)}


def fis_topic(name: str) -> str:
    """Return the topic on which the fuzzy system called `name` is recorded."""
    return FIS_PREFIX + name


def split_unit(field: str) -> tuple[str, str]:
    """Split a field's name before its unit suffix, which is empty if it has none."""
    for suffix, _unit in _UNIT_OF_SUFFIX:
        if field.endswith(suffix):
            return field.removesuffix(suffix), suffix
    return field, ""


def unit_of(field: str) -> str:
    """Return the unit that a field's name ends in, or an empty string."""
    return dict(_UNIT_OF_SUFFIX).get(split_unit(field)[1], "")


def suffix_of(unit: str) -> str:
    """Return the suffix for a unit in a field's name; empty for a unit that no field has."""
    return {known: suffix for suffix, known in _UNIT_OF_SUFFIX}.get(unit, "")
