"""SVG files made fit to stand inside a page: no outside references, ids of their own, colours of the page."""

import re
from html import escape

from pipeline.report.figures import style

#: colours that a page replaces by its own, to the names of the page's variables
VARIABLES = {
    style.INK: "ink",
    style.MUTED: "muted",
    style.GRID: "grid",
    style.PAPER: "paper",
    style.BLUE: "blue",
    style.VERMILION: "vermilion",
    style.GREEN: "green",
    style.PURPLE: "purple",
    style.ORANGE: "orange",
    style.SKY: "sky",
    style.OLIVE: "olive",
}

_PROLOGUE = re.compile(r"\A.*?(?=<svg)", re.DOTALL)
_LEFT_OUT = re.compile(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>|<!--.*?-->", re.DOTALL)
_TAG = re.compile(r"<[^>]+>")
_ROOT = re.compile(r"<svg[^>]*?(viewBox=\"[^\"]*\")[^>]*>")
_ID = re.compile(r"\bid=\"|\bhref=\"#|url\(#")
_PATH = re.compile(r"(?<=\bd=\")[^\"]*")
_DECIMALS = re.compile(r"(\.\d\d)\d+")
_COLOUR = re.compile(r"(?<=[a-z]: )#[0-9a-f]{6}")
_FONT = re.compile(r"font-family: [^;\"]*;? ?")
_INDENT = re.compile(r"\s*\n\s*")


def inline(svg: str, name: str, description: str) -> str:
    """Turn an SVG file into an element of a page.

    Parameters
    ----------
    svg : str
        As matplotlib writes it.
    name : str
        Put before every id, so that pictures of one page do not take each other's.
    description : str
        Alternative text for readers who cannot see it.

    Returns
    -------
    str
        HTML; colours of `VARIABLES` are ``var(--name)``.
    """
    variables = {colour.lower(): f"var(--{variable})" for colour, variable in VARIABLES.items()}

    def fit(tag: re.Match[str]) -> str:
        text = tag[0].replace("xlink:href", "href")
        text = _ID.sub(lambda match: f"{match[0]}{name}-", text)
        text = _PATH.sub(lambda match: _DECIMALS.sub(r"\1", match[0]), text)
        text = _COLOUR.sub(lambda match: variables.get(match[0], match[0]), text)
        return _FONT.sub("", text)

    label = escape(description)
    text = _LEFT_OUT.sub("", _PROLOGUE.sub("", svg))
    text = _ROOT.sub(lambda match: f"<svg {match[1]}>", text, count=1)
    text = _TAG.sub(fit, text).replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
    return _INDENT.sub("\n", text).strip()
