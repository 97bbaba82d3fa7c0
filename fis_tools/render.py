"""Pictures of fuzzy systems: axes in, axes out, nothing saved.

Colours are safe for colour-blind eyes, and what a colour says is also said by a word, a line style or a
brightness, so that a grey print says the same.
"""

from collections.abc import Iterator, Mapping
from itertools import product

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fis_tools.analysis import Surface, surface
from fis_tools.formats.text import number, with_unit
from fis_tools.membership import sample, sample_terms
from fis_tools.model import FuzzySystem, Term, Variable, rule_table
from fis_tools.validate import nearest

Floats = NDArray[np.float64]

#: Okabe and Ito's palette without its yellow and with a darker purple: bright lines drown on white.
LINE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#AA4499", "#000000", "#E69F00", "#56B4E9")
LINE_STYLES = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1, 1)), (0, (3, 1, 1, 1, 1, 1)))
#: From dark to bright without a turn, and the same to every eye.
BRIGHTNESS_MAP = "cividis"

_LABEL_POINTS = 8.0
_INCHES_A_CHARACTER = 0.068


def memberships(variable: Variable, ax: Axes) -> Axes:
    """Draw the membership functions of a variable, each named at its peak.

    Parameters
    ----------
    variable : Variable
        A variable without problems.
    ax : Axes
        Where to draw.
    """
    universe = variable.universe
    functions = sample_terms(variable)
    peaks = [_peak(universe, function) for function in functions]
    levels = _label_levels(variable, peaks, ax)
    for place, (term, function) in enumerate(zip(variable.terms, functions, strict=True)):
        colour = LINE_COLOURS[place % len(LINE_COLOURS)]
        ax.plot(
            universe, function, color=colour, linestyle=LINE_STYLES[place % len(LINE_STYLES)], linewidth=1.8
        )
        ax.annotate(
            term.name,
            (peaks[place], 1.0),
            xytext=(0, 2 + (_LABEL_POINTS + 2) * levels[place]),
            textcoords="offset points",
            ha=_alignment(variable, peaks[place]),
            va="bottom",
            color=colour,
            fontsize=_LABEL_POINTS,
        )
    room = (max(levels) + 1) * (_LABEL_POINTS + 4) / (72 * _inches(ax)[1])
    ax.set(xlim=(variable.minimum, variable.maximum), ylim=(0.0, 1.0 / max(0.3, 1.0 - room)))
    ax.set(xlabel=with_unit(variable), ylabel="membership", yticks=(0.0, 0.5, 1.0))
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines["left"].set_bounds(0.0, 1.0)
    for line in ax.lines:
        line.set_clip_on(False)
    return ax


def _peak(universe: Floats, function: Floats) -> float:
    peak = float(np.mean(universe[function == function.max()]))
    return 0.0 if abs(peak) < 1e-9 * (universe[-1] - universe[0]) else peak


def _inches(ax: Axes) -> tuple[float, float]:
    """Return about how wide and high axes are."""
    figure = ax.get_figure(root=True)
    width, height = figure.get_size_inches() if figure is not None else (6.4, 4.8)
    place = ax.get_position()
    return float(width * place.width), float(height * place.height)


def _alignment(variable: Variable, peak: float) -> str:
    place = (peak - variable.minimum) / (variable.maximum - variable.minimum)
    return "left" if place < 0.08 else "right" if place > 0.92 else "center"


def _label_levels(variable: Variable, peaks: list[float], ax: Axes) -> list[int]:
    """Give each label the lowest line on which it does not run into the one before it."""
    inches, _ = _inches(ax)
    taken: list[float] = []
    levels = [0] * len(peaks)
    for place in np.argsort(peaks, kind="stable"):
        length = _INCHES_A_CHARACTER * len(variable.terms[place].name)
        centre = inches * (peaks[place] - variable.minimum) / (variable.maximum - variable.minimum)
        side = _alignment(variable, peaks[place])
        start = centre - {"left": 0.0, "center": 0.5, "right": 1.0}[side] * length
        level = next((level for level, end in enumerate(taken) if end <= start), len(taken))
        taken[level : level + 1] = [start + length + _INCHES_A_CHARACTER]
        levels[place] = level
    return levels


def rule_matrix(system: FuzzySystem, ax: Axes, fixed: Mapping[str, str] | None = None) -> Axes:
    """Draw a full rule table as a matrix of output terms, the lowest terms at the lower left.

    Rows are the terms of the last input but one, columns those of the last, as in `surface_map`.

    Parameters
    ----------
    system : FuzzySystem
        A system whose rules are a full table.
    ax : Axes
        Where to draw.
    fixed : mapping, optional
        For each input before the last two, the term that the matrix is for.

    Raises
    ------
    ValueError
        If the rules are no full table, or `fixed` does not name a term of each outer input.
    """
    table = rule_table(system)
    if table is None:
        raise ValueError(
            f"the rules of system {system.name!r} are no full table; list them as sentences instead"
        )
    *outer, last = system.inputs
    rows = outer.pop() if outer else None
    index = _fixed_terms(system, outer, dict(fixed or {}))
    cells = table.reshape([len(variable.terms) for variable in system.inputs])[index].reshape(
        -1, len(last.terms)
    )
    terms = system.outputs[0].terms
    colours = _term_colours(len(terms))
    ax.imshow(colours[cells], origin="lower", aspect="auto", interpolation="nearest")
    words = _wrapped(terms)
    longest = max(len(line) for word in words for line in word.split("\n"))
    size = np.clip(72 * _inches(ax)[0] / len(last.terms) / (0.65 * longest), 5.0, 10.0)
    for (row, column), term in np.ndenumerate(cells):
        colour = _readable_on(colours[term])
        ax.text(column, row, words[term], ha="center", va="center", color=colour, fontsize=size)
    ax.set_xticks(range(len(last.terms)), _wrapped(last.terms))
    ax.set_xlabel(last.name)
    ax.set_yticks(range(len(cells)), _wrapped(rows.terms) if rows else [""])
    ax.set_ylabel(rows.name if rows else "")
    ax.set_xticks(np.arange(0.5, len(last.terms) - 1), minor=True)
    ax.set_yticks(np.arange(0.5, len(cells) - 1), minor=True)
    ax.grid(which="minor", color="white", linewidth=2)
    ax.tick_params(which="both", length=0)
    ax.spines[:].set_visible(False)
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


def _wrapped(terms: tuple[Term, ...]) -> list[str]:
    return [term.name.replace(" ", "\n", 1) for term in terms]


def _term_colours(count: int) -> Floats:
    """Return one colour a term, from dark to bright, shape (count, 3)."""
    places = np.linspace(0.08, 0.98, count) if count > 1 else np.array([0.7])
    return np.asarray(mpl.colormaps[BRIGHTNESS_MAP](places))[:, :3]


def _readable_on(colour: Floats) -> str:
    return "black" if colour @ (0.299, 0.587, 0.114) > 0.5 else "white"


def surface_map(
    system: FuzzySystem,
    ax: Axes,
    x: str | None = None,
    y: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    output: str | None = None,
    num_points: int = 81,
) -> Axes:
    """Evaluate an output over two inputs and draw it, see `draw_surface`.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems, with two inputs or more.
    ax : Axes
        Where to draw.
    x, y : str, optional
        The inputs along the axes; by default the last free one and the one before it, as in `rule_matrix`.
    fixed, output, num_points
        As in `fis_tools.analysis.surface`.

    Raises
    ------
    ValueError
        As `fis_tools.analysis.surface` does.
    """
    if x is None and y is None:
        free = [variable.name for variable in system.inputs if variable.name not in (fixed or {})]
        x, y = (free[-1], free[-2]) if len(free) > 1 else (None, None)
    return draw_surface(surface(system, x, y, fixed=fixed, output=output, num_points=num_points), ax)


def draw_surface(
    result: Surface, ax: Axes, limits: tuple[float, float] | None = None, *, has_colour_bar: bool = True
) -> Axes:
    """Draw an output over two inputs, as brightness with labelled contours; the zero contour is thick.

    Parameters
    ----------
    result : Surface
        What `fis_tools.analysis.surface` returns.
    ax : Axes
        Where to draw.
    limits : (float, float), optional
        Outputs drawn darkest and brightest; by default the least and the greatest there is.
    has_colour_bar : bool
        Whether to put a colour bar beside the axes.
    """
    low, high = limits or _limits([result])
    image = ax.imshow(
        result.values,
        origin="lower",
        aspect="auto",
        extent=(result.x[0], result.x[-1], result.y[0], result.y[-1]),
        cmap=BRIGHTNESS_MAP,
        vmin=low,
        vmax=high,
        interpolation="bilinear",
    )
    levels = MaxNLocator(8).tick_values(low, high)
    levels = levels[(levels > result.values.min()) & (levels < result.values.max())]
    if len(levels):
        lines = ax.contour(
            result.x,
            result.y,
            result.values,
            levels,
            colors=["white" if level < 0.5 * (low + high) else "black" for level in levels],
            linewidths=np.where(np.abs(levels) < 1e-9 * (high - low), 2.0, 0.8),
            linestyles="solid",
        )
        ax.clabel(lines, fmt=number, fontsize=7)
    ax.set(xlabel=with_unit(result.x_variable), ylabel=with_unit(result.y_variable))
    figure = ax.get_figure()
    if has_colour_bar and figure is not None:
        figure.colorbar(image, ax=ax, label=with_unit(result.output))
    return ax


def _limits(results: list[Surface]) -> tuple[float, float]:
    """Return the least and the greatest output of some surfaces; the universe's ends where all are one."""
    low = min(float(result.values.min()) for result in results)
    high = max(float(result.values.max()) for result in results)
    output = results[0].output
    is_flat = high - low < 1e-9 * (output.maximum - output.minimum)
    return (output.minimum, output.maximum) if is_flat else (low, high)


def system_figures(system: FuzzySystem) -> Iterator[tuple[str, Figure]]:
    """Draw what there is to see of a system, one figure after the other.

    Rules and surfaces have one panel for each combination of the terms of the inputs before the last two; a
    surface holds these inputs at the terms' peaks.

    Yields
    ------
    (name, figure)
        ``memberships`` always, ``rules`` for full tables, ``surface`` (``surface-OUTPUT`` for several
        outputs) for two inputs or more.
    """
    variables = (*system.inputs, *system.outputs)
    figure = Figure(figsize=(6.4, 1.9 * len(variables) + 0.3), layout="constrained")
    for variable, ax in zip(variables, figure.subplots(len(variables), squeeze=False).ravel(), strict=True):
        memberships(variable, ax)
    yield "memberships", figure
    if rule_table(system) is not None:
        yield "rules", _rules_figure(system)
    if len(system.inputs) >= 2:
        for output in system.outputs:
            name = "surface" if len(system.outputs) == 1 else f"surface-{output.name}"
            yield name, _surface_figure(system, output)


def one_panel(title: str) -> tuple[Figure, Axes]:
    """Make a figure with one pair of axes."""
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    figure.suptitle(title)
    return figure, figure.subplots()


def _outer_terms(system: FuzzySystem) -> list[dict[str, Term]]:
    """Return every combination of terms of the inputs before the last two."""
    outer = system.inputs[:-2]
    return [
        {variable.name: term for variable, term in zip(outer, terms, strict=True)}
        for terms in product(*(variable.terms for variable in outer))
    ]


def _rules_figure(system: FuzzySystem) -> Figure:
    combinations = _outer_terms(system)
    width = 1.5 + 0.75 * len(system.inputs[-1].terms)
    figure, axes = _panels(len(combinations), width, 3.2, system.outputs[0].name)
    for terms, ax in zip(combinations, axes, strict=True):
        words = {name: term.name for name, term in terms.items()}
        rule_matrix(system, ax, words)
        ax.set_title(", ".join(f"{name} is {term}" for name, term in words.items()), fontsize="medium")
    return figure


def _surface_figure(system: FuzzySystem, output: Variable) -> Figure:
    combinations = _outer_terms(system)
    results = []
    for terms in combinations:
        fixed = {}
        for name, term in terms.items():
            variable = system.variable(name)
            fixed[name] = _peak(variable.universe, sample(variable, term))
        x, y = system.inputs[-1].name, system.inputs[-2].name
        results.append(surface(system, x, y, fixed=fixed, output=output.name, num_points=81))
    limits = _limits(results)
    figure, axes = _panels(len(combinations), 3.8, 3.3, output.name)
    for result, ax in zip(results, axes, strict=True):
        draw_surface(result, ax, limits, has_colour_bar=False)
        words = (f"{name} = {number(value)}" for name, value in result.fixed.items())
        ax.set_title(", ".join(words), fontsize="medium")
    figure.colorbar(axes[0].images[0], ax=axes, label=with_unit(output), fraction=0.05, pad=0.02)
    return figure


def _panels(count: int, width: float, height: float, title: str) -> tuple[Figure, list[Axes]]:
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(width * columns + 0.8, height * rows + 0.4), layout="constrained")
    figure.suptitle(title)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[count:]:
        ax.set_visible(False)
    return figure, list(axes[:count])
