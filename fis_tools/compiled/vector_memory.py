"""The LLVM code that reads vectors from arrays and writes them, for numba.

Importing this module registers it with numba.
"""

import operator
from typing import Any

from numba import TypingError, types

from fis_tools.compiled import vectors
from fis_tools.compiled.fingerprint import covers_this_module
from fis_tools.compiled.numba_parts import GetItemBuffer, SetItemBuffer, cgutils, infer_global, ir
from fis_tools.compiled.vector_types import (
    F64,
    FIRST,
    I32,
    I64,
    VectorType,
    alike,
    defined,
    members,
    splat,
    width_of_type,
)

covers_this_module()

#: so many columns or fewer are gathered without transposing whole squares
NARROW = 2

# Elements of arrays: numba supports them itself, but would try lists, dictionaries and texts first


class _Element(GetItemBuffer):
    key = operator.getitem
    metadata = FIRST


class _Assigned(SetItemBuffer):
    key = operator.setitem
    metadata = FIRST


infer_global(operator.getitem, types.Function(_Element))
infer_global(operator.setitem, types.Function(_Assigned))


def _width_type(rows: Any) -> Any:
    """Return the number of lanes as a literal type, from the shape in the type of rows."""
    kind = next(iter(rows.fields.values())).type if isinstance(rows, types.Record) else rows
    return types.literal(kind.shape[-1]) if isinstance(kind, types.NestedArray) else None


@defined(vectors.width_of, types.Type, result=_width_type)
def _width(context: Any, builder: Any, signature: Any, rows: Any) -> Any:
    return I64(signature.return_type.literal_value)


def _splat_type(value: Any, width: Any) -> Any:
    return VectorType(width_of_type(width))


@defined(vectors.splat, types.Number, types.Integer, result=_splat_type, takes_constants=True)
def _splat_number(context: Any, builder: Any, signature: Any, value: Any, width: Any) -> Any:
    return alike(context, builder, signature.return_type, [value], signature.args[:1])[0]


def _is_of_floats(array: Any, most_dimensions: int) -> bool:
    """Return True if the elements of an array's rows are contiguous; others are rejected."""
    if array.dtype != types.float64 or array.layout != "C" or array.ndim > most_dimensions:
        raise TypingError(
            f"vectors are not read from {array}; pass an array of float64 in C order, "
            f"of {'one dimension' if most_dimensions == 1 else 'one to three dimensions'}"
        )
    return True


def _is_index(array: Any, at: Any) -> bool:
    """Return whether an index consists of whole numbers; others do not lead to an element or a row."""
    kinds = members(at) or (at,)
    if not all(isinstance(kind, types.Integer) for kind in kinds):
        return False
    if len(kinds) != array.ndim and not (at is kinds[0] and array.ndim == 2):
        raise TypingError(f"{at} is no index of a vector in {array}; pass a whole number for each dimension")
    return True


def _pointer(context: Any, builder: Any, kind: Any, array: Any, at: Any, index: Any) -> Any:
    """Return the pointer to the element of an array at an index."""
    whole = cgutils.create_struct_proxy(kind)(context, builder, value=array)
    kinds = members(index)
    parts = [at] if kinds is None else cgutils.unpack_tuple(builder, at, len(kinds))
    numbers = [context.cast(builder, *pair, types.intp) for pair in zip(parts, kinds or [index], strict=True)]
    numbers += [I64(0)] * (kind.ndim - len(numbers))
    return cgutils.get_item_pointer(context, builder, kind, whole, numbers)


def _load_type(array: Any, at: Any, width: Any) -> Any:
    return VectorType(width_of_type(width)) if _is_of_floats(array, 3) and _is_index(array, at) else None


@defined(vectors.load, types.Array, types.Type, types.Integer, result=_load_type, takes_constants=True)
def _load(context: Any, builder: Any, signature: Any, array: Any, at: Any, width: Any) -> Any:
    pointer = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    vector = ir.VectorType(F64, signature.return_type.width)
    return builder.load(builder.bitcast(pointer, vector.as_pointer()), align=8)


def _spread_type(array: Any, at: Any, width: Any) -> Any:
    return VectorType(width_of_type(width)) if _is_of_floats(array, 1) else None


@defined(vectors.spread, types.Array, types.Integer, types.Integer, result=_spread_type, takes_constants=True)
def _spread(context: Any, builder: Any, signature: Any, array: Any, at: Any, width: Any) -> Any:
    pointer = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    return splat(builder, builder.load(pointer), signature.return_type.width)


def _store_type(array: Any, at: Any, vector: Any) -> Any:
    return types.none if _is_of_floats(array, 3) and _is_index(array, at) else None


@defined(vectors.store, types.Array, types.Type, VectorType, result=_store_type)
def _store(context: Any, builder: Any, signature: Any, array: Any, at: Any, vector: Any) -> Any:
    pointer = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    builder.store(vector, builder.bitcast(pointer, vector.type.as_pointer()), align=8)
    return context.get_dummy_value()


def _gather_type(array: Any, at: Any, offsets: Any) -> Any:
    return offsets if _is_of_floats(array, 1) else None


@defined(vectors.gather, types.Array, types.Integer, VectorType, result=_gather_type)
def _gather(context: Any, builder: Any, signature: Any, array: Any, at: Any, offsets: Any) -> Any:
    """Load one element for each lane, at the lane's offset."""
    gathered = ir.Constant(offsets.type, ir.Undefined)
    # one by one: on most processors a gather instruction is no faster
    for lane, pointer in enumerate(_pointers(context, builder, signature, array, at, offsets)):
        gathered = builder.insert_element(gathered, builder.load(pointer, align=8), I32(lane))
    return gathered


def _pointers(context: Any, builder: Any, signature: Any, array: Any, at: Any, offsets: Any) -> list[Any]:
    """Return the pointer of each lane, at its offset from an index of an array."""
    first = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    whole = builder.fptosi(offsets, ir.VectorType(I64, offsets.type.count))
    lanes = range(offsets.type.count)
    return [builder.gep(first, [builder.extract_element(whole, I32(lane))]) for lane in lanes]


def _gather_rows_type(array: Any, at: Any, offsets: Any, count: Any, out: Any) -> Any:
    return types.none if _is_of_floats(array, 1) and _is_of_floats(out, 2) else None


@defined(
    *(vectors.gather_rows, types.Array, types.Integer, VectorType, types.Integer, types.Array),
    result=_gather_rows_type,
)
def _gather_rows(context: Any, builder: Any, signature: Any, *args: Any) -> Any:
    """Load rows at the lanes' offsets and store their columns; few columns without transposing squares."""
    *_, count, out = args
    pointers = _pointers(context, builder, signature, *args[:3])
    wanted = context.cast(builder, count, signature.args[3], types.intp)

    def write(columns: list[Any]) -> None:
        for row, vector in enumerate(columns):
            with builder.if_then(builder.icmp_signed("<", I64(row), wanted)):
                to = _pointer(context, builder, signature.args[4], out, I64(row), types.intp)
                builder.store(vector, builder.bitcast(to, vector.type.as_pointer()), align=8)

    with builder.if_else(builder.icmp_signed("<=", wanted, I64(NARROW))) as (few, many):
        with few:
            write(_columns(builder, pointers, NARROW))
        with many:
            write(_columns_by_squares(builder, pointers, vectors.ROW))
    return context.get_dummy_value()


def _loaded(builder: Any, pointers: list[Any], size: int) -> list[Any]:
    """Return `size` elements from each pointer on."""
    row = ir.VectorType(F64, size).as_pointer()
    return [builder.load(builder.bitcast(pointer, row), align=8) for pointer in pointers]


def _columns(builder: Any, pointers: list[Any], size: int) -> list[Any]:
    """Return the columns of short rows: of all rows side by side every `size`-th element."""
    lanes = len(pointers)
    rows = _beside(builder, _loaded(builder, pointers, size), lanes * size)
    every = [list(range(column, lanes * size, size)) for column in range(size)]
    return [
        builder.shuffle_vector(rows, rows, ir.Constant(ir.VectorType(I32, lanes), chosen)) for chosen in every
    ]


def _columns_by_squares(builder: Any, pointers: list[Any], size: int) -> list[Any]:
    """Return the columns of rows as long as a square is high; one not filled has some twice."""
    groups = [
        _transposed(builder, _loaded(builder, (pointers * size)[group : group + size], size))
        for group in range(0, len(pointers), size)
    ]
    return [_beside(builder, [group[row] for group in groups], len(pointers)) for row in range(size)]


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """Return the columns of a square, by exchanging off-diagonal blocks: of one, of two, of four."""
    size, stride = len(rows), 1
    while stride < size:
        upper = [k if k & stride == 0 else size + k - stride for k in range(size)]
        lower = [k + stride if k & stride == 0 else size + k for k in range(size)]
        for k in range(size):
            if k & stride == 0:
                pair = rows[k], rows[k + stride]
                for row, chosen in ((k, upper), (k + stride, lower)):
                    rows[row] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(I32, size), chosen))
        stride *= 2
    return rows


def _first(count: int) -> Any:
    """Return which lanes a shuffle takes: the first `count`."""
    return ir.Constant(ir.VectorType(I32, count), list(range(count)))


def _beside(builder: Any, parts: list[Any], lanes: int) -> Any:
    """Return the concatenation of vectors of one width, or the first lanes of a single one."""
    while len(parts) > 1:
        pairs = zip(parts[::2], parts[1::2], strict=True)
        parts = [builder.shuffle_vector(*pair, _first(2 * pair[0].type.count)) for pair in pairs]
    return builder.shuffle_vector(parts[0], parts[0], _first(lanes))
