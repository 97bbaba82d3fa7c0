"""Fuzzy systems that show themselves in a notebook: controllers and systems as tables, variables as pictures.

The nouns of `fis_tools.model` know nothing of pages and pictures, so the notebook is told how to show them.
"""

from collections.abc import Callable
from typing import Any

from fis_tools.formats.printed import html
from fis_tools.model import FuzzyController, FuzzySystem, Variable


def show_in(shell: Any) -> None:
    """Tell an IPython shell how to show what this package is about."""
    shown: dict[str, tuple[tuple[type, Callable[[Any], str]], ...]] = {
        "text/html": ((FuzzyController, controller_tables), (FuzzySystem, system_tables)),
        "image/svg+xml": ((Variable, variable_picture),),
    }
    for kind, ways in shown.items():
        formatter = shell.display_formatter.formatters[kind]
        for noun, way in ways:
            formatter.for_type(noun, way)


def controller_tables(controller: FuzzyController) -> str:
    """Return a controller's facts, terms and rules as HTML."""
    return html.fragment(controller)


def system_tables(system: FuzzySystem) -> str:
    """Return a system's terms and rules as HTML."""
    return html.fragment(FuzzyController(system.name, (system,)))


def variable_picture(variable: Variable) -> str:
    """Return a variable's membership functions as SVG."""
    from fis_tools import render  # noqa: PLC0415 - tables are shown without matplotlib

    figure, ax = render.one_panel("")
    render.memberships(variable, ax)
    return render.encode(figure, "svg").decode("utf-8")
