"""Rules drawn: as a coloured table of output terms, and as they fire along a flight."""

from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from fis_tools.analysis.arrays import FIRED, output_named
from fis_tools.array_types import Floats, Integers
from fis_tools.model import FuzzySystem, Variable
from fis_tools.model.rule_tables import conjunction
from fis_tools.render import lettering
from fis_tools.render.surfaces import colour_bar
from fis_tools.render.theme import LIGHT, MEDIUM, SMALL, Theme, dress, readable_on, term_colours
from fis_tools.words.text import antecedent_words, weighted

#: Tables with more cells than this are not laid out.
MOST_CELLS = 4096
#: In a table fewer cells than this share must not be empty.
_LEAST_FILLED = 0.5
_SIZES = (5.0, 10.0)
#: Names of rows and columns take no more than this beside and below a table, in inches.
_MOST_BESIDE, _MOST_BELOW = 1.3, 1.1
_LABEL_SIZES = (6.5, SMALL)


def rule_cells(system: FuzzySystem, output: Variable) -> tuple[Integers, Floats] | None:
    """Lay the rules that conclude on an output out as a table.

    Returns
    -------
    terms, weights : (num_terms of each input…)
        Of each cell the output's term that is concluded, -1 where no rule is, and the consequent's weight.
        None where some rule is not a plain conjunction, two rules conclude differently in one cell, or more
        than half of the cells would be empty.
    """
    shape = tuple(len(variable.terms) for variable in system.inputs)
    if prod(shape) > MOST_CELLS:
        return None
    terms, weights = np.full(shape, -1, dtype=np.int64), np.ones(shape)
    for index, consequent in system.conclusions_on(output):
        conditions = conjunction(system.rules[index].antecedent)
        if conditions is None:
            return None
        cell = tuple(
            v.term_index(conditions[v.name]) if v.name in conditions else slice(None) for v in system.inputs
        )
        term = output.term_index(consequent.term)
        taken = terms[cell] != -1
        if np.any(taken & ((terms[cell] != term) | (weights[cell] != consequent.weight))):
            return None
        terms[cell], weights[cell] = term, consequent.weight
    return (terms, weights) if np.mean(terms != -1) >= _LEAST_FILLED else None


def rule_matrix(
    system: FuzzySystem,
    ax: Axes,
    fixed: Mapping[str, str] | None = None,
    *,
    output: str | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draw rules as a table of output terms, the lowest terms at the lower left.

    Rows are the terms of the last input but one, columns those of the last, as in `surface_map`. Higher
    output terms are brighter, so that a grey print says the same; cells without a rule are hatched.

    Parameters
    ----------
    system : FuzzySystem
        A system whose rules can be laid out as a table, see `rule_cells`.
    ax : Axes
        Where to draw.
    fixed : mapping, optional
        For each input before the last two, the term that the table is for.
    output : str, optional
        Which output; by default the first.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        If the rules are not a table, the output is unknown, or `fixed` names no term of an outer input.
    """
    concluded = output_named(system, output)
    cells = rule_cells(system, concluded)
    if cells is None:
        raise ValueError(
            f"the rules of system {system.name!r} are not a full table; print them with fis_tools show"
        )
    *outer, last = system.inputs
    rows = outer.pop() if outer else None
    index = _fixed_terms(system, outer, dict(fixed or {}))
    terms, weights = (part[index].reshape(-1, len(last.terms)) for part in cells)
    sizes = _label(ax, last, rows)
    _fill(ax, concluded, terms, weights, theme)
    ax.grid(visible=False)
    ax.tick_params(which="both", length=0)
    ax.spines[:].set_visible(False)
    dress(ax, theme, *sizes)
    return ax


def _fixed_terms(system: FuzzySystem, outer: list[Variable], fixed: dict[str, str]) -> tuple[int, ...]:
    """Return the index of each outer input's fixed term."""
    for variable in outer:
        terms = [term.name for term in variable.terms]
        if fixed.get(variable.name) not in terms:
            raise ValueError(
                f"a matrix of system {system.name!r} is for one term of {variable.name!r}; fix it to one of "
                + ", ".join(terms)
            )
    return tuple(variable.term_index(fixed[variable.name]) for variable in outer)


def _label(ax: Axes, columns: Variable, rows: Variable | None) -> tuple[float, float]:
    """Name columns and rows; return the sizes of their letters."""
    num_columns, num_rows = len(columns.terms), len(rows.terms) if rows else 1
    names = [term.name for term in columns.terms]
    beside = [term.name for term in rows.terms] if rows else []
    widest = max((lettering.width(name, SMALL) for name in beside), default=0.0)
    left, _ = lettering.make_room(ax, left=min(_MOST_BESIDE, widest))
    box = (0.94 * lettering.inches(ax)[0] / num_columns, _MOST_BELOW)
    below = lettering.fit(names, box, _LABEL_SIZES)
    if below.rotation:
        longest = max(lettering.width(text, below.size) for text in below.texts)
        _, room = lettering.make_room(ax, below=longest)
        below = lettering.fit(names, (box[0], room), _LABEL_SIZES)
    ax.set_xticks(range(num_columns), below.texts, rotation=below.rotation)
    ax.set_xlabel(columns.name)
    high = 0.95 * lettering.inches(ax)[1] / num_rows
    at_rows = lettering.fit(beside, (left, high), _LABEL_SIZES, may_stand=False)
    ax.set_yticks(range(len(beside)), at_rows.texts)
    ax.set_ylabel(rows.name if rows else "", labelpad=6)
    ax.set(xlim=(-0.5, num_columns - 0.5), ylim=(-0.5, num_rows - 0.5))
    return below.size, at_rows.size


def _fill(ax: Axes, output: Variable, terms: Integers, weights: Floats, theme: Theme) -> None:
    """Draw the cells of a rule table: each has the colour and name of the term that it concludes."""
    across, down = lettering.inches(ax)
    room = (0.9 * across / terms.shape[1], 0.9 * down / terms.shape[0])
    concluded = [(int(term), float(weight)) for term, weight in zip(terms.flat, weights.flat, strict=True)]
    words = [
        "no rule" if term < 0 else weighted(output.terms[term].name, weight) for term, weight in concluded
    ]
    texts = lettering.fit(words, room, _SIZES)
    colours = term_colours(len(output.terms))
    without: dict[str, Any] = {"fc": theme.paper, "ec": theme.grid, "lw": 0, "hatch": "///"}
    written: dict[str, Any] = {"ha": "center", "va": "center", "linespacing": 1.05}
    written |= {"fontsize": texts.size, "rotation": texts.rotation}
    for (row, column), text, (term, _) in zip(np.ndindex(terms.shape), texts.texts, concluded, strict=True):
        ink, style = theme.muted, without
        if term >= 0:
            ink, style = readable_on(colours[term]), {"fc": tuple(colours[term]), "ec": theme.paper, "lw": 2}
        ax.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, **style))
        ax.text(column, row, text, color=ink, **written)


def legend(system: FuzzySystem) -> str:
    """Return the key to rule names: the inputs in order, then the outputs."""
    return f"{' · '.join(v.name for v in system.inputs)} → {', '.join(v.name for v in system.outputs)}"


def rule_names(system: FuzzySystem) -> list[str]:
    """Name each rule by its number and its words.

    A rule that asks for at most one term of each input, and for nothing else, is told by its terms in the
    order of `legend`, ``any`` for an input it does not ask for: ``4: near · still → PS``. Others are told
    with the names of their inputs.
    """
    names = []
    for number, rule in enumerate(system.rules, start=1):
        conditions = conjunction(rule.antecedent)
        words = antecedent_words(rule.antecedent)
        if conditions is not None:
            words = " · ".join(conditions.get(variable.name, "any") for variable in system.inputs)
        outputs = ["" if len(system.outputs) == 1 else f"{c.variable} " for c in rule.consequents]
        concluded = [
            out + weighted(c.term, c.weight) for out, c in zip(outputs, rule.consequents, strict=True)
        ]
        names.append(f"{number}: {words} → {', '.join(concluded)}")
    return names


#: Rules with a smaller share that never fire are not drawn along a flight.
_LEAST_SHARE = 0.005


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
    """
    mean = strengths.mean(axis=0)
    shares = mean / max(float(mean.sum()), np.finfo(np.float64).tiny)
    order = np.argsort(-shares, kind="stable")
    is_seen = (shares >= _LEAST_SHARE) | (strengths.max(axis=0) >= FIRED)
    shown = order[is_seen[order]][:most_rules]
    names = rule_names(system)
    hold = time_s[-1] - time_s[-2] if len(time_s) > 1 else 1.0
    x, y = np.append(time_s, time_s[-1] + hold), np.arange(len(shown) + 1) - 0.5
    scale: dict[str, Any] = {"cmap": theme.strength_map, "vmin": 0.0, "vmax": 1.0}
    image = ax.pcolormesh(x, y, strengths[:, shown].T, rasterized=True, **scale)
    colour_bar([ax], image, "firing strength", theme)
    size = _name_rows(ax, system, [f"{names[index]} ({100 * shares[index]:.0f}\u00a0%)" for index in shown])
    left = len(system.rules) - len(shown)
    if left:
        rest = 100 * max(0.0, 1.0 - float(shares[shown].sum()))
        ax.set_title(f"{left} more rules share {rest:.1f} %", loc="right")
    ax.set_xlabel("time (s)" if is_timed else "row")
    ax.grid(visible=False)
    dress(ax, theme, y_size=size)
    return ax


def _name_rows(ax: Axes, system: FuzzySystem, names: list[str]) -> float:
    """Write names left of the rows of axes, the first at the top; return their size."""
    count = max(1, len(names))
    wanted = min(3.2, max((lettering.width(name, SMALL) for name in names), default=0.0))
    room, _ = lettering.make_room(ax, left=wanted + 0.02)
    _, down = lettering.inches(ax)
    texts = lettering.fit(names, (room, 0.95 * down / count), _LABEL_SIZES, may_stand=False)
    ax.set_yticks(range(len(names)), texts.texts)
    ax.set(ylim=(count - 0.5, -0.5))
    ax.set_ylabel(lettering.shortened(legend(system), 0.95 * down, MEDIUM))
    return texts.size
