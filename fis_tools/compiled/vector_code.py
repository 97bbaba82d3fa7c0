"""The LLVM code of vectors, for numba: their types, and each operation of `fis_tools.compiled.vectors`.

Importing this module registers all of it with numba, and `fis_tools.compiled.borrowed_code` adds borrowed
values. LLVM has vectors of any width as values and maps them to the processor's registers.
"""

import operator
from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from numba import TypingError, types
from numba.extending import infer, lower_builtin, models, register_model

from fis_tools.compiled import vectors
from fis_tools.compiled.fingerprint import covers_this_module
from fis_tools.compiled.numba_parts import (
    AbstractTemplate,
    GetItemBuffer,
    SetItemBuffer,
    cgutils,
    infer_global,
    ir,
)

covers_this_module()

MOST_LANES = 64

#: up to this many columns are gathered without transposing whole squares
NARROW = 2

#: makes numba try a typing before those for any target
FIRST = {"target": "cpu"}

I1, I32, I64, F64 = (*map(ir.IntType, (1, 32, 64)), ir.DoubleType())


class LanesType(types.Type):
    """Base of the numba types of vectors: `width` lanes of one kind of element."""

    element: Any

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"{type(self).__name__.removesuffix('Type')}({width})")


class VectorType(LanesType):
    """A float in each lane."""

    element = F64


class MaskType(LanesType):
    """A truth value in each lane."""

    element = I1


@register_model(VectorType)
@register_model(MaskType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, ir.VectorType(kind.element, kind.width))


def _width_of(width: Any) -> int:
    """Return the width that an argument's type stands for."""
    lanes = getattr(width, "literal_value", None)
    if not isinstance(lanes, int):
        raise TypingError(f"the width of a vector is {width}; pass a constant")
    if not (1 <= lanes <= MOST_LANES and lanes & (lanes - 1) == 0):
        raise TypingError(f"a vector cannot be {lanes} wide; choose a power of two up to {MOST_LANES}")
    return lanes


def _joint(x: Any, y: Any) -> VectorType | types.Float | None:
    """Return the common type of vectors of one width and numbers: a vector, or a float without any."""
    vectors_of = {kind for kind in (x, y) if isinstance(kind, VectorType)}
    rest = [kind for kind in (x, y) if not isinstance(kind, VectorType)]
    if len(vectors_of) > 1 or not all(isinstance(kind, (types.Float, types.Integer)) for kind in rest):
        return None
    return vectors_of.pop() if vectors_of else types.float64


def typed(operation: Any, count: int, typer: Callable[..., Any], takes_constants: bool = False) -> None:
    """Register with numba the result type of an operation of `count` arguments; None if it does not apply.

    It is tried before all of numba's own typings of the operation and, if it takes constants, with these
    before variables of their type: otherwise type inference is a third of the compilation time, because numba
    formats a text for each mismatch.
    """

    class Typing(AbstractTemplate):
        key = operation
        prefer_literal = takes_constants
        metadata = FIRST

        def generic(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
            result = None if kws or len(args) != count else typer(*args)
            return None if result is None else result(*args)

    infer(Typing)
    infer_global(operation, types.Function(Typing))


def defined(
    operation: Any, *kinds: Any, result: Callable[..., Any], takes_constants: bool = False
) -> Callable[[Any], Any]:
    """Register an operation of arguments of some kinds; `result` returns its type from theirs, see `typed`.

    The code is made by the decorated function from the context, builder, signature and arguments.
    """

    def typer(*args: Any) -> Any:
        return result(*args) if all(map(isinstance, args, kinds)) else None

    def register(emit: Any) -> Any:
        typed(operation, len(kinds), typer, takes_constants)
        lower_builtin(operation, *kinds)(
            lambda context, builder, signature, args: emit(context, builder, signature, *args)
        )
        return emit

    return register


def _alike(context: Any, builder: Any, wanted: Any, values: Any, kinds: Any) -> list[Any]:
    """Return vectors and numbers, of some types, as floats or as vectors of the wanted type."""

    def alike(value: Any, kind: Any) -> Any:
        if isinstance(kind, VectorType):
            return value
        number = context.cast(builder, value, kind, types.float64)
        return _splat(builder, number, wanted.width) if isinstance(wanted, VectorType) else number

    return [alike(*pair) for pair in zip(values, kinds, strict=True)]


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


def _is_three(kind: Any) -> bool:
    return getattr(kind, "instance_class", None) is vectors.Three


def _component(kind: Any, axis: int) -> Any:
    """Return the type of a three-vector's component, or that of a number or vector for all components."""
    return kind.types[axis] if _is_three(kind) else kind


def _three_type(x: Any, y: Any) -> Any:
    joint = tuple(_joint(_component(x, axis), _component(y, axis)) for axis in range(3))
    return None if None in joint else types.BaseTuple.from_types(joint, vectors.Three)


def _binary(
    operation: Any,
    result: Callable[[Any], Any],
    emit: Callable[[Any, Any, Any], Any],
    threes: Collection[tuple[bool, bool]] = (),
) -> None:
    """Register an operation of two vectors, or of a vector and a number; for two numbers it is numba's.

    `threes` says which arguments may be three-vectors: on these it works component by component.
    """

    def typer(x: Any, y: Any) -> Any:
        if x is y and x in (types.float64, types.int64):
            return result(x)
        if (_is_three(x), _is_three(y)) in threes:
            return _three_type(x, y)
        joint = _joint(x, y)
        return result(joint) if isinstance(joint, VectorType) else None

    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return emit(builder, *_alike(context, builder, _joint(*signature.args), args, signature.args))

    def lower_threes(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        components = []
        for axis, wanted in enumerate(signature.return_type.types):
            values = [
                builder.extract_value(value, axis) if _is_three(kind) else value
                for value, kind in zip(args, signature.args, strict=True)
            ]
            kinds = [_component(kind, axis) for kind in signature.args]
            components.append(emit(builder, *_alike(context, builder, wanted, values, kinds)))
        return context.make_tuple(builder, signature.return_type, components)

    typed(operation, 2, typer)
    for kinds in ((VectorType, VectorType), (VectorType, types.Number), (types.Number, VectorType)):
        lower_builtin(operation, *kinds)(lower)
    for is_three in threes:
        for number in (VectorType, types.Number):
            three_or_number = [types.BaseNamedTuple if is_one else number for is_one in is_three]
            lower_builtin(operation, *three_or_number)(lower_threes)


def _quotient(kind: Any) -> Any:
    return kind if isinstance(kind, VectorType) else types.float64


BOTH, FIRST_ALONE, SECOND_ALONE = (True, True), (True, False), (False, True)
for _operations, _result, _emit, _threes in (
    ((operator.add, operator.iadd), lambda kind: kind, ir.IRBuilder.fadd, (BOTH,)),
    ((operator.sub, operator.isub), lambda kind: kind, ir.IRBuilder.fsub, (BOTH,)),
    ((operator.mul, operator.imul), lambda kind: kind, ir.IRBuilder.fmul, (FIRST_ALONE, SECOND_ALONE)),
    ((operator.truediv, operator.itruediv), _quotient, ir.IRBuilder.fdiv, (FIRST_ALONE,)),
):
    for _operation in _operations:
        _binary(_operation, _result, _emit, _threes)


def _truth_of(kind: Any) -> Any:
    return MaskType(kind.width) if isinstance(kind, VectorType) else types.boolean


def _comparing(symbol: str) -> Callable[[Any, Any, Any], Any]:
    # NaN differs from everything, and all other comparisons with it are false
    compare = ir.IRBuilder.fcmp_unordered if symbol == "!=" else ir.IRBuilder.fcmp_ordered
    return lambda builder, x, y: compare(builder, symbol, x, y)


for _name, _symbol in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "=="), ("ne", "!=")):
    _binary(getattr(operator, _name), _truth_of, _comparing(_symbol))


def _same(x: Any, y: Any) -> Any:
    return x if x == y else None


def _logic(emit: Callable[[Any, Any, Any], Any], *operations: Any) -> None:
    """Register an operation of two masks."""
    for operation in operations:
        defined(operation, MaskType, MaskType, result=_same)(
            lambda context, builder, signature, x, y: emit(builder, x, y)
        )


_logic(ir.IRBuilder.and_, operator.and_, operator.iand)
_logic(ir.IRBuilder.or_, operator.or_, operator.ior)
_logic(ir.IRBuilder.xor, operator.xor, operator.ixor)


def _unary(operation: Any, kind: type, emit: Callable[[Any, Any], Any], result: Any = None) -> None:
    """Register an operation of a vector or a mask; the result is of the same type unless another is given."""
    defined(operation, kind, result=lambda x: result or x)(
        lambda context, builder, signature, x: emit(builder, x)
    )


def _intrinsic(name: str) -> Callable[[Any, Any], Any]:
    """Call a function of LLVM's own that works on vectors of any width."""

    def emit(builder: Any, x: Any) -> Any:
        kind = x.type
        shape = ir.FunctionType(kind, [kind])
        called = builder.module.declare_intrinsic(f"{name}.v{kind.count}f64", (), shape)
        return builder.call(called, [x])

    return emit


_unary(operator.neg, VectorType, ir.IRBuilder.fneg)
_unary(operator.invert, MaskType, ir.IRBuilder.not_)
_unary(abs, VectorType, _intrinsic("llvm.fabs"))
_unary(np.sqrt, VectorType, _intrinsic("llvm.sqrt"))
_unary(np.floor, VectorType, _intrinsic("llvm.floor"))
_unary(np.rint, VectorType, _intrinsic("llvm.rint"))


# Choice


def _select_type(mask: Any, x: Any, y: Any) -> Any:
    """Return the type of a selection from two values by a mask or a bool; None if they do not fit."""
    joint = _joint(x, y)
    if isinstance(mask, MaskType):
        return VectorType(mask.width) if joint in (VectorType(mask.width), types.float64) else None
    return joint if mask == types.boolean and not isinstance(joint, VectorType) else None


@defined(vectors.select, types.Type, types.Type, types.Type, result=_select_type)
def _select(context: Any, builder: Any, signature: Any, mask: Any, *values: Any) -> Any:
    return builder.select(mask, *_alike(context, builder, signature.return_type, values, signature.args[1:]))


def _extreme(operation: Any, symbol: str) -> None:
    """Register the choice of the operand that compares so with the other, else the other."""

    @defined(operation, types.Type, types.Type, result=_joint)
    def emit(context: Any, builder: Any, signature: Any, *values: Any) -> Any:
        x, y = _alike(context, builder, signature.return_type, values, signature.args)
        return builder.select(builder.fcmp_ordered(symbol, x, y), x, y)


_extreme(vectors.least, "<")
_extreme(vectors.most, ">")


@defined(vectors.higher, VectorType, VectorType, result=_same)
def _higher(context: Any, builder: Any, signature: Any, *degrees: Any) -> Any:
    whole = ir.VectorType(I64, degrees[0].type.count)
    x, y = (builder.bitcast(degree, whole) for degree in degrees)
    higher = builder.select(builder.icmp_signed(">", x, y), x, y)
    return builder.bitcast(higher, degrees[0].type)


# Conversions between vectors and their elements


def _width_type(rows: Any) -> Any:
    """Return the number of lanes as a literal type, from the shape in the type of rows."""
    kind = next(iter(rows.fields.values())).type if isinstance(rows, types.Record) else rows
    return types.literal(kind.shape[-1]) if isinstance(kind, types.NestedArray) else None


@defined(vectors.width_of, types.Type, result=_width_type)
def _width(context: Any, builder: Any, signature: Any, rows: Any) -> Any:
    return I64(signature.return_type.literal_value)


def _splat_type(value: Any, width: Any) -> Any:
    return VectorType(_width_of(width))


@defined(vectors.splat, types.Number, types.Integer, result=_splat_type, takes_constants=True)
def _splat_number(context: Any, builder: Any, signature: Any, value: Any, width: Any) -> Any:
    return _alike(context, builder, signature.return_type, [value], signature.args[:1])[0]


def _is_of_floats(array: Any, most_dimensions: int) -> bool:
    """Return True if the elements of an array's rows are contiguous; others are rejected."""
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
    return VectorType(_width_of(width)) if _is_of_floats(array, 3) and _is_index(array, at) else None


@defined(vectors.load, types.Array, types.Type, types.Integer, result=_load_type, takes_constants=True)
def _load(context: Any, builder: Any, signature: Any, array: Any, at: Any, width: Any) -> Any:
    pointer = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    vector = ir.VectorType(F64, signature.return_type.width)
    return builder.load(builder.bitcast(pointer, vector.as_pointer()), align=8)


def _spread_type(array: Any, at: Any, width: Any) -> Any:
    return VectorType(_width_of(width)) if _is_of_floats(array, 1) else None


@defined(vectors.spread, types.Array, types.Integer, types.Integer, result=_spread_type, takes_constants=True)
def _spread(context: Any, builder: Any, signature: Any, array: Any, at: Any, width: Any) -> Any:
    pointer = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    return _splat(builder, builder.load(pointer), signature.return_type.width)


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
    width = offsets.type.count
    first = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    whole = builder.fptosi(offsets, ir.VectorType(I64, width))
    gathered = ir.Constant(offsets.type, ir.Undefined)
    # one by one: on most processors a gather instruction is no faster
    for lane in range(width):
        element = builder.load(builder.gep(first, [builder.extract_element(whole, I32(lane))]), align=8)
        gathered = builder.insert_element(gathered, element, I32(lane))
    return gathered


def _gather_rows_type(array: Any, at: Any, offsets: Any, count: Any, out: Any) -> Any:
    return types.none if _is_of_floats(array, 1) and _is_of_floats(out, 2) else None


@defined(
    *(vectors.gather_rows, types.Array, types.Integer, VectorType, types.Integer, types.Array),
    result=_gather_rows_type,
)
def _gather_rows(context: Any, builder: Any, signature: Any, *args: Any) -> Any:
    """Load rows at the lanes' offsets and store their columns; few columns without transposing squares."""
    array, at, offsets, count, out = args
    lanes = offsets.type.count
    first = _pointer(context, builder, signature.args[0], array, at, signature.args[1])
    whole = builder.fptosi(offsets, ir.VectorType(I64, lanes))
    pointers = [builder.gep(first, [builder.extract_element(whole, I32(lane))]) for lane in range(lanes)]
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
            size = vectors.ROW
            groups = [
                _transposed(builder, _loaded(builder, (pointers * size)[group : group + size], size))
                for group in range(0, lanes, size)
            ]
            write([_beside(builder, [group[row] for group in groups], lanes) for row in range(size)])
    return context.get_dummy_value()


def _loaded(builder: Any, pointers: list[Any], size: int) -> list[Any]:
    """Return `size` elements from each of some pointers on."""
    row = ir.VectorType(F64, size).as_pointer()
    return [builder.load(builder.bitcast(pointer, row), align=8) for pointer in pointers]


def _columns(builder: Any, pointers: list[Any], size: int) -> list[Any]:
    """Return the columns of short rows: all rows concatenated, then every `size`-th element."""
    lanes = len(pointers)
    every = _beside(builder, _loaded(builder, pointers, size), lanes * size)
    return [
        builder.shuffle_vector(
            every, every, ir.Constant(ir.VectorType(I32, lanes), list(range(column, lanes * size, size)))
        )
        for column in range(size)
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
                for row, chosen in ((k, upper), (k + stride, lower)):
                    rows[row] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(I32, size), chosen))
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


def _total(builder: Any, vector: Any) -> Any:
    """Add the upper half of a vector to the lower until one lane is left."""
    half = vector.type.count // 2
    while half:
        lanes = [ir.Constant(ir.VectorType(I32, half), list(range(k, k + half))) for k in (0, half)]
        vector = builder.fadd(*(builder.shuffle_vector(vector, vector, chosen) for chosen in lanes))
        half //= 2
    return builder.extract_element(vector, I32(0))


def _some(builder: Any, mask: Any) -> Any:
    number = builder.bitcast(mask, ir.IntType(mask.type.count))
    return builder.icmp_unsigned("!=", number, number.type(0))


def _count(builder: Any, mask: Any) -> Any:
    number = builder.bitcast(mask, ir.IntType(mask.type.count))
    return builder.ctpop(number if number.type == I64 else builder.zext(number, I64))


def _power_of_two(builder: Any, exponent: Any) -> Any:
    """Put whole numbers into a float's exponent, bits 52 to 62, with its bias of 1023."""
    whole = ir.VectorType(I64, exponent.type.count)
    biased = builder.add(builder.fptosi(exponent, whole), ir.Constant(whole, [1023] * whole.count))
    return builder.bitcast(builder.shl(biased, ir.Constant(whole, [52] * whole.count)), exponent.type)


_unary(vectors.total, VectorType, _total, types.float64)
_unary(vectors.some, MaskType, _some, types.boolean)
_unary(vectors.count, MaskType, _count, types.int64)
_unary(vectors.power_of_two, VectorType, _power_of_two)
