"""A field of what an on-board function is given or answers: in C, in packets, in FPP and in EDS."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pipeline.onboard.values import number_text

#: stands for the number of the chief's points
POINTS = -1


class WireKind(NamedTuple):
    """A kind of number: in C, as NumPy's, how many octets it takes in packets, in FPP and in EDS."""

    c: str
    dtype: str
    octets: int
    fpp: str
    eds: str


#: flags are bytes in C, and bits in packets
KINDS = {
    "double": WireKind("double", "f8", 8, "F64", "BASE_TYPES/double"),
    "int": WireKind("int", "i4", 4, "I32", "BASE_TYPES/int32"),
    "word": WireKind("unsigned int", "u4", 4, "U32", "BASE_TYPES/uint32"),
    "flags": WireKind("unsigned char", "u1", 1, "U8", "BASE_TYPES/uint8"),
    "reason": WireKind("enum controller_reason", "i4", 1, "Reason", "Reason"),
}


@dataclass(frozen=True)
class InterfaceField:
    """A field of a message.

    Parameters
    ----------
    name, kind, about : str
        The kind is one of `KINDS`.
    count : int
        How many numbers it is; `POINTS` for one a point.
    unit, frame : str
    limits : (lowest, highest) or None
        Numbers, or names of what a mission knows.
    is_unit, is_nonzero : bool
        Whether squares sum to one, and whether they may not sum to zero.
    in_plane : bool
        Whether its second number is zero, as both but for a thousandth.
    only_with : str
        Name of the field that must not be 0 for it to count.
    source : str
        What measures it; "" where it has no age.
    bit : str
        Of the status, set where it is out of range; "" where any value is well.
    member : str
        Of the state, into which it is copied.
    step_bit : str
        Of the status, set where a step is given what does not go with it.
    start : float or sequence of float
        What a block starts with.
    """

    name: str
    kind: str
    about: str
    count: int = 1
    unit: str = ""
    frame: str = ""
    limits: tuple[Any, Any] | None = None
    is_unit: bool = False
    is_nonzero: bool = False
    in_plane: bool = False
    only_with: str = ""
    source: str = ""
    bit: str = ""
    member: str = ""
    step_bit: str = ""
    start: float | Sequence[float] = 0.0

    @property
    def wire(self) -> WireKind:
        """Its kind."""
        return KINDS[self.kind]

    @property
    def wire_count(self) -> int:
        """How many numbers it is in a packet, where eight flags are one."""
        return -(-self.count // 8) if self.kind == "flags" else self.count

    @property
    def octets(self) -> int:
        """What it takes in a packet."""
        return self.wire.octets * self.wire_count

    @property
    def is_array(self) -> bool:
        """Whether it is an array in C, as all flags are."""
        return self.kind == "flags" or self.count != 1

    @property
    def declaration(self) -> str:
        """Its declaration in C."""
        length = "CONTROLLER_NUM_POINTS" if self.kind == "flags" else self.count
        return f"{self.wire.c} {self.name}{f'[{length}]' * self.is_array};"

    @property
    def comment(self) -> str:
        """What it is, with unit and frame."""
        return ", ".join(filter(None, (self.about, self.unit, self.frame)))

    @property
    def range(self) -> str:
        """What it may be, in words; "" for anything."""
        if self.is_unit:
            return "unit vector"
        return "" if self.limits is None else f"{self.limits[0]:g} to {self.limits[1]:g}"

    @property
    def starts(self) -> list[float]:
        """What each of its numbers starts with in a block."""
        return [float(self.start)] * self.count if isinstance(self.start, float) else list(self.start)

    @property
    def condition(self) -> str:
        """What it meets where it is well, as C, of a message called ``input``."""
        name = f"input->{self.name}"
        if self.is_unit:
            in_plane = f" && lie_between(&{name}[1], 1, -1.0e-3, 1.0e-3)" * self.in_plane
            return f"is_unit({name}, {self.count}){in_plane}"
        lowest, highest = self.limits or (0, 0)
        if self.kind == "int":
            return f"({name} >= {lowest}) && ({name} <= {highest})"
        lowest, highest = map(number_text, (lowest, highest))
        within = f"lie_between({name}, {self.count}, {lowest}, {highest})"
        if self.is_nonzero:
            within += f" && (square_of({name}, {self.count}, {highest}) > 0.0)"
        return f"(input->{self.only_with} == 0) || {within}" if self.only_with else within

    @property
    def fault(self) -> str:
        """What is wrong where its bit is set."""
        if self.is_unit:
            out = ", or out of the orbit plane" * self.in_plane
            return f"{self.name} is no unit vector{out}, but for a thousandth"
        span = f"{self.range}{f' {self.unit}' * bool(self.unit)}"
        each = (" along each axis" if self.count == 3 else " in each entry") * self.is_array
        return f"{self.name} is not from {span}{each}{', or zero' * self.is_nonzero}"


def offsets(fields: Sequence[InterfaceField], *, in_packets: bool = False) -> list[int]:
    """Return where each field begins, in octets of a packet or among all numbers one after the other."""
    sizes = [field.octets if in_packets else field.count for field in fields]
    return [sum(sizes[:index]) for index in range(len(sizes))]
