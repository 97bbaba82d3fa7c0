"""Rules as a coloured table of output terms."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from fis_tools.array_types import Floats, Integers
from fis_tools.model import FuzzySystem, Variable
from fis_tools.model.validate import nearest
from fis_tools.render import lettering
from fis_tools.render.rule_lists import plain_statements
from fis_tools.render.surfaces import named
from fis_tools.render.theme import LIGHT, SMALL, Theme, dress, readable_on, term_colours
from fis_tools.words.text import number

#: Tables with more cells than this are not laid out.
MOST_CELLS = 4096
#: In a table fewer cells than this share must not be empty.
_LEAST_FILLED = 0.5
_SIZES = (5.0, 10.0)
#: Names of rows and columns take no more than this beside and below a table, in inches.
_MOST_BESIDE, _MOST_BELOW = 1.3, 1.1
_LABEL_SIZES = (6.5, SMALL)


@dataclass(frozen=True)
class RuleCells:
    """Rules laid out over the terms of the inputs.

    Parameters
    ----------
    terms : (num_terms of each input…) int
        The output's term that is concluded in each cell; -1 where no rule is.
    weights : same shape
        Of the consequents.
    """

    terms: Integers
    weights: Floats


def rule_cells(system: FuzzySystem, output: Variable) -> RuleCells | None:
    """Lay the rules that conclude on an output out as a table.

    Returns
    -------
    RuleCells or None
        None where some rule is not a plain conjunction, two rules conclude differently in one cell, or more
        than half of the cells would be empty.
    """
    shape = tuple(len(variable.terms) for variable in system.inputs)
    if prod(shape) > MOST_CELLS:
        return None
    terms, weights = np.full(shape, -1, dtype=np.int64), np.ones(shape)
    for rule in system.rules:
        for consequent in rule.consequents:
            if consequent.variable != output.name:
                continue
            asked = plain_statements(rule)
            if asked is None:
                return None
            cell = tuple(
                v.term_index(asked[v.name]) if v.name in asked else slice(None) for v in system.inputs
            )
            term = output.term_index(consequent.term)
            taken = terms[cell] != -1
            if np.any(taken & ((terms[cell] != term) | (weights[cell] != consequent.weight))):
                return None
            terms[cell], weights[cell] = term, consequent.weight
    return RuleCells(terms, weights) if np.mean(terms != -1) >= _LEAST_FILLED else None


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
    concluded = named(system, "output", output)
    cells = rule_cells(system, concluded)
    if cells is None:
        raise ValueError(
            f"the rules of system {system.name!r} are not a full table; print them with fis_tools show"
        )
    *outer, last = system.inputs
    rows = outer.pop() if outer else None
    index = _fixed_terms(system, outer, dict(fixed or {}))
    terms = cells.terms[index].reshape(-1, len(last.terms))
    weights = cells.weights[index].reshape(terms.shape)
    sizes = _label(ax, last, rows)
    _fill(ax, concluded, terms, weights, theme)
    ax.grid(visible=False)
    ax.tick_params(which="both", length=0)
    ax.spines[:].set_visible(False)
    dress(ax, theme, *sizes)
    return ax


def _fixed_terms(system: FuzzySystem, outer: list[Variable], fixed: dict[str, str]) -> tuple[int, ...]:
    names = [variable.name for variable in outer]
    for name in fixed:
        if name not in names:
            raise ValueError(f"system {system.name!r} has no outer input {name!r}; {nearest(name, names)}")
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
    across, down = lettering.inches(ax)
    room = (0.9 * across / terms.shape[1], 0.9 * down / terms.shape[0])
    concluded = [(int(term), float(weight)) for term, weight in zip(terms.flat, weights.flat, strict=True)]
    words = [
        "no rule" if term < 0 else output.terms[term].name + ("" if weight == 1.0 else f" × {number(weight)}")
        for term, weight in concluded
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
