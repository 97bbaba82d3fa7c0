"""The interface of one export: the table of messages with the lengths and limits of a mission."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, radians
from typing import Any, NamedTuple

import numpy as np

from pipeline.flight.state.arrays import World
from pipeline.flight.state.signals import CONSTANTS
from pipeline.onboard.fields import POINTS, InterfaceField
from pipeline.onboard.functions import Function
from pipeline.onboard.messages import CHANGE, CHANGED, FIELD_BITS, OTHER_BITS, OUTPUT, START, START_BITS

#: positions are taken up to so many times the greatest distance allowed, speeds up to that within a time, s
REACH, PASSAGE_S = 50.0, 2.0
#: the Sun's direction serves until it has turned by so much in Hill axes
SUN_TURNS_DEG = 2.0
#: control periods for which other inputs serve: what moves for one, and points, of which only fewer are left
OLDEST = {"navigation": 1, "attitude": 1, "points": 6}
#: functions of C without which nothing is computed from what a start is given
CHECKED_BY = {"START_SUN": "suns_apart", "START_POINTS": "note_deadlines"}
#: beyond this no parameter is one
MOST_PARAMETER = 1e9
#: units of parameters by the ends of their names
UNITS = {"_m_s": "m/s", "_m": "m", "_n": "N", "_rad": "rad"}


class StatusBit(NamedTuple):
    """A bit of the status, and what it says."""

    name: str
    number: int
    about: str


@dataclass(frozen=True)
class Interface:
    """The interface of one export.

    Parameters
    ----------
    start, step, output, parameters : sequence of InterfaceField
        With lengths and limits as numbers; the parameters are those that may be changed in flight.
    bits : sequence of StatusBit
    needs : mapping of str to sequence of str
        With which bits the rules, a plan and the safety layer cannot go on.
    """

    start: Sequence[InterfaceField]
    step: Sequence[InterfaceField]
    output: Sequence[InterfaceField]
    parameters: Sequence[InterfaceField]
    bits: Sequence[StatusBit]
    needs: dict[str, list[str]]

    @property
    def messages(self) -> dict[str, Sequence[InterfaceField]]:
        """All messages by name."""
        messages = {"start_input": self.start, "step_input": self.step, "output": self.output}
        return messages | ({"change_input": CHANGE, "change_output": CHANGED} if self.parameters else {})

    @property
    def ages(self) -> Sequence[InterfaceField]:
        """The ages of the sources."""
        return [field for field in self.step if field.name.startswith("age_")]

    @staticmethod
    def checks(fields: Iterable[InterfaceField]) -> dict[str, list[str]]:
        """Return what fields must meet, as C, by the bits that are set where one does not."""
        conditions: dict[str, list[str]] = {}
        for field in fields:
            if field.bit:
                conditions.setdefault(field.bit, []).append(field.condition)
        return conditions

    def mask(self, who: str) -> int:
        """Return the sum of the bits with which one cannot go on."""
        return sum(bit.number for bit in self.bits if bit.name in self.needs[who])

    @property
    def has_safety(self) -> bool:
        """Whether collision avoidance may go on alone."""
        return "safety" in self.needs

    def has(self, bit: str) -> bool:
        """Whether the status may have a bit."""
        return any(each.name == bit for each in self.bits)

    def needed_by(self, field: InterfaceField) -> list[str]:
        """Return which ways of deciding cannot go on without a field."""
        bit = field.bit or f"OLD_{field.source.upper()}"
        return [who for who, bits in self.needs.items() if bit in bits]

    def oldest(self, field: InterfaceField) -> int | None:
        """Return how old a field may be, in control periods; None where it has no age."""
        limits = [age.limits for age in self.ages if age.name == f"age_{field.source}"]
        return int(limits[0][1]) if limits and limits[0] else None


def dtype_of(fields: Sequence[InterfaceField], num_points: int) -> np.dtype[Any]:
    """Return the layout of a message's structure, as this machine's C has it."""
    lengths = {POINTS: num_points}
    shapes = [(lengths.get(each.count, each.count),) if each.is_array else () for each in fields]
    rows = [(each.name, each.wire.dtype, shape) for each, shape in zip(fields, shapes, strict=True)]
    return np.dtype(rows, align=True)


def interface_of(
    world: World,
    *,
    is_sun_in_plane: bool,
    inputs: Sequence[InterfaceField],
    parameters: Mapping[str, float],
    members: Iterable[str],
    functions: Sequence[Function],
    **words: str,
) -> Interface:
    """Return the interface of an export, from the members of its state and the functions that read them."""
    reach = REACH * world.max_distance
    limits = {
        **{"reach_m": reach, "-reach_m": -reach, "speed_m_s": reach / PASSAGE_S},
        **{"-speed_m_s": -reach / PASSAGE_S, "last_period": world.num_controls - 1},
        **OLDEST,
        "square_m2": reach * reach,
        "-square_m2": -reach * reach,
        "sun": floor(radians(SUN_TURNS_DEG) / (world.mean_motion * world.control_period)),
    }

    def resolved(field: InterfaceField) -> InterfaceField:
        pair = field.limits and tuple(limits.get(limit, limit) for limit in field.limits)
        return replace(
            field,
            about=field.about.format(**words),
            frame=field.frame.format(**words),
            count=world.num_points if field.count == POINTS else field.count,
            limits=pair,
            in_plane=is_sun_in_plane and field.name == "sun_elevation",
        )

    start, step, output = ([resolved(each) for each in fields] for fields in (START, inputs, OUTPUT))
    named: dict[str, list[str]] = {}
    for each in step:
        if each.bit:
            named.setdefault(each.bit, []).append(each.fault)
    bits = [StatusBit(name, FIELD_BITS[name], "; ".join(faults)) for name, faults in named.items()]
    bits += [
        StatusBit(name, *row) for name, row in OTHER_BITS.items() if parameters or name != "BAD_PARAMETERS"
    ]
    written = {each.name for each in functions}
    bits += [StatusBit(name, *row) for name, row in START_BITS.items() if CHECKED_BY[name] in written]
    bits.sort(key=lambda bit: bit.number)
    needs = _needs(step, set(members), functions)
    needs["rules"] += [bit.name for bit in bits if bit.name in START_BITS]
    return Interface(start, step, output, [_parameter(*each) for each in parameters.items()], bits, needs)


def _parameter(name: str, value: float) -> InterfaceField:
    """Return a constant of a controller that may be changed in flight, as it was designed."""
    constant = CONSTANTS[name]
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
    lowest = -MOST_PARAMETER if constant.is_signed else 0.0
    return InterfaceField(
        name, "double", constant.description, unit=unit, limits=(lowest, MOST_PARAMETER), start=value
    )


def _needs(
    step: Sequence[InterfaceField], members: set[str], functions: Sequence[Function]
) -> dict[str, list[str]]:
    """Return the bits with which each way of deciding cannot go on: of what it reads, and of its age."""
    known = {each.name: each for each in step}
    bodies = {each.name: "\n".join(line.text for line in each.lines) for each in functions}

    def bits(names: Iterable[str]) -> list[str]:
        fields = [known[name] for name in names]
        ages = [f"OLD_{each.source.upper()}" for each in fields if each.source]
        return list(dict.fromkeys(filter(None, (*(each.bit for each in fields), *ages))))

    def read_by(function: str) -> tuple[str, list[str]]:
        text, called = "", [function]
        for name in called:
            body = bodies.get(name, "")
            called += sorted(set(re.findall(r"(\w+)\(state\b", body)) - set(called))
            text += body
        return text, [
            each.name for each in step if each.member and re.search(rf"state->{each.member}\b", text)
        ]

    text, fields = read_by("assure")
    # there the period is mostly only passed on
    is_timed = re.search(r"\b(now_)?k\b", re.sub(r"\(state, (now_)?k\b", "", text)) is not None
    others = ["BAD_PARAMETERS"] * ("parameters" in text) + ["BAD_PERIOD"] * is_timed
    moving = ("position_m", "velocity_m_s")
    used = [each.name for each in step if each.member in members]
    needs = {
        "rules": [*bits(["period", *moving, *used, "given_n"]), "BAD_START", "BAD_PARAMETERS"],
        "plan": [
            *bits(["period", *moving, *read_by("command_given")[1], *fields, "given_n"]),
            "BAD_START",
            *others,
        ],
        "safety": [*bits([*moving, *fields]), "BAD_START", *others],
    }
    return needs if "assure" in bodies else {who: needs[who] for who in ("rules", "plan")}
