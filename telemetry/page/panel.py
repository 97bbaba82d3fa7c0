"""The player as a part of a page, from what it is given as plain data; see ``scripts/player.js``."""

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from fis_tools.document.html import ScriptedPanel, read, template

PACKAGE = "telemetry.page"
FOLDER = Path(__file__).parent
#: what makes elements and axes
OF_REVIEW = ("elements", "scale")
VIEWS = ("view", "recorded")
SCRIPTS = (*("arrays", "saving", "plots", "points_map", "dots", "cases_table", "bouts"), *("side", "player"))
#: what lines of comments begin with
COMMENTS = ("//", "/**", "* ", "*/")


def panel(
    title: str, content: Mapping[str, Any], names: Sequence[str], more: Sequence[str] = ()
) -> ScriptedPanel:
    """Return the player; its script is compressed, which takes two thirds of it from a page.

    Parameters
    ----------
    title : str
    content : mapping
        What the script is given.
    names : sequence of str
        Of the flights beside each other.
    more : sequence of str
        Scripts of whoever flies or infers in the page.
    """
    review = [read(f"scripts/{name}.js", "fis_tools.review") for name in OF_REVIEW]
    views = [read(f"{name}.js", PACKAGE) for name in VIEWS]
    scripts = [read(f"scripts/{name}.js", PACKAGE) for name in SCRIPTS]
    code = as_script("\n".join([*review, *views, *more, *scripts]))
    frame = read("frame.html", PACKAGE).replace(' id="scene"', "")  # there may be several
    body = template("telemetry", "page", "player.html").render(
        frame=Markup(frame),  # noqa: S704 - of this package
        names=names,
        has_cases=content["cases"] is not None,
    )
    style = Markup(read("view.css", PACKAGE) + read("player.css", PACKAGE))  # noqa: S704 - likewise
    script = f'"use strict";(() => {{\nconst PLAYER = {as_json(content)};\n{code}\n}})();'
    unpacking = as_script(read("scripts/unpack.js", PACKAGE)).replace("PACKED", packed(script.encode()))
    # a file of this package around base64; what the template wrote is escaped
    return ScriptedPanel(title, style, Markup(body), Markup(unpacking), script)  # noqa: S704


def as_script(code: str) -> str:
    """Make a script of modules, without their comments and indents."""
    lines = [line.strip() for line in code.split("\n")]
    kept = [line for line in lines if line and not line.startswith(COMMENTS) and line != "*"]
    return "\n".join(line.removeprefix("export ") for line in kept if not line.startswith("import "))


def packed(content: bytes) -> str:
    """Return bytes as text, compressed."""
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode("ascii")


def as_json(content: Any) -> str:
    """Return JSON that can stand inside a script element: no ``<``, ``>`` or ``&`` in it."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
