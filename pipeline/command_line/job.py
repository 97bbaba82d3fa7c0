"""A run after its configuration is composed; nothing from here on needs Hydra."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import FREE

#: the group that experiments are chosen from
EXPERIMENT = "experiment"
#: characters of a value in a message
MOST_SHOWN = 60


class ConfigError(ValueError):
    """A command line or a configuration that cannot be used."""


@dataclass(frozen=True)
class Job:
    """A run to be started.

    Parameters
    ----------
    config : dict
        Plain data, resolved, without Hydra's own.
    experiment : Experiment
        The experiment it describes.
    folder : Path
        The run's folder.
    """

    config: dict[str, Any]
    experiment: Experiment
    folder: Path


def differences(
    then: Mapping[str, Any],
    now: Mapping[str, Any],
    but: Collection[str],
    words: tuple[str, str] = ("then", "now"),
) -> list[str]:
    """Return the keys in which two configurations differ, each with both values shortened.

    Parameters
    ----------
    then, now : mapping
        Plain data.
    but : collection of str
        Top-level keys to ignore.
    words : (str, str)
        Names of the two.

    Returns
    -------
    list of str
        Such as ``seed (then 1, now 2)``; a controller counts as one value.
    """

    def walk(one: Any, other: Any, key: str) -> Iterator[str]:
        if one == other:
            return
        if isinstance(one, Mapping) and isinstance(other, Mapping) and key != FREE:
            for name in sorted({*one, *other}):
                yield from walk(one.get(name), other.get(name), f"{key}.{name}" if key else name)
        else:
            yield f"{key} ({words[0]} {_short(one)}, {words[1]} {_short(other)})"

    first, second = (
        {key: value for key, value in config.items() if key not in but} for config in (then, now)
    )
    return list(walk(first, second, ""))


def _short(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."
