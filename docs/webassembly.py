"""Functions that numba compiled as a WebAssembly module, by the LLVM that numba brings.

The arguments are folded into the module: arrays lie in its memory, numbers are constants.
"""

import re
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import binding
from numba import types

from fis_tools.compiled import borrowed_code  # noqa: F401 - registers our vectors with numba
from fis_tools.compiled.shipped.build import without_wrappers

FEATURES = "+simd128,+bulk-memory,+sign-ext,+nontrapping-fptoint,+mutable-globals"
#: the two lengths that a call chooses: one flight is logged, or all are tracked
CHOSEN = {"results.log.position_m": "%logged", "results.tracks": "%tracked"}

#: what numba's code calls: room for arrays that it makes, none of which outlives a call
RUNTIME = """
@heap = internal global [65536 x i8] zeroinitializer, align 64
@heap_end = internal global i64 0

define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {
  %offset = load i64, ptr @heap_end
  %info = getelementptr i8, ptr @heap, i64 %offset
  %data = getelementptr i8, ptr %info, i64 64
  %more = add i64 %size, 191
  %rounded = and i64 %more, -64
  %end = add i64 %offset, %rounded
  store i64 %end, ptr @heap_end
  store i64 1, ptr %info
  %destructor = getelementptr i8, ptr %info, i64 8
  store ptr null, ptr %destructor
  %data_field = getelementptr i8, ptr %info, i64 24
  store ptr %data, ptr %data_field
  %size_field = getelementptr i8, ptr %info, i64 32
  store i64 %size, ptr %size_field
  ret ptr %info
}
define void @NRT_MemInfo_call_dtor(ptr %info) { ret void }
declare double @llvm.sqrt.f64(double)
define double @sqrt(double %x) {
  %root = call double @llvm.sqrt.f64(double %x)
  ret double %root
}
"""


class Translated(NamedTuple):
    """A function as LLVM's module of numba's code, and the code that calls it with the folded arguments."""

    name: str
    module: Any
    entry: str


class Operand(NamedTuple):
    """A leaf of the arguments as LLVM writes it."""

    kind: str
    text: str


class Memory:
    """Arrays in the memory of the module: those with content in one block, those of zeros in another."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.num_zeros = 0
        self.arrays: dict[str, dict[str, Any]] = {}
        self._by_address: dict[int, dict[str, Any]] = {}
        self._held: list[Any] = []

    def add(self, name: str, array: Any) -> str:
        """Store an array once, and return its address; views from its first element share it."""
        array = np.asarray(array)
        address = array.__array_interface__["data"][0]
        held = self._by_address.get(address) if array.nbytes else None
        if held is None or held["bytes"] < array.nbytes:
            held = self._store(array.tobytes())
            self._by_address[address] = held
            self._held.append(array)
        self.arrays[name] = held
        return f"ptr getelementptr (i8, ptr @{held['block']}, i64 {held['offset']})"

    def _store(self, content: bytes) -> dict[str, Any]:
        if not any(content):
            offset = self.num_zeros
            self.num_zeros += -(-(len(content) + 16) // 64) * 64
            return {"block": "zeros", "offset": offset, "bytes": len(content)}
        self.content += bytes(-len(self.content) % 64)
        offset = len(self.content)
        self.content += content + bytes(16)
        return {"block": "content", "offset": offset, "bytes": len(content)}


def operands(memory: Memory, value: Any, kind: Any, name: str) -> Iterator[Operand]:
    """Yield the leaves of an argument in numba's order, with its arrays stored in the memory."""
    if isinstance(kind, types.NoneType):
        yield Operand("ptr", "ptr null")
    elif isinstance(kind, types.BaseTuple):
        fields = getattr(kind, "fields", None) or map(str, range(len(kind.types)))
        for field, member, member_kind in zip(fields, value, kind.types, strict=True):
            yield from operands(memory, member, member_kind, f"{name}.{field}".removeprefix("."))
    elif isinstance(kind, types.Record):
        yield Operand("ptr", memory.add(name, value))
    elif isinstance(kind, types.Array):
        array = np.ascontiguousarray(value)
        # its owner and parent, which nothing counts here, then size, item size, data, shape and strides
        yield from (Operand("ptr", "ptr null"), Operand("ptr", "ptr null"))
        yield from (Operand("i64", f"i64 {array.size}"), Operand("i64", f"i64 {array.itemsize}"))
        yield Operand("ptr", memory.add(name, array))
        lengths = [CHOSEN.get(name, array.shape[0]) if array.ndim else None, *array.shape[1:]][: array.ndim]
        yield from (Operand("i64", f"i64 {number}") for number in (*lengths, *array.strides))
    elif isinstance(kind, types.Boolean):
        yield Operand("i8", f"i8 {int(bool(value))}")
    elif isinstance(kind, types.Integer):
        yield Operand("i64", f"i64 {value if isinstance(value, str) else int(value)}")
    elif isinstance(kind, types.Float):
        (bits,) = struct.unpack("<Q", struct.pack("<d", value))
        yield Operand("double", f"double 0x{bits:016X}")
    else:
        raise TypeError(f"the argument {name} is of numba's type {kind}, which is not folded into the module")


def code_of(function: Any, kinds: tuple[Any, ...], name: str, target: Any) -> tuple[str, list[str]]:
    """Return numba's LLVM code of a function under a new name, and the LLVM types of its parameters."""
    dispatcher: Any = numba.njit(nogil=True, error_model="numpy")(function.py_func)
    dispatcher.compile(kinds)
    text = without_wrappers(dispatcher.inspect_llvm(kinds))
    pattern = rf"^define [^@\n]*@(\S*{function.py_func.__name__}[^\s(]*)\((.*)\)[^)\n]*{{$"
    (main, parameters), *_ = re.findall(pattern, text, re.MULTILINE)
    text = re.sub(r"^define (?:linkonce_odr |linkonce |weak |hidden )*", "define internal ", text, flags=re.M)
    text = re.sub(r"\b(?:linkonce|common|local_unnamed_addr) (?=.*global)", "", text)
    text = re.sub(r"(?<== )(?=(?:constant|global) )", "internal ", text)
    text = text.replace(f"define internal i32 @{main}(", f"define i32 @{name}(").replace(
        f"@{main}(", f"@{name}("
    )
    text = re.sub(r"^target datalayout.*$", f'target datalayout = "{target.target_data}"', text, flags=re.M)
    text = re.sub(r"^target triple.*$", f'target triple = "{target.triple}"', text, flags=re.M)
    return text, [parameter.split()[0] for parameter in parameters.split(", ")]


def entry(name: str, chosen: tuple[str, ...], leaves: list[Operand], parameters: list[str]) -> str:
    """Return the LLVM code of a function that calls numba's with the folded arguments.

    Raises
    ------
    ValueError
        Where they are not what numba's function takes.
    """
    # where the result and the exception go precede the arguments
    if [leaf.kind for leaf in leaves] != parameters[2:]:
        raise ValueError(f"numba passes the arguments of {name} in another way than this module assumes")
    given = ", ".join(f"i64 %{argument}" for argument in chosen)
    passed = ", ".join(leaf.text for leaf in leaves)
    return f"""
declare i32 @{name}_compiled({", ".join(parameters)})
define i32 @{name}({given}) {{
  %result = alloca i64, align 8
  %exception = alloca ptr, align 8
  store ptr null, ptr %exception
  store i64 0, ptr @heap_end
  %status = call i32 @{name}_compiled(ptr %result, ptr %exception, {passed})
  ret i32 %status
}}
"""


def target_machine() -> Any:
    """Return LLVM's description of the machine that the pages' code runs on."""
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    return binding.Target.from_triple("wasm64-unknown-unknown").create_target_machine(
        cpu="generic", features=FEATURES, opt=3, reloc="static"
    )


def translate(
    memory: Memory,
    target: Any,
    name: str,
    function: Any,
    arguments: tuple[Any, ...],
    names: tuple[str, ...],
    chosen: tuple[str, ...],
) -> Translated:
    """Return a function in LLVM's code, with its arguments stored in the memory under their names.

    A call gives the chosen integers: first the arguments without a name, in order, then lengths of `CHOSEN`.
    """
    kinds = tuple(map(numba.typeof, arguments))
    text, parameters = code_of(function, kinds, f"{name}_compiled", target)
    module = binding.parse_assembly(text)
    free = iter(chosen)
    leaves = []
    for value, kind, argument in zip(arguments, kinds, names, strict=True):
        given = f"%{next(free)}" if not argument else value
        leaves.extend(operands(memory, given, kind, argument))
    return Translated(name, module, entry(name, chosen, leaves, parameters))


def write_module(path: Path, target: Any, memory: Memory, functions: Sequence[Translated]) -> None:
    """Write a WebAssembly module that exports the functions, and the addresses of the memory's two blocks."""
    blocks = "".join(f"\\{byte:02X}" for byte in memory.content)
    shim = f"""
target datalayout = "{target.target_data}"
target triple = "{target.triple}"
@content = internal global [{len(memory.content)} x i8] c"{blocks}", align 64
@zeros = internal global [{memory.num_zeros} x i8] zeroinitializer, align 64
define ptr @content_address() {{ ret ptr @content }}
define ptr @zeros_address() {{ ret ptr @zeros }}
{RUNTIME}{"".join(function.entry for function in functions)}"""
    whole = binding.parse_assembly(shim)
    for function in functions:
        whole.link_in(function.module)
    exported = (*(function.name for function in functions), "content_address", "zeros_address")
    for defined in whole.functions:
        if not defined.is_declaration and defined.name not in exported:
            defined.linkage = binding.Linkage.internal
    whole.verify()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = True
    binding.create_pass_builder(target, options).getModulePassManager().run(
        whole, binding.create_pass_builder(target, options)
    )
    _link(target.emit_object(whole), exported, path)


def _link(code: bytes, exported: tuple[str, ...], output: Path) -> None:
    """Link an object file, and let it run in 32-bit memory: numba's offsets are those of 64 bits."""
    linker = next((path for name in ("wasm-ld", "wasm-ld-19") if (path := shutil.which(name))), None)
    lowering = shutil.which("wasm-opt")
    if linker is None or lowering is None:
        sys.exit("wasm-ld and wasm-opt are needed: apt install lld-19, npm install binaryen, and set PATH")
    with tempfile.TemporaryDirectory() as scratch:
        unlinked, wide = Path(scratch, "flight.o"), Path(scratch, "flight.wasm")
        unlinked.write_bytes(code)
        words = ["-mwasm64", "--no-entry", *(f"--export={name}" for name in exported), "--export-memory"]
        words += [
            "--allow-undefined",
            "--stack-first",
            "-z",
            "stack-size=1048576",
            "--gc-sections",
            "--strip-all",
        ]
        subprocess.run([linker, *words, unlinked, "-o", wide], check=True)  # noqa: S603
        enabled = (
            "memory64",
            "simd",
            "bulk-memory",
            "sign-ext",
            "nontrapping-float-to-int",
            "mutable-globals",
        )
        words = [*(f"--enable-{name}" for name in enabled), "--memory64-lowering", "-O3", "--strip-producers"]
        subprocess.run([lowering, *words, wide, "-o", output], check=True)  # noqa: S603
