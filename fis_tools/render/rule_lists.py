"""Rules as a list, for rule bases that are not a table."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes

from fis_tools.model import And, Consequent, FuzzySystem, Is, Rule
from fis_tools.render import lettering
from fis_tools.render.theme import LIGHT, Theme, dress, readable_on, term_colours
from fis_tools.words.text import antecedent_words, number


def legend(system: FuzzySystem) -> str:
    """Say how the names of a system's plain rules are to be read: the inputs in order, then the outputs."""
    return f"{' · '.join(v.name for v in system.inputs)} → {', '.join(v.name for v in system.outputs)}"


def rule_names(system: FuzzySystem) -> list[str]:
    """Name each rule by its number and its words.

    A rule that asks for at most one term of each input, and for nothing else, is told by its terms in the
    order of `legend`, ``any`` for an input it does not ask for: ``4: near · still → PS``. Others are told
    with the names of their inputs.
    """
    return [f"{place}: {_name(system, rule)}" for place, rule in enumerate(system.rules, start=1)]


def plain_statements(rule: Rule) -> dict[str, str] | None:
    """Return the term that a rule asks for of each input, or None where it is not a plain conjunction."""
    statements = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
    asked = {statement.variable: statement.term for statement in statements if isinstance(statement, Is)}
    return asked if len(asked) == len(statements) else None


def conclusion(consequent: Consequent) -> str:
    """Say the term of a consequent, and its weight where that is not one."""
    weight = "" if consequent.weight == 1.0 else f" × {number(consequent.weight)}"
    return f"{consequent.term}{weight}"


def _name(system: FuzzySystem, rule: Rule) -> str:
    asked = plain_statements(rule)
    if asked is None:
        words = antecedent_words(rule.antecedent)
    else:
        words = " · ".join(asked.get(variable.name, "any") for variable in system.inputs)
    if len(system.outputs) == 1:
        return f"{words} → {conclusion(rule.consequents[0])}"
    return f"{words} → {', '.join(f'{c.variable} {conclusion(c)}' for c in rule.consequents)}"


_SIZES = (9.0, 8.5, 8.0, 7.5, 7.0, 6.5)
_MARGIN, _GAP = 0.05, 0.15
#: Between rules, and around a coloured conclusion, in sizes of the letters.
_SPACE, _PAD = 0.8, 0.25
#: From one conclusion to the next, in sizes of the letters.
_CHIP = 1.9


@dataclass(frozen=True)
class _Entry:
    """A rule as it is written: its words broken to the room there is."""

    head: str
    antecedent: str
    consequents: tuple[tuple[str, tuple[float, float, float]], ...]

    def height(self, size: float) -> float:
        lines = lettering.LINE_SPACING * (self.antecedent.count("\n") + 1)
        return (max(lines, _CHIP * len(self.consequents)) + _SPACE) * size / lettering.POINTS_AN_INCH


def rule_list(
    system: FuzzySystem, ax: Axes, rules: Sequence[int] | None = None, *, theme: Theme = LIGHT
) -> Axes:
    """List rules as sentences, what each concludes in the colour of its term, as in `rule_matrix`.

    Rules for which the axes have no room are counted at the end.

    Parameters
    ----------
    system : FuzzySystem
        Any system.
    ax : Axes
        Where to write; the axes' own lines are taken away.
    rules : sequence of int, optional
        Which rules, in this order, counted from 0; by default all.
    theme : Theme
        Colours.
    """
    across, down = lettering.inches(ax)
    places = list(range(len(system.rules))) if rules is None else list(rules)
    for size in _SIZES:
        entries = _entries(system, places, across, size)
        heights = [entry.height(size) for entry in entries]
        if sum(heights) <= down:
            break
    ax.set(xlim=(0.0, across), ylim=(down, 0.0), xticks=(), yticks=())
    ax.set_axis_off()
    left, middle = _columns(system, places, across, size)
    top = 0.0
    for shown, (entry, height) in enumerate(zip(entries, heights, strict=True)):
        is_last = shown == len(entries) - 1
        if top + height > down - (0.0 if is_last else 1.5 * size / lettering.POINTS_AN_INCH):
            ax.text(
                left, top, f"and {len(entries) - shown} more rules", va="top", size=size, color=theme.muted
            )
            break
        _write(ax, entry, (left, middle, top), size, theme)
        top += height
    dress(ax, theme)
    return ax


def list_height(system: FuzzySystem, rules: Sequence[int], across: float) -> float:
    """Return how high axes of a width must be to list some rules in the largest letters, in inches."""
    return sum(entry.height(_SIZES[0]) for entry in _entries(system, rules, across, _SIZES[0]))


def _columns(system: FuzzySystem, rules: Sequence[int], across: float, size: float) -> tuple[float, float]:
    """Return where antecedents and where consequents begin."""
    left = _MARGIN + lettering.width(f"{max(rules, default=0) + 1}", size) + _GAP
    widest = max(
        (lettering.width(_words(c), size) for place in rules for c in system.rules[place].consequents),
        default=0,
    )
    return left, max(across - widest - _GAP - _MARGIN, left + 0.4 * across)


def _entries(system: FuzzySystem, rules: Sequence[int], across: float, size: float) -> list[_Entry]:
    left, middle = _columns(system, rules, across, size)
    colours = {
        (variable.name, term.name): (float(red), float(green), float(blue))
        for variable in system.outputs
        for term, (red, green, blue) in zip(variable.terms, term_colours(len(variable.terms)), strict=True)
    }
    entries = []
    for place in rules:
        rule = system.rules[place]
        label = f"[{rule.label}] " if rule.label else ""
        words = f"{label}If {antecedent_words(rule.antecedent)} then"
        consequents = tuple(
            (lettering.shortened(_words(c), across - middle - _MARGIN, size), colours[c.variable, c.term])
            for c in rule.consequents
        )
        broken = lettering.broken(words, middle - left - _GAP, size)
        entries.append(_Entry(f"{place + 1}", broken, consequents))
    return entries


def _words(consequent: Consequent) -> str:
    weight = "" if consequent.weight == 1.0 else f" × {number(consequent.weight)}"
    return f"{consequent.variable} is {consequent.term}{weight}"


def _write(ax: Axes, entry: _Entry, place: tuple[float, float, float], size: float, theme: Theme) -> None:
    left, middle, top = place
    ax.text(left - _GAP, top, entry.head, ha="right", va="top", size=size, color=theme.muted)
    ax.text(
        left, top, entry.antecedent, va="top", size=size, color=theme.ink, linespacing=lettering.LINE_SPACING
    )
    for line, (words, colour) in enumerate(entry.consequents):
        ax.text(
            middle,
            top + _CHIP * line * size / lettering.POINTS_AN_INCH,
            words,
            va="top",
            size=size,
            color=readable_on(colour),
            bbox={
                "facecolor": colour,
                "edgecolor": theme.muted,
                "linewidth": 0.5,
                "boxstyle": f"round,pad={_PAD}",
            },
        )
