"""The LLVM code of vectors' arithmetic, for numba: operators, choices, and what all lanes give together.

Importing this module registers it with numba; `fis_tools.compiled.vector_memory` adds reading and writing,
`fis_tools.compiled.borrowed_code` borrowed values.
"""

import operator
from collections.abc import Callable, Collection
from itertools import product
from typing import Any

import numpy as np
from numba import types
from numba.extending import lower_builtin

from fis_tools.compiled import vectors
from fis_tools.compiled.fingerprint import covers_this_module
from fis_tools.compiled.numba_parts import ir
from fis_tools.compiled.vector_types import I32, I64, MaskType, VectorType, alike, defined, joint_type, typed

covers_this_module()


def _is_three(kind: Any) -> bool:
    return getattr(kind, "instance_class", None) is vectors.Three


def _component(kind: Any, axis: int) -> Any:
    """Return the type of a three-vector's component, or that of a number or vector for all components."""
    return kind.types[axis] if _is_three(kind) else kind


def _three_type(x: Any, y: Any) -> Any:
    """Return the type of the sum or product of three-vectors and numbers; None if they do not fit."""
    joint = tuple(joint_type(_component(x, axis), _component(y, axis)) for axis in range(3))
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
        joint = joint_type(x, y)
        return result(joint) if isinstance(joint, VectorType) else None

    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        """Write the operation, for three-vectors component by component."""
        kinds, result = signature.args, signature.return_type
        if not _is_three(result):
            return emit(builder, *alike(context, builder, joint_type(*kinds), args, kinds))
        components = []
        for axis, wanted in enumerate(result.types):
            pairs = zip(args, kinds, strict=True)
            values = [builder.extract_value(x, axis) if _is_three(kind) else x for x, kind in pairs]
            numbers = [_component(kind, axis) for kind in kinds]
            components.append(emit(builder, *alike(context, builder, wanted, values, numbers)))
        return context.make_tuple(builder, result, components)

    typed(operation, 2, typer)
    for kinds in ((VectorType, VectorType), (VectorType, types.Number), (types.Number, VectorType)):
        lower_builtin(operation, *kinds)(lower)
    for is_three, number in product(threes, (VectorType, types.Number)):
        lower_builtin(operation, *(types.BaseNamedTuple if three else number for three in is_three))(lower)


def _quotient(kind: Any) -> Any:
    """Return the type of a quotient."""
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
    """Return the type of a comparison's result."""
    return MaskType(kind.width) if isinstance(kind, VectorType) else types.boolean


def _comparing(symbol: str) -> Callable[[Any, Any, Any], Any]:
    """Return the function that writes a comparison."""
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


def _select_type(mask: Any, x: Any, y: Any) -> Any:
    """Return the type of a selection from two values by a mask or a bool; None if they do not fit."""
    joint = joint_type(x, y)
    if isinstance(mask, MaskType):
        return VectorType(mask.width) if joint in (VectorType(mask.width), types.float64) else None
    return joint if mask == types.boolean and not isinstance(joint, VectorType) else None


@defined(vectors.select, types.Type, types.Type, types.Type, result=_select_type)
def _select(context: Any, builder: Any, signature: Any, mask: Any, *values: Any) -> Any:
    return builder.select(mask, *alike(context, builder, signature.return_type, values, signature.args[1:]))


def _extreme(operation: Any, symbol: str) -> None:
    """Register the choice of the operand that compares so with the other, else the other."""

    @defined(operation, types.Type, types.Type, result=joint_type)
    def emit(context: Any, builder: Any, signature: Any, *values: Any) -> Any:
        x, y = alike(context, builder, signature.return_type, values, signature.args)
        return builder.select(builder.fcmp_ordered(symbol, x, y), x, y)


_extreme(vectors.least, "<")
_extreme(vectors.most, ">")


def _degrees_type(x: Any, y: Any) -> Any:
    return x if isinstance(x, VectorType) and x == y else None


@defined(vectors.higher, VectorType, VectorType, result=_degrees_type)
def _higher(context: Any, builder: Any, signature: Any, *degrees: Any) -> Any:
    """Choose the vector whose bits are the larger integer, lane by lane."""
    kind = degrees[0].type
    x, y = (builder.bitcast(degree, ir.VectorType(I64, kind.count)) for degree in degrees)
    return builder.bitcast(builder.select(builder.icmp_signed(">", x, y), x, y), kind)


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
    return builder.ctpop(builder.zext(number, I64))


def _power_of_two(builder: Any, exponent: Any) -> Any:
    """Put whole numbers into a float's exponent, bits 52 to 62, with its bias of 1023."""
    whole = ir.VectorType(I64, exponent.type.count)
    biased = builder.add(builder.fptosi(exponent, whole), ir.Constant(whole, [1023] * whole.count))
    return builder.bitcast(builder.shl(biased, ir.Constant(whole, [52] * whole.count)), exponent.type)


_unary(vectors.total, VectorType, _total, types.float64)
_unary(vectors.some, MaskType, _some, types.boolean)
_unary(vectors.count, MaskType, _count, types.int64)
_unary(vectors.power_of_two, VectorType, _power_of_two)
