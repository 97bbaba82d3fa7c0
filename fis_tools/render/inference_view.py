"""The steps of one inference, each on axes of its own: a statement, a conclusion, the output."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from fis_tools.engines.inference import Inference, OutputInference
from fis_tools.model import And, AndOperator, Consequent, Expression, Hedged, Is, Not, Or, Rule, Variable
from fis_tools.model.membership import sample, sample_terms
from fis_tools.model.operators import AND_OPERATORS
from fis_tools.render import lettering
from fis_tools.render.theme import LIGHT, MEDIUM, SMALL, Theme, dress
from fis_tools.words.text import METHODS, number, quantity, with_unit

#: How much of the colour of a curve its area has.
_PALE, _FULL = 0.25, 0.55


def statement_panel(
    inference: Inference, rule: Rule, variable: Variable, ax: Axes, *, theme: Theme = LIGHT
) -> Axes:
    """Draw what a rule asks of an input, and how far its value fulfils that.

    Parameters
    ----------
    inference : Inference
        What `fis_tools.engines.inference.infer` returns.
    rule : Rule
        One of its system's rules.
    variable : Variable
        One of its system's inputs.
    ax : Axes
        Where to draw.
    theme : Theme
        Colours.
    """
    place = [v.name for v in inference.system.inputs].index(variable.name)
    value = float(inference.clipped[place])
    words = []
    for term, is_denied in _asked(rule.antecedent, variable.name):
        index = variable.term_index(term)
        degree = float(inference.memberships[place][index])
        curve = sample(variable, variable.terms[index])
        degree, curve = (1.0 - degree, 1.0 - curve) if is_denied else (degree, curve)
        line = theme.line(index)
        ax.fill_between(variable.universe, np.minimum(curve, degree), color=line["color"], alpha=_PALE, lw=0)
        ax.plot(variable.universe, curve, linewidth=1.5, clip_on=False, **line)
        ax.plot([value, variable.maximum], [degree, degree], color=line["color"], linewidth=0.8)
        ax.plot(value, degree, "o", color=line["color"], mec=theme.paper, ms=5, zorder=4, clip_on=False)
        words.append(f"{'not ' if is_denied else ''}{term} {degree:.2f}")
    if words:
        ax.plot([value, value], [0.0, 1.0], color=theme.ink, linewidth=1.0, zorder=3)
    _finish(ax, variable, ", ".join(words) or "any", theme, is_empty=not words)
    return ax


def conclusion_panel(
    variable: Variable,
    consequents: tuple[Consequent, ...],
    strength: float,
    ax: Axes,
    *,
    theme: Theme = LIGHT,
) -> Axes:
    """Draw what a rule concludes on an output, its terms cut at the rule's strength times their weight.

    Parameters
    ----------
    variable : Variable
        The output.
    consequents : tuple of Consequent
        What the rule concludes; those on other outputs are left out.
    strength : float
        How strongly the rule fires, before weights.
    ax : Axes
        Where to draw.
    theme : Theme
        Colours.
    """
    words = []
    for consequent in consequents:
        if consequent.variable != variable.name:
            continue
        index = variable.term_index(consequent.term)
        cut = strength * consequent.weight
        curve, line = sample(variable, variable.terms[index]), theme.line(index)
        ax.fill_between(variable.universe, np.minimum(curve, cut), color=line["color"], alpha=_FULL, lw=0)
        ax.plot(variable.universe, curve, linewidth=1.5, clip_on=False, **line)
        weight = "" if consequent.weight == 1.0 else f"{strength:.2f} × {number(consequent.weight)} = "
        words.append(f"{consequent.term} {weight}{cut:.2f}")
    _finish(ax, variable, ", ".join(words) or "nothing", theme, is_empty=not words)
    return ax


def output_panel(
    output: OutputInference,
    defuzzifier: str,
    ax: Axes,
    *,
    implication: AndOperator = "min",
    theme: Theme = LIGHT,
) -> Axes:
    """Draw the aggregated output, the cut terms it is made of, and the number it becomes.

    Parameters
    ----------
    output : OutputInference
        One of the outputs of an inference.
    defuzzifier : str
        How the number comes about, by the system's word for it.
    ax : Axes
        Where to draw.
    implication : str
        How strengths shape the terms.
    theme : Theme
        Colours.
    """
    variable = output.variable
    imply = AND_OPERATORS[implication]
    for index, (curve, cut) in enumerate(zip(sample_terms(variable), output.cuts, strict=True)):
        if cut > 0:
            ax.plot(
                variable.universe,
                imply(np.full(len(curve), cut), curve),
                linewidth=1.2,
                clip_on=False,
                **theme.line(index),
            )
    ax.fill_between(output.universe, output.aggregated, color=theme.muted, alpha=_PALE, lw=0)
    ax.plot(output.universe, output.aggregated, color=theme.ink, linewidth=1.5, clip_on=False)
    ax.axvline(
        output.value, color=theme.ink, linewidth=2.0, linestyle=(0, (2, 1)) if output.is_default else "-"
    )
    ax.plot(output.value, 0.0, "^", color=theme.ink, mec=theme.paper, ms=9, clip_on=False, zorder=4)
    reason = "the default: no rule fires" if output.is_default else METHODS[defuzzifier]
    words = f"{variable.name} = {quantity(variable, output.value)}, {reason}"
    ax.set_title(lettering.broken(words, lettering.inches(ax)[0], MEDIUM), loc="left")
    ax.set(xlim=(variable.minimum, variable.maximum), ylim=(0.0, 1.0), yticks=(0.0, 0.5, 1.0))
    ax.set(xlabel=with_unit(variable), ylabel="membership")
    lettering.few_ticks(ax)
    ax.spines[["top", "right"]].set_visible(False)
    dress(ax, theme)
    ax.title.set_fontweight("bold")
    return ax


def _asked(expression: Expression, name: str, *, is_denied: bool = False) -> Iterator[tuple[str, bool]]:
    """Yield the terms that an antecedent names of an input, and whether under an odd number of nots."""
    match expression:
        case Is(variable, term):
            if variable == name:
                yield term, is_denied
        case Not(operand):
            yield from _asked(operand, name, is_denied=not is_denied)
        case Hedged(_, operand):
            yield from _asked(operand, name, is_denied=is_denied)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from _asked(operand, name, is_denied=is_denied)


def _finish(ax: Axes, variable: Variable, words: str, theme: Theme, *, is_empty: bool) -> None:
    ax.set(xlim=(variable.minimum, variable.maximum), ylim=(0.0, 1.0), xticks=(), yticks=())
    ax.spines[["top", "right", "left"]].set_visible(False)
    dress(ax, theme)
    across, _ = lettering.inches(ax)
    ax.set_title(
        lettering.shortened(words, across, SMALL),
        loc="left",
        size=SMALL,
        color=theme.muted if is_empty else theme.ink,
        pad=4,
        parse_math=False,
    )
