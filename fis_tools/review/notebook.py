"""What a notebook shows of fuzzy systems: controllers and systems as tables, variables as pictures.

The nouns of `fis_tools.model` know nothing of pages and pictures; `fis_tools.show_in` tells the notebook.
"""

from fis_tools.document import html
from fis_tools.errors import MissingExtra
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.model.systems import has_sets
from fis_tools.words.outline import outline


def controller_tables(controller: FuzzyController) -> str:
    """Return a controller's facts, terms and rules as HTML."""
    return html.fragment(outline(controller))


def system_tables(system: FuzzySystem) -> str:
    """Return a system's terms and rules as HTML."""
    return controller_tables(FuzzyController(system.name, (system,)))


def variable_picture(variable: Variable) -> str | None:
    """Return a variable's membership functions as SVG; None, for its text, without matplotlib or any."""
    if not has_sets(variable):
        return None
    try:
        from fis_tools import render  # noqa: PLC0415 - tables are shown without matplotlib
    except MissingExtra:
        return None

    figure, ax = render.one_panel("")
    render.memberships(variable, ax)
    return render.encode(figure, "svg").decode("utf-8")
