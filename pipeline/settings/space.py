"""The space of a search: keys of the configuration, each with its range or its choices."""

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.settings.checks import SettingError
from pipeline.settings.keys import is_key, unknown


@dataclass(frozen=True)
class Dimension:
    """A key and its possible values.

    Parameters
    ----------
    key : str
        Dotted, such as ``optimizer.initial_step``.
    low, high : float or int
        Of a range; whole numbers if both are.
    is_log : bool
        Whether values are uniform in the logarithm.
    choices : tuple
        Instead of a range.
    """

    key: str
    low: float = 0.0
    high: float = 0.0
    is_log: bool = False
    choices: tuple[Any, ...] = ()


def dimensions(space: Mapping[str, Any]) -> tuple[Dimension, ...]:
    """Read a space: keys, each with ``{low:, high:}``, and ``log: true``, or with ``{choices: []}``.

    Raises
    ------
    SettingError
        If a key is unknown, or its entry has another form.
    """
    return tuple(_dimension(key, told) for key, told in sorted(_leaves(space, ())))


def _leaves(node: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    for name, told in node.items():
        if isinstance(told, Mapping) and told and not set(told) & {"low", "high", "choices"}:
            yield from _leaves(told, (*above, str(name)))
        else:
            yield ".".join((*above, str(name))), told


def _dimension(key: str, told: Any) -> Dimension:
    if not is_key(key):
        raise SettingError(f"hparams_search.space: {unknown(key)}")
    if isinstance(told, Mapping) and set(told) == {"choices"} and isinstance(told["choices"], list):
        if len(told["choices"]) > 1:
            return Dimension(key, choices=tuple(told["choices"]))
    elif isinstance(told, Mapping) and {"low", "high"} <= set(told) <= {"low", "high", "log"}:
        low, high, is_log = told["low"], told["high"], told.get("log", False)
        are_numbers = all(type(value) in (int, float) and math.isfinite(value) for value in (low, high))
        if are_numbers and low < high and isinstance(is_log, bool) and (low > 0 or not is_log):
            return Dimension(key, low, high, is_log)
    raise SettingError(
        f"hparams_search.space.{key} is {told}; give a range, {{low: 0.1, high: 10.0, log: true}}, the lower "
        "end less than the upper and with log positive, or {choices: [a, b]}, two or more"
    )


def with_values(config: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with some dotted keys set.

    Raises
    ------
    SettingError
        If a key is not in this configuration.
    """
    changed = copy.deepcopy(dict(config))
    for key, value in values.items():
        *groups, name = key.split(".")
        node: Any = changed
        for group in groups:
            node = node.get(group) if isinstance(node, dict) else None
        if not isinstance(node, dict) or name not in node:
            raise SettingError(f"hparams_search.space.{key} is no key of this experiment; leave it out")
        node[name] = value
    return changed
