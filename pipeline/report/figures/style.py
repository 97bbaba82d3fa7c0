"""How all pictures look, and how a figure becomes files and an element of a page."""

import io
import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from html import escape
from typing import Any

import matplotlib as mpl
import numpy as np
import yaml
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from numpy.typing import NDArray

from plain_files import document
from plain_files.document.html import element, read

__all__ = ["STYLE", "Figure", "Picture", "grid", "pixels", "save", "style"]

#: colours with a part to play; a page puts its variables of these names in their places
COLOURS = {
    "ink": "#1b1f24",
    "muted": "#5b6571",
    "grid": "#d4d9df",
    "paper": "#fffffe",
    "blue": "#0072B2",
    "vermilion": "#D55E00",
    "green": "#009E73",
    "purple": "#AA4499",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "olive": "#7A7A29",
}
INK, MUTED, GRID, PAPER, BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, OLIVE = COLOURS.values()
#: of what is drawn side by side, in this order
PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, OLIVE, INK)

#: of lines that are a limit or a border
DOTS = (0, (2, 2))

#: of words in a picture: small print, words centred on their place, and words a little beside it
SMALL_PRINT: dict[str, Any] = {"color": MUTED, "fontsize": 8}
CENTRED: dict[str, Any] = {"ha": "center", "va": "center"}
BESIDE: dict[str, Any] = {"textcoords": "offset points", "ha": "center"}

#: of PNG files, from 0 to 9: the usual 6 takes half as long again and makes them a tenth smaller at most
COMPRESSION = 3

#: up to so many flights each value is drawn, beyond only the crowd
MOST_POINTS = 40

STYLE: dict[Any, Any] = {
    **dict.fromkeys(("text.color", "axes.labelcolor"), INK),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), MUTED),
    # a name with a dollar sign is a name
    **dict.fromkeys(("text.parse_math", "axes.formatter.use_mathtext", "legend.frameon"), False),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    **dict.fromkeys([f"boxplot.{part}props.color" for part in ("box", "whisker", "cap", "median")], MUTED),
    "boxplot.medianprops.linewidth": 1.6,
    "boxplot.showfliers": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.titley": 1.0,
    "axes.linewidth": 0.8,
    # fitting letters to pixels takes long, gains nothing so fine, and bends those that stand upright
    "text.hinting": "none",
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
}


@dataclass(frozen=True)
class Picture:
    """A figure as files."""

    png: bytes
    svg: str


def grid(
    figure: Figure, rows: int, columns: int, margins: Sequence[float], between: Sequence[float], **ratios: Any
) -> GridSpec:
    """Divide a figure into cells for axes, with given room for labels: measuring them takes long.

    Parameters
    ----------
    figure : Figure
    rows, columns : int
    margins : sequence of four float
        Left, right, bottom and top, in inches.
    between : sequence of two float
        Between columns and between rows, in inches.
    **ratios
        Of widths and heights, see `matplotlib.gridspec.GridSpec`.
    """
    width, height = figure.get_size_inches()
    left, right, bottom, top = margins
    across, down = between
    return figure.add_gridspec(
        rows,
        columns,
        left=left / width,
        right=1.0 - right / width,
        bottom=bottom / height,
        top=1.0 - top / height,
        wspace=across * columns / (width - left - right - across * (columns - 1)),
        hspace=down * rows / (height - bottom - top - down * (rows - 1)),
        **ratios,
    )


def style() -> AbstractContextManager[None]:
    """Draw in the report's style."""
    return mpl.rc_context(STYLE)


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """Return a figure as pixels: red, green and blue, shape (height, width, 3)."""
    raw = io.BytesIO()
    with style():
        figure.savefig(raw, format="rgba", dpi=figure.dpi)
    width, height = (figure.get_size_inches() * figure.dpi).astype(int)
    return np.frombuffer(raw.getvalue(), dtype=np.uint8).reshape(height, width, 4)[..., :3].copy()


def save(figure: Figure, name: str, dots_per_inch: int) -> Picture:
    """Turn a figure into files: a PNG on white and an SVG without background.

    Parameters
    ----------
    figure : Figure
    name : str
        Keeps the ids of one SVG apart from those of another.
    dots_per_inch : int
        Of the PNG, and of what is rasterised in the SVG.
    """
    png, svg = io.BytesIO(), io.StringIO()
    figure.set_dpi(dots_per_inch)
    engine = figure.get_layout_engine()
    if engine is not None:
        # once: with an engine, saving lays out and draws before it draws
        engine.execute(figure)
        figure.set_layout_engine(None)
    figure.savefig(
        png, format="png", dpi=dots_per_inch, facecolor="white", pil_kwargs={"compress_level": COMPRESSION}
    )
    with mpl.rc_context({"svg.hashsalt": name}):
        figure.savefig(svg, format="svg", dpi=dots_per_inch, transparent=True, metadata={"Date": None})
    return Picture(png.getvalue(), svg.getvalue())


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
    variables = {colour.lower(): f"var(--{name})" for name, colour in COLOURS.items()}

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


@cache
def _captions() -> Mapping[str, str]:
    return yaml.safe_load(read("templates/captions.yaml", "pipeline.report"))


def caption_of(name: str, **values: Any) -> str:
    """Return a caption, or another sentence of a page, with some values, see ``templates/captions.yaml``."""
    return _captions()[name].format(**values)


@dataclass(frozen=True)
class Illustration:
    """A picture with its words.

    Parameters
    ----------
    name : str
        Of its file, without the ending.
    caption : str
        Plain text.
    png : bytes
    element : str
        The same picture as HTML.
    """

    name: str
    caption: str
    png: bytes
    element: str

    @property
    def block(self) -> document.Figure:
        """The picture above its caption, as a block of a page."""
        caption = element("figcaption", self.caption)
        return document.Figure(element("figure", Markup(self.element), caption, tabindex="0"))  # noqa: S704 - drawn here


def illustrate(name: str, caption: str, figure: Figure, dots_per_inch: int) -> Illustration:
    """Turn a figure that was drawn in the report's style into its picture, in the same style."""
    picture = save(figure, name, dots_per_inch)
    return Illustration(name, caption, picture.png, inline(picture.svg, name, caption))
