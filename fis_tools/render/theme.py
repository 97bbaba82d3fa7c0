"""Themes: colours for light and for dark paper, passed as an argument and set on artists alone.

Line colours have a contrast of 4.5 or more to their paper, for letters bear them too. Any two of a theme are
25 or more apart (CIE 1976 L*a*b*), also for eyes without red, green or blue cones as G. M. Machado,
M. M. Oliveira and L. A. F. Fernandes simulate them (IEEE Transactions on Visualization and Computer Graphics
15, 2009).
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_rgb
from matplotlib.text import Text

from fis_tools.array_types import Floats
from fis_tools.render import lettering

#: A name, or red, green and blue from 0 to 1.
Colour: TypeAlias = str | Floats | tuple[float, float, float]

#: From dark to bright without a turn, and nearly the same to every eye (J. R. Nunez, C. R. Anderton and
#: R. S. Renslow, PLOS ONE 13, 2018).
BRIGHTNESS_MAP = "cividis"
_DASHES = ((5, 1.5), (6, 1.5, 1, 1.5), (1, 1), (3, 1, 1, 1, 1, 1))
LINE_STYLES: tuple[Any, ...] = ("-", *((0, dashes) for dashes in _DASHES))

#: Sizes of letters, in points.
SMALL, MEDIUM, LARGE = 8.0, 9.0, 11.0


@dataclass(frozen=True)
class Theme:
    """The colours of a picture.

    Parameters
    ----------
    name : str
        What a user asks for it by.
    paper, ink, muted, grid : str
        The background; letters and marks; frames and ticks; what should hardly be seen.
    lines : tuple of str
        Of curves, one after the other.
    strong : str
        The far end of the scale that begins at `paper`.
    less, more : str
        The ends of the scale whose middle, for no change, is `paper`.
    """

    name: str
    paper: str
    ink: str
    muted: str
    grid: str
    lines: tuple[str, ...]
    strong: str
    less: str
    more: str

    def line(self, index: int) -> dict[str, Any]:
        """Return colour and line style of the curve at an index."""
        colour, style = self.lines[index % len(self.lines)], LINE_STYLES[index % len(LINE_STYLES)]
        return {"color": colour, "linestyle": style}

    @property
    def strength_map(self) -> Colormap:
        """From the paper, for nothing, to the strongest colour."""
        return LinearSegmentedColormap.from_list(f"{self.name}-strength", [self.paper, self.strong])

    @property
    def change_map(self) -> Colormap:
        """From less through the paper, for no change, to more."""
        return LinearSegmentedColormap.from_list(f"{self.name}-change", [self.less, self.paper, self.more])


LIGHT = Theme(
    name="light",
    paper="#fffffe",
    ink="#1b1f24",
    muted="#5b6571",
    grid="#d4d9df",
    lines=("#0072b2", "#c24770", "#7a7a00", "#7a00f5", "#1b1f24", "#522900"),
    strong="#08306b",
    less="#0b5394",
    more="#a63a00",
)
DARK = Theme(
    name="dark",
    paper="#14181d",
    ink="#e8ebef",
    muted="#9aa5b1",
    grid="#39424c",
    lines=("#56b4e9", "#ff5c0a", "#a070ff", "#ffc285", "#e8ebef", "#d17575"),
    strong="#ffe08a",
    less="#6cb8f5",
    more="#ff9a52",
)
THEMES = {theme.name: theme for theme in (LIGHT, DARK)}


def dress(ax: Axes, theme: Theme, x_size: float = SMALL, y_size: float = SMALL) -> None:
    """Give axes and their figure a theme's colours, and take every text as it is written, dollars included.

    The sizes are those of the words at the ticks.
    """
    lettering.figure_of(ax).set_facecolor(theme.paper)
    ax.set_facecolor(theme.paper)
    for spine in ax.spines.values():
        spine.set_edgecolor(theme.muted)
    ax.tick_params(which="both", color=theme.muted, labelcolor=theme.ink)
    ax.tick_params(axis="x", labelsize=x_size)
    ax.tick_params(axis="y", labelsize=y_size)
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set(color=theme.ink, size=MEDIUM)
        axis.get_offset_text().set_color(theme.ink)
    for side in ("left", "center", "right"):
        words = ax.get_title(loc=side)
        if words:
            ax.set_title(words, loc=side, color=theme.ink, size=MEDIUM)
    for text in ax.findobj(Text):
        text.set_parse_math(False)


def head(figure: Any, words: str, theme: Theme) -> None:
    """Set the title of a whole figure."""
    figure.set_facecolor(theme.paper)
    figure.suptitle(words, color=theme.ink, size=LARGE, parse_math=False)


def term_colours(count: int) -> Floats:
    """Return one colour per term, from dark for the lowest to bright for the highest, (count, 3)."""
    positions = np.linspace(0.08, 0.98, count) if count > 1 else np.array([0.7])
    return np.asarray(mpl.colormaps[BRIGHTNESS_MAP](positions))[:, :3]


def luminance(colour: Colour) -> float:
    """Return the relative luminance of an sRGB colour, from 0 to 1 (IEC 61966-2-1, as WCAG 2 takes it)."""
    encoded = np.array(to_rgb(colour if isinstance(colour, str) else tuple(colour)))
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(first: Colour, other: Colour) -> float:
    """Return the contrast ratio of two colours, from 1 to 21, as WCAG 2 defines it."""
    low, high = sorted((luminance(first), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def readable_on(colour: Colour) -> str:
    """Return black or white, whichever has more contrast to a colour."""
    return max(("black", "white"), key=lambda ink: contrast(ink, colour))
