"""One inference step by step, in one figure: inputs, the rules that fire, the outputs."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fis_tools.engines.inference import Inference
from fis_tools.model.weighing import require_mamdani
from fis_tools.render import lettering
from fis_tools.render.inference_view import conclusion_panel, output_panel, statement_panel
from fis_tools.render.membership_curves import memberships
from fis_tools.render.theme import LARGE, LIGHT, MEDIUM, SMALL, Theme
from fis_tools.words.text import SHOWN_FROM, sentence

#: Lengths in inches.
_LEFT, _GAP, _RIGHT = 0.6, 0.5, 0.25
_WIDTH, _CURVES, _RULE, _OUTPUT = 2.7, 1.4, 0.5, 1.2
#: What stands over and under panels: titles, numbers, names of axes.
_HEAD, _TITLE, _AXIS, _WORDS = 0.4, 0.5, 0.5, 0.25


def inference_figure(inference: Inference, *, most_rules: int = 6, theme: Theme = LIGHT) -> Figure:
    """Draw an inference step by step.

    A column is an input or an output. The first row marks how far each input belongs to its terms; then each
    rule that fires has a row, the strongest first, with what it asks and what it concludes; the last row is
    what the conclusions add up to, and the number that becomes of it.

    Parameters
    ----------
    inference : Inference
        What `fis_tools.engines.inference.infer` returns.
    most_rules : int
        How many rules are drawn; the others that fire are counted.
    theme : Theme
        Colours.
    """
    system = inference.system
    strengths = inference.firing_strengths
    order = [int(p) for p in np.argsort(-strengths, kind="stable") if strengths[p] >= SHOWN_FROM]
    require_mamdani((system,), "the picture of an inference")
    page = _Page(inference, order[:most_rules], theme)
    for column, variable in enumerate(system.inputs):
        memberships(variable, page.axes(column, _CURVES), float(inference.inputs[column]), theme=theme)
    page.down(_CURVES + _AXIS)
    for place in order[:most_rules]:
        page.rule(place)
    page.write(_left_over(inference, order, most_rules), SMALL, theme.muted)
    page.down(_TITLE)
    for column, output in enumerate(inference.outputs, start=len(system.inputs)):
        output_panel(
            output,
            system.defuzzifier,
            page.axes(column, _OUTPUT),
            implication=system.implication,
            theme=theme,
        )
    return page.figure


def _left_over(inference: Inference, order: list[int], most_rules: int) -> str:
    if not order:
        return "no rule fires"
    left = int(np.count_nonzero(inference.firing_strengths)) - len(order[:most_rules])
    if not left:
        return "no other rule fires"
    rest = np.sort(inference.firing_strengths)[-len(order[:most_rules]) - 1]
    return (
        f"{left} more rules fire, at {rest:.2g} or less" if left > 1 else f"1 more rule fires, at {rest:.2g}"
    )


class _Page:
    """A figure that is filled from the top, and how far it is filled."""

    def __init__(self, inference: Inference, rules: list[int], theme: Theme) -> None:
        self.inference, self.theme = inference, theme
        system = inference.system
        columns = len(system.inputs) + len(system.outputs)
        self.width = _LEFT + columns * _WIDTH + (columns - 1) * _GAP + _RIGHT
        self.texts = {place: self._sentence(place) for place in rules}
        rows = sum(self._height(text) for text in self.texts.values())
        self.height = _HEAD + _TITLE + _CURVES + _AXIS + rows + _WORDS + _TITLE + _OUTPUT + _AXIS
        self.figure = Figure(figsize=(self.width, self.height), facecolor=theme.paper)
        self.top = 0.0
        steps = f"and: {system.and_operator}, or: {system.or_operator}, defuzzifier: {system.defuzzifier}"
        self.write(system.name, LARGE, theme.ink)
        self.write(steps, SMALL, theme.muted, _LEFT + lettering.width(system.name, LARGE) + 0.2)
        self.down(_HEAD + _TITLE)

    def _sentence(self, place: int) -> str:
        rule = self.inference.system.rules[place]
        strength = self.inference.firing_strengths[place]
        words = f"rule {place + 1} fires at {strength:.2f}: {sentence(rule)}"
        return lettering.broken(words, self.width - _LEFT - _RIGHT, MEDIUM)

    @staticmethod
    def _height(text: str) -> float:
        return 0.12 + lettering.height(text, MEDIUM) + _WORDS + _RULE + 0.06

    def axes(self, column: int, height: float) -> Axes:
        left = _LEFT + column * (_WIDTH + _GAP)
        bottom = self.height - self.top - height
        place = (left / self.width, bottom / self.height, _WIDTH / self.width, height / self.height)
        ax: Axes = self.figure.add_axes(place)
        return ax

    def down(self, inches: float) -> None:
        self.top += inches

    def write(self, words: str, size: float, colour: str, left: float = _LEFT) -> None:
        y = 1.0 - (self.top + 0.12) / self.height
        self.figure.text(left / self.width, y, words, size=size, color=colour, va="top", parse_math=False)

    def rule(self, place: int) -> None:
        """Draw a row of what a rule asks and concludes."""
        system, theme = self.inference.system, self.theme
        rule, text = system.rules[place], self.texts[place]
        self.write(text, MEDIUM, theme.ink)
        start = self.top
        self.down(0.12 + lettering.height(text, MEDIUM) + _WORDS)
        for column, variable in enumerate(system.inputs):
            statement_panel(self.inference, rule, variable, self.axes(column, _RULE), theme=theme)
        strength = float(self.inference.firing_strengths[place])
        for column, variable in enumerate(system.outputs, start=len(system.inputs)):
            ax = self.axes(column, _RULE)
            conclusion_panel(variable, rule.consequents, strength, ax, theme=theme)
        self.top = start + self._height(text)
