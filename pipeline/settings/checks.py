"""Checks of single settings. Each refusal states the fact, what is expected and how to get there.

They are written so that NaN, for which every comparison is false, never passes.
"""

import math
from collections.abc import Sequence

import numpy as np


class SettingError(ValueError):
    """Raised for a setting that is impossible."""


def number(key: str, value: float, unit: str = "") -> None:
    """Refuse what is not a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise SettingError(f"{key} is {value}; it must be a finite number{_of(unit)}")


def positive(key: str, value: float, unit: str = "") -> None:
    """Refuse zero and below."""
    number(key, value, unit)
    if not value > 0:
        raise SettingError(f"{key} is {value}; it must be greater than 0{_in(unit)}")


def within(key: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Refuse what lies outside [low, high]."""
    number(key, value, unit)
    if not low <= value <= high:
        bounds = f"at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"
        raise SettingError(f"{key} is {value}; it must be {bounds}{_in(unit)}")


def count(key: str, value: int, least: int, cure: str = "") -> None:
    """Refuse what is not a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise SettingError(f"{key} is {value}; it must be a whole number of at least {least}{cure}")


def ascending(low_key: str, low: float, high_key: str, high: float, unit: str = "") -> None:
    """Refuse two bounds of which the second is not the greater."""
    number(low_key, low, unit)
    number(high_key, high, unit)
    if not low < high:
        raise SettingError(
            f"{low_key} is {low} and {high_key} is {high}; the first must be less than the second{_in(unit)}"
        )


def bounds(key: str, pair: Sequence[float], least: float, greatest: float, unit: str = "") -> None:
    """Refuse what is not a lower and a greater upper bound, both in (least, greatest]."""
    if len(pair) != 2:
        raise SettingError(f"{key} is {list(pair)}; it must be a lower and an upper bound, [low, high]")
    ascending(f"{key}[0]", pair[0], f"{key}[1]", pair[1], unit)
    for index, value in enumerate(pair):
        if not least < value <= greatest:
            upper = "" if greatest == math.inf else f" and at most {greatest:g}"
            raise SettingError(
                f"{key}[{index}] is {value}; it must be greater than {least:g}{upper}{_in(unit)}"
            )


def interval(key: str, pair: Sequence[float], least: float, greatest: float, unit: str = "") -> None:
    """Refuse what is not a lower and a greater upper bound, both in [least, greatest]."""
    if len(pair) != 2:
        raise SettingError(f"{key} is {list(pair)}; it must be a lower and an upper bound, [low, high]")
    ascending(f"{key}[0]", pair[0], f"{key}[1]", pair[1], unit)
    for index, value in enumerate(pair):
        within(f"{key}[{index}]", value, least, greatest, unit)


def vector(key: str, values: Sequence[float], unit: str = "") -> None:
    """Refuse what is not three finite numbers."""
    if len(values) != 3:
        raise SettingError(f"{key} has {len(values)} numbers; it must have three, [x, y, z]{_in(unit)}")
    for index, value in enumerate(values):
        number(f"{key}[{index}]", value, unit)


def unit_vector(key: str, values: Sequence[float]) -> None:
    """Refuse what is not of length one."""
    vector(key, values)
    length = math.hypot(*values)
    if not abs(length - 1.0) < 1e-6:
        raise SettingError(
            f"{key} has length {length:.6g}; it must be a unit vector: divide it by its length"
        )


def inertia(key: str, rows: Sequence[Sequence[float]]) -> None:
    """Refuse what is no rigid body's inertia matrix: symmetric, positive definite, moments of a real mass."""
    if len(rows) != 3 or any(len(row) != 3 for row in rows):
        raise SettingError(f"{key} is {rows}; it must be three rows of three numbers in kg m^2")
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            number(f"{key}[{i}][{j}]", value, "kg m^2")
    matrix = np.array(rows, dtype=np.float64)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        raise SettingError(f"{key} is {matrix.tolist()}, not symmetric; set [i][j] equal to [j][i]")
    moments = np.linalg.eigvalsh(matrix)
    if not moments[0] > 1e-12 * abs(moments[2]):
        raise SettingError(
            f"{key} has the principal moments {_listed(moments)} kg m^2; all must be greater than 0, "
            "or the body cannot turn by Euler's equation"
        )
    if not moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9):
        raise SettingError(
            f"{key} has the principal moments {_listed(moments)} kg m^2; no rigid body has one greater "
            "than the sum of the other two"
        )


def divides(key: str, period: float, whole_key: str, whole: float) -> None:
    """Refuse a period that does not fit a whole number of times, both in seconds."""
    positive(key, period, "s")
    positive(whole_key, whole, "s")
    ratio = whole / period
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        fitting = whole / max(1, round(ratio))
        raise SettingError(
            f"{key} is {period} s and {whole_key} is {whole} s; the first must fit into the second a whole "
            f"number of times, as {fitting:g} s does"
        )


def shell(group: str, low: float, high: float) -> None:
    """Refuse a shell of distances (m) that is inside out or begins at the centre."""
    positive(f"{group}.min_distance_m", low, "m")
    number(f"{group}.max_distance_m", high, "metres")
    if not low <= high:
        raise SettingError(
            f"{group}.min_distance_m is {low} and {group}.max_distance_m is {high}; the first must not be "
            "greater than the second (m)"
        )


def workers(key: str, value: int | None) -> None:
    """Refuse what is no number of threads; None stands for one a processor."""
    if value is not None:
        count(key, value, 1, ", or null for one a processor")


def _in(unit: str) -> str:
    return f" ({unit})" if unit else ""


def _of(unit: str) -> str:
    return f" of {unit}" if unit else ""


def _listed(values: Sequence[float] | np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
