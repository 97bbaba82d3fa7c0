"""Functions that numba compiled as a WebAssembly module, by the LLVM that numba brings.

Nothing is folded into a module: each leaf of a function's arguments is loaded from a slot, so that one module
runs whatever has its types. What fills the slots is a snapshot, see `pipeline.player.memory`.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numba
from llvmlite import binding

from fis_tools.compiled import borrowed_code  # noqa: F401 - registers our vectors with numba
from fis_tools.compiled.shipped.build import without_words, without_wrappers
from pipeline.player.memory import Leaf
from plain_files.file_access import write_bytes

#: of functions that are inlined in a module that shall be small
FEW_INSTRUCTIONS = 25
FEATURES = "+simd128,+bulk-memory,+sign-ext,+nontrapping-fptoint,+mutable-globals"

#: what numba's code calls: room for arrays that it makes, of which the topmost is freed, and products of
#: 128 bits, by which indices are divided
RUNTIME = """
@heap = internal global [1048576 x i8] zeroinitializer, align 64
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
define void @NRT_MemInfo_call_dtor(ptr %info) {
  %size_field = getelementptr i8, ptr %info, i64 32
  %size = load i64, ptr %size_field
  %more = add i64 %size, 191
  %rounded = and i64 %more, -64
  %place = ptrtoint ptr %info to i64
  %start = ptrtoint ptr @heap to i64
  %offset = sub i64 %place, %start
  %above = add i64 %offset, %rounded
  %end = load i64, ptr @heap_end
  %is_top = icmp eq i64 %end, %above
  %freed = select i1 %is_top, i64 %offset, i64 %end
  store i64 %freed, ptr @heap_end
  ret void
}
define void @__multi3(ptr %product, i64 %a, i64 %a_high, i64 %b, i64 %b_high) {
  %a0 = and i64 %a, 4294967295
  %a1 = lshr i64 %a, 32
  %b0 = and i64 %b, 4294967295
  %b1 = lshr i64 %b, 32
  %p00 = mul i64 %a0, %b0
  %p01 = mul i64 %a0, %b1
  %p10 = mul i64 %a1, %b0
  %p11 = mul i64 %a1, %b1
  %carried = lshr i64 %p00, 32
  %middle = add i64 %p10, %carried
  %middle_low = and i64 %middle, 4294967295
  %middle_high = lshr i64 %middle, 32
  %other = add i64 %p01, %middle_low
  %other_high = lshr i64 %other, 32
  %high0 = add i64 %p11, %middle_high
  %high1 = add i64 %high0, %other_high
  %low = mul i64 %a, %b
  %cross1 = mul i64 %a_high, %b
  %cross2 = mul i64 %a, %b_high
  %high2 = add i64 %high1, %cross1
  %high3 = add i64 %high2, %cross2
  store i64 %low, ptr %product
  %high_field = getelementptr i64, ptr %product, i64 1
  store i64 %high3, ptr %high_field
  ret void
}
declare double @llvm.sqrt.f64(double)
define double @sqrt(double %x) {
  %root = call double @llvm.sqrt.f64(double %x)
  ret double %root
}
"""


#: what only the generated machine code calls, so that it must be kept until then
CALLED_LATE = ("__multi3",)


class Translated(NamedTuple):
    """A function as LLVM's module of numba's code, and the code that calls it with what is in its slots."""

    name: str
    module: Any
    entry: str


def code_of(function: Any, kinds: tuple[Any, ...], name: str, target: Any) -> tuple[str, list[str]]:
    """Return numba's LLVM code of a function under a new name, and the LLVM types of its parameters."""
    dispatcher: Any = numba.njit(nogil=True, error_model="numpy")(function.py_func)
    dispatcher.compile(kinds)
    text = without_words(without_wrappers(dispatcher.inspect_llvm(kinds)))
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


def entry(name: str, leaves: Sequence[Leaf], parameters: list[str], types: int) -> str:
    """Return the LLVM code of a function that calls numba's with what its slots hold.

    It is exported with where its slots are, and with what its types are told by.

    Raises
    ------
    ValueError
        Where the leaves are not what numba's function takes.
    """
    # where the result and the exception go precede the arguments
    if [leaf.kind for leaf in leaves] != parameters[2:]:
        raise ValueError(f"numba passes the arguments of {name} in another way than this module assumes")
    slots = f"@{name}_slots"
    loads = "\n".join(
        f"  %a{index} = load {leaf.kind}, ptr getelementptr (i64, ptr {slots}, i64 {index})"
        for index, leaf in enumerate(leaves)
    )
    passed = ", ".join(f"{leaf.kind} %a{index}" for index, leaf in enumerate(leaves))
    return f"""
declare i32 @{name}_compiled({", ".join(parameters)})
{slots} = internal global [{len(leaves)} x i64] zeroinitializer, align 64
define ptr @{name}_at() {{ ret ptr {slots} }}
define i32 @{name}_types() {{ ret i32 {types} }}
define i32 @{name}() {{
  %result = alloca i64, align 8
  %exception = alloca ptr, align 8
  store ptr null, ptr %exception
  store i64 0, ptr @heap_end
{loads}
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
    target: Any, name: str, function: Any, kinds: tuple[Any, ...], leaves: Sequence[Leaf], types: int
) -> Translated:
    """Return a function of arguments of some of numba's types in LLVM's code, called by its slots."""
    text, parameters = code_of(function, kinds, f"{name}_compiled", target)
    return Translated(name, binding.parse_assembly(text), entry(name, leaves, parameters, types))


def write_module(path: Path, target: Any, functions: Sequence[Translated], *, is_small: bool = False) -> None:
    """Write a WebAssembly module that exports the functions, where their slots are, and their types.

    It is fast unless it shall be small; its results are the same.
    """
    shim = f"""
target datalayout = "{target.target_data}"
target triple = "{target.triple}"
{RUNTIME}{"".join(function.entry for function in functions)}"""
    whole = binding.parse_assembly(shim)
    for function in functions:
        whole.link_in(function.module)
    exported = tuple(f"{function.name}{end}" for function in functions for end in ("", "_at", "_types"))
    for defined in whole.functions:
        if not defined.is_declaration and defined.name not in (*exported, *CALLED_LATE):
            defined.linkage = binding.Linkage.internal
    whole.verify()
    options = binding.create_pipeline_tuning_options(speed_level=2 if is_small else 3)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = not is_small
    if is_small:
        options.inlining_threshold = FEW_INSTRUCTIONS
    binding.create_pass_builder(target, options).getModulePassManager().run(
        whole, binding.create_pass_builder(target, options)
    )
    _link(target.emit_object(whole), exported, path, "-Os" if is_small else "-O3")


def _link(code: bytes, exported: tuple[str, ...], output: Path, level: str) -> None:
    """Link an object file, and let it run in 32-bit memory: numba's offsets are those of 64 bits."""
    linker = next((path for name in ("wasm-ld", "wasm-ld-19") if (path := shutil.which(name))), None)
    lowering = shutil.which("wasm-opt")
    if linker is None or lowering is None:
        sys.exit("wasm-ld and wasm-opt are needed: apt install lld-19, npm install binaryen, and set PATH")
    with tempfile.TemporaryDirectory() as scratch:
        unlinked, wide = Path(scratch, "flight.o"), Path(scratch, "flight.wasm")
        write_bytes(unlinked, code)
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
        words = [*(f"--enable-{name}" for name in enabled), "--memory64-lowering", level, "--strip-producers"]
        subprocess.run([lowering, *words, wide, "-o", output], check=True)  # noqa: S603
