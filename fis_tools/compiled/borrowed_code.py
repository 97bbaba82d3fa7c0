"""The LLVM code of `fis_tools.compiled.vectors.borrowed`, for numba.

Borrowed arrays have references that are not counted; a borrowed named tuple is one pointer.
Importing this module registers them with numba, as well as all operations of vectors.
"""

from functools import cache
from typing import Any

from numba import types
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model

from fis_tools.compiled import vector_code, vector_memory, vectors  # noqa: F401 - register operations
from fis_tools.compiled.fingerprint import covers_this_module
from fis_tools.compiled.numba_parts import AttributeTemplate, cgutils, ir
from fis_tools.compiled.vector_types import I64, defined, members

covers_this_module()

I8 = ir.IntType(8)


class BorrowedType(types.Type):
    """A named tuple that a caller holds, as a pointer to its values."""

    def __init__(self, held: Any) -> None:
        self.held = held
        super().__init__(name=f"Borrowed({held.name})")


@register_model(BorrowedType)
class _BorrowedModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: BorrowedType) -> None:
        super().__init__(manager, kind, I8.as_pointer())


def _borrowed_type(kind: Any) -> Any:
    """Return the numba type of a borrowed array or tuple."""
    if isinstance(kind, types.BaseNamedTuple):
        return BorrowedType(kind)
    held = members(kind)
    return kind if held is None else types.Tuple([_borrowed_type(member) for member in held])


def _uncounted(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return a value without the owners of its arrays, so that numba counts no references to them."""
    if isinstance(kind, types.Array):
        array = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        for owner in ("meminfo", "parent"):
            setattr(array, owner, ir.Constant(getattr(array, owner).type, None))
        return array._getvalue()
    for index, member in enumerate(members(kind) or ()):
        part = _uncounted(context, builder, member, builder.extract_value(value, index))
        value = builder.insert_value(value, part, index)
    return value


def _lent(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return a borrowed array or tuple; a named tuple becomes a pointer to its values on the stack."""
    if isinstance(kind, types.BaseNamedTuple):
        stored = cgutils.alloca_once_value(builder, _uncounted(context, builder, kind, value))
        return builder.bitcast(stored, I8.as_pointer())
    if members(kind) is None:
        return _uncounted(context, builder, kind, value)
    parts = [
        _lent(context, builder, member, builder.extract_value(value, index))
        for index, member in enumerate(members(kind) or ())
    ]
    return context.make_tuple(builder, _borrowed_type(kind), parts)


@defined(vectors.borrowed, types.Type, result=_borrowed_type)
def _borrowed(context: Any, builder: Any, signature: Any, value: Any) -> Any:
    return _lent(context, builder, signature.args[0], value)


@infer_getattr
class _BorrowedAttributes(AttributeTemplate):
    key = BorrowedType

    def generic_resolve(self, kind: BorrowedType, name: str) -> Any:  # type: ignore[override]
        if name in kind.held.fields:
            return _borrowed_type(kind.held.types[kind.held.fields.index(name)])
        return None


@cache
def _offset(context: Any, held: Any, index: int) -> int:
    """Return the byte offset of one of a tuple's values."""
    values, data = context.get_value_type(held), context.target_data
    if isinstance(values, ir.ArrayType):  # all have the same type
        return index * int(values.element.get_abi_size(data))
    return int(values.get_element_offset(data, index))


@lower_getattr_generic(BorrowedType)
def _lower_borrowed_attribute(context: Any, builder: Any, kind: BorrowedType, value: Any, name: str) -> Any:
    """Load a field of a borrowed named tuple through its pointer."""
    index = kind.held.fields.index(name)
    member = kind.held.types[index]
    pointer = builder.gep(value, [I64(_offset(context, kind.held, index))])
    if isinstance(member, types.BaseNamedTuple):
        return pointer
    element = builder.load(builder.bitcast(pointer, context.get_value_type(member).as_pointer()))
    return _lent(context, builder, member, element)
