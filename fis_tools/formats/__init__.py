"""Readers and writers of controller files; templates lie beside the modules that fill them in."""

from typing import Any


def rendered(template: str, **facts: Any) -> str:
    """Fill a template in.

    Parameters
    ----------
    template : str
        Where it lies in this folder.
    facts
        What it asks for. The filter `exact` writes a number that reads back the same, `xml` a text in XML.
    """
    from html import escape  # noqa: PLC0415 - as below

    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - few commands write files

    environment = Environment(  # noqa: S701 - most forms know no markup, the others have a filter
        loader=PackageLoader("fis_tools.formats", ""),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"exact": repr, "xml": escape}
    return environment.get_template(template).render(facts)
