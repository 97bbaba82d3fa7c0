"""The LLVM code of vectors, for numba: their types, and each operation of `fis_tools.compiled.vectors`.

Importing this module registers all of it with numba, and `fis_tools.compiled.borrowed_code` adds borrowed
values. LLVM has vectors of any width as values and maps them to the processor's registers.
"""

import operator
from collections.abc import Callable
from inspect import signature as signature_of
from typing import Any

import numpy as np
from numba import TypingError, types
from numba.extending import infer, lower_builtin, models, register_model

from fis_tools.compiled import vectors
from fis_tools.compiled.numba_parts import (
    AbstractTemplate,
    GetItemBuffer,
    SetItemBuffer,
    cgutils,
    infer_global,
    ir,
)

MOST_LANES = 64

#: up to this many columns are gathered without transposing whole squares
NARROW = 2

#: makes numba try a typing before those for any target
FIRST = {"target": "cpu"}

I1, I32, I64, F64 = (*map(ir.IntType, (1, 32, 64)), ir.DoubleType())


class VectorType(types.Type):
    """A float in each lane."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Vector({width})")


class MaskType(types.Type):
    """A truth value in each lane."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Mask({width})")


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: VectorType) -> None:
        super().__init__(manager, kind, ir.VectorType(F64, kind.width))


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: MaskType) -> None:
        super().__init__(manager, kind, ir.VectorType(I1, kind.width))


def _width_of(width: Any) -> int:
    """Return the width that an argument's type stands for."""
    lanes = getattr(width, "literal_value", None)
    if not isinstance(lanes, int):
        raise TypingError(f"the width of a vector is {width}; pass a constant")
    if not (1 <= lanes <= MOST_LANES and lanes & (lanes - 1) == 0):
        raise TypingError(f"a vector cannot be {lanes} wide; choose a power of two up to {MOST_LANES}")
    return lanes


def _joint(one: Any, other: Any) -> VectorType | types.Float | None:
    """Return the common type of vectors of one width and numbers: a vector, or a float without any."""
    found = {kind for kind in (one, other) if isinstance(kind, VectorType)}
    rest = [kind for kind in (one, other) if not isinstance(kind, VectorType)]
    if len(found) > 1 or not all(isinstance(kind, (types.Float, types.Integer)) for kind in rest):
        return None
    return found.pop() if found else types.float64


def typed(operation: Any, typer: Callable[..., Any], takes_constants: bool = False) -> None:
    """Register an operation's result type with numba; a typer returns None if it does not apply.

    It is tried before all of numba's own typings of the operation and, if it takes constants, with these
    before variables of their type: otherwise type inference is a third of the compilation time, because numba
    formats a text for each mismatch.
    """
    count = len(signature_of(typer).parameters)

    class Typing(AbstractTemplate):
        key = operation
        prefer_literal = takes_constants
        metadata = FIRST

        def generic(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
            result = None if kws or len(args) != count else typer(*args)
            return None if result is None else result(*args)

    infer(Typing)
    infer_global(operation, types.Function(Typing))


def _as(context: Any, builder: Any, value: Any, kind: Any, wanted: Any) -> Any:
    """Return a vector, or a number as a float or as a vector of equal lanes."""
    if isinstance(kind, VectorType):
        return value
    number = context.cast(builder, value, kind, types.float64)
    return _splat(builder, number, wanted.width) if isinstance(wanted, VectorType) else number


def _splat(builder: Any, value: Any, width: int) -> Any:
    nothing = ir.Constant(ir.VectorType(F64, width), ir.Undefined)
    first = builder.insert_element(nothing, value, I32(0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(I32, width), [0] * width))


# Elements of arrays: numba supports them itself, but would try lists, dictionaries and texts first


class _Element(GetItemBuffer):
    key = operator.getitem
    metadata = FIRST


class _Assigned(SetItemBuffer):
    key = operator.setitem
    metadata = FIRST


infer_global(operator.getitem, types.Function(_Element))
infer_global(operator.setitem, types.Function(_Assigned))

# Arithmetic, comparisons and logic


def _binary(operation: Any, result: Callable[[Any], Any], emit: Callable[[Any, Any, Any], Any]) -> None:
    """Register an operation of two vectors, or of a vector and a number; for two numbers it is numba's."""

    def typer(one: Any, other: Any) -> Any:
        if one is other and one in (types.float64, types.int64):
            return result(one)
        joint = _joint(one, other)
        return result(joint) if isinstance(joint, VectorType) else None

    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        joint = _joint(*signature.args)
        one, other = (_as(context, builder, *pair, joint) for pair in zip(args, signature.args, strict=True))
        return emit(builder, one, other)

    typed(operation, typer)
    for kinds in ((VectorType, VectorType), (VectorType, types.Number), (types.Number, VectorType)):
        lower_builtin(operation, *kinds)(lower)


def _quotient(kind: Any) -> Any:
    return kind if isinstance(kind, VectorType) else types.float64


for _plain, _in_place, _emit in (
    (operator.add, operator.iadd, lambda builder, one, other: builder.fadd(one, other)),
    (operator.sub, operator.isub, lambda builder, one, other: builder.fsub(one, other)),
    (operator.mul, operator.imul, lambda builder, one, other: builder.fmul(one, other)),
    (operator.truediv, operator.itruediv, lambda builder, one, other: builder.fdiv(one, other)),
):
    for _operation in (_plain, _in_place):
        _binary(_operation, _quotient if _plain is operator.truediv else lambda kind: kind, _emit)


def _truth_of(kind: Any) -> Any:
    return MaskType(kind.width) if isinstance(kind, VectorType) else types.boolean


def _comparing(symbol: str) -> Callable[[Any, Any, Any], Any]:
    def emit(builder: Any, one: Any, other: Any) -> Any:
        # NaN differs from everything, and all other comparisons with it are false
        compare = builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered
        return compare(symbol, one, other)

    return emit


for _operation, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
    (operator.ne, "!="),
):
    _binary(_operation, _truth_of, _comparing(_symbol))


def _logic(operations: tuple[Any, ...], emit: Callable[[Any, Any, Any], Any]) -> None:
    def typer(one: Any, other: Any) -> Any:
        return one if isinstance(one, MaskType) and one == other else None

    for operation in operations:
        typed(operation, typer)
        lower_builtin(operation, MaskType, MaskType)(
            lambda context, builder, signature, args: emit(builder, *args)
        )


_logic((operator.and_, operator.iand), lambda builder, one, other: builder.and_(one, other))
_logic((operator.or_, operator.ior), lambda builder, one, other: builder.or_(one, other))
_logic((operator.xor, operator.ixor), lambda builder, one, other: builder.xor(one, other))


def _unary(operation: Any, kind: type, emit: Callable[[Any, Any], Any]) -> None:
    typed(operation, lambda x: x if isinstance(x, kind) else None)
    lower_builtin(operation, kind)(lambda context, builder, signature, args: emit(builder, args[0]))


def _intrinsic(name: str) -> Callable[[Any, Any], Any]:
    """Call a function of LLVM's own that works on vectors of any width."""

    def emit(builder: Any, x: Any) -> Any:
        kind = x.type
        shape = ir.FunctionType(kind, [kind])
        called = builder.module.declare_intrinsic(f"{name}.v{kind.count}f64", (), shape)
        return builder.call(called, [x])

    return emit


_unary(operator.neg, VectorType, lambda builder, x: builder.fneg(x))
_unary(operator.invert, MaskType, lambda builder, mask: builder.not_(mask))
_unary(abs, VectorType, _intrinsic("llvm.fabs"))
_unary(np.sqrt, VectorType, _intrinsic("llvm.sqrt"))
_unary(np.floor, VectorType, _intrinsic("llvm.floor"))
_unary(np.rint, VectorType, _intrinsic("llvm.rint"))


# Choice


def _select_type(mask: Any, one: Any, other: Any) -> Any:
    joint = _joint(one, other)
    if isinstance(mask, MaskType):
        return VectorType(mask.width) if joint in (VectorType(mask.width), types.float64) else None
    return joint if mask == types.boolean and not isinstance(joint, VectorType) else None


def _lower_select(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    one, other = (
        _as(context, builder, value, kind, signature.return_type)
        for value, kind in zip(args[1:], signature.args[1:], strict=True)
    )
    return builder.select(args[0], one, other)


typed(vectors.select, _select_type)
lower_builtin(vectors.select, types.Any, types.Any, types.Any)(_lower_select)


def _chosen_by(symbol: str) -> Callable[[Any, Any, Any], Any]:
    """Return the operand that compares so with the other, else the other."""
    return lambda builder, one, other: builder.select(builder.fcmp_ordered(symbol, one, other), one, other)


def _extreme(operation: Any, symbol: str) -> None:
    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pairs = zip(args, signature.args, strict=True)
        one, other = (_as(context, builder, *pair, signature.return_type) for pair in pairs)
        return _chosen_by(symbol)(builder, one, other)

    typed(operation, _joint)
    lower_builtin(operation, types.Any, types.Any)(lower)


_extreme(vectors.least, "<")
_extreme(vectors.most, ">")


def _higher_type(one: Any, other: Any) -> Any:
    return one if isinstance(one, VectorType) and one == other else None


typed(vectors.higher, _higher_type)


@lower_builtin(vectors.higher, VectorType, VectorType)
def _lower_higher(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    whole = ir.VectorType(I64, args[0].type.count)
    one, other = (builder.bitcast(degrees, whole) for degrees in args)
    higher = builder.select(builder.icmp_signed(">", one, other), one, other)
    return builder.bitcast(higher, args[0].type)


# Conversions between vectors and their elements


def _vector_in(operation: Any, *kinds: Any) -> Callable[[Any], Any]:
    """Register an operation whose last argument is the width of the vector that it returns."""

    def register(emit: Any) -> Any:
        def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return emit(context, builder, signature, *args[:-1], signature.return_type.width)

        lower_builtin(operation, *kinds, types.IntegerLiteral)(lower)
        return emit

    return register


def _width_type(rows: Any) -> Any:
    kind = next(iter(rows.fields.values())).type if isinstance(rows, types.Record) else rows
    return types.literal(kind.shape[-1]) if isinstance(kind, types.NestedArray) else None


typed(vectors.width_of, _width_type)


@lower_builtin(vectors.width_of, types.Any)
def _lower_width_of(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    return I64(signature.return_type.literal_value)


typed(vectors.splat, lambda value, width: VectorType(_width_of(width)), takes_constants=True)


@_vector_in(vectors.splat, types.Number)
def _lower_splat(context: Any, builder: Any, signature: Any, value: Any, width: int) -> Any:
    return _as(context, builder, value, signature.args[0], signature.return_type)


def _is_of_floats(array: Any, most_dimensions: int) -> bool:
    """Return whether the elements of an array's rows are contiguous; others are rejected."""
    if not isinstance(array, types.Array):
        return False
    if array.dtype != types.float64 or array.layout != "C" or array.ndim > most_dimensions:
        raise TypingError(
            f"vectors are not read from {array}; pass an array of float64 in C order, "
            f"of {'one dimension' if most_dimensions == 1 else 'one to three dimensions'}"
        )
    return True


def members(kind: Any) -> tuple[Any, ...] | None:
    """Return the types of a tuple's elements; None if it is not a tuple."""
    held: tuple[Any, ...] = getattr(kind, "types", ())
    return held if isinstance(kind, types.BaseTuple) else None


def _is_place(array: Any, at: Any) -> bool:
    """Return whether an index consists of whole numbers; others do not lead to an element or a row."""
    kinds = members(at) or (at,)
    if not all(isinstance(kind, types.Integer) for kind in kinds):
        return False
    if len(kinds) != array.ndim and not (at is kinds[0] and array.ndim == 2):
        raise TypingError(f"{at} is no index of a vector in {array}; pass a whole number for each dimension")
    return True


def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any, index: Any) -> Any:
    """Return the pointer to the element of an array at an index."""
    whole = cgutils.create_struct_proxy(kind)(context, builder, value=array)
    kinds = members(index)
    pairs = [(at, index)]
    if kinds is not None:
        pairs = list(zip(cgutils.unpack_tuple(builder, at, len(kinds)), kinds, strict=True))
    numbers = [context.cast(builder, *pair, types.intp) for pair in pairs]
    numbers += [ir.Constant(I64, 0)] * (kind.ndim - len(numbers))
    offset = numbers[0]
    for axis in range(1, kind.ndim):
        offset = builder.mul(offset, builder.extract_value(whole.shape, axis))
        offset = builder.add(offset, numbers[axis])
    return builder.gep(whole.data, [offset])


def _load_type(array: Any, at: Any, width: Any) -> Any:
    if not (_is_of_floats(array, 3) and _is_place(array, at)):
        return None
    return VectorType(_width_of(width))


typed(vectors.load, _load_type, takes_constants=True)


@_vector_in(vectors.load, types.Array, types.Any)
def _lower_load(context: Any, builder: Any, signature: Any, array: Any, at: Any, width: int) -> Any:
    place = _place(context, builder, signature.args[0], array, at, signature.args[1])
    return builder.load(builder.bitcast(place, ir.VectorType(F64, width).as_pointer()), align=8)


def _spread_type(array: Any, at: Any, width: Any) -> Any:
    if not (_is_of_floats(array, 1) and isinstance(at, types.Integer)):
        return None
    return VectorType(_width_of(width))


typed(vectors.spread, _spread_type, takes_constants=True)


@_vector_in(vectors.spread, types.Array, types.Integer)
def _lower_spread(context: Any, builder: Any, signature: Any, array: Any, at: Any, width: int) -> Any:
    place = _place(context, builder, signature.args[0], array, at, signature.args[1])
    return _splat(builder, builder.load(place), width)


def _store_type(array: Any, at: Any, vector: Any) -> Any:
    is_possible = _is_of_floats(array, 3) and _is_place(array, at) and isinstance(vector, VectorType)
    return types.none if is_possible else None


typed(vectors.store, _store_type)


@lower_builtin(vectors.store, types.Array, types.Any, VectorType)
def _lower_store(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array, at, vector = args
    place = _place(context, builder, signature.args[0], array, at, signature.args[1])
    builder.store(vector, builder.bitcast(place, vector.type.as_pointer()), align=8)
    return context.get_dummy_value()


def _gather_type(array: Any, at: Any, offsets: Any) -> Any:
    is_possible = (
        _is_of_floats(array, 1) and isinstance(at, types.Integer) and isinstance(offsets, VectorType)
    )
    return offsets if is_possible else None


typed(vectors.gather, _gather_type)


@lower_builtin(vectors.gather, types.Array, types.Integer, VectorType)
def _lower_gather(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array, at, offsets = args
    width = offsets.type.count
    first = _place(context, builder, signature.args[0], array, at, signature.args[1])
    whole = builder.fptosi(offsets, ir.VectorType(I64, width))
    found = ir.Constant(offsets.type, ir.Undefined)
    # one by one: on most processors a gather instruction is no faster
    for lane in range(width):
        element = builder.load(builder.gep(first, [builder.extract_element(whole, I32(lane))]), align=8)
        found = builder.insert_element(found, element, I32(lane))
    return found


def _gather_rows_type(array: Any, at: Any, offsets: Any, count: Any, out: Any) -> Any:
    is_possible = (
        _is_of_floats(array, 1)
        and _is_of_floats(out, 2)
        and isinstance(at, types.Integer)
        and isinstance(offsets, VectorType)
        and isinstance(count, types.Integer)
    )
    return types.none if is_possible else None


typed(vectors.gather_rows, _gather_rows_type)


@lower_builtin(vectors.gather_rows, types.Array, types.Integer, VectorType, types.Integer, types.Array)
def _lower_gather_rows(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array, at, offsets, count, out = args
    lanes = offsets.type.count
    first = _place(context, builder, signature.args[0], array, at, signature.args[1])
    whole = builder.fptosi(offsets, ir.VectorType(I64, lanes))
    places = [builder.gep(first, [builder.extract_element(whole, I32(lane))]) for lane in range(lanes)]
    wanted = context.cast(builder, count, signature.args[3], types.intp)

    def write(columns: list[Any]) -> None:
        for place, vector in enumerate(columns):
            with builder.if_then(builder.icmp_signed("<", I64(place), wanted)):
                to = _place(context, builder, signature.args[4], out, I64(place), types.intp)
                builder.store(vector, builder.bitcast(to, vector.type.as_pointer()), align=8)

    with builder.if_else(builder.icmp_signed("<=", wanted, I64(NARROW))) as (few, many):
        with few:
            write(_columns(builder, places, NARROW))
        with many:
            size = vectors.ROW
            groups = [
                _transposed(builder, _loaded(builder, (places * size)[group : group + size], size))
                for group in range(0, lanes, size)
            ]
            write([_beside(builder, [group[place] for group in groups], lanes) for place in range(size)])
    return context.get_dummy_value()


def _loaded(builder: Any, places: list[Any], size: int) -> list[Any]:
    """Return `size` elements from each of some pointers on."""
    row = ir.VectorType(F64, size).as_pointer()
    return [builder.load(builder.bitcast(place, row), align=8) for place in places]


def _columns(builder: Any, places: list[Any], size: int) -> list[Any]:
    """Return the columns of short rows: all rows concatenated, then every `size`-th element."""
    lanes = len(places)
    every = _beside(builder, _loaded(builder, places, size), lanes * size)
    return [
        builder.shuffle_vector(
            every, every, ir.Constant(ir.VectorType(I32, lanes), list(range(place, lanes * size, size)))
        )
        for place in range(size)
    ]


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """Return the columns of a square, by exchanging off-diagonal blocks: of one, of two, of four."""
    size, stride = len(rows), 1
    while stride < size:
        upper = [k if k & stride == 0 else size + k - stride for k in range(size)]
        lower = [k + stride if k & stride == 0 else size + k for k in range(size)]
        for k in range(size):
            if k & stride == 0:
                pair = rows[k], rows[k + stride]
                for place, chosen in ((k, upper), (k + stride, lower)):
                    rows[place] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(I32, size), chosen))
        stride *= 2
    return rows


def _beside(builder: Any, parts: list[Any], lanes: int) -> Any:
    """Return the concatenation of vectors of one width, or the first lanes of a single one."""
    while len(parts) > 1:
        both = 2 * parts[0].type.count
        chosen = ir.Constant(ir.VectorType(I32, both), list(range(both)))
        parts = [builder.shuffle_vector(*pair, chosen) for pair in zip(parts[::2], parts[1::2], strict=True)]
    if parts[0].type.count == lanes:
        return parts[0]
    return builder.shuffle_vector(
        parts[0], parts[0], ir.Constant(ir.VectorType(I32, lanes), list(range(lanes)))
    )


def _of_vector(operation: Any, kind: type, result: Any) -> Callable[[Any], Any]:
    """Register an operation from a vector or a mask to a scalar."""

    def register(emit: Any) -> Any:
        typed(operation, lambda x: result if isinstance(x, kind) else None)
        lower_builtin(operation, kind)(lambda context, builder, signature, args: emit(builder, args[0]))
        return emit

    return register


def _by_halves(builder: Any, vector: Any, combine: Callable[[Any, Any, Any], Any]) -> Any:
    half = vector.type.count // 2
    while half:
        lanes = [ir.Constant(ir.VectorType(I32, half), list(range(k, k + half))) for k in (0, half)]
        lower, upper = (builder.shuffle_vector(vector, vector, own) for own in lanes)
        vector = combine(builder, lower, upper)
        half //= 2
    return builder.extract_element(vector, I32(0))


@_of_vector(vectors.total, VectorType, types.float64)
def _lower_total(builder: Any, vector: Any) -> Any:
    return _by_halves(builder, vector, lambda builder, lower, upper: builder.fadd(lower, upper))


def _as_integer(builder: Any, mask: Any) -> Any:
    return builder.bitcast(mask, ir.IntType(mask.type.count))


def _as_int64(builder: Any, number: Any) -> Any:
    return number if number.type == I64 else builder.zext(number, I64)


@_of_vector(vectors.some, MaskType, types.boolean)
def _lower_some(builder: Any, mask: Any) -> Any:
    number = _as_integer(builder, mask)
    return builder.icmp_unsigned("!=", number, number.type(0))


@_of_vector(vectors.count, MaskType, types.int64)
def _lower_count(builder: Any, mask: Any) -> Any:
    return builder.ctpop(_as_int64(builder, _as_integer(builder, mask)))


def _power_of_two(builder: Any, exponent: Any) -> Any:
    """Put whole numbers into a float's exponent, bits 52 to 62, with its bias of 1023."""
    whole = ir.VectorType(I64, exponent.type.count)
    biased = builder.add(builder.fptosi(exponent, whole), ir.Constant(whole, [1023] * whole.count))
    return builder.bitcast(builder.shl(biased, ir.Constant(whole, [52] * whole.count)), exponent.type)


_unary(vectors.power_of_two, VectorType, _power_of_two)
