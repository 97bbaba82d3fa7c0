"""Whole figures of a system, sized so that every word can be read, and files of them."""

import io
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fis_tools.analysis.arrays import Surface, output_named, surface
from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem, Inferable, Term, Variable, peak, sample
from fis_tools.render import lettering, surfaces
from fis_tools.render.inference import memberships
from fis_tools.render.rules import firing_map, rule_cells, rule_matrix
from fis_tools.render.theme import LIGHT, MEDIUM, SMALL, Theme, head
from fis_tools.words.text import with_unit
from plain_files.file_access import write_bytes

#: A figure has panels for so many combinations of outer terms; the others are left to `surface` and `show`.
MOST_PANELS = 30


def one_panel(title: str, *, theme: Theme = LIGHT, in_space: bool = False) -> tuple[Figure, Any]:
    """Make a figure with one pair of axes, flat or in space."""
    figure, (ax,) = _panels(1, (4.8, 4.0), title, theme, "3d" if in_space else None)
    return figure, ax


def memberships_figure(system: FuzzySystem, *, theme: Theme = LIGHT) -> Figure:
    """Draw the terms of all variables, one below the other.

    Outputs whose terms are numbers are left out.
    """
    variables = [v for v in system.variables if v.has_sets]
    tall = [2.0 + 0.06 * len(variable.terms) for variable in variables]
    figure = Figure(figsize=(6.4, sum(tall) + 0.3), layout="constrained")
    axes = figure.subplots(len(variables), squeeze=False, height_ratios=tall).ravel()
    for variable, ax in zip(variables, axes, strict=True):
        memberships(variable, ax, theme=theme)
    head(figure, system.name, theme)
    return figure


def rules_figures(system: FuzzySystem, *, theme: Theme = LIGHT) -> Iterator[tuple[str, Figure]]:
    """Draw the rules of a system as tables, one figure per output.

    Each has one panel for each combination of the terms of the inputs before the last two. Rules that are no
    table for some output (see `rule_cells`), or one of more than `MOST_PANELS` panels, are not drawn:
    `fis_tools show` prints them.

    Yields
    ------
    (name, figure)
        As `system_figures` does.
    """
    cells = [rule_cells(system, output) for output in system.outputs]
    if any(table is None for table in cells) or len(_outer_terms(system)) > MOST_PANELS:
        return
    for output in system.outputs:
        name = "rules" if len(system.outputs) == 1 else f"rules-{output.name}"
        yield name, _matrix_figure(system, output, theme)


def surface_figures(
    system: Inferable, *, in_space: bool = False, samples: Floats | None = None, theme: Theme = LIGHT
) -> Iterator[tuple[str, Figure]]:
    """Draw every output with `surface_figure`; over a single input as a curve, and that only once.

    Yields
    ------
    (name, figure)
        As `system_figures` does; in space ``surface-3d``.
    """
    kind = "surface-3d" if in_space else "surface"
    if len(system.inputs) == 1:
        kind = "curve"
    for output in () if kind == "curve" and in_space else system.outputs:
        name = kind if len(system.outputs) == 1 else f"{kind}-{output.name}"
        if kind == "curve":
            figure, ax = one_panel(output.name, theme=theme)
            surfaces.output_curve(system, ax, output=output.name, samples=samples, theme=theme)
        else:
            figure = surface_figure(system, output.name, samples=samples, in_space=in_space, theme=theme)
        yield name, figure


def surface_figure(
    system: Inferable,
    output: str | None = None,
    *,
    samples: Floats | None = None,
    in_space: bool = False,
    theme: Theme = LIGHT,
) -> Figure:
    """Draw an output over the last two inputs, as maps or in space.

    There is one panel for each combination of the terms of the other inputs, these held at the terms' peaks,
    all in the same colours. With more than `MOST_PANELS` there is one, these held in the middle of their
    universes.

    Parameters
    ----------
    system : FuzzySystem or FuzzyTree
        Without problems, with two inputs or more.
    output : str, optional
        Which output; by default the first.
    samples : (n, num_inputs), optional
        Inputs to mark, each in the panel to whose terms it belongs most.
    in_space : bool
        Whether to draw surfaces in space.
    theme : Theme
        Colours.
    """
    concluded = output_named(system, output)
    combinations = _outer_terms(system)
    if len(combinations) > MOST_PANELS:
        combinations = [{}]
    results = [_slice(system, terms, concluded) for terms in combinations]
    limits = surfaces.value_limits(results)
    size = (4.2, 3.9) if in_space else (3.9, 3.3)
    figure, axes = _panels(len(results), size, concluded.name, theme, "3d" if in_space else None)
    for terms, result, ax in zip(combinations, results, axes, strict=True):
        flown = None if samples is None else _belonging(system, terms, samples)
        words: Any = {"title": surfaces.held_words(system, result.fixed), "theme": theme}
        words["points"] = surfaces.over_axes(system, result, flown)
        if in_space:
            surfaces.surface_space(result, ax, limits, **words)
        else:
            surfaces.draw_surface(result, ax, limits, has_colour_bar=False, **words)
    if not in_space:
        surfaces.colour_bar(axes, axes[0].images[0], with_unit(concluded), theme)
    return figure


def firing_figure(
    system: FuzzySystem, time_s: Floats, strengths: Floats, *, is_timed: bool = True, theme: Theme = LIGHT
) -> Figure:
    """Draw how the rules of a system fired along a flight, with the share of each in all firing."""
    count = min(20, len(system.rules))
    figure = Figure(figsize=(9.0, 1.3 + 0.22 * count), layout="constrained")
    head(figure, f"{system.name}: rules over {'time' if is_timed else 'rows'}", theme)
    firing_map(system, time_s, strengths, figure.subplots(), most_rules=count, is_timed=is_timed, theme=theme)
    return figure


def system_figures(system: FuzzySystem, *, theme: Theme = LIGHT) -> Iterator[tuple[str, Figure]]:
    """Draw what there is to see of a system, one figure after the other.

    Yields
    ------
    (name, figure)
        ``memberships``, ``rules``, and ``surface``, or ``curve`` for a single input; ``rules-OUTPUT`` and
        ``surface-OUTPUT`` for several outputs; ``rules-2`` and so on where a list fills several figures.
    """
    yield "memberships", memberships_figure(system, theme=theme)
    yield from rules_figures(system, theme=theme)
    yield from surface_figures(system, theme=theme)


def _outer_terms(system: Inferable) -> list[dict[str, Term]]:
    """Return every combination of terms of the inputs before the last two (the outer inputs)."""
    outer = system.inputs[:-2]
    return [
        {variable.name: term for variable, term in zip(outer, terms, strict=True)}
        for terms in product(*(variable.terms for variable in outer))
    ]


def _slice(system: Inferable, terms: Mapping[str, Term], output: Variable) -> Surface:
    fixed = {name: peak(system.variable(name), term) for name, term in terms.items()}
    x, y = system.inputs[-1].name, system.inputs[-2].name
    return surface(system, x, y, fixed=fixed, output=output.name, num_points=81)


def _belonging(system: Inferable, terms: Mapping[str, Term], samples: Floats) -> Floats:
    """Return the samples whose outer inputs belong most to these terms."""
    keep = np.ones(len(samples), dtype=bool)
    for index, variable in enumerate(system.inputs):
        if variable.name in terms:
            x = np.clip(samples[:, index], variable.minimum, variable.maximum)
            belongs = [np.interp(x, variable.universe, sample(variable, term)) for term in variable.terms]
            keep &= np.argmax(belongs, axis=0) == variable.term_index(terms[variable.name].name)
    return samples[keep]


def _matrix_figure(system: FuzzySystem, output: Variable, theme: Theme) -> Figure:
    """Draw the rules that conclude on an output, one table for each combination of outer inputs."""
    combinations = _outer_terms(system)
    last, rows = system.inputs[-1], system.inputs[-2] if len(system.inputs) > 1 else None
    longest = max(_longest_piece(variable) for variable in (last, output))
    beside = 0.5 + min(1.3, max(lettering.width(t.name, SMALL) for t in rows.terms)) if rows else 0.3
    across = beside + len(last.terms) * max(0.75, 1.2 * longest)
    down = 0.9 + 0.5 * (len(rows.terms) if rows else 1)
    figure, axes = _panels(len(combinations), (across, down), output.name, theme)
    for terms, ax in zip(combinations, axes, strict=True):
        words = {name: term.name for name, term in terms.items()}
        rule_matrix(system, ax, words, output=output.name, theme=theme)
        if words:
            title = ", ".join(f"{name} is {term}" for name, term in words.items())
            ax.set_title(title, color=theme.ink, size=MEDIUM, parse_math=False)
    return figure


def _longest_piece(variable: Variable) -> float:
    """Return the width of the longest part of a term's name that is not broken, in the letters of a table."""
    pieces = (
        piece for term in variable.terms for piece in lettering.broken(term.name, 0.0, MEDIUM).split("\n")
    )
    return max(lettering.width(piece, MEDIUM) for piece in pieces)


def _panels(
    count: int, size: tuple[float, float], title: str, theme: Theme, projection: str | None = None
) -> tuple[Figure, Sequence[Axes]]:
    """Return a titled figure with `count` axes of a size, in at most three columns."""
    columns = min(count, 3, max(1, int(16.0 / size[0])))
    rows = -(-count // columns)
    figsize = (size[0] * columns + 0.8, size[1] * rows + 0.4)
    figure = Figure(figsize=figsize, layout="constrained")
    head(figure, title, theme)
    with mpl.rc_context({"grid.color": theme.grid}):  # axes in space take it only when they are made
        axes = figure.subplots(rows, columns, squeeze=False, subplot_kw={"projection": projection}).ravel()
    for ax in axes[count:]:
        ax.remove()
    return figure, list(axes[:count])


FORMATS = ("png", "svg", "pdf")

_OPTIONS: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "fis_tools", "pdf.fonttype": 42}
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def encode(figure: Figure, form: str, dots_per_inch: int = 150) -> bytes:
    """Return a figure as a file of one of `FORMATS`.

    Raises
    ------
    ValueError
        If the format is another.
    """
    if form not in FORMATS:
        raise ValueError(f"{form!r} is not a picture format; choose one of {', '.join(FORMATS)}")
    content = io.BytesIO()
    with mpl.rc_context(_OPTIONS):
        figure.savefig(content, format=form, dpi=dots_per_inch, metadata=_METADATA[form])
    return content.getvalue()


def save(figure: Figure, path: Path | str, dots_per_inch: int = 150) -> None:
    """Write a figure to a file, in the format that the name ends with.

    Raises
    ------
    ValueError
        If the name ends with no format that there is.
    """
    path = Path(path)
    write_bytes(path, encode(figure, path.suffix.removeprefix(".").lower(), dots_per_inch))
