"""Charts of the page, as options of its library (Apache ECharts)."""

from typing import Any

import numpy as np
from nicegui import ui

from fis_tools.analysis.arrays import Surface
from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem
from fis_tools.words.text import with_unit

Options = dict[str, Any]

#: of a surface, from its lowest to its highest
RAMP = ("#1f5fa8", "#8fb3d9", "#f1f2f4", "#e9ab86", "#be5014")


def draw(place: ui.echart, options: Options) -> None:
    """Draw a chart, again and again: past the page's own state, which would watch every point."""
    if place.options["series"]:
        place.run_chart_method("setOption", options)
    else:
        place.options.update(options)


def axis(name: str, gap: int = 26, **more: Any) -> Options:
    """Return an axis with its name beside it."""
    options = {"type": "value", "name": name, "nameLocation": "middle", "nameGap": gap}
    return options | {"axisTick": {"show": False}} | more


def chart(x: Options, y: Options, series: list[Options], **more: Any) -> Options:
    """Return a chart; several named series have a legend."""
    names = [one["name"] for one in series if "name" in one]
    legend = {"type": "scroll", "top": 0, "itemHeight": 9, "data": names} if names else {"show": False}
    grid = {"left": 58, "right": 14, "top": 28 if names else 10, "bottom": 42}
    options: Options = {"animation": False, "grid": grid, "legend": legend}
    return options | {"xAxis": x, "yAxis": y, "series": series} | more


def line(points: Floats, colour: str, **more: Any) -> Options:
    """Return a line through points of shape (n, 2)."""
    return {"type": "line", "showSymbol": False, "color": colour, "data": points.round(6).tolist()} | more


def dots(points: Floats, colour: str, size: int, **more: Any) -> Options:
    """Return points of shape (n, 2)."""
    options = {"type": "scatter", "symbolSize": size, "silent": True, "color": colour}
    return options | {"data": points.round(6).tolist()} | more


def surface(found: Surface) -> Options:
    """Return an output over two inputs."""
    rows, columns = np.indices(found.values.shape)
    values = np.round(np.nan_to_num(found.values), 9)
    points = np.stack([columns.ravel(), rows.ravel(), values.ravel()], axis=1).tolist()
    x, y = (
        axis(with_unit(one), gap, type="category", data=[f"{point:.3g}" for point in at])
        | {"axisLabel": {"interval": (len(at) - 1) // 4 - 1}}
        for one, at, gap in ((found.x_variable, found.x, 26), (found.y_variable, found.y, 40))
    )
    ends = {"min": found.output.minimum, "max": found.output.maximum}
    colours = {**ends, "show": False, "inRange": {"color": list(RAMP)}}
    still = {"progressive": 0, "silent": True, "emphasis": {"disabled": True}}
    return chart(x, y, [{"type": "heatmap", "data": points, **still}], visualMap=colours)


def curve(system: FuzzySystem, points: Floats, values: Floats) -> Options:
    """Return an output over the only input."""
    only, output = system.inputs[0], system.outputs[0]
    x = axis(with_unit(only), min=only.minimum, max=only.maximum)
    return chart(x, axis(with_unit(output), 40), [line(np.stack([points, values], axis=1), RAMP[0])])
