"""Charts, by Apache ECharts: what they show, as its options."""

from typing import Any

import numpy as np
from nicegui import ui

from fis_tools.analysis.arrays import Surface
from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem, Variable
from fis_tools.words import text
from plain_files.document import html

Options = dict[str, Any]

#: of a surface, from its lowest to its highest; each chart is readable on light and on dark
RAMP = ("#1f5fa8", "#8fb3d9", "#f1f2f4", "#e9ab86", "#be5014")
BEFORE, AFTER = "#8d97a1", "#3b82c4"
AXIS_COLOURS = ("#c9601f", AFTER, "#3f8f4a")
#: numbers at the scale of a surface
SCALE = 5


class Chart(ui.echart, component="chart.js"):
    """A chart that is drawn again and again, in the colours of the page; see ``chart.js``.

    Parameters
    ----------
    kind : str
        Its class in ``style.css``.
    """

    def __init__(self, kind: str) -> None:
        super().__init__({})
        self.classes(kind)

    def draw(self, options: Options) -> None:
        """Draw what changes."""
        self.run_method("draw", options)


def axis(name: str, gap: int = 26, **more: Any) -> Options:
    """Return an axis with its name beside it."""
    options = {"type": "value", "name": name, "nameLocation": "middle", "nameGap": gap}
    return options | {"axisTick": {"show": False}} | more


def chart(x: Options, y: Options, series: list[Options], **more: Any) -> Options:
    """Return a chart; several named series have a legend."""
    names = [entry["name"] for entry in series if "name" in entry]
    legend = {"type": "scroll", "top": 0, "itemHeight": 9, "data": names} if names else {"show": False}
    grid = {"left": 58, "right": 14, "top": 28 if names else 10, "bottom": 42}
    options: Options = {"animation": False, "grid": grid, "legend": legend}
    return options | {"xAxis": x, "yAxis": y, "series": series} | more


def line(points: Floats, colour: str, **more: Any) -> Options:
    """Return a line through points of shape (n, 2)."""
    return {"type": "line", "showSymbol": False, "color": colour, "data": points.round(6).tolist()} | more


def surface(heights: Surface) -> Options:
    """Return an output over two inputs."""
    rows, columns = np.indices(heights.values.shape)
    values = np.round(np.nan_to_num(heights.values), 9)
    points = np.stack([columns.ravel(), rows.ravel(), values.ravel()], axis=1).tolist()
    x, y = (
        axis(text.with_unit(shown_axis), gap, type="category", data=[f"{point:.3g}" for point in at])
        | {"axisLabel": {"interval": (len(at) - 1) // 4 - 1}}
        for shown_axis, at, gap in ((heights.x_variable, heights.x, 26), (heights.y_variable, heights.y, 40))
    )
    ends = {"min": heights.output.minimum, "max": heights.output.maximum}
    colours = {**ends, "show": False, "inRange": {"color": list(RAMP)}}
    unanimated = {"progressive": 0, "silent": True, "emphasis": {"disabled": True}}
    return chart(x, y, [{"type": "heatmap", "data": points, **unanimated}], visualMap=colours)


def curve(system: FuzzySystem, points: Floats, values: Floats) -> Options:
    """Return an output over the only input."""
    only, output = system.inputs[0], system.outputs[0]
    x = axis(text.with_unit(only), min=only.minimum, max=only.maximum)
    return chart(x, axis(text.with_unit(output), 40), [line(np.stack([points, values], axis=1), AFTER)])


def scale(output: Variable) -> str:
    """Return the scale of a surface as HTML: its colours, numbers along them, and what they are."""
    ramp = html.element("i", style=f"background: linear-gradient(to right, {', '.join(RAMP)})")
    marks = np.linspace(output.minimum, output.maximum, SCALE)
    numbers = (html.element("span", f"{mark:.3g}") for mark in marks)
    return ramp + html.element("p", *numbers) + html.element("p", text.with_unit(output))
