"""Fuzzy inference systems as readable data, with a compiled evaluator and the means to review them.

>>> import fis_tools
>>> controller = fis_tools.read_controller("tipper.fis")  # doctest: +SKIP
>>> tip = fis_tools.compile(controller.systems[0])  # doctest: +SKIP
>>> tip({"service": [3.0, 9.0], "food": 7.0})  # doctest: +SKIP
{'tip': array([12.21837921, 24.44141407])}

One line each, of a scikit-fuzzy ``ControlSystem``, a system, a controller or the path of a file:
``review(system, "page.html")``, ``plot(system, "figures")``, ``surface(system)``, ``audit(system)``,
``explain(system, inputs)``, ``export_c(system, "controller.c")``; ``learn(table, "target")`` makes a system
from a table, ``imitate(function, ranges)`` from answers. The rest is found by its noun: `analysis.bounds`,
`findings.difference`, `findings.simplification`, `render`. In a notebook controllers, systems and variables
show themselves.
"""

import sys
from collections.abc import Mapping
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fis_tools.engines.compiler import CompiledSystem
    from fis_tools.errors import MissingExtra
    from fis_tools.learning.learner import imitate, learn
    from fis_tools.model import FuzzyController, Inferable
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
_MODULES = {
    "CompiledSystem": "engines.compiler",
    "MissingExtra": "errors",
    "imitate": "learning.learner",
    "learn": "learning.learner",
    "read_controller": "source",
}


def __getattr__(name: str) -> Any:
    """Import a name of `__all__` from the module that defines it, or a package or module of this one."""
    if name in _MODULES:
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    if name.startswith("_") or find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")


def _controller(thing: object) -> "FuzzyController":
    from fis_tools.source import as_controller  # noqa: PLC0415 - each line imports what it needs

    return as_controller(thing)


def _whole(thing: object) -> "Inferable":
    from fis_tools.model import FuzzyTree, whole  # noqa: PLC0415

    return thing if isinstance(thing, FuzzyTree) else whole(_controller(thing), "pass one of them")


def compile(thing: object, **options: Any) -> Any:
    """Compile into a function of whole arrays, from a file too; see `fis_tools.engines.compiler.compile`."""
    from fis_tools.engines import compiler  # noqa: PLC0415

    return compiler.compile(_whole(thing) if isinstance(thing, str | Path) else thing, **options)


def audit(thing: object) -> Any:
    """List what a reviewer should know; see `fis_tools.findings.audit.audit`."""
    from fis_tools.findings import audit as findings  # noqa: PLC0415

    return findings.audit(_controller(thing))


def explain(thing: object, inputs: Mapping[str, float]) -> Any:
    """Tell which rules moved the outputs; see `fis_tools.findings.explanation.explain`."""
    from fis_tools.findings import explanation  # noqa: PLC0415

    return explanation.explain(_whole(thing), inputs)


def surface(thing: object, x: str | None = None, y: str | None = None, **options: Any) -> Any:
    """Evaluate an output over two inputs; see `fis_tools.analysis.arrays.surface`."""
    from fis_tools.analysis import arrays  # noqa: PLC0415

    return arrays.surface(_whole(thing), x, y, **options)


def plot(thing: object, folder: Path | str = "figures", form: str = "png") -> list[Path]:
    """Draw terms, rules and surfaces of every system into a folder; return the files."""
    from fis_tools import render  # noqa: PLC0415

    Path(folder).mkdir(parents=True, exist_ok=True)
    values = []
    for system in _controller(thing).systems:
        for name, figure in render.system_figures(system):
            values.append(Path(folder) / f"{system.name}-{name}.{form}".replace("/", "_"))
            render.save(figure, values[-1])
    return values


def export_c(thing: object, path: Path | str) -> Path:
    """Write one C99 file that infers as Python does; see `fis_tools.formats.c.source.write`."""
    from fis_tools.formats.c import source  # noqa: PLC0415
    from plain_files.file_access import write_text  # noqa: PLC0415

    write_text(Path(path), source.write(_controller(thing)))
    return Path(path)


def __dir__() -> list[str]:
    """List the lazily imported names too."""
    return sorted({*globals(), *__all__})


#: For each kind of content, which function of `fis_tools.review` shows which noun.
_SHOWN = {
    "text/html": {"systems.FuzzyController": "controller_tables", "systems.FuzzySystem": "system_tables"},
    "image/svg+xml": {"variables.Variable": "variable_picture"},
}


def show_in(shell: Any) -> None:
    """Register displays of controllers, systems and variables with IPython; imported at first use."""
    for kind, methods in _SHOWN.items():
        for noun, method in methods.items():
            module, _, name = noun.rpartition(".")
            formatter = shell.display_formatter.formatters[kind]
            formatter.for_type_by_name(f"{__name__}.model.{module}", name, partial(_show, method))


def _show(method: str, thing: object) -> Any:
    return getattr(import_module(f"{__name__}.review"), method)(thing)


if "IPython" in sys.modules and (_shell := sys.modules["IPython"].get_ipython()) is not None:
    show_in(_shell)
