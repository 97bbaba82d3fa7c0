"""Documents as HTML: a fragment for a notebook, or a page that needs no other file."""

import base64
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from plain_files.document import Document, Heading
from plain_files.file_access import read_shipped


@dataclass(frozen=True)
class ScriptedPanel:
    """A part of a page that runs a script of its own: its title, style, body and script.

    ``packed`` is the script that this script unpacks and begins, if it does.
    """

    title: str
    style: Markup
    body: Markup
    script: Markup
    packed: str = ""

    @property
    def scripts(self) -> tuple[str, ...]:
        """What the policy of its page allows to run."""
        return (self.script, self.packed) if self.packed else (self.script,)


def policy(style: str = "", scripts: Sequence[str] = (), *, flies: bool = False) -> Markup:
    """Return the content security policy of a page: nothing runs but its scripts, nothing is fetched.

    With the source of its style element, no other style is applied; without a script none runs. Where the
    scripts fly, they may compile WebAssembly and begin workers of their own.
    """
    allowed = source_hash(style) if style else "unsafe-inline"
    compiles, workers = (" 'wasm-unsafe-eval'", "worker-src blob:; ") if flies else ("", "")
    hashes = " ".join(f"'{source_hash(script)}'" for script in scripts)
    runs = f"script-src {hashes}{compiles}; {workers}" if scripts else ""
    return Markup(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; {}style-src '{}'; "
        "img-src data:; base-uri 'none'; form-action 'none'\">"
    ).format(Markup(runs), Markup(allowed))  # noqa: S704 - hashes or words


@cache
def template(package: str, folder: str, name: str) -> Template:
    """Return a template in a folder of a package; it escapes all that is put into it."""
    return environment(package, folder, autoescape=True).get_template(name)


def environment(package: str, folder: str, **options: Any) -> Environment:
    """Return a jinja2 environment for the templates in a folder of a package; options are jinja2's."""
    loader = PackageLoader(package, folder)
    return Environment(  # noqa: S701 - some forms know no markup
        loader=loader,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        optimized=False,  # looking for constants takes longer than they save in a page that is written once
        **options,
    )


def read(name: str, package: str = "plain_files.document") -> str:
    """Return the content of a text file that is part of a package."""
    return read_shipped(files(package) / name)


def as_script_data(content: Any) -> str:
    """Return JSON that can stand inside a script element: no ``<``, ``>`` or ``&`` in it."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def source_hash(source: str) -> str:
    """Return the hash by which a content security policy allows a script or style element of this source."""
    return "sha256-" + base64.b64encode(hashlib.sha256(source.encode()).digest()).decode("ascii")


def png_address(png: bytes) -> str:
    """Return a data URL that holds a PNG picture."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def element(tag: str, *inside: object, **attributes: Any) -> Markup:
    """Return an element of HTML or SVG; what is put into it is escaped, unless it is Markup.

    Underscores in the names of attributes stand for hyphens; one at the end, as of ``class_``, for nothing.
    Attributes that are None or empty are left out.
    """
    return void(tag, **attributes) + Markup().join(map(escape, inside)) + Markup(f"</{tag}>")  # noqa: S704


def void(tag: str, **attributes: Any) -> Markup:
    """Return an element without content, such as ``img``; attributes are as of `element`."""
    words = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
        if value not in (None, "")
    )
    return Markup(f"<{tag}{words}>")  # noqa: S704 - escaped above


def fragment(document: Document) -> str:
    """Write a document as a part of a page, with its style."""
    return str(element("style", Markup(read("style.css"))) + _main(document))  # noqa: S704 - of this package


def page(document: Document, style: str = "", panel: ScriptedPanel | None = None) -> str:
    """Write a document as a page of its own, which fetches nothing; ``style`` is CSS.

    It runs nothing but the script of a panel, which may fly; the panel follows the document. Headings of
    level 2 that have an id make its sections and its navigation.
    """
    main = _main(document)
    style = Markup(read("style.css") + read("page.css") + style)  # noqa: S704 - of our packages
    styled = "" if panel or "style=" in main or "<style" in main else style
    return template("plain_files", "document", "page.html").render(
        title=document.title,
        style=style,
        policy=policy(styled, panel.scripts if panel else (), flies=panel is not None),
        navigation=[
            block for block in document.blocks if isinstance(block, Heading) and block.level == 2 and block.id
        ],
        body=main,
        panel=panel,
    )


def body(document: Document) -> Markup:
    """Write the blocks of a document alone, for a page that has more: its sections, without a style."""
    blocks: Any = template("plain_files", "document", "blocks.html").module
    return Markup(blocks.body(document.blocks))  # noqa: S704 - escaped by the template


def _main(document: Document) -> Markup:
    return element("main", body(document), class_="document")
