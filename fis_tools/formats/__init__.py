"""Readers and writers of controller files; templates lie beside the modules that fill them in."""

from functools import cache
from typing import Any


@cache
def _templates() -> Any:
    """Return the templates of this package, each compiled once."""
    from html import escape  # noqa: PLC0415 - as below

    from plain_files.document.html import environment  # noqa: PLC0415 - few commands write files

    forms = environment("fis_tools.formats", "", keep_trailing_newline=True)
    forms.filters |= {"exact": repr, "xml": escape}
    return forms


def rendered(template: str, **facts: Any) -> str:
    """Render a template of this package.

    Parameters
    ----------
    template : str
        Where it lies in this folder.
    facts
        What it asks for. The filter `exact` writes a number that reads back the same, `xml` a text in XML.
    """
    return str(_templates().get_template(template).render(facts))
