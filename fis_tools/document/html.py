"""Documents as HTML: a fragment for a notebook, or a page that needs no other file."""

import base64
import hashlib
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from fis_tools.document import (
    Block,
    Cell,
    Change,
    Code,
    Document,
    Figure,
    Fold,
    Heading,
    Items,
    Mark,
    Paragraph,
    Table,
)


def policy(style: str = "") -> Markup:
    """Return the policy of a page without scripts: nothing runs, and nothing is fetched.

    With the source of its style element, no other style is applied.
    """
    allowed = source_hash(style) if style else "unsafe-inline"
    return Markup(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src '{}'; "
        "img-src data:; base-uri 'none'; form-action 'none'\">"
    ).format(Markup(allowed))  # noqa: S704 - a hash or a word


def template(package: str, folder: str, name: str) -> Template:
    """Return a template in a folder of a package; it escapes all that is put into it."""
    environment = Environment(
        loader=PackageLoader(package, folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def read(name: str, package: str = "fis_tools.document") -> str:
    """Return a text file of a package."""
    return (files(package) / name).read_text(encoding="utf-8")


def source_hash(source: str) -> str:
    """Return what a content security policy allows a script or style element of this source by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(source.encode()).digest()).decode("ascii")


def element(tag: str, *inside: object, **attributes: Any) -> Markup:
    """Return an element of HTML or SVG; what is put into it is escaped, unless it is Markup.

    Underscores in the names of attributes stand for hyphens; one at the end, as of ``class_``, for nothing.
    Attributes that are None or empty are left out.
    """
    return void(tag, **attributes) + Markup().join(map(escape, inside)) + Markup(f"</{tag}>")  # noqa: S704


def void(tag: str, **attributes: Any) -> Markup:
    """Return an element that has nothing inside, such as ``img``; attributes are as of `element`."""
    words = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
        if value not in (None, "")
    )
    return Markup(f"<{tag}{words}>")  # noqa: S704 - escaped above


#: a table with more columns is read row by row on a phone
NARROW = 2


def fragment(document: Document) -> str:
    """Write a document as a part of a page, with its style."""
    return str(element("style", Markup(read("style.css"))) + _main(document))  # noqa: S704 - of this package


def page(document: Document, style: str = "") -> str:
    """Write a document as a page of its own, which runs nothing and fetches nothing; ``style`` is CSS.

    Headings of level 2 that have an id make its sections and its navigation.
    """
    main = _main(document)
    style = Markup(read("style.css") + read("page.css") + style)  # noqa: S704 - of our packages
    return template("fis_tools", "document", "page.html").render(
        title=document.title,
        style=style,
        policy=policy("" if "style=" in main or "<style" in main else style),
        navigation=[
            block for block in document.blocks if isinstance(block, Heading) and block.level == 2 and block.id
        ],
        body=main,
    )


def body(document: Document) -> Markup:
    """Write the blocks of a document alone, for a page that has more: its sections, without a style."""
    parts: list[Markup] = [Markup("")]
    sections: list[tuple[Heading | None, list[Markup]]] = [(None, [])]
    for block in document.blocks:
        if isinstance(block, Heading) and block.level == 2 and block.id:
            sections.append((block, []))
        else:
            sections[-1][1].extend(_elements(block))
    for heading, inside in sections:
        if heading is None:
            parts += inside
        else:
            title = element("h2", heading.words, id=f"{heading.id}-title")
            lines = Markup("\n").join(["", title, *inside, ""])
            parts.append(element("section", lines, id=heading.id, aria_labelledby=f"{heading.id}-title"))
    return Markup("\n").join([*parts, Markup("")])


def _main(document: Document) -> Markup:
    return element("main", body(document), class_="document")


def _elements(block: Block) -> Iterator[Markup]:
    match block:
        case Heading(words, level, name):
            yield element(f"h{level}", words, id=name)
        case Paragraph(words):
            yield element("p", words)
        case Items(items):
            broken = (Markup("<br>").join(item.split("\n")) for item in items)
            yield element("ul", *(element("li", words) for words in broken))
        case Code(words):
            yield element("pre", element("code", words), tabindex=0)
        case Table():
            yield _table(block)
        case Figure(markup):
            yield Markup(markup)  # noqa: S704 - safe, as figures are
        case Fold(words, blocks, name):
            inside = [part for one in blocks for part in _elements(one)]
            yield element("details", element("summary", words), *inside, id=name)


def _table(table: Table) -> Markup:
    is_number = ["number" if place in table.numbers else "" for place in range(len(table.heads))]
    heads = [
        element("th", head, scope="col", class_=css) for head, css in zip(table.heads, is_number, strict=True)
    ]
    stacks = len(table.heads) > NARROW and not table.across
    names = table.heads if stacks else [""] * max(map(len, table.rows), default=0)

    def row(first: Cell, *cells: Cell) -> Markup:
        data = [
            element(
                "td", _cell(cell, place in table.numbers), class_=_class(cell, place, table), data_head=head
            )
            for place, (cell, head) in enumerate(zip(cells, names[1:], strict=True), start=1)
        ]
        return element("tr", element("th", _cell(first), scope="row"), *data)

    parts = [element("caption", table.caption)] if table.caption else []
    parts += [element("thead", element("tr", *heads))] if heads else []
    body = element("tbody", Markup("\n").join(row(*cells) for cells in table.rows))
    whole = element("table", *parts, body, class_="stacked" if stacks else "")
    name = table.caption or next(filter(None, table.heads), "facts")
    return element("div", whole, class_="wide", role="region", tabindex=0, aria_label=name)


def _class(cell: Cell, place: int, table: Table) -> str:
    if isinstance(cell, Change) and table.across:
        return "same" if cell.before == cell.after else "changed"
    return "number" if place in table.numbers else ""


def _cell(cell: Cell, is_number: bool = False) -> Markup:
    if isinstance(cell, str):
        value, bracket, interval = cell.partition(" (") if is_number else (cell, "", "")
        # an interval stands below its value: many columns are to fit a page
        return escape(value) + (Markup("<br>(") + escape(interval) if bracket else "")
    if isinstance(cell, Mark):
        return _mark(cell)
    if cell.before == cell.after:
        return escape(cell.after)
    return element("del", cell.before) + element("ins", cell.after)


def _mark(mark: Mark) -> Markup:
    words = escape(mark.words) if mark.value is None else element("data", mark.words, value=mark.value)
    words = element("span", words, class_=f"mark {mark.kind}") if mark.kind else words
    words = element("a", words, href=f"#{mark.link}") if mark.link else words
    return words + element("span", mark.note, class_="note") if mark.note else words
