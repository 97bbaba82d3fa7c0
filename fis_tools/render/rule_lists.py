"""Rules in short words, and how much they are used."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from fis_tools.analysis.arrays import FIRED, rule_usage
from fis_tools.array_types import Floats
from fis_tools.model import And, Consequent, FuzzySystem, Is, Rule
from fis_tools.render import lettering
from fis_tools.render.theme import LIGHT, MEDIUM, SMALL, Theme, dress
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


_BAR_SIZES = (6.5, SMALL)
#: Rules with a smaller share that never fire are not drawn along a flight.
_LEAST_SHARE = 0.005
_MOST_BARS = 15


def firing_shares(strengths: Floats) -> Floats:
    """Return the share of each rule in all firing, (num_rules,): its strengths' part of the sum of all.

    Parameters
    ----------
    strengths : (n, num_rules)
        Firing strengths, at least one row.

    Raises
    ------
    ValueError
        If there are no samples.
    """
    mean = rule_usage(strengths).mean_strength
    total = mean.sum()
    return mean / total if total > 0 else mean


def firing_map(
    system: FuzzySystem,
    time_s: Floats,
    strengths: Floats,
    ax: Axes,
    *,
    most_rules: int = 20,
    is_timed: bool = True,
    theme: Theme = LIGHT,
) -> Axes:
    """Draw how strongly rules fire along a flight, those with the largest share at the top.

    Parameters
    ----------
    system : FuzzySystem
        What flew.
    time_s : (n,)
        Ascending; each strength holds until the next time.
    strengths : (n, num_rules)
        Firing strengths, as `fis_tools.analysis.flights.read_flight` gives them.
    ax : Axes
        Where to draw.
    most_rules : int
        How many rules are drawn; the others are counted below.
    is_timed : bool
        Whether ``time_s`` are times, and not numbers of rows.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        If the shapes do not fit, there are no samples, or the times run backwards.
    """
    expected = (len(time_s), len(system.rules))
    if strengths.shape != expected or not len(time_s):
        raise ValueError(f"strengths have shape {strengths.shape}; pass {expected}, one row or more")
    if np.any(np.diff(time_s) < 0):
        raise ValueError("the times run backwards; draw one flight at a time")
    shares = firing_shares(strengths)
    order = np.argsort(-shares, kind="stable")
    is_seen = (shares >= _LEAST_SHARE) | (strengths.max(axis=0) >= FIRED)
    shown = order[is_seen[order]][:most_rules]
    names = rule_names(system)
    hold = time_s[-1] - time_s[-2] if len(time_s) > 1 else 1.0
    x, y = np.append(time_s, time_s[-1] + hold), np.arange(len(shown) + 1) - 0.5
    scale: dict[str, Any] = {"cmap": theme.strength_map, "vmin": 0.0, "vmax": 1.0}
    image = ax.pcolormesh(x, y, strengths[:, shown].T, rasterized=True, **scale)
    _add_scale(ax, image, theme)
    size = _name_rows(ax, system, [f"{names[place]} ({100 * shares[place]:.0f}\u00a0%)" for place in shown])
    left = len(system.rules) - len(shown)
    if left:
        rest = 100 * max(0.0, 1.0 - float(shares[shown].sum()))
        ax.set_title(f"{left} more rules share {rest:.1f} %", loc="right")
    ax.set_xlabel("time (s)" if is_timed else "row")
    ax.grid(visible=False)
    dress(ax, theme, y_size=size)
    return ax


def rule_bars(system: FuzzySystem, values: Floats, ax: Axes, *, theme: Theme = LIGHT) -> Axes:
    """Draw the shares of rules in all firing as bars, the longest at the top, the others counted.

    Parameters
    ----------
    system : FuzzySystem
        Whose rules.
    values : (num_rules,)
        Zero or more; written as per cent.
    ax : Axes
        Where to draw.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        If there is not one value for each rule.
    """
    if np.shape(values) != (len(system.rules),):
        raise ValueError(
            f"values have shape {np.shape(values)}; pass one for each of {len(system.rules)} rules"
        )
    order = np.argsort(-values, kind="stable")[:_MOST_BARS]
    names = rule_names(system)
    size = _name_rows(ax, system, [names[place] for place in order])
    ax.barh(range(len(order)), 100 * values[order], height=0.7, color=theme.lines[0])
    beside: dict[str, Any] = {"xytext": (3, 0), "textcoords": "offset points", "va": "center"}
    for row, place in enumerate(order):
        length = 100 * values[place]
        ax.annotate(f"{length:.1f}", (length, row), fontsize=SMALL, color=theme.ink, **beside)
    left = len(system.rules) - len(order)
    if left:
        most = 100 * float(np.delete(values, order).max())
        ax.set_title(f"{left} more rules have {most:.1f} % at most", loc="right")
    ax.set_xlim(0.0, 112 * max(float(values.max()), 1e-12))
    ax.set_xlabel("share of all firing (%)")
    ax.spines[["top", "right"]].set_visible(False)
    dress(ax, theme, y_size=size)
    return ax


def _name_rows(ax: Axes, system: FuzzySystem, names: list[str]) -> float:
    """Write names left of the rows of axes, the first at the top; return their size."""
    count = max(1, len(names))
    wanted = min(3.2, max((lettering.width(name, SMALL) for name in names), default=0.0))
    room, _ = lettering.make_room(ax, left=wanted + 0.02)
    _, down = lettering.inches(ax)
    texts = lettering.fit(names, (room, 0.95 * down / count), _BAR_SIZES, may_stand=False)
    ax.set_yticks(range(len(names)), texts.texts)
    ax.set(ylim=(count - 0.5, -0.5))
    ax.set_ylabel(lettering.shortened(legend(system), 0.95 * down, MEDIUM))
    return texts.size


def _add_scale(ax: Axes, image: object, theme: Theme) -> None:
    figure = ax.get_figure()
    if figure is not None:
        scale = figure.colorbar(image, ax=ax, label="firing strength", fraction=0.06, pad=0.02)  # type: ignore[arg-type]
        scale.outline.set_edgecolor(theme.muted)
        dress(scale.ax, theme)
