"""Types of settings with their limits, and marks among their annotations.

pydantic checks values by them. In messages ``{key}`` stands for the setting's key and ``{unit}`` for its unit
in brackets. Comparisons are written so that NaN, which compares false with everything, never passes.
"""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, Strict, ValidationInfo

from pipeline.settings import sizes
from pipeline.settings.keys import unit_of


class Freely:
    """Marks settings that no result depends on, such as how a command shares out its work."""


class Follows:
    """Marks settings that may be null, and are then what the mission asks for."""


def _whole(value: Any) -> Any:
    """Accept a whole number written like 1e3."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _long(length: int, words: str) -> AfterValidator:
    """Return a validator of the length of a list of numbers; `words` says in its message what they are."""

    def check(values: tuple[float, ...]) -> tuple[float, ...]:
        if len(values) != length:
            raise ValueError(f"{{key}} has {len(values)} numbers; it must have {words}")
        return values

    return AfterValidator(check)


def _unit_vector(values: tuple[float, ...]) -> tuple[float, ...]:
    length = math.hypot(*values)
    if not abs(length - 1.0) < 1e-6:
        raise ValueError(
            f"{{key}} has length {length:.6g}; it must be a unit vector: divide it by its length"
        )
    return values


def _pair(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) != 2:
        raise ValueError(f"{{key}} is {list(values)}; it must be a lower and an upper bound, [low, high]")
    if not values[0] < values[1]:
        raise ValueError(
            f"{{key}}[0] is {values[0]} and {{key}}[1] is {values[1]}; the first must be less than the "
            "second{unit}"
        )
    return values


def _box(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len(rows) != 2 or any(len(row) != 6 for row in rows):
        raise ValueError(
            "{key} must be two rows of six numbers: the least and the greatest x, y, z (m), x', y', z' (m/s)"
        )
    if not all(low <= high for low, high in zip(*rows, strict=True)):
        raise ValueError(
            f"{{key}} is {[*map(list, rows)]}; no number of its first row may be above that of the second"
        )
    return rows


def _thrusters(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Raise ValueError unless each has a position, a unit vector and a maximum force."""
    if not 4 <= len(rows) <= 64:
        raise ValueError(f"{{key}} has {len(rows)} rows, one a thruster; there must be from 4 to 64")
    for which, row in enumerate(rows):
        if len(row) != 7 or not abs(math.hypot(*row[3:6]) - 1.0) < 1e-6 or not row[6] > 0.0:
            raise ValueError(
                f"{{key}}[{which}] is {list(row)}; it must be seven numbers: the place [x, y, z] (m), the "
                "unit vector of its force [x, y, z], both in body axes, and the greatest force (N)"
            )
    import numpy as np  # noqa: PLC0415 - few runs need it to check their settings

    directions = np.array(rows, dtype=np.float64)[:, 3:6]
    # if all lie on one side of a plane, then of one that passes through two of them
    sides = np.cross(directions[:, np.newaxis], directions).reshape(-1, 3)
    sides = sides[np.linalg.norm(sides, axis=1) > 1e-9] @ directions.T
    if np.linalg.matrix_rank(directions) < 3 or np.any(sides.min(axis=1) > -1e-9):
        raise ValueError("{key} cannot push in every direction; add a thruster that pushes where none does")
    return rows


def _spheres(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Raise ValueError unless each has a centre and a radius."""
    for which, row in enumerate(rows):
        if len(row) != 4 or not row[3] > 0.0:
            raise ValueError(
                f"{{key}}[{which}] is {list(row)}; it must be four numbers: the centre [x, y, z], chief "
                "axes, and the radius, which is positive (m)"
            )
    return rows


def _inertia(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Raise ValueError unless it is symmetric, positive definite and obeys the triangle inequality."""
    if len(rows) != 3 or any(len(row) != 3 for row in rows):
        raise ValueError(f"{{key}} is {rows}; it must be three rows of three numbers in kg m^2")
    if not all(math.isclose(rows[i][j], rows[j][i], rel_tol=1e-9) for i, j in ((0, 1), (0, 2), (1, 2))):
        raise ValueError(f"{{key}} is {[*map(list, rows)]}, not symmetric; set [i][j] equal to [j][i]")
    moments = _principal_moments(rows)
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if not moments[0] > 1e-12 * abs(moments[2]):
        raise ValueError(
            f"{{key}} has the principal moments {listed} kg m^2; all must be greater than 0, "
            "or the body cannot turn by Euler's equation"
        )
    if not moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9):
        raise ValueError(
            f"{{key}} has the principal moments {listed} kg m^2; no rigid body has one greater "
            "than the sum of the other two"
        )
    return rows


def _principal_moments(rows: tuple[tuple[float, ...], ...]) -> Sequence[float]:
    """Return the principal moments of an inertia matrix, ascending."""
    if not any(rows[i][j] for i in range(3) for j in range(3) if i != j):
        return sorted(rows[i][i] for i in range(3))
    import numpy as np  # noqa: PLC0415 - as above

    return [float(moment) for moment in np.linalg.eigvalsh(np.array(rows))]


def _not_beyond(value: float, info: ValidationInfo) -> float:
    """Raise ValueError for a number too large for its unit."""
    if not abs(value) <= (greatest := unit_of(str(info.field_name)).greatest):
        raise ValueError(f"{{key}} is {value}; it must be at most {greatest:g}{{unit}}, whatever its sign")
    return value


def _not_vanishing(value: float, info: ValidationInfo) -> float:
    """Raise ValueError for a positive number too small for its unit."""
    _, least, greatest = unit_of(str(info.field_name))
    if 0.0 < value < least:
        raise ValueError(f"{{key}} is {value}; it must be from {least:g} to {greatest:g}{{unit}}")
    return value


def _tags(value: Any) -> Any:
    """Accept plain names with plain values of one line, as texts."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{{key}} is {value!r}; it must be a group of names, as +{{key}}.campaign=spring")
    for name, tag in value.items():
        if not re.fullmatch(TAG_NAME, str(name)):
            raise ValueError(
                f"{{key}} has the name {str(name)[:80]!r}; a name is a letter and at most "
                f"{MOST_TAG_NAME - 1} letters, digits, _ and -"
            )
        is_plain = isinstance(tag, str | int | float) and str(tag).isprintable()
        if not is_plain or len(str(tag)) > MOST_TAG:
            raise ValueError(
                f"{{key}}.{name} is {str(tag)[:80]!r}; it must be a text of one line, or a number, of "
                f"at most {MOST_TAG} printable characters"
            )
    return {str(name): str(tag) for name, tag in value.items()}


#: of what is noted about a run: characters of a name and of a text
MOST_TAG_NAME, MOST_TAG = 64, 200
TAG_NAME = rf"[A-Za-z][A-Za-z0-9_-]{{0,{MOST_TAG_NAME - 1}}}"
Text = Annotated[str, Strict()]
Texts = tuple[Text, ...]
Flag = Annotated[bool, Strict()]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False), AfterValidator(_not_beyond)]
Positive = Annotated[Number, Field(gt=0), AfterValidator(_not_vanishing)]
NotNegative = Annotated[Number, Field(ge=0)]
#: of what is rounded to multiples of it, unless it is zero; a quotient by less would overflow
Step = Annotated[NotNegative, AfterValidator(_not_vanishing)]
Share = Annotated[Number, Field(ge=0, le=1)]
Tags = Annotated[dict[str, str], BeforeValidator(_tags), Freely()]
Whole = Annotated[int, Strict(), BeforeValidator(_whole)]
Natural = Annotated[Whole, Field(ge=0, le=sizes.MOST)]
Count = Annotated[Whole, Field(ge=1, le=sizes.MOST)]
#: flown in parts
Cases = Annotated[Whole, Field(ge=1, le=sizes.MOST_CASES)]
Seed = Annotated[Whole, Field(ge=0, le=2**63 - 1)]
#: worker threads; None is one per processor
Workers = Annotated[Whole | None, Field(ge=1, le=1024), Freely()]
Vector = Annotated[tuple[Number, ...], _long(3, "three, [x, y, z]{unit}")]
Thrusters = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_thrusters)]
Spheres = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_spheres)]
#: half angles across and up an image
Rectangle = Annotated[
    tuple[Annotated[Positive, Field(lt=90)], ...], _long(2, "two, [across, up]{unit}, each below 90")
]
#: least and greatest place (m) and velocity (m/s), Hill axes
Box = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_box)]
UnitVector = Annotated[Vector, AfterValidator(_unit_vector)]
Quaternion = Annotated[
    tuple[Number, ...], _long(4, "four, [q1, q2, q3, q4], scalar last"), AfterValidator(_unit_vector)
]
Inertia = Annotated[tuple[tuple[Number, ...], ...], AfterValidator(_inertia)]
#: a lower and a greater upper bound: of some type, of any numbers, of positive ones, of nonnegative ones
Bound = TypeVar("Bound")
IntervalOf = Annotated[tuple[Bound, ...], AfterValidator(_pair)]
Interval = IntervalOf[Number]
PositiveInterval = IntervalOf[Positive]
NotNegativeInterval = IntervalOf[NotNegative]
#: the first case, and the one after the last
CaseRange = IntervalOf[Annotated[Whole, Field(ge=0, le=sizes.MOST_CASES)]]
