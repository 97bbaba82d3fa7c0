"""Make the shipped code: objects of what numba compiled for one family of processors.

numba's code is taken as it was optimised; what Python would call is left out, and room for arrays comes from
the C library.
"""

import hashlib
import lzma
import re
from collections.abc import Iterator
from typing import Any, cast

from llvmlite import binding
from numba import types

from fis_tools.compiled.shipped.load import ENTRY


def head(destructor: str, *, is_list: bool) -> str:
    """Return the LLVM code that writes what precedes an array or a list.

    That is a count, a destructor, whether the data has room of its own, the data and the size.
    """
    return f"""  store i64 1, ptr %info
  %destructor_field = getelementptr i8, ptr %info, i64 8
  store ptr {destructor}, ptr %destructor_field
  %own_field = getelementptr i8, ptr %info, i64 16
  store i64 {int(is_list)}, ptr %own_field
{STORED}"""


#: What gives a list other data, in LLVM's code.
STORED = """  %data_field = getelementptr i8, ptr %info, i64 24
  store ptr %data, ptr %data_field
  %size_field = getelementptr i8, ptr %info, i64 32
  store i64 %size, ptr %size_field"""
#: What numba's code calls for arrays and lists that it makes.
RUNTIME = f"""
declare ptr @malloc(i64)
declare void @free(ptr)
define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {{
  %more = add i64 %size, 192
  %info = call ptr @malloc(i64 %more)
  %start = ptrtoint ptr %info to i64
  %after = add i64 %start, 127
  %rounded = and i64 %after, -64
  %data = inttoptr i64 %rounded to ptr
{head("null", is_list=False)}
  ret ptr %info
}}
define void @NRT_MemInfo_call_dtor(ptr %info) {{
  %own_field = getelementptr i8, ptr %info, i64 16
  %is_own = load i64, ptr %own_field
  %is_list = icmp ne i64 %is_own, 0
  br i1 %is_list, label %list, label %end
list:
  %data_field = getelementptr i8, ptr %info, i64 24
  %data = load ptr, ptr %data_field
  %destructor_field = getelementptr i8, ptr %info, i64 8
  %destructor = load ptr, ptr %destructor_field
  %has_destructor = icmp ne ptr %destructor, null
  br i1 %has_destructor, label %destroy, label %freed
destroy:
  call void %destructor(ptr %data)
  br label %freed
freed:
  call void @free(ptr %data)
  br label %end
end:
  call void @free(ptr %info)
  ret void
}}
define ptr @NRT_MemInfo_alloc(i64 %size) {{
  %info = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 32)
  ret ptr %info
}}
define ptr @NRT_MemInfo_new_varsize_dtor(i64 %size, ptr %destructor) {{
  %data = call ptr @malloc(i64 %size)
  %info = call ptr @malloc(i64 64)
{head("%destructor", is_list=True)}
  ret ptr %info
}}
define ptr @NRT_Allocate(i64 %size) {{
  %data = call ptr @malloc(i64 %size)
  ret ptr %data
}}
define void @NRT_Free(ptr %data) {{
  call void @free(ptr %data)
  ret void
}}
"""
#: What some of numba's code calls besides: lists that grow, and arrays in another shape.
FURTHER = {
    "NRT_MemInfo_varsize_alloc": f"""
define ptr @NRT_MemInfo_varsize_alloc(ptr %info, i64 %size) {{
  %data = call ptr @malloc(i64 %size)
{STORED}
  ret ptr %data
}}""",
    "NRT_MemInfo_varsize_realloc": f"""
declare ptr @realloc(ptr, i64)
define ptr @NRT_MemInfo_varsize_realloc(ptr %info, i64 %size) {{
  %before_field = getelementptr i8, ptr %info, i64 24
  %before = load ptr, ptr %before_field
  %data = call ptr @realloc(ptr %before, i64 %size)
{STORED}
  ret ptr %data
}}""",
    "NRT_MemInfo_varsize_free": """
define void @NRT_MemInfo_varsize_free(ptr %info, ptr %data) {
  call void @free(ptr %data)
  %data_field = getelementptr i8, ptr %info, i64 24
  %held = load ptr, ptr %data_field
  %is_held = icmp eq ptr %data, %held
  br i1 %is_held, label %forget, label %end
forget:
  store ptr null, ptr %data_field
  br label %end
end:
  ret void
}""",
    # of arrays whose numbers lie one behind the other, or that have none; of others it says no, and the
    # call ends with an error
    "numba_attempt_nocopy_reshape": """
define i32 @numba_attempt_nocopy_reshape(i64 %axes, ptr %shape, ptr %strides, i64 %new_axes, ptr %new_shape,
                                         ptr %new_strides, i64 %item_size, i32 %is_fortran) {
entry:
  br label %count
count:
  %counted = phi i64 [ 0, %entry ], [ %counted_more, %count_next ]
  %is_counted = icmp eq i64 %counted, %axes
  br i1 %is_counted, label %check, label %count_next
count_next:
  %counted_field = getelementptr i64, ptr %shape, i64 %counted
  %counted_length = load i64, ptr %counted_field
  %counted_more = add i64 %counted, 1
  %is_empty = icmp eq i64 %counted_length, 0
  br i1 %is_empty, label %fill, label %count
check:
  %left = phi i64 [ %axes, %count ], [ %axis, %next ]
  %expected = phi i64 [ %item_size, %count ], [ %more, %next ]
  %is_checked = icmp eq i64 %left, 0
  br i1 %is_checked, label %fill, label %look
look:
  %axis = sub i64 %left, 1
  %length_field = getelementptr i64, ptr %shape, i64 %axis
  %length = load i64, ptr %length_field
  %stride_field = getelementptr i64, ptr %strides, i64 %axis
  %stride = load i64, ptr %stride_field
  %is_next = icmp eq i64 %stride, %expected
  %is_single = icmp eq i64 %length, 1
  %fits = or i1 %is_next, %is_single
  br i1 %fits, label %next, label %refused
next:
  %more = mul i64 %expected, %length
  br label %check
refused:
  ret i32 0
fill:
  %new_left = phi i64 [ %new_axes, %check ], [ %new_axes, %count_next ], [ %new_axis, %write ]
  %new_stride = phi i64 [ %item_size, %check ], [ %item_size, %count_next ], [ %new_more, %write ]
  %is_filled = icmp eq i64 %new_left, 0
  br i1 %is_filled, label %end, label %write
write:
  %new_axis = sub i64 %new_left, 1
  %new_stride_field = getelementptr i64, ptr %new_strides, i64 %new_axis
  store i64 %new_stride, ptr %new_stride_field
  %new_length_field = getelementptr i64, ptr %new_shape, i64 %new_axis
  %new_length = load i64, ptr %new_length_field
  %new_more = mul i64 %new_stride, %new_length
  br label %fill
end:
  ret i32 1
}""",
}
#: What makes an exception: the status alone is passed on.
WITHOUT_PYTHON = {
    "PyErr_SetString": "define void @PyErr_SetString(ptr %kind, ptr %text) { ret void }",
    "PyUnicode_FromKindAndData": (
        "define ptr @PyUnicode_FromKindAndData(i32 %kind, ptr %data, i64 %size) { ret ptr null }"
    ),
    "PyObject_Hash": "define i64 @PyObject_Hash(ptr %object) { ret i64 0 }",
    "PyTuple_Pack": "define ptr @PyTuple_Pack(i64 %count, ...) { ret ptr null }",
}
#: What may be called outside of an object: the C library, and LLVM's own.
OUTSIDE = re.compile(
    r"llvm\.|(malloc|realloc|free|sqrt|sin|cos|atan|atan2|asin|acos|exp|log|pow|tan|memset|memcpy|memmove)$"
)


#: Where code goes that is not for this machine: the target and the processor, as LLVM names them.
TARGETS = {"aarch64": ("aarch64-unknown-linux-gnu", "generic")}
#: What counts references down in code that was made for x86-64, by the condition that none is left.
COUNT_DOWN = re.compile(r"llvm\.x86\.atomic\.sub\.cc\.i64(?=\(.*i32 (?:4|immarg)\))")
COUNTED_DOWN = """
define i8 @counted_down(ptr %count, i64 %less, i32 %condition) alwaysinline {
  %before = atomicrmw sub ptr %count, i64 %less acq_rel
  %is_zero = icmp eq i64 %before, %less
  %result = zext i1 %is_zero to i8
  ret i8 %result
}
"""
#: What LLVM's code says of its target.
TARGET = re.compile(r"^target (?:datalayout|triple) = .*$", re.MULTILINE)
#: Constants that only exceptions take. They tell where files lie on the machine that compiled, and name
#: functions by numbers that follow the order of compiling.
SAID = re.compile(
    r"^(@\"?\.const\.(?:pickledata\.|picklebuf\.|missing Environment: ).*? = .*?constant ).*$", re.MULTILINE
)
#: Results that are handed on, as the module `struct` names them.
NUMBERS = {types.float64: "d", types.int64: "q", types.boolean: "?"}


class NotShippedError(ValueError):
    """Code that cannot be shipped; the text says why."""


def leaf_kinds(kind: Any) -> Iterator[str]:
    """Yield the types of LLVM in which numba passes an argument, as `arguments.Block` orders them."""
    if isinstance(kind, types.NoneType):
        yield "ptr"
    elif isinstance(kind, types.BaseTuple):
        for part in cast(Any, kind).types:
            yield from leaf_kinds(part)
    elif isinstance(kind, types.Record):
        yield "ptr"
    elif isinstance(kind, types.Array):
        yield from ("ptr", "ptr", "i64", "i64", "ptr", *(("i64",) * (2 * kind.ndim)))
    elif isinstance(kind, types.Boolean):
        yield "i8"
    elif isinstance(kind, types.Integer):
        yield "i64"
    elif isinstance(kind, types.Float):
        yield "double"
    else:
        raise NotShippedError(f"an argument is of numba's type {kind}")


def result_kind(kind: Any) -> str:
    """Return the kind of a result, as `load.read_result` takes it.

    Raises
    ------
    NotShippedError
        If it is neither nothing, nor a number, nor a plain tuple of numbers.
    """
    if isinstance(kind, types.NoneType):
        return ""
    is_tuple = isinstance(kind, types.Tuple | types.UniTuple)
    parts = cast(Any, kind).types if is_tuple else (kind,)
    if all(part in NUMBERS for part in parts) and not (is_tuple and types.boolean in parts):
        return ("," if is_tuple else "") + "".join(NUMBERS[part] for part in parts)
    raise NotShippedError(f"it returns numba's type {kind}")


def object_of(text: str, name: str, kinds: tuple[Any, ...], family: str, *, returns: bool = False) -> bytes:
    """Return the object file of a function.

    Parameters
    ----------
    text : str
        LLVM's code of numba's library, optimised for the family; for aarch64 for any, as long as it has no
        instruction of that one alone.
    name : str
        Of numba's function in it.
    kinds : tuple
        numba's types of its arguments.
    family : str
        As LLVM names it.
    returns : bool
        Whether it returns something: that is written behind the second argument of the entry.

    Raises
    ------
    NotShippedError
        If it calls what no object has, or passes its arguments in another way than is assumed.
    """
    text = without_words(without_wrappers(text))
    pattern = rf"^define [^@\n]*@\"?{re.escape(name)}\"?\((.*)\)[^)\n]*{{$"
    header = re.search(pattern, text, re.MULTILINE)
    if header is None:
        raise NotShippedError(f"numba's code has no {name[:80]}")
    # where the result and the exception go precede the arguments
    parameters = re.findall(r"(\w+)[^%]*%[^\s,]+(?:, )?", header[1])
    leaves = [leaf for kind in kinds for leaf in leaf_kinds(kind)]
    if parameters[2:] != leaves:
        raise NotShippedError("numba passes arguments in another way than a block has them")
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    triple, cpu = TARGETS.get(family, (binding.get_process_triple(), family))
    machine = binding.Target.from_triple(triple).create_target_machine(
        cpu=cpu, opt=3, reloc="default", codemodel="jitdefault", jit=True
    )
    text = TARGET.sub("", text)
    if family in TARGETS:
        text = COUNT_DOWN.sub("counted_down", text)
    whole = binding.parse_assembly(
        f'target datalayout = "{machine.target_data}"\ntarget triple = "{machine.triple}"\n'
        + RUNTIME
        + "".join(f"{code}\n" for part, code in (WITHOUT_PYTHON | FURTHER).items() if f"@{part}(" in text)
        + (COUNTED_DOWN if "counted_down" in text else "")
        + _entry(name, parameters, returns=returns)
    )
    whole.link_in(binding.parse_assembly(text))
    for number, defined in enumerate((*whole.functions, *whole.global_variables)):
        if not defined.is_declaration and defined.name != ENTRY:
            defined.linkage = binding.Linkage.internal
            defined.name = f"f{number}"  # numba's names have what differs from process to process
    whole.verify()
    options = binding.create_pipeline_tuning_options(speed_level=1)
    passes = binding.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(whole, binding.create_pass_builder(machine, options))
    outside = [each.name for each in whole.functions if each.is_declaration]
    if unknown := [
        each for each in outside if not OUTSIDE.match(each) or (family in TARGETS and ".x86." in each)
    ]:
        raise NotShippedError(f"it calls {', '.join(unknown)}")
    return bytes(machine.emit_object(whole))


def packed(content: bytes) -> bytes:
    """Return an object compressed, the same bytes each time."""
    return lzma.compress(content, preset=9)


def sha256(content: bytes) -> str:
    """Return the hash by which a file is known."""
    return hashlib.sha256(content).hexdigest()


def _entry(name: str, parameters: list[str], *, returns: bool) -> str:
    lines = []
    for index, leaf in enumerate(parameters[2:]):
        lines.append(f"  %p{index} = getelementptr i8, ptr %block, i64 {8 * index}")
        lines.append(f"  %a{index} = load {leaf}, ptr %p{index}, align 8")
    passed = "".join(f", {leaf} %a{index}" for index, leaf in enumerate(parameters[2:]))
    body = "\n".join(lines)
    into = "%result" if returns else "%nothing"
    unused = "" if returns else "%nothing = alloca i64, align 8"
    return f"""
declare i32 @"{name}"({", ".join(parameters)})
define i32 @{ENTRY}(ptr %block, ptr %result) {{
  {unused}
  %exception = alloca ptr, align 8
  store ptr null, ptr %exception
{body}
  %status = call i32 @"{name}"(ptr {into}, ptr %exception{passed})
  ret i32 %status
}}
"""


def without_wrappers(text: str) -> str:
    """Return LLVM code without the functions that Python or C would call."""
    lines, skips = [], False
    for line in text.split("\n"):
        skips |= bool(re.match(r'define .*@"?(?:_ZN7cpython|cfunc\.)', line))
        if not skips:
            lines.append(line)
        skips &= line != "}"
    return "\n".join(lines)


def without_words(text: str) -> str:
    """Return LLVM code without what exceptions say: where there is no Python, nobody reads it.

    The same source then gives the same code in any folder, whatever was compiled before it.
    """
    return SAID.sub(r"\1[1 x i8] zeroinitializer", text)
