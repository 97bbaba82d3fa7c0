"""Membership functions, and one inference step by step: inputs, the rules that fire, the outputs."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fis_tools.array_types import Floats
from fis_tools.engines.inference import Inference, OutputInference
from fis_tools.model import (
    And,
    Between,
    Expression,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Rule,
    Variable,
    peak,
    sample,
)
from fis_tools.model.intervals import UPPER, bound_of, require_type_1, sampled_bounds
from fis_tools.model.operators import AND_OPERATORS
from fis_tools.model.systems import require_mamdani
from fis_tools.render import lettering
from fis_tools.render.theme import LARGE, LIGHT, MEDIUM, SMALL, Theme, dress
from fis_tools.words.text import METHODS, SHOWN_FROM, number, quantity, sentence, with_unit

#: Names of terms may take this share of the height of axes.
_MOST_ROOM = 0.55
_APART = 0.08


def memberships(variable: Variable, ax: Axes, value: float | None = None, *, theme: Theme = LIGHT) -> Axes:
    """Draw the membership functions of a variable, each named over its peak.

    Parameters
    ----------
    variable : Variable
        A variable without problems.
    ax : Axes
        Where to draw.
    value : float, optional
        A value of the variable, to be marked: what belongs to its terms how far is marked on the curves and
        written above. It is clipped to the universe.
    theme : Theme
        Colours.
    """
    x = variable.universe
    for index, term in enumerate(variable.terms):
        lower, upper = sampled_bounds(variable, term)
        if isinstance(term.membership, Between):
            ax.plot(x, lower, linewidth=1.0, clip_on=False, **theme.line(index))
            ax.fill_between(x, lower, upper, color=theme.line(index)["color"], alpha=0.2, linewidth=0.0)
        ax.plot(x, upper, linewidth=1.8, clip_on=False, **theme.line(index))
    room = _name(variable, ax, theme)
    _frame(variable, ax, 1.0 / (1.0 - room))
    if value is not None:
        _mark(variable, variable.memberships, value, ax, theme)
    ax.spines["left"].set_bounds(0.0, 1.0)
    dress(ax, theme)
    return ax


def _frame(variable: Variable, ax: Axes, top: float) -> None:
    """Set axes to the range of a variable and to degrees of membership."""
    ax.set(xlim=(variable.minimum, variable.maximum), ylim=(0.0, top), yticks=(0.0, 0.5, 1.0))
    ax.set(xlabel=with_unit(variable), ylabel="membership")
    lettering.few_ticks(ax)
    ax.spines[["top", "right"]].set_visible(False)


def _name(variable: Variable, ax: Axes, theme: Theme) -> float:
    """Write each term's name over its peak, one line above the other; return the share of height taken."""
    across, down = lettering.inches(ax)
    tops = [replace(term, membership=bound_of(term.membership, UPPER)) for term in variable.terms]
    peaks = [across * (peak(variable, top) - variable.minimum) / variable.span for top in tops]
    most_lines = max(1, int((_MOST_ROOM * down - 0.05) / lettering.height("", SMALL)))
    names = [term.name for term in variable.terms]
    widths = [1.0, 0.6, 0.45, 0.3, 0.2, 0.15, 0.1]
    for share in widths:
        texts = [lettering.shortened(name, share * across, SMALL) for name in names]
        centres, levels = _lines(texts, peaks, across)
        if max(levels) < most_lines:
            break
    over: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    over |= {"ha": "center", "va": "bottom"}
    for index, (text, centre, level) in enumerate(zip(texts, centres, levels, strict=True)):
        up, colour = 2 + lettering.LINE_SPACING * SMALL * level, theme.line(index)["color"]
        ax.annotate(text, (centre / across, 1.0), xytext=(0, up), color=colour, fontsize=SMALL, **over)
    return min(0.7, (lettering.height("\n" * max(levels), SMALL) + 0.05) / down)


def _lines(texts: list[str], peaks: list[float], across: float) -> tuple[list[float], list[int]]:
    """Return each name's centre, inside the axes, and the lowest line on which it overlaps no other."""
    centres, levels = [0.0] * len(texts), [0] * len(texts)
    ends: list[float] = []
    for index in np.argsort(peaks, kind="stable"):
        length = lettering.width(texts[index], SMALL)
        centre = float(np.clip(peaks[index], 0.5 * length, max(0.5 * length, across - 0.5 * length)))
        start = centre - 0.5 * length
        level = next((level for level, end in enumerate(ends) if end + _APART <= start), len(ends))
        ends[level : level + 1] = [start + length]
        centres[index], levels[index] = centre, level
    return centres, levels


def _mark(variable: Variable, functions: Floats, value: float, ax: Axes, theme: Theme) -> None:
    """Draw a value as a line, with its membership in each term."""
    clipped = float(np.clip(value, variable.minimum, variable.maximum))
    ax.plot([clipped, clipped], [0.0, 1.0], color=theme.ink, linewidth=1.2, zorder=3)
    belongs = []
    for index, (term, function) in enumerate(zip(variable.terms, functions, strict=True)):
        membership = float(np.interp(clipped, variable.universe, function))
        if membership >= SHOWN_FROM:
            belongs.append((membership, f"{term.name}\u00a0{membership:.2f}"))
            colour = theme.line(index)["color"]
            ax.plot(clipped, membership, "o", color=colour, mec=theme.paper, ms=6, zorder=4, clip_on=False)
    terms = ", ".join(words for _, words in sorted(belongs, key=lambda pair: -pair[0])) or "none of its terms"
    note = f" (taken as {number(clipped)})" if clipped != value else ""
    across, _ = lettering.inches(ax)
    words = f"{variable.name} = {quantity(variable, value)}{note}: {terms}"
    ax.set_title(lettering.broken(words, across, MEDIUM), loc="left")


#: How much of the colour of a curve its area has.
_PALE, _FULL = 0.25, 0.55


def statement_panel(
    inference: Inference, rule: Rule, variable: Variable, ax: Axes, theme: Theme = LIGHT
) -> Axes:
    """Draw a rule's statement on an input: its term, and the degree of the inferred value."""
    column = [v.name for v in inference.system.inputs].index(variable.name)
    value = float(inference.clipped[column])
    words = []
    for term, is_denied in _named_terms(rule.antecedent, variable.name):
        index = variable.term_index(term)
        degree = float(inference.memberships[column][index])
        curve = sample(variable, variable.terms[index])
        degree, curve = (1.0 - degree, 1.0 - curve) if is_denied else (degree, curve)
        line = theme.line(index)
        _fill_up_to(ax, variable, curve, degree, line, _PALE)
        ax.plot([value, variable.maximum], [degree, degree], color=line["color"], linewidth=0.8)
        ax.plot(value, degree, "o", color=line["color"], mec=theme.paper, ms=5, zorder=4, clip_on=False)
        words.append(f"{'not ' if is_denied else ''}{term} {degree:.2f}")
    if words:
        ax.plot([value, value], [0.0, 1.0], color=theme.ink, linewidth=1.0, zorder=3)
    return _finished(ax, variable, ", ".join(words) or "any", theme, is_empty=not words)


def conclusion_panel(variable: Variable, rule: Rule, strength: float, ax: Axes, theme: Theme = LIGHT) -> Axes:
    """Draw a rule's conclusion on an output: its terms cut at the rule's strength times their weight."""
    words = []
    for consequent in (each for each in rule.consequents if each.variable == variable.name):
        index = variable.term_index(consequent.term)
        cut = strength * consequent.weight
        _fill_up_to(ax, variable, sample(variable, variable.terms[index]), cut, theme.line(index), _FULL)
        weight = "" if consequent.weight == 1.0 else f"{strength:.2f} × {number(consequent.weight)} = "
        words.append(f"{consequent.term} {weight}{cut:.2f}")
    return _finished(ax, variable, ", ".join(words) or "nothing", theme, is_empty=not words)


def _fill_up_to(
    ax: Axes, variable: Variable, curve: Floats, height: float, line: dict[str, Any], alpha: float
) -> None:
    """Draw a membership function, filled up to a height."""
    ax.fill_between(variable.universe, np.minimum(curve, height), color=line["color"], alpha=alpha, lw=0)
    ax.plot(variable.universe, curve, linewidth=1.5, clip_on=False, **line)


def output_panel(output: OutputInference, system: FuzzySystem, ax: Axes, theme: Theme = LIGHT) -> Axes:
    """Draw the aggregated output with its cut terms, and the defuzzified value."""
    variable = output.variable
    imply = AND_OPERATORS[system.implication]
    for index, (curve, cut) in enumerate(zip(variable.memberships, output.cuts, strict=True)):
        if cut > 0:
            implied = imply(np.full(len(curve), cut), curve)
            ax.plot(variable.universe, implied, linewidth=1.2, clip_on=False, **theme.line(index))
    ax.fill_between(output.universe, output.aggregated, color=theme.muted, alpha=_PALE, lw=0)
    ax.plot(output.universe, output.aggregated, color=theme.ink, linewidth=1.5, clip_on=False)
    style = (0, (2, 1)) if output.is_default else "-"
    ax.axvline(output.value, color=theme.ink, linewidth=2.0, linestyle=style)
    ax.plot(output.value, 0.0, "^", color=theme.ink, mec=theme.paper, ms=9, clip_on=False, zorder=4)
    method = METHODS[system.defuzzifier_of(variable)]
    reason = "the default: no rule fires" if output.is_default else method
    words = f"{variable.name} = {quantity(variable, output.value)}, {reason}"
    ax.set_title(lettering.broken(words, lettering.inches(ax)[0], MEDIUM), loc="left")
    _frame(variable, ax, 1.0)
    dress(ax, theme)
    ax.title.set_fontweight("bold")
    return ax


def _named_terms(expression: Expression, name: str, *, is_denied: bool = False) -> Iterator[tuple[str, bool]]:
    """Yield each term of an input in an antecedent, and whether under an odd number of nots."""
    match expression:
        case Is(variable, term):
            if variable == name:
                yield term, is_denied
        case Not(operand):
            yield from _named_terms(operand, name, is_denied=not is_denied)
        case Hedged(_, operand):
            yield from _named_terms(operand, name, is_denied=is_denied)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from _named_terms(operand, name, is_denied=is_denied)


def _finished(ax: Axes, variable: Variable, words: str, theme: Theme, *, is_empty: bool) -> Axes:
    """Return a panel's axes without ticks, with words above them."""
    ax.set(xlim=(variable.minimum, variable.maximum), ylim=(0.0, 1.0), xticks=(), yticks=())
    ax.spines[["top", "right", "left"]].set_visible(False)
    dress(ax, theme)
    across, _ = lettering.inches(ax)
    ink, shown = theme.muted if is_empty else theme.ink, lettering.shortened(words, across, SMALL)
    ax.set_title(shown, loc="left", size=SMALL, color=ink, pad=4, parse_math=False)
    return ax


#: Lengths in inches.
_LEFT, _GAP, _RIGHT = 0.6, 0.5, 0.25
_WIDTH, _CURVES, _RULE, _OUTPUT = 2.7, 1.4, 0.5, 1.2
#: What stands over and under panels: titles, numbers, names of axes.
_HEAD, _TITLE, _AXIS, _WORDS, _OVER = 0.4, 0.5, 0.5, 0.25, 0.12


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
    system, strengths = inference.system, inference.firing_strengths
    order = [int(p) for p in np.argsort(-strengths, kind="stable") if strengths[p] >= SHOWN_FROM]
    require_mamdani((system,), "the picture of an inference")
    require_type_1((system,), "the picture of an inference")
    columns = len(system.inputs) + len(system.outputs)
    width = _LEFT + columns * _WIDTH + (columns - 1) * _GAP + _RIGHT
    rules = {
        index: lettering.broken(
            f"rule {index + 1} fires at {strengths[index]:.2f}: {sentence(system.rules[index])}",
            width - _LEFT - _RIGHT,
            MEDIUM,
        )
        for index in order[:most_rules]
    }
    heights = [_HEAD + _TITLE, _CURVES, _AXIS]
    for words in rules.values():
        heights += [_OVER + lettering.height(words, MEDIUM) + _WORDS, _RULE, 0.5 * _OVER]
    heights += [_TITLE, _OUTPUT, _AXIS + _WORDS]
    figure = Figure(figsize=(width, sum(heights)), facecolor=theme.paper)
    sides = {"left": _LEFT / width, "right": 1.0 - _RIGHT / width, "top": 1.0, "bottom": 0.0}
    grid = figure.add_gridspec(
        len(heights), columns, height_ratios=heights, hspace=0.0, wspace=_GAP / _WIDTH, **sides
    )

    def write(row: int, words: str, size: float, colour: str, across: float = 0.0) -> None:
        box = grid[row, 0].get_position(figure)
        x, y = box.x0 + across / width, box.y1 - _OVER / sum(heights)
        figure.text(x, y, words, size=size, color=colour, va="top", parse_math=False)

    steps = f"and: {system.and_operator}, or: {system.or_operator}, defuzzifier: {system.defuzzifier}"
    write(0, system.name, LARGE, theme.ink)
    write(0, steps, SMALL, theme.muted, lettering.width(system.name, LARGE) + 0.2)
    for column, variable in enumerate(system.inputs):
        ax = figure.add_subplot(grid[1, column])
        memberships(variable, ax, float(inference.inputs[column]), theme=theme)
    for row, (rule, words) in enumerate(rules.items(), start=1):
        write(3 * row, words, MEDIUM, theme.ink)
        axes = iter([figure.add_subplot(grid[3 * row + 1, column]) for column in range(columns)])
        for variable in system.inputs:
            statement_panel(inference, system.rules[rule], variable, next(axes), theme)
        for variable in system.outputs:
            conclusion_panel(variable, system.rules[rule], float(strengths[rule]), next(axes), theme)
    write(-3, _left_over(inference, order, most_rules), SMALL, theme.muted)
    for column, output in enumerate(inference.outputs, start=len(system.inputs)):
        output_panel(output, system, figure.add_subplot(grid[-2, column]), theme)
    return figure


def _left_over(inference: Inference, order: list[int], most_rules: int) -> str:
    """Return how many more rules fire than are shown, and how strongly at most."""
    if not order:
        return "no rule fires"
    left = int(np.count_nonzero(inference.firing_strengths)) - len(order[:most_rules])
    if not left:
        return "no other rule fires"
    rest = np.sort(inference.firing_strengths)[-len(order[:most_rules]) - 1]
    return (
        f"{left} more rules fire, at {rest:.2g} or less" if left > 1 else f"1 more rule fires, at {rest:.2g}"
    )
