"""The dotted keys of the configuration, their units, and their earlier names."""

import copy
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from fis_tools.errors import nearest
from pipeline.settings import plugged

#: the group whose keys depend on its kind; they are checked when the controller is read
FREE = "controller"
#: the group whose keys are those of the mission
DISPERSIONS = "dispersions"


class Unit(NamedTuple):
    """A unit, and the least positive and the greatest magnitude in it that makes sense.

    Beyond them formulas lose digits, overflow or fill the memory.
    """

    symbol: str
    least: float
    greatest: float


#: of keys that name none
NO_UNIT: Final = Unit("", 1e-9, 1e12)
#: suffixes of keys to their units; the first that fits counts
UNITS: Mapping[str, Unit] = {
    "_kg_m2": Unit("kg m^2", 1e-9, 1e9),
    "_ks2": Unit("1e6 s^2", 1e-9, 1e12),
    "_rad_s": Unit("rad/s", 1e-8, 10.0),
    "_n_m": Unit("N m", 1e-9, 1e6),
    "_n_s": Unit("N s", 1e-9, 1e6),
    "_m3_s2": Unit("m^3/s^2", 1e6, 1e21),
    "_m_s2": Unit("m/s^2", 1e-15, 1e3),
    "_m_s": Unit("m/s", 1e-9, 1e12),  # also of prices
    "_per_s": Unit("1/s", 1e-9, 1e3),
    "_percent": Unit("%", 1e-9, 1e12),
    "_deg": Unit("deg", 1e-6, 360.0),
    "_rad": Unit("rad", 1e-9, 100.0),
    "_kg": Unit("kg", 1e-3, 1e6),
    "_m": Unit("m", 1e-6, 1e7),
    "_n": Unit("N", 1e-9, 1e6),
    "_s": Unit("s", 1e-3, 1e8),
    "proportional_gain": Unit("1/s^2", 1e-12, 1e3),
    "derivative_gain": Unit("1/s", 1e-9, 1e3),
}
#: keys, groups and controllers of earlier revisions to their present names
RENAMED: Mapping[str, str] = {
    **{
        f"dynamics.{name}": f"orbit.{name}"
        for name in ("eccentricity", "true_anomaly_deg", "inclination_deg", "latitude_argument_deg")
    },
    "optimizer.penalty.c_d": "optimizer.penalty.outside_m_s",
    "optimizer.penalty.c_95": "optimizer.penalty.short_point_m_s",
    "optimizer.penalty.c_99": "optimizer.penalty.missed_point_m_s",
    "search": "hparams_search",
    "tracking": "logger",
    "champion_leo_foresight": "champion_leo_rehearsed",
}
#: keys of earlier versions that have no present one; runs that hold them are read without
GONE = (
    "logger.place",
    *("engine.processes", "engine.scheduler"),
    *("optimizer.consistency", "optimizer.islands", "optimizer.migrate_every", "optimizer.migrants"),
)
#: the group whose keys are those of the configuration
SPACE = "hparams_search.space"
#: groups whose keys are words of the user's: what is noted about a run, and settings of stages of one's own
TAGS, EXTENSIONS = "tags", "extensions"
#: all groups with keys that are not known beforehand
OPEN = (FREE, DISPERSIONS, SPACE, TAGS, EXTENSIONS)
#: every dotted key and group of the configuration, as `pipeline.settings.groups` enters them
KNOWN: set[str] = set()


def is_key(key: str) -> bool:
    """Return whether a dotted key may be in the configuration."""
    return key in KNOWN or key.startswith(tuple(f"{group}." for group in OPEN))


def unknown(key: str) -> str:
    """Return a message that there is no such key, with the key that may be meant."""
    return f"there is no key {key}{did_you_mean(key, KNOWN)}"


def value_at(config: Mapping[str, Any], key: str, otherwise: Any = None) -> Any:
    """Return the value of a dotted key, `otherwise` if there is none; for "" the configuration itself."""
    node: Any = config
    for name in filter(None, key.split(".")):
        node = node.get(name, otherwise) if isinstance(node, Mapping) else otherwise
    return node


def in_todays_words(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with the keys of earlier versions under their present names."""
    renamed = copy.deepcopy(dict(config))
    for old, new in RENAMED.items():
        (group, _, was), (new_group, _, name) = old.rpartition("."), new.rpartition(".")
        node, new_node = value_at(renamed, group), value_at(renamed, new_group)
        if isinstance(node, dict) and was in node and isinstance(new_node, dict) and name not in new_node:
            new_node[name] = node.pop(was)
    if value_at(renamed, "logger.kind", "none") not in plugged.loggers():
        # of a package that is not installed here: such a run is read and goes on without
        renamed["logger"]["kind"] = "none"
    return renamed


def with_values(config: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a configuration with some dotted keys set; missing groups are created."""
    changed = copy.deepcopy(dict(config))
    for key, value in values.items():
        *groups, name = key.split(".")
        node = changed
        for group in groups:
            below = node.setdefault(group, {})
            # the group is a new one if its place is taken by a value
            node = below if isinstance(below, dict) else {}
        node[name] = copy.deepcopy(value)
    return changed


def without(config: Mapping[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    """Return a copy of a configuration without some dotted keys; groups are kept, even if empty."""
    left = copy.deepcopy(dict(config))
    for key in keys:
        group, _, name = key.rpartition(".")
        node = value_at(left, group)
        if isinstance(node, dict) and (group or not isinstance(node.get(name), dict)):
            node.pop(name, None)
    return left


def leaves(node: Mapping[str, Any], ends: Collection[str], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted keys below a group with their values; a mapping with any key of `ends` is a value."""
    for name, value in node.items():
        if isinstance(value, Mapping) and value and not any(end in value for end in ends):
            yield from leaves(value, ends, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def dotted(group: str, location: Iterable[int | str]) -> str:
    """Return the location of a value: names joined by dots, list indices in brackets."""
    words = [f"[{name}]" if isinstance(name, int) else f".{name}" for name in location]
    return (group + "".join(words)).lstrip(".")


def unit_of(key: str) -> Unit:
    """Return the unit of a key, by its last suffix."""
    name = key.partition("[")[0]
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), NO_UNIT)


def choices_of(word: str, known: Sequence[str], plural: str = "choices") -> str:
    """Return ``; did you mean …? The choices are …``; `plural` is the word for the choices."""
    guess = did_you_mean(word, known)
    return (f"{guess} The" if guess else "; the") + f" {plural} are {', '.join(known)}"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean …?``: a known word, perhaps by its earlier name; nothing if none is similar."""
    old = next((old for old in RENAMED if f"{word}.".startswith(f"{old}.")), None)
    match = RENAMED[old] + word.removeprefix(old) if old else nearest(word, sorted(known))
    return f"; did you mean {match}?" if match else ""
