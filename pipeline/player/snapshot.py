"""What a module flies: a mission, a controller and starts as the slots and the memory of its functions."""

from collections.abc import Collection, Mapping
from typing import Any

from pipeline.player.arguments import Arguments
from pipeline.player.memory import Location, Memory, packed, types_of
from telemetry.page.panel import packed as as_text


def snapshot_of(
    functions: Mapping[str, Arguments], shared: Collection[str], chosen: Collection[str], **arrays: Any
) -> dict[str, Any]:
    """Return a snapshot as plain data, which `scripts/module.js` puts into a module's memory.

    Parameters
    ----------
    functions : mapping of str to Arguments
        Of the module's functions; an array of several of them is stored once.
    shared : collection of str
        Names of arrays that a page reads or writes, such as ``results.log.position_m``.
    chosen : collection of str
        Names of the slots that a page sets, such as ``first``.
    **arrays : array
        Further arrays for the page, shared under their names.

    Returns
    -------
    dict
        ``functions`` with the hash of their types, their slots (base64), which of them are addresses in the
        blocks of content and of zeros, and the indices of the chosen ones; ``content`` (base64 of gzip),
        ``numZeros``, and ``arrays``: whether each is in the block of zeros, its offset and its bytes.
    """
    memory = Memory()
    described = {name: _described(arguments, memory, chosen) for name, arguments in functions.items()}
    for name, array in arrays.items():
        memory.add(name, array)
    return {
        "functions": described,
        "content": as_text(bytes(memory.content)),
        "numZeros": memory.num_zeros,
        "arrays": {
            name: [int(location.is_zero), *location[1:]]
            for name, location in memory.arrays.items()
            if name in shared or name in arrays
        },
    }


def _described(arguments: Arguments, memory: Memory, chosen: Collection[str]) -> dict[str, Any]:
    leaves = arguments.leaves(memory)
    locations = [(index, leaf.value) for index, leaf in enumerate(leaves) if isinstance(leaf.value, Location)]
    return {
        "types": types_of(leaves),
        "slots": as_text(b"".join(map(packed, leaves))),
        "content": [index for index, location in locations if not location.is_zero],
        "zeros": [index for index, location in locations if location.is_zero],
        "chosen": {leaf.name: index for index, leaf in enumerate(leaves) if leaf.name in chosen},
    }
