"""What may be written in C: operations by the kinds of their operands, and ranges of whole numbers.

An operation is translated if its signature stands in a table of this module, where C and Python agree; any
other is refused. Whole numbers are Python's, without end, and C's `int`: so what is computed of them needs a
range, which is followed from where a number is known.
"""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Literal

#: "lane" is a double of one point of the chief, where the flight works on a vector of points
Kind = Literal["double", "lane", "int", "bool"]
C_TYPES: Mapping[Kind, str] = {"double": "double", "lane": "double", "int": "int", "bool": "bool"}
#: least and greatest value of a whole number; None where it is not known
Range = tuple[int, int] | None
#: the whole numbers of C's int, on every processor that has doubles
LEAST_INT, MOST_INT = -(2**31), 2**31 - 1
#: how a kind is called in what is refused
KINDS: Mapping[Kind, str] = {
    "double": "a double",
    "lane": "a double of a point",
    "int": "a whole number",
    "bool": "a condition",
}


class TranslationError(Exception):
    """Something that has no translation; the message names the file and the line."""


class NotTranslatableError(TranslationError):
    """A controller or a mission of which there is no on-board function; the text says why."""


def _arithmetic() -> Iterator[tuple[tuple[str, Kind, Kind], Kind]]:
    numbers: tuple[Kind, ...] = ("double", "lane", "int")
    for left, right in product(numbers, numbers):
        real: Kind = "lane" if "lane" in (left, right) else "double"
        yield ("/", left, right), real
        for operator in "+-*":
            yield (operator, left, right), "int" if left == right == "int" else real
    for operator in ("//", "%"):
        yield (operator, "int", "int"), "int"
    for left, right in (("int", "bool"), ("bool", "int"), ("bool", "bool")):  # conditions are counted
        yield ("+", left, right), "int"


#: the kind of a result by operator and kinds of operands
ARITHMETIC: Mapping[tuple[str, Kind, Kind], Kind] = dict(_arithmetic())
#: the kind of a negative
NEGATIVE: Mapping[Kind, Kind] = {"double": "double", "lane": "lane", "int": "int"}
#: kinds that are compared with each other
COMPARED = frozenset(product(("double", "lane", "int"), repeat=2)) | {("bool", "bool")}
#: kinds of values that variables and elements of arrays of a kind take
STORED: Mapping[Kind, frozenset[Kind]] = {
    "double": frozenset({"double", "lane"}),
    "lane": frozenset({"double", "lane"}),
    "int": frozenset({"int", "bool"}),
    "bool": frozenset({"bool"}),
}


def result_of(operator: str, left: Kind, right: Kind) -> Kind:
    """Return the kind of a result.

    Raises
    ------
    TranslationError
        If the operation is not translated for such operands.
    """
    kind = ARITHMETIC.get((operator, left, right))
    if kind is None:
        raise TranslationError(
            f"`{operator}` of {KINDS[left]} and {KINDS[right]} is not translated; "
            + _cure(operator, {left, right})
        )
    return kind


def _cure(operator: str, kinds: set[Kind]) -> str:
    if "bool" in kinds:
        return "write `1.0 if condition else 0.0` where a condition is to be a number"
    if operator in ("//", "%"):
        return "divide whole numbers, or use `np.floor`"
    taken = sorted({" and ".join((left, right)) for op, left, right in ARITHMETIC if op == operator})
    return f"it takes {', '.join(taken) or 'nothing here'}"


def negative_of(kind: Kind) -> Kind:
    """Return the kind of a negative; a condition has none."""
    if kind not in NEGATIVE:
        raise TranslationError(
            "the negative of a condition is not translated; write `-1 if condition else 0`"
        )
    return NEGATIVE[kind]


def check_compared(left: Kind, right: Kind) -> None:
    """Refuse to compare numbers with conditions."""
    if (left, right) not in COMPARED:
        raise TranslationError(
            f"{KINDS[left]} is compared with {KINDS[right]}; compare numbers with numbers, "
            "and use a condition as it is, or `not`"
        )


def common_kind(kinds: set[Kind], *, has_zero: bool) -> Kind:
    """Return the kind of what is a value of one of several kinds.

    Parameters
    ----------
    kinds : set
    has_zero : bool
        Whether one that is a whole number may be zero: Python's has no sign, a double has.

    Raises
    ------
    TranslationError
        If Python would go on with either kind, and C cannot.
    """
    if len(kinds) == 1:
        return next(iter(kinds))
    if kinds == {"int", "bool"}:
        return "int"
    if "bool" in kinds or ("int" in kinds and has_zero):
        names = " or ".join(sorted(KINDS[kind] for kind in kinds))
        raise TranslationError(f"a value is {names}, as it comes; write both as one kind, such as `0.0`")
    return "lane" if "lane" in kinds else "double"


def check_stored(target: Kind, value: Kind, *, is_zero_possible: bool, what: str) -> None:
    """Refuse that a variable changes its kind, as it could in Python."""
    if value in STORED[target]:
        return
    if target in ("double", "lane") and value == "int" and not is_zero_possible:
        return
    raise TranslationError(
        f"{what} holds {KINDS[target]} and is given {KINDS[value]}; give it one kind on every way, such as "
        f"`{'0.0' if target in ('double', 'lane') else '0' if target == 'int' else 'x > 0.0'}`"
    )


def range_of_result(operator: str, a: Range, b: Range) -> Range:
    """Return the range of a sum, difference, product, quotient or rest of whole numbers; None if not known.

    Raises
    ------
    TranslationError
        If it goes beyond C's int, or where Python and C divide differently.
    """
    if operator in ("//", "%"):
        if a is None or b is None or a[0] < 0 or b[0] <= 0:
            shown = " by ".join(
                "an unknown range" if each is None else f"{each[0]} to {each[1]}" for each in (a, b)
            )
            raise TranslationError(
                f"`{operator}` of {shown}: of negative numbers Python and C give other results; "
                "add a multiple of the divisor that makes it positive, or limit it by `max`"
            )
        return (a[0] // b[1], a[1] // b[0]) if operator == "//" else (0, min(a[1], b[1] - 1))
    if a is None or b is None:
        return None
    if operator == "+":
        return checked_range((a[0] + b[0], a[1] + b[1]))
    if operator == "-":
        return checked_range((a[0] - b[1], a[1] - b[0]))
    products = [x * y for x in a for y in b]
    return checked_range((min(products), max(products)))


def checked_range(span: tuple[int, int]) -> tuple[int, int]:
    """Return a range of whole numbers; refuse one beyond C's int."""
    if span[0] < LEAST_INT or span[1] > MOST_INT:
        raise TranslationError(
            f"whole numbers from {span[0]} to {span[1]} do not fit into 32 bits; limit them by `min` and "
            "`max`, or compute with doubles"
        )
    return span


def union(a: Range, b: Range) -> Range:
    """Return the range of what lies in one of two."""
    return None if a is None or b is None else (min(a[0], b[0]), max(a[1], b[1]))


def decided(operator: str, a: Range, b: Range) -> bool | None:
    """Return how numbers from one range compare with those from another; None where it depends on them."""
    if a is None or b is None:
        return None
    if operator in ("<", ">="):
        is_less = True if a[1] < b[0] else False if a[0] >= b[1] else None
        return is_less if operator == "<" or is_less is None else not is_less
    if operator in (">", "<="):
        return decided("<" if operator == ">" else ">=", b, a)
    return operator == "!=" if a[1] < b[0] or b[1] < a[0] else None
