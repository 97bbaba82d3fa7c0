"""Code of one's own, which installed packages offer by entry points: stages, loggers, quantities.

Nothing of a package is imported before a run names what it offers.
"""

from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, cast

#: groups of entry points: functions that run a stage, functions that open a logger, quantities of formulas
STAGES, LOGGERS, QUANTITIES = "pipeline.stages", "pipeline.loggers", "pipeline.quantities"
#: loggers that need no package of one's own
SHIPPED_LOGGERS: Final = ("none", "tensorboard")
#: groups whose code changes what a run makes
COUNTED: Final = (STAGES, QUANTITIES)


class PluginError(ValueError):
    """Code of one's own that cannot be used."""


@cache
def _points(group: str) -> dict[str, tuple[EntryPoint, ...]]:
    """Return the entry points of a group by name."""
    points = entry_points(group=group)
    return {name: tuple(point for point in points if point.name == name) for name in sorted(points.names)}


def names(group: str) -> tuple[str, ...]:
    """Return the names in a group of entry points, sorted; nothing is imported."""
    return tuple(_points(group))


def loggers() -> tuple[str, ...]:
    """Return the names of all loggers that may be chosen."""
    return (*SHIPPED_LOGGERS, *names(LOGGERS))


def load(group: str, name: str) -> Any:
    """Import what an installed package offers by a name.

    Raises
    ------
    PluginError
        If no package offers it, two do, or it cannot be imported.
    """
    offered = _points(group).get(name, ())
    packages = sorted({point.dist.name for point in offered if point.dist is not None})
    if not offered:
        raise PluginError(f"no installed package offers {name} by an entry point of the group {group}")
    if len({(point.value, point.dist and point.dist.name) for point in offered}) > 1:
        raise PluginError(f"{' and '.join(packages)} offer {name} in the group {group}; uninstall one")
    try:
        return offered[0].load()
    except Exception as error:
        raise PluginError(
            f"{name} of the package {', '.join(packages)} cannot be imported from {offered[0].value} "
            f"({type(error).__name__}: {error}); correct the package"
        ) from error


def function(group: str, name: str) -> Callable[..., Any]:
    """Import a function that an installed package offers.

    Raises
    ------
    PluginError
        As `load`, and if it is no function.
    """
    offered = load(group, name)
    if not callable(offered):
        raise PluginError(
            f"{name} in the group {group} is {type(offered).__name__}; it must be a function, MODULE:NAME"
        )
    return cast(Callable[..., Any], offered)


def versions() -> dict[str, str]:
    """Return the versions of the packages whose code changes what a run makes, by their names."""
    points = (point for group in COUNTED for offered in _points(group).values() for point in offered)
    packages = {point.dist.name: point.dist.version for point in points if point.dist is not None}
    return dict(sorted(packages.items()))
