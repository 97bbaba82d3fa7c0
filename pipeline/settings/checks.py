"""Checks of settings whose errors are sentences: the fact, what is expected, and how to get there.

Comparisons are written so that NaN, which compares false with everything, never passes.
"""

import math
from collections.abc import Sequence
from typing import Any

from pipeline.settings.keys import did_you_mean


class SettingError(ValueError):
    """A setting with an invalid value."""


def within(key: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise SettingError if a value is outside [low, high]."""
    if not low <= value <= high:
        raise SettingError(f"{key} is {value}; it must be {expected(low, high)}{in_unit(unit)}")


def expected(low: float | None, high: float) -> str:
    """Return the allowed range in words."""
    if low is None:
        return f"at most {in_digits(high)}"
    least = in_digits(low)
    return f"at least {least}" if high == math.inf else f"from {least} to {in_digits(high)}"


def in_digits(limit: Any) -> str:
    """Return a limit: a number in few digits, a whole one in all it needs."""
    short = f"{limit:g}" if isinstance(limit, int | float) else str(limit)
    return str(limit) if isinstance(limit, int) and float(short) != limit else short


def each_once(key: str, values: Sequence[str]) -> None:
    """Raise SettingError if a list of names is empty, or has one of them twice."""
    if not values or len(set(values)) != len(values):
        raise SettingError(f"{key} is [{', '.join(values)}]; name at least one, and each once")


def divides(key: str, period_s: float, whole_key: str, whole_s: float) -> None:
    """Raise SettingError unless a period fits a whole number of times."""
    ratio = whole_s / period_s
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        fitting = whole_s / max(1, round(ratio))
        raise SettingError(
            f"{key} is {period_s} s and {whole_key} is {whole_s} s; the first must fit into the second a "
            f"whole number of times, as {fitting:g} s does"
        )


def shell(group: str, low_m: float, high_m: float, *, may_be_thin: bool = True) -> None:
    """Raise SettingError if a shell's inner radius exceeds its outer radius, or may not equal it and does."""
    if not (low_m < high_m or (may_be_thin and low_m == high_m)):
        words = "not be greater" if may_be_thin else "be less"
        raise SettingError(
            f"{group}.min_distance_m is {low_m} and {group}.max_distance_m is {high_m}; the first must "
            f"{words} than the second (m)"
        )


def in_unit(unit: str) -> str:
    """Return a unit in brackets, or nothing."""
    return f" ({unit})" if unit else ""


def no_choice(value: Any, choices: Sequence[str]) -> str:
    """Return a message about a value that is none of some choices: the value, and what it must be."""
    return f"{value!r}; it must be one of {', '.join(choices)}{did_you_mean(str(value), choices)}"
