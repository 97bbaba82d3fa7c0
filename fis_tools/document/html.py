"""Documents as HTML: a fragment for a notebook, or a page that needs no other file."""

from collections.abc import Iterator

from markupsafe import Markup, escape

from fis_tools.document import Block, Change, Code, Document, Figure, Heading, Items, Paragraph, Table
from fis_tools.document.element import element
from fis_tools.document.page import read, template


def fragment(document: Document) -> str:
    """Write a document as a part of a page, with its style."""
    return str(element("style", Markup(read("style.css"))) + _body(document))  # noqa: S704 - of this package


def page(document: Document, style: str = "") -> str:
    """Write a document as a page of its own, which runs nothing and fetches nothing; ``style`` is CSS."""
    style = Markup(style + read("style.css"))  # noqa: S704 - of our packages
    return template("fis_tools", "document", "page.html").render(
        title=document.title, style=style, body=_body(document)
    )


def _body(document: Document) -> Markup:
    parts = [part for block in document.blocks for part in _elements(block)]
    return element("main", Markup("\n").join(["", *parts, ""]), class_="document")


def _elements(block: Block) -> Iterator[Markup]:
    match block:
        case Heading(words, level):
            yield element(f"h{level}", words)
        case Paragraph(words):
            yield element("p", words)
        case Items(items):
            broken = (Markup("<br>").join(item.split("\n")) for item in items)
            yield element("ul", *(element("li", words) for words in broken))
        case Code(words):
            yield element("pre", element("code", words))
        case Table():
            yield _table(block)
        case Figure(markup):
            yield Markup(markup)  # noqa: S704 - safe, as figures are


def _table(table: Table) -> Markup:
    heads = element("thead", element("tr", *(element("th", head, scope="col") for head in table.heads)))
    rows = [
        element(
            "tr",
            element("th", _cell(first), scope="row"),
            *(
                element("td", _cell(cell), class_=_class(cell, place, table))
                for place, cell in enumerate(cells, start=1)
            ),
        )
        for first, *cells in table.rows
    ]
    body = element("tbody", Markup("\n").join(rows))
    return element("div", element("table", *([heads] if table.heads else []), body), class_="wide")


def _class(cell: str | Change, place: int, table: Table) -> str:
    if isinstance(cell, Change) and table.across:
        return "same" if cell.before == cell.after else "changed"
    return "number" if place in table.numbers else ""


def _cell(cell: str | Change) -> Markup:
    if isinstance(cell, str):
        return escape(cell)
    if cell.before == cell.after:
        return escape(cell.after)
    return element("del", cell.before) + element("ins", cell.after)
