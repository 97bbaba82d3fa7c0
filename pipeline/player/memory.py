"""Arguments of compiled functions as slots and one block of memory, as a module takes them."""

import hashlib
import struct
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

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
    """A leaf of arguments: LLVM's type, its name and numba's type, and its value or where its array lies.

    The type is numba's in words, which are written without numba: loading it takes longer than flying.
    """

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


def leaves_of(memory: Memory, value: Any, name: str) -> Iterator[Leaf]:
    """Yield the leaves of an argument in numba's order, with its arrays stored in the memory.

    Parameters
    ----------
    memory : Memory
    value : object
    name : str
        Of the argument; a leaf's is its path from there.

    Raises
    ------
    TypeError
        If the argument has a part that is not passed to a module.
    """
    if value is None:
        yield Leaf("ptr", name, "none", 0)
    elif isinstance(value, tuple):
        fields = getattr(value, "_fields", None) or map(str, range(len(value)))
        for field, member in zip(fields, value, strict=True):
            yield from leaves_of(memory, member, f"{name}.{field}")
    elif isinstance(value, np.void):
        yield Leaf("ptr", name, _type_of(value.dtype), memory.add(name, value))
    elif isinstance(value, np.ndarray):
        # its owner and parent, which nothing counts here, then size, item size, data, shape and strides
        yield from (Leaf("ptr", f"{name}:{part}", "none", 0) for part in ("owner", "parent"))
        yield Leaf("i64", f"{name}:size", "int64", value.size)
        yield Leaf("i64", f"{name}:item", "int64", value.itemsize)
        yield Leaf("ptr", name, _type_of_array(value, name), memory.add(name, value))
        for part, numbers in (("length", value.shape), ("stride", value.strides)):
            yield from (Leaf("i64", f"{name}:{part}{i}", "int64", number) for i, number in enumerate(numbers))
    elif isinstance(value, bool | np.bool_):
        yield Leaf("i8", name, "bool", int(value))
    elif isinstance(value, int | np.int64):
        yield Leaf("i64", name, "int64", int(value))
    elif isinstance(value, float):
        yield Leaf("double", name, "float64", float(value))
    else:
        kind = type(value).__qualname__
        raise TypeError(f"the argument {name} is of the type {kind}, which is not passed to a module")


def _type_of_array(array: Any, name: str) -> str:
    """Return the type of a contiguous array, as numba tells it."""
    if not (array.flags.c_contiguous and array.flags.aligned and array.dtype.isnative):
        raise TypeError(f"the argument {name} is no contiguous array, and no other is passed to a module")
    kept = "" if array.flags.writeable else "readonly "
    return f"{kept}array({_type_of(array.dtype)}, {array.ndim}d, C)"


def _type_of(dtype: np.dtype[Any]) -> str:
    """Return the type of an array's elements, or of a record, as numba tells it."""
    if dtype.subdtype is not None:
        element, shape = dtype.subdtype
        return f"nestedarray({_type_of(element)}, {shape})"
    if dtype.fields is None:
        return dtype.name
    fields = (
        f"{name}[type={_type_of(kind)};offset={offset}]" for name, (kind, offset, *_) in dtype.fields.items()
    )
    return f"Record({','.join(fields)};{dtype.itemsize};{dtype.isalignedstruct})"


def types_of(leaves: Sequence[Leaf]) -> int:
    """Return what tells arguments of some types from those of others: 32 bits of a hash, with a sign."""
    text = "\n".join(f"{leaf.name}:{leaf.type}" for leaf in leaves)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little", signed=True)


def packed(leaf: Leaf) -> bytes:
    """Return what a leaf's slot holds; of an array, where it lies in its block."""
    if isinstance(leaf.value, Location):
        return struct.pack("<q", leaf.value.offset)
    return struct.pack("<d" if leaf.kind == "double" else "<q", leaf.value)
