"""Find shipped code for a call, link it by llvmlite, and call it."""

import ctypes
import hashlib
import lzma
import os
import platform
import struct
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from fis_tools.compiled.fingerprint import UnknownPartError
from fis_tools.compiled.shipped.arguments import Block, Passed, UnknownArgumentError
from fis_tools.compiled.shipped.identity import digest
from plain_files.file_access import read_bytes, read_shipped
from plain_files.plain_text import parse_json

CODE = Path(__file__).with_name("code")
INDEX = CODE / "index.json"
#: More than any of them has.
MOST_BYTES = 1 << 24


class Family(NamedTuple):
    """Processors that run the same code: the machine as `platform` names it, and what they must have."""

    machine: str
    features: tuple[str, ...] = ()


#: The best first.
FAMILIES = {
    "x86-64-v4": Family("x86_64", ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")),
    "x86-64-v3": Family("x86_64", ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")),
    "aarch64": Family("aarch64"),
}
#: Set to 0, everything is compiled.
SWITCH = "FIS_TOOLS_SHIPPED"
#: Room for what a function returns.
MOST_RESULT_BYTES = 64
#: The name of the function in each object.
ENTRY = "shipped_entry"

_linking = threading.Lock()
#: Linked code, with what must live as long.
_held: list[Any] = []


class Shipped:
    """The shipped code of one function, by the types of its arguments."""

    def __init__(self, compiled: Any, facts: dict[str, Any]) -> None:
        self._compiled = compiled
        self._facts = facts
        self._codes: dict[str, tuple[Callable[[int, int], int] | None, str]] = {}
        self._last: tuple[Passed, ...] = ()

    def find(self, arguments: Sequence[Any]) -> "Callable[..., Any] | None":
        """Return what calls the code for arguments of these types; None if there is none.

        It must be called with arguments of exactly these types.
        """
        try:
            block = Block(arguments, self._last)
        except UnknownArgumentError:
            return None
        types = block.kinds
        if types not in self._codes:
            with _linking:
                if types not in self._codes:
                    self._codes[types] = self._linked(types)
        self._last = block.parts
        code, result = self._codes[types]
        return None if code is None else Call(code, block, result)

    def _linked(self, types: str) -> tuple[Callable[[int, int], int] | None, str]:
        """Return the code for arguments of some types, and the kind of its result."""
        facts = self._facts.get(hashlib.sha256(types.encode()).hexdigest()[:16])
        if facts is None or facts["digest"] != _digest(self._compiled):
            return None, ""
        file = facts["families"].get(family())
        if file is None:
            return None, ""
        # what comes compiled only saves time: where it cannot be used, numba compiles
        with suppress(OSError, ValueError, RuntimeError, lzma.LZMAError):
            packed = read_bytes(CODE / family() / file["name"], MOST_BYTES)  # file: shipped, by its hash
            if hashlib.sha256(packed).hexdigest() == file["sha256"]:
                return link(lzma.decompress(packed)), facts.get("result", "")
        return None, ""


class Call:
    """Shipped code for arguments of some types; the same arguments again cost nothing to pass on."""

    def __init__(self, code: Callable[[int, int], int], block: Block, result: str = "") -> None:
        self._code = code
        self._block = block
        self._result = result

    def __call__(self, *arguments: Any) -> Any:
        """Call it; return what it returns, nothing or numbers."""
        block = self._block
        for given, held in zip(arguments, block.arguments, strict=True):
            if given is not held:
                block = self._block = Block(arguments, block.parts)
                break
        return self._run(block)

    def again(self) -> Any:
        """Call it with the same arguments, whose arrays may hold something else by now."""
        return self._run(self._block)

    def _run(self, block: Block) -> Any:
        room = ctypes.create_string_buffer(MOST_RESULT_BYTES) if self._result else None
        status = self._code(block.address, 0 if room is None else ctypes.addressof(room))
        if status not in (0, -2):  # numba's codes: done, and done without a result
            raise RuntimeError(f"compiled code ended with status {status}; {SWITCH}=0 compiles it anew")
        return None if room is None else read_result(self._result, room)


def read_result(kind: str, room: "ctypes.Array[ctypes.c_char]") -> Any:
    """Read a result: numbers as the module `struct` names them, a tuple of them behind a comma."""
    numbers = struct.unpack_from(kind.lstrip(","), room)
    return numbers if kind.startswith(",") else numbers[0]


@cache
def index() -> dict[str, Any]:
    """Return what is shipped; nothing where it is switched off."""
    if os.environ.get(SWITCH) == "0" or not INDEX.exists():
        return {"functions": {}, "modules": {}}
    content: dict[str, Any] = parse_json(read_shipped(INDEX))
    return content


@cache
def names() -> frozenset[str]:
    """Return the functions that code is shipped of, by module and name."""
    return frozenset(index()["functions"])


def of(compiled: Any) -> Shipped | None:
    """Return the shipped code of a function; None if there is none."""
    facts = index()["functions"].get(f"{compiled.py_func.__module__}.{compiled.py_func.__qualname__}")
    return None if facts is None else Shipped(compiled, facts)


def shipped_words() -> Iterator[str]:
    """Tell in lines what comes compiled for this processor, and what of it is no longer used."""
    if not (held := index()["functions"]):
        yield f"no machine code comes with the product, or {SWITCH}=0 turns it off"
        return
    if not family():
        yield f"machine code comes for {', '.join(FAMILIES)} on Linux, and this is another processor"
        return
    yield f"machine code for {family()}:"
    for name, shapes in held.items():
        module, _, attribute = name.rpartition(".")
        compiled = getattr(import_module(module), attribute, None)  # it may have another name now
        used = sum(compiled is not None and facts["digest"] == _digest(compiled) for facts in shapes.values())
        of_all = f"{used} of {len(shapes)} kinds of arguments"
        yield f"  {name}: {of_all}" + ("" if used else "; its source is another here, so it is compiled")


@cache
def _digest(compiled: Any) -> str:
    with suppress(UnknownPartError, OSError, TypeError):
        return digest(compiled, index()["modules"])
    return ""


@cache
def family() -> str:
    """Return the best family of processors that this one belongs to; "" if it belongs to none."""
    if not sys.platform.startswith("linux"):
        return ""
    with suppress(ModuleNotFoundError):
        from llvmlite import binding  # noqa: PLC0415 - it takes a moment, and not all ship with it

        features = binding.get_host_cpu_features()
        for name, (machine, needed) in FAMILIES.items():
            if machine == platform.machine() and all(features.get(feature) for feature in needed):
                return name
    return ""


def link(content: bytes) -> Callable[[int, int], int]:
    """Link an object file, and return its entry, which takes the address of a block and one of a result."""
    from llvmlite import binding  # noqa: PLC0415 - as above

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(opt=3, jit=True)
    module = binding.parse_assembly("")
    engine = binding.create_mcjit_compiler(module, machine)
    file = binding.ObjectFileRef.from_data(content)
    engine.add_object_file(file)
    engine.finalize_object()
    _held.append((content, file, module, machine, engine))
    kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    function: Callable[[int, int], int] = kind(engine.get_function_address(ENTRY))
    return function
