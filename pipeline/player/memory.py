"""Arguments of compiled functions as slots and one block of memory, as a module takes them."""

import hashlib
import struct
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types

#: bytes between arrays, so that what reads whole vectors stays inside
ROOM = 16
#: bytes of a cache line, which arrays are aligned to
LINE = 64


class Location(NamedTuple):
    """Where an array lies: in the block with content or, all zeros, in the one that is not carried."""

    is_zero: bool
    offset: int
    num_bytes: int


class Leaf(NamedTuple):
    """A leaf of arguments: LLVM's type, its name and numba's type, and its value or where its array lies."""

    kind: str
    name: str
    type: str
    value: float | Location


class Memory:
    """Arrays in two blocks, those with content and those of zeros; views from one first element share it."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.num_zeros = 0
        self.arrays: dict[str, Location] = {}
        self._by_address: dict[int, Location] = {}
        self._held: list[Any] = []

    def add(self, name: str, array: Any) -> Location:
        """Store an array once, and return its place."""
        array = np.asarray(array)
        address = array.__array_interface__["data"][0]
        held = self._by_address.get(address) if array.nbytes else None
        if held is None or held.num_bytes < array.nbytes:
            held = self._store(array.tobytes())
            self._by_address[address] = held
            self._held.append(array)
        self.arrays[name] = held
        return held

    def _store(self, content: bytes) -> Location:
        if not any(content):
            offset = self.num_zeros
            self.num_zeros += -(-(len(content) + ROOM) // LINE) * LINE
            return Location(True, offset, len(content))
        self.content += bytes(-len(self.content) % LINE)
        offset = len(self.content)
        self.content += content + bytes(ROOM)
        return Location(False, offset, len(content))


def leaves_of(memory: Memory, value: Any, kind: Any, name: str) -> Iterator[Leaf]:
    """Yield the leaves of an argument in numba's order, with its arrays stored in the memory.

    Parameters
    ----------
    memory : Memory
    value : object
    kind
        Its type for numba.
    name : str
        Of the argument; a leaf's is its path from there.

    Raises
    ------
    TypeError
        If the argument has a part that is not passed to a module.
    """
    if isinstance(kind, types.NoneType):
        yield Leaf("ptr", name, "none", 0)
    elif isinstance(kind, types.BaseTuple):
        kinds: Any = kind.types  # type: ignore[attr-defined]
        fields = getattr(kind, "fields", None) or map(str, range(len(kinds)))
        for field, member, member_kind in zip(fields, value, kinds, strict=True):
            yield from leaves_of(memory, member, member_kind, f"{name}.{field}")
    elif isinstance(kind, types.Record):
        yield Leaf("ptr", name, str(kind), memory.add(name, value))
    elif isinstance(kind, types.Array):
        array = np.ascontiguousarray(value)
        # its owner and parent, which nothing counts here, then size, item size, data, shape and strides
        yield from (Leaf("ptr", f"{name}:{part}", "none", 0) for part in ("owner", "parent"))
        yield Leaf("i64", f"{name}:size", "int64", array.size)
        yield Leaf("i64", f"{name}:item", "int64", array.itemsize)
        yield Leaf("ptr", name, str(kind), memory.add(name, array))
        for part, numbers in (("length", array.shape), ("stride", array.strides)):
            yield from (Leaf("i64", f"{name}:{part}{i}", "int64", number) for i, number in enumerate(numbers))
    elif isinstance(kind, types.Boolean):
        yield Leaf("i8", name, "bool", int(bool(value)))
    elif isinstance(kind, types.Integer):
        yield Leaf("i64", name, str(kind), int(value))
    elif isinstance(kind, types.Float):
        yield Leaf("double", name, str(kind), float(value))
    else:
        raise TypeError(f"the argument {name} is of numba's type {kind}, which is not passed to a module")


def types_of(leaves: Sequence[Leaf]) -> int:
    """Return what tells arguments of some types from those of others: 32 bits of a hash, with a sign."""
    text = "\n".join(f"{leaf.name}:{leaf.type}" for leaf in leaves)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little", signed=True)


def packed(leaf: Leaf) -> bytes:
    """Return what a leaf's slot holds; of an array, where it lies in its block."""
    if isinstance(leaf.value, Location):
        return struct.pack("<q", leaf.value.offset)
    return struct.pack("<d" if leaf.kind == "double" else "<q", leaf.value)
