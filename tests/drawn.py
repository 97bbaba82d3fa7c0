"""Figures as readable text, to be stored beside a test: what axes and artists were given, not their looks.

So it is the same with every version of the library, its fonts and its layouts.
"""

from itertools import groupby

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import Collection, LineCollection, PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import FixedLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Path3DCollection, Poly3DCollection

from tests.stored import array, number, rounded

#: of the properties of artists, those that say where and how they are drawn
PROPERTIES = ("label", "zorder", "alpha", "linestyle", "linewidth", "drawstyle", "marker", "markersize")
PROPERTIES += ("markeredgewidth", "rasterized", "rotation", "fontsize", "fontweight", "fontstyle")
PROPERTIES += ("horizontalalignment", "verticalalignment", "fill")
SHORT = {"horizontalalignment": "ha", "verticalalignment": "va", "linestyle": "dashes", "linewidth": "width"}
USUAL = {"rasterized": False, "fontweight": "normal", "fontstyle": "normal", "rotation": 0.0, "fill": True}
USUAL |= {"drawstyle": "default", "linestyle": "0 None", "marker": "None"}
COLOURS = ("color", "markerfacecolor", "markeredgecolor", "facecolor", "edgecolor")


def _colours(value):
    if isinstance(value, str):
        return value
    value = np.atleast_2d(np.asarray(value, dtype=float))
    if not value.size:
        return ""
    names = [to_hex(each, keep_alpha=True) for each in value]
    shown = list(dict.fromkeys(names))
    return " ".join(shown[:8]) + (f" ... of {len(names)}" if len(names) > 8 else "")


def _looks(artist):
    words = []
    is_marked = getattr(artist, "get_marker", str)() not in ("", "None", None)
    for name in PROPERTIES:
        value = getattr(artist, f"get_{name}", lambda: None)()
        if name == "linestyle" and isinstance(artist, Collection):
            value = [(float(start), dashes) for start, dashes in artist._linestyles]
        if name == "linestyle" and isinstance(artist, Line2D):
            value = artist._unscaled_dash_pattern
        if isinstance(value, np.ndarray | list | tuple):
            value = " ".join(rounded(each) for each in sorted(set(map(str, value)))[:4])
        is_usual = value is None or value == USUAL.get(name, "") or str(value).startswith("_")
        if not is_usual and (is_marked or not name.startswith("marker")):
            words.append(f"{SHORT.get(name, name)}={rounded(str(value))}")
    seen = ""
    for name in COLOURS:
        value = getattr(artist, f"get_{name}", str)()
        colours = _colours(value) if is_marked or not name.startswith("marker") else ""
        if colours not in ("", seen):
            words.append(f"{name}={colours}")
        seen = seen or colours
    return " ".join(words)


#: what an artist was given to draw, by its kind: the first that fits
DATA = {
    Line3DCollection: lambda artist: _pieces(artist._segments3d),
    Path3DCollection: lambda artist: (
        f"{array(np.transpose(artist._offsets3d))} sizes {array(artist.get_sizes())}"
    ),
    Poly3DCollection: lambda artist: array(artist._faces),
    LineCollection: lambda artist: _pieces(artist.get_segments()),
    PathCollection: lambda artist: f"{array(artist.get_offsets())} sizes {array(artist.get_sizes())}",
    Collection: lambda artist: _pieces([path.vertices for path in artist.get_paths()]),
    Line2D: lambda artist: f"x {array(artist.get_xdata(orig=False))} y {array(artist.get_ydata(orig=False))}",
    Circle: lambda artist: array([*artist.center, artist.radius]),
    Artist: lambda _: "",
}


def _pieces(pieces):
    return f"{len(pieces)} of {'; '.join(array(each) for each in pieces[:3])}"


def _data(artist):
    return next(words(artist) for kind, words in DATA.items() if isinstance(artist, kind))


def _text(text):
    at = text.get_position_3d() if hasattr(text, "get_position_3d") else text.get_position()
    words = f"{text.get_text()!r} at {array(at)}"
    if text.axes is not None:
        transforms = {"data": text.axes.transData, "axes": text.axes.transAxes}
        words += "".join(f" in {name}" for name, each in transforms.items() if text.get_transform() == each)
    if hasattr(text, "xyann"):
        words += f" of {array(text.xy)} {text.anncoords}"
        arrow = text.arrowprops or {}
        words += "".join(
            f" {SHORT.get(name, name)}={value}" for name, value in arrow.items() if name != "relpos"
        )
    if box := text.get_bbox_patch():
        words += f" box {_looks(box)}"
    return f"{words} {_looks(text)}"


def _axis(ax, name):
    axis = getattr(ax, f"{name}axis")
    label = axis.get_label()
    low, high = getattr(ax, f"get_{name}lim")()
    scale = axis.get_scale()
    words = f"{name}: {label.get_text()!r} from {number(low)} to {number(high)} {scale} pad {axis.labelpad:g}"
    locator = axis.get_major_locator()
    if isinstance(locator, FixedLocator):
        ticks = locator()
        labels = axis.get_major_formatter().format_ticks(ticks)
        words += f" ticks {array(ticks)} {labels}"
    else:
        words += f" {type(locator).__name__}"
    return f"{words}{' grid' if axis._major_tick_kw.get('gridOn') else ''}"


def _legend(legend):
    names, anchor, at = [text.get_text() for text in legend.get_texts()], legend._bbox_to_anchor, ""
    if anchor is not None:
        parent = legend.parent
        across = parent.transFigure if isinstance(parent, Figure) else parent.transAxes
        at = f" at {array(across.inverted().transform(anchor.p0))}"
    return f"legend {names} loc {legend._loc_real} columns {legend._ncols}{at}"


def figure(drawn):
    """A figure as it was told to be drawn: what its axes and artists were given, nothing that is laid out."""
    engine = drawn.get_layout_engine()
    lines = [f"figure {array(drawn.get_size_inches())} {type(engine).__name__}"]
    lines += [f"  {_legend(legend)}" for legend in drawn.legends]
    lines += [f"  text {_text(text)}" for text in drawn.texts]
    for ax in drawn.axes:
        spec = ax.get_subplotspec()
        where = (
            f"cell {spec.rowspan.start} {spec.colspan.start} of {spec.get_gridspec().get_geometry()}"
            if spec
            else ""
        )
        if engine is None:
            where += f" at {array(ax.get_position(original=True).bounds)}"
        spines = [name for name, spine in ax.spines.items() if spine.get_visible()]
        lines.append(f"  {type(ax).__name__} {where} aspect={ax.get_aspect()} spines={','.join(spines)}")
        for side in ("center", "left", "right"):
            if title := ax.get_title(loc=side):
                lines.append(f"    title {side} {title!r}")
        lines += [f"    {_axis(ax, name)}" for name in ("x", "y", "z") if hasattr(ax, f"{name}axis")]
        if legend := ax.get_legend():
            lines.append(f"    {_legend(legend)}")
        bars = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
        for artist in (
            *ax.lines,
            *ax.collections,
            *(patch for patch in ax.patches if patch not in bars),
            *ax.images,
        ):
            lines.append(f"    {type(artist).__name__} {_data(artist)} {_looks(artist)}")
        for looks, alike in groupby(bars, _looks):
            values = [[*bar.get_xy(), bar.get_width(), bar.get_height()] for bar in alike]
            lines.append(f"    Rectangle {array(values)} {looks}")
        lines += [f"    text {_text(text)}" for text in ax.texts]
    return "\n".join(line.rstrip() for line in lines) + "\n"
