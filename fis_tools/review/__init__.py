"""The review page: one HTML file of one controller and its flights, for the person who signs it off.

Here is also what a notebook shows: controllers and systems as tables, variables as pictures. The nouns of
`fis_tools.model` know nothing of pages and pictures; `fis_tools.show_in` tells the notebook.
"""

import sys
from pathlib import Path
from types import ModuleType

from fis_tools.errors import MissingExtra
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.words.text import outline
from plain_files.document import html
from plain_files.file_access import write_text


class _Review(ModuleType):
    """A callable module, so that ``fis_tools.review(system, "page.html")`` works."""

    def __call__(self, thing: object, path: Path | str = "review.html") -> Path:
        """Write the review page of a system, a controller, a file or a scikit-fuzzy control system."""
        from fis_tools.review import page  # noqa: PLC0415 - takes long to import
        from fis_tools.source import as_controller  # noqa: PLC0415

        write_text(Path(path), page.write(as_controller(thing)))
        return Path(path)


sys.modules[__name__].__class__ = _Review


def controller_tables(controller: FuzzyController) -> str:
    """Return a controller's facts, terms and rules as HTML."""
    return html.fragment(outline(controller))


def system_tables(system: FuzzySystem) -> str:
    """Return a system's terms and rules as HTML."""
    return controller_tables(FuzzyController(system.name, (system,)))


def variable_picture(variable: Variable) -> str | None:
    """Return a variable's membership functions as SVG; None, for its text, without matplotlib or any."""
    if not variable.has_sets:
        return None
    try:
        from fis_tools import render  # noqa: PLC0415 - tables are shown without matplotlib
    except MissingExtra:
        return None

    figure, ax = render.one_panel("")
    render.memberships(variable, ax)
    return render.encode(figure, "svg").decode("utf-8")
