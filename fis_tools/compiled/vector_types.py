"""The numba types of vectors and masks, and how their operations are registered with numba.

LLVM has vectors of any width as values and maps them to the processor's registers.
"""

from collections.abc import Callable
from typing import Any

from numba import TypingError, types
from numba.extending import infer, lower_builtin, models, register_model

from fis_tools.compiled.fingerprint import covers_this_module
from fis_tools.compiled.numba_parts import AbstractTemplate, infer_global, ir

covers_this_module()

MOST_LANES = 64

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


def width_of_type(width: Any) -> int:
    """Return the width that an argument's type stands for."""
    lanes = getattr(width, "literal_value", None)
    if not isinstance(lanes, int):
        raise TypingError(f"the width of a vector is {width}; pass a constant")
    if not (1 <= lanes <= MOST_LANES and lanes & (lanes - 1) == 0):
        raise TypingError(f"a vector cannot be {lanes} wide; choose a power of two up to {MOST_LANES}")
    return lanes


def joint_type(x: Any, y: Any) -> VectorType | types.Float | None:
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


def alike(context: Any, builder: Any, wanted: Any, values: Any, kinds: Any) -> list[Any]:
    """Return vectors and numbers, of some types, as floats or as vectors of the wanted type."""

    def converted(value: Any, kind: Any) -> Any:
        if isinstance(kind, VectorType):
            return value
        number = context.cast(builder, value, kind, types.float64)
        return splat(builder, number, wanted.width) if isinstance(wanted, VectorType) else number

    return [converted(*pair) for pair in zip(values, kinds, strict=True)]


def splat(builder: Any, value: Any, width: int) -> Any:
    """Return a vector with a number in each lane."""
    nothing = ir.Constant(ir.VectorType(F64, width), ir.Undefined)
    first = builder.insert_element(nothing, value, I32(0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(I32, width), [0] * width))


def members(kind: Any) -> tuple[Any, ...] | None:
    """Return the types of a tuple's elements; None if it is not a tuple."""
    held: tuple[Any, ...] = getattr(kind, "types", ())
    return held if isinstance(kind, types.BaseTuple) else None
