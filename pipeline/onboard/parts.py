"""Parts of an exported source that an analyser takes one by one, for any state that their callers may leave.

Where one is called, what it counts on is checked, and any state that it may leave stands in its stead. So it
is analysed once, and not again wherever it is called. What it touches is read from the C; if that were wrong,
an alarm would be left.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipeline.flight.state.arrays import World
from pipeline.flight.state.log import LIMITS
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.values import number_text

#: functions that each control period of a flight ahead calls, and that each part of a search does
PARTS = ("decide", "assure", "move_ahead", "select_cheaper")
_FUNCTION = re.compile(r"^(?:static )?[\w ]+?\*?(\w+)\(([^;{}]*)\)\n\{\n(.*?)^\}", re.MULTILINE | re.DOTALL)


class StateMember(NamedTuple):
    """A member of the state: name, lengths along its axes, kind, and its range as numbers of C, or None."""

    name: str
    lengths: Sequence[int]
    kind: str
    limits: tuple[str, str] | None


@dataclass(frozen=True)
class AnalysedPart:
    """A function that is analysed by itself.

    Parameters
    ----------
    name : str
    arguments : str
        As it declares them; the first is the state.
    numbers : sequence of StateMember
        Its other arguments, as a state's members are described.
    shared : sequence of StateMember
        That it reads or writes, and other functions too.
    private : sequence of StateMember
        That no other function reads or writes.
    others : sequence of StateMember
        That it neither reads nor writes.
    """

    name: str
    arguments: str
    numbers: Sequence[StateMember]
    shared: Sequence[StateMember]
    private: Sequence[StateMember]
    others: Sequence[StateMember]


def parts_of(
    code: str, members: Mapping[str, tuple[tuple[int, ...], str]], program: OnboardProgram
) -> list[AnalysedPart]:
    """Return the parts of a source; none where nothing is flown ahead.

    Parameters
    ----------
    code : str
    members : mapping of str to (shape, kind)
        Of its state, beside the parameters.
    program : OnboardProgram
    """
    if program.planner is None or program.planner.again is None:
        return []
    text = re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL)
    functions = {name: (arguments, body) for name, arguments, body in _FUNCTION.findall(text)}
    ranges = _ranges(program)
    described = [StateMember(f"parameters.{name}", (), "double", None) for name in program.parameters] + [
        StateMember(name, [length for length in shape if length != 1], kind, ranges.get(name))
        for name, (shape, kind) in members.items()
    ]
    parts, translated = [], {function.name: function for function in program.translator.functions}
    for name in filter(functions.__contains__, PARTS):
        bodies = [functions[each][1] for each in _called(name, functions)]
        touched, rest = _members_of("".join(bodies)), text
        for body in bodies:
            rest = rest.replace(body, "")
        elsewhere = _members_of(rest)
        arguments = functions[name][0]
        numbers = [
            StateMember(number, (), kind, span and (str(span[0]), str(span[1])))
            for number, (kind, span) in translated[name].parameters.items()
        ]
        known = [member for member in described if member.name.partition(".")[0] in touched]
        shared = [member for member in known if member.name.partition(".")[0] in elsewhere]
        private = [member for member in known if member not in shared]
        others = [member for member in described if member not in known]
        parts.append(AnalysedPart(name, arguments, numbers, shared, private, others))
    return parts


def _ranges(program: OnboardProgram) -> dict[str, tuple[str, str]]:
    """Return ranges of members, as numbers of C, that functions keep and count on."""
    world: World = program.world
    most_rules = max((len(system.rules) for system in program.controller.systems), default=0)
    force = float(world.max_force)
    doubles = {
        "deadlines": (0.0, world.num_controls * world.control_period),
        "num_unseen": (0.0, float(world.num_points)),
        "commanded": (-force, force),
        "limit": (0.0, float(len(LIMITS))),
        **dict.fromkeys(("unseen", "lit"), (0.0, 1.0)),
    }
    exact = {name: (number_text(least), number_text(most)) for name, (least, most) in doubles.items()}
    spans = {**program.translator.setting.ranges, **(program.planner.ranges if program.planner else {})}
    whole = {name: (str(least), str(most)) for name, (least, most) in spans.items()}
    return {**exact, **whole, "leading": ("-1", str(most_rules - 1))}


def _called(name: str, functions: Mapping[str, tuple[str, str]]) -> Iterator[str]:
    """Yield a function and those that it calls."""
    waiting, seen = [name], {name}
    while waiting:
        each = waiting.pop()
        yield each
        calls = set(re.findall(r"\b(\w+)\(", functions[each][1])) & functions.keys()
        waiting += calls - seen
        seen |= calls


def _members_of(text: str) -> set[str]:
    """Return the members of the state that C names."""
    return set(re.findall(r"\bstate->(\w+)", text))
