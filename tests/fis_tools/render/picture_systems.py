"""Systems that are hard to draw, and what pictures are asked about."""

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from fis_tools.model import FuzzySystem, Variable
from tests.fis_tools.sample_controllers import FORCE_TERMS, FORCE_X, force, gaussian_terms, table_system

_AMOUNTS = ("extremely", "rather", "moderately", "slightly")
NINE = (
    *(f"{amount} negative" for amount in _AMOUNTS),
    "about zero",
    *(f"{amount} positive" for amount in reversed(_AMOUNTS)),
)


def nine_terms_system() -> FuzzySystem:
    """81 rules over long names."""
    inputs = (
        Variable("temperature_error", "degC", -20.0, 20.0, gaussian_terms(NINE, -20.0, 20.0, 0.4)),
        Variable("rate_of_change", "degC/min", -2.0, 2.0, gaussian_terms(NINE, -2.0, 2.0, 0.4)),
    )
    output = Variable("heating_power", "kW", -5.0, 5.0, gaussian_terms(NINE, -5.0, 5.0, 0.4), default=0.0)
    table = [NINE[int(np.clip(12 - row - column, 0, 8))] for row in range(9) for column in range(9)]
    return table_system("heater", inputs, output, table)


def autopilot_system() -> FuzzySystem:
    """125 rules over three inputs."""
    inputs = tuple(
        Variable(name, unit, -end, end, gaussian_terms(FORCE_TERMS, -end, end))
        for name, unit, end in (("pitch", "deg", 30.0), ("pitch_rate", "deg/s", 5.0), ("speed", "m/s", 10.0))
    )
    output = force("elevator")
    table = [FORCE_TERMS[(12 - a - b - c) // 3] for a in range(5) for b in range(5) for c in range(5)]
    return table_system("autopilot", inputs, output, table)


def one_input_system() -> FuzzySystem:
    return table_system("damper", FORCE_X.inputs[1:], FORCE_X.outputs[0], ["PL", "PS", "ZE", "NS", "NL"])


def words_of(ax: Axes) -> list[Text]:
    """Every text of axes that is seen."""
    titles = [ax.title, ax._left_title, ax._right_title]  # type: ignore[attr-defined]
    labels = [ax.xaxis.label, ax.yaxis.label, *ax.get_xticklabels(), *ax.get_yticklabels()]
    return [text for text in (*titles, *labels, *ax.texts) if text.get_text() and text.get_visible()]


def seen_words(figure: Figure) -> list[tuple[Text, Bbox]]:
    """Lay a figure out as it is drawn; return its texts, and the box of each in points of the picture."""
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    titles = [figure._suptitle] if figure._suptitle else []  # type: ignore[attr-defined]
    texts = [*titles, *figure.texts]
    for ax in figure.axes:
        if ax.name == "3d":
            texts += [text for text in (ax.title, *ax.texts) if text.get_text()]
            continue
        low, high = sorted(ax.get_xlim())
        bottom, top = sorted(ax.get_ylim())
        x_off = {text for text in ax.get_xticklabels() if not low <= text.get_position()[0] <= high}
        y_off = {text for text in ax.get_yticklabels() if not bottom <= text.get_position()[1] <= top}
        texts += [text for text in words_of(ax) if text not in x_off | y_off]
    return [(text, text.get_window_extent()) for text in dict.fromkeys(texts)]


def collisions(figure: Figure, boxes: list[tuple[Text, Bbox]] | None = None, slack: float = 1.0) -> list[str]:
    """Tell which texts of a figure run into one another or over its edge, by more than some points."""
    boxes = seen_words(figure) if boxes is None else boxes
    overlaps = [
        f"{word.get_text()!r} and {other.get_text()!r}"
        for (word, box), (other, beside) in combinations(boxes, 2)
        if min(box.x1, beside.x1) - max(box.x0, beside.x0) > slack
        and min(box.y1, beside.y1) - max(box.y0, beside.y0) > slack
    ]
    page = figure.bbox.padded(slack)
    outside = [text for text, box in boxes if Bbox.union([page, box]).bounds != page.bounds]
    return overlaps + [f"{text.get_text()!r} and the edge" for text in outside]
