"""Distributions of the settings that are dispersed over the flights of an evaluation.

With a correlation time a setting varies within a flight as well; `pipeline.flight.cases.processes` defines
how.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Literal

from pipeline.settings.checks import SettingError, no_choice
from pipeline.settings.keys import leaves

#: keys that define each kind; low and high truncate a normal one
KINDS: Mapping[str, tuple[set[str], set[str]]] = {
    "normal": ({"mean", "std"}, {"low", "high", "correlation_s"}),
    "uniform": ({"low", "high"}, {"correlation_s"}),
}

#: settings that may vary within a flight: errors that are otherwise constant (the distribution is that of
#: the error, separately for each axis), standard deviations of what is drawn anew each time, and a value.
#: The random numbers of a key depend on its place here: append new ones at the end
IN_TIME: Mapping[str, Literal["error", "spread", "value"]] = {
    "actuators.scale_error": "error",
    "actuators.misalignment_deg": "error",
    "navigation.bias_m": "error",
    "navigation.attitude_bias_deg": "error",
    "navigation.noise_m": "spread",
    "navigation.range_noise_m": "spread",
    "navigation.bearing_noise_deg": "spread",
    "navigation.attitude_noise_deg": "spread",
    "dynamics.drag_m_s2": "value",
}


@dataclass(frozen=True)
class Distribution:
    """Distribution of one key: normal, truncated at low and high, or uniform between them.

    Parameters
    ----------
    key : str
        Such as ``deputy.mass_kg``.
    kind : str
        One of `KINDS`.
    mean, std : float
        Of a normal distribution before truncation.
    low, high : float
        Infinite where not truncated.
    correlation_s : float, optional
        Time after which the correlation with a value within the flight has fallen to 1/e; None for
        one value per case.
    """

    key: str
    kind: str
    mean: float = 0.0
    std: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    correlation_s: float | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the greatest value; the median for one without a bound."""
        low, high = (end if math.isfinite(end) else self.value(0.5) for end in (self.low, self.high))
        return low, high

    def value(self, share: float) -> float:
        """Return the quantile at a probability from 0 to less than 1."""
        if self.kind == "uniform":
            return self.low + share * (self.high - self.low)
        normal = NormalDist(self.mean, self.std)
        below, upto = normal.cdf(self.low), normal.cdf(self.high)
        # strictly between 0 and 1, where the inverse is finite
        at = min(max(below + share * (upto - below), 2.0**-53), 1.0 - 2.0**-53)
        return min(max(normal.inv_cdf(at), self.low), self.high)


def distributions(config: Mapping[str, Any]) -> tuple[Distribution, ...]:
    """Return the distributions in the group ``dispersions`` from which each case draws one value, by key.

    Raises
    ------
    SettingError
        If one is not written as in `KINDS`, or a value is not allowed.
    """
    constant = (each for each in _read(config) if each.correlation_s is None)
    return tuple(sorted(constant, key=lambda each: each.key))


def processes(config: Mapping[str, Any]) -> dict[str, Distribution]:
    """Return the distributions in the same group that vary within a flight, by key; see `IN_TIME`.

    Raises
    ------
    SettingError
        As `distributions`.
    """
    return {each.key: each for each in _read(config) if each.correlation_s is not None}


def in_time_alone(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the group without the distributions of which each case draws one value."""
    kept = {name: value if "kind" in value else in_time_alone(value) for name, value in config.items()}
    return {
        name: node for name, node in kept.items() if node and ("correlation_s" in node or "kind" not in node)
    }


def _read(config: Mapping[str, Any]) -> Iterator[Distribution]:
    for key, value in leaves(config, ("kind",)):
        if not isinstance(value, Mapping):
            raise SettingError(
                f"dispersions.{key} is {value!r}; give a distribution, as {{kind: normal, mean: 12, std: 1}}"
            )
        if value:
            yield _distribution(key, value)


def _distribution(key: str, node: Mapping[str, Any]) -> Distribution:
    kind, where = node["kind"], f"dispersions.{key}"
    if kind not in KINDS:
        raise SettingError(f"{where}.kind is {no_choice(kind, [*KINDS])}")
    needed, allowed = KINDS[kind]
    names = set(node) - {"kind"}
    if not needed <= names <= needed | allowed:
        extra = f", and may have {', '.join(sorted(allowed))}" if allowed else ""
        raise SettingError(
            f"{where} has {', '.join(sorted(names)) or 'nothing'}; one of kind {kind} has "
            f"{', '.join(sorted(needed))}{extra}"
        )
    for name in names:
        number = node[name]
        if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
            raise SettingError(f"{where}.{name} is {number!r}; it must be a finite number")
    distribution = Distribution(key, kind, **{name: float(node[name]) for name in names})
    for words in _refusals(distribution):
        raise SettingError(f"{where}{words}")
    return distribution


def _refusals(given: Distribution) -> Iterator[str]:
    """Yield what is wrong with a distribution, or with one that varies within a flight."""
    if not given.low < given.high:
        yield f".low is {given.low:g} and its high {given.high:g}; the first must be less"
    if given.kind == "normal" and not given.std > 0.0:
        yield f".std is {given.std:g}; it must be greater than 0"
    if given.kind == "normal" and not max(given.low - given.mean, given.mean - given.high) < 8 * given.std:
        yield " has low and high more than eight standard deviations beside the mean; move them"
    if given.correlation_s is not None and given.key not in IN_TIME:
        may = ", ".join(sorted(IN_TIME))
        yield f".correlation_s is given, but it does not vary within a flight, as {may} do; leave it out"
    if given.correlation_s is not None and not given.correlation_s > 0.0:
        yield f".correlation_s is {given.correlation_s:g}; it must be greater than 0 (s)"
    if given.correlation_s is not None and IN_TIME[given.key] == "spread" and not given.low >= 0.0:
        yield f".low is {given.low:g}; of a standard deviation low must be at least 0"
