"""Fuzzy inference systems as readable data, with a compiled evaluator and the means to review them.

>>> import fis_tools
>>> controller = fis_tools.read_controller("tipper.fis")  # doctest: +SKIP
>>> tip = fis_tools.compile(controller.systems[0])  # doctest: +SKIP
>>> tip({"service": [3.0, 9.0], "food": 7.0})  # doctest: +SKIP
{'tip': array([12.21531604, 24.43823122])}

One line each, of a scikit-fuzzy ``ControlSystem``, a system, a controller or the path of a file:
``review(system, "page.html")``, ``plot(system, "figures")``, ``surface(system)``, ``audit(system)``,
``explain(system, inputs)``, ``export_c(system, "controller.c")``; ``learn(table, "target")`` makes a system
from a table, ``imitate(function, ranges)`` from answers. The rest is found by its noun: `analysis.bounds`,
`findings.difference`, `findings.simplification`, `render`. In a notebook controllers, systems and variables
show themselves.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fis_tools.engines.compiler import CompiledSystem, compile
    from fis_tools.errors import MissingExtra
    from fis_tools.learning.learner import imitate, learn
    from fis_tools.shortcuts import audit, explain, export_c, plot, surface
    from fis_tools.source import read_controller

__all__ = [
    "CompiledSystem",
    "MissingExtra",
    "audit",
    "compile",
    "explain",
    "export_c",
    "imitate",
    "learn",
    "plot",
    "read_controller",
    "review",
    "surface",
]

#: Where the names are that are found here; imported when they are asked for, since most take a while.
_PLACES = {
    "CompiledSystem": "engines.compiler",
    "MissingExtra": "errors",
    "compile": "engines.compiler",
    "imitate": "learning.imitation",
    "learn": "learning.learner",
    "read_controller": "source",
    **dict.fromkeys(("audit", "explain", "export_c", "plot", "surface"), "shortcuts"),
}


def __getattr__(name: str) -> Any:
    """Fetch a name of `__all__` from the module that defines it."""
    if name == "review":  # a package that can be called
        return import_module(f"{__name__}.review")
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    """Show what is imported when it is asked for."""
    return sorted({*globals(), *__all__})


#: For each kind of content, which function of `fis_tools.review.notebook` shows which noun.
_SHOWN = {
    "text/html": {"systems.FuzzyController": "controller_tables", "systems.FuzzySystem": "system_tables"},
    "image/svg+xml": {"variables.Variable": "variable_picture"},
}


def show_in(shell: Any) -> None:
    """Tell an IPython shell how to show controllers, systems and variables; it imports when it shows one."""
    for kind, ways in _SHOWN.items():
        for noun, way in ways.items():
            module, _, name = noun.rpartition(".")
            formatter = shell.display_formatter.formatters[kind]
            formatter.for_type_by_name(f"{__name__}.model.{module}", name, _shown_by(way))


def _shown_by(way: str) -> Callable[[Any], str | None]:
    def show(thing: Any) -> str | None:
        shown: str | None = getattr(import_module(f"{__name__}.review.notebook"), way)(thing)
        return shown

    return show


if "IPython" in sys.modules and (_shell := sys.modules["IPython"].get_ipython()) is not None:
    show_in(_shell)
