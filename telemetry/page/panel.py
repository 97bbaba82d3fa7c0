"""The player as a part of a page, from what it is given as plain data; see ``scripts/player.js``."""

import base64
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from plain_files.document.html import ScriptedPanel, as_script_data, read, template

PACKAGE = "telemetry.page"
FOLDER = Path(__file__).parent
#: what makes elements and axes
OF_REVIEW = ("elements", "scale")
VIEWS = ("view", "recorded")
#: which the script applies
STYLES = ("view", "player")
SCRIPTS = (*("saving", "plots", "points_map", "dots", "cases_table", "bouts"), *("side", "player"))
#: zlib's word for a header of gzip
WITH_HEADER = 31
#: how much zlib gathers before it begins a block: least for arrays, files and scripts
OF_NUMBERS, OF_FILES, OF_SCRIPTS = 5, 6, 7
#: what lines of comments begin with
COMMENTS = ("//", "/**", "* ", "*/")
#: what the frame's key says
KEY = re.compile(r'(?<=<div class="key">).*?(?=</div>)')
#: a comment after code, and blanks of a style that say nothing
AFTER_CODE = re.compile(r"\s+// [^\"'`]*$")
BLANK = re.compile(r"\s*([{};])\s*")


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
    # beside a worker's, which has it too, and so shrinks
    code = as_script("\n".join([read("scripts/arrays.js", PACKAGE), *review, *views, *more, *scripts]))
    frame = read("frame.html", PACKAGE).replace(' id="scene"', "")  # there may be several
    frame = KEY.sub("", frame)  # which the script writes as each flight has it
    body = template("telemetry", "page", "player.html").render(
        frame=Markup(frame),  # noqa: S704 - of this package
        names=names,
        has_cases=content["cases"] is not None,
    )
    style = as_script_data(BLANK.sub(r"\1", "".join(read(f"{name}.css", PACKAGE) for name in STYLES)))
    given = f"const PLAYER_STYLE = {style}, PLAYER = {as_script_data(content)};"
    script = f'"use strict";(() => {{\n{given}\n{code}\n}})();'
    unpacking = as_script(read("scripts/unpack.js", PACKAGE)).replace("PACKED", dense(script.encode()))
    # a file of this package around digits; what the template wrote is escaped
    first = Markup(read("first.css", PACKAGE))  # noqa: S704 - of this package
    return ScriptedPanel(title, first, Markup(body), Markup(unpacking), script)  # noqa: S704


def as_script(code: str) -> str:
    """Make a script of modules, without their comments and indents."""
    lines = [AFTER_CODE.sub("", line).strip() for line in code.split("\n")]
    kept = [line for line in lines if line and not line.startswith(COMMENTS) and line != "*"]
    return "\n".join(line.removeprefix("export ") for line in kept if not line.startswith("import "))


def packed(content: bytes, gathered: int = OF_FILES) -> str:
    """Return bytes as text, compressed."""
    return base64.b64encode(_deflated(content, gathered)).decode("ascii")


def dense(content: bytes) -> str:
    """Return bytes as shorter text, compressed, in digits of base 85: RFC 1924's, with a comma for ``<``."""
    return base64.b85encode(_deflated(content, OF_SCRIPTS)).decode("ascii").replace("<", ",")


def _deflated(content: bytes, gathered: int) -> bytes:
    """Compress bytes as gzip does, in blocks for which zlib gathers so much."""
    maker = zlib.compressobj(9, zlib.DEFLATED, WITH_HEADER, gathered)
    return maker.compress(content) + maker.flush()


def planes(values: Any, kind: str) -> str:
    """Return an array as text, compressed with bytes of one rank beside each other, which shrink more."""
    numbers = np.ascontiguousarray(values, dtype=kind)
    return packed(numbers.view(np.uint8).reshape(len(numbers), -1).T.tobytes(), OF_NUMBERS)
