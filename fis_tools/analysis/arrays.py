"""Response surfaces, rule firing, coverage and similarity of terms, as arrays.

Memberships are linear between the points of a universe, and the measures are exact for these polygons, also
between the points.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count, islice
from math import isqrt

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.errors import require_known
from fis_tools.model import FuzzySystem, Inferable, Variable

#: Points and statements gone through for samples spread over ranges, a few seconds' worth.
MOST_WORK = 200_000_000
#: Samples spread over ranges, however slow inference is.
LEAST_SAMPLES = 64

#: The firing strength from which a rule counts as fired.
FIRED = 0.05


@dataclass(frozen=True)
class Surface:
    """An output over a grid of two inputs, the other inputs held.

    Parameters
    ----------
    x_variable, y_variable, output : Variable
        What lies along the axes, and what is shown.
    x : (nx,), y : (ny,)
        Grid points over the whole universes.
    values : (ny, nx)
        The output; NaN where a formula has no value, or an infinite one.
    fixed : dict
        The values of the inputs that are held.
    """

    x_variable: Variable
    y_variable: Variable
    output: Variable
    x: Floats
    y: Floats
    values: Floats
    fixed: dict[str, float]


@dataclass(frozen=True)
class Coverage:
    """The value of a variable at which its highest membership is lowest, and that membership."""

    least: float
    at: float


@dataclass(frozen=True)
class Distinguishability:
    """How similar the terms of a variable are.

    Parameters
    ----------
    similarity : (num_terms, num_terms)
        Jaccard: the area under the lower of two functions over that under the higher. 1 on the diagonal;
        above 0.7 or so two terms mean the same.
    possibility : (num_terms, num_terms)
        The highest point of the lower of two functions.
    """

    similarity: Floats
    possibility: Floats


@dataclass(frozen=True)
class RuleUsage:
    """How the rules of a system are used over some samples; arrays of shape (num_rules,).

    Parameters
    ----------
    fired : array
        Fraction of the samples in which the rule fires at the threshold or more.
    leading : array
        Fraction of the samples in which no rule fires stronger, and this one above zero.
    max_strength : array
        Over all samples.
    """

    fired: Floats
    leading: Floats
    max_strength: Floats


def check_samples(systems: Sequence[FuzzySystem], samples: Mapping[str, Floats]) -> None:
    """Raise a ValueError for samples that do not fit a system's number of inputs."""
    by_name = {system.name: system for system in systems}
    require_known(samples, by_name, "samples are given for", ValueError)
    for name, rows in samples.items():
        wanted = len(by_name[name].inputs)
        if rows.ndim != 2 or rows.shape[1] != wanted:
            raise ValueError(
                f"samples of {name!r} have shape {rows.shape}; give one row per sample, {wanted} numbers each"
            )


def evaluate(system: Inferable, inputs: Floats) -> Floats:
    """Return the outputs of a valid system for many samples.

    Parameters
    ----------
    system : FuzzySystem or FuzzyTree
        Without problems.
    inputs : (n, num_inputs)
        One row per sample; clipped to the universes.

    Returns
    -------
    (n, num_outputs)
    """
    return compile(system)(inputs)


def firing(system: FuzzySystem, inputs: Floats) -> Floats:
    """Return the firing strength of each rule for each sample, before weights, (n, num_rules)."""
    return compile(system).firing_strengths(inputs)


def spread_inputs(system: FuzzySystem, num_samples: int = 4096) -> Floats:
    """Return samples that cover the input ranges of a system evenly, (n, num_inputs); see `spread`.

    They are fewer if inference is slow: of systems whose points and statements are together more than
    `MOST_WORK` divided by their number.
    """
    work = sum(variable.num_points for variable in system.outputs) + len(system.rules) * len(system.inputs)
    num_samples = min(num_samples, max(LEAST_SAMPLES, MOST_WORK // max(1, work)))
    low = np.array([variable.minimum for variable in system.inputs])
    high = np.array([variable.maximum for variable in system.inputs])
    return spread(low, high, num_samples)


def spread(low: Floats, high: Floats, num_samples: int) -> Floats:
    """Return samples that cover a box evenly, the same at each call; more of them begin with the same.

    The points of a Halton sequence (J. H. Halton, Numerische Mathematik 2, 1960) without its first, which
    lies in a corner.

    Parameters
    ----------
    low, high : (num_inputs,)
        The corners of the box.
    num_samples : int

    Returns
    -------
    (num_samples, num_inputs)
    """
    fractions = np.stack([_radical_inverse(num_samples, base) for base in _primes(len(low))], axis=1)
    return low + (high - low) * fractions


def _radical_inverse(count: int, base: int) -> Floats:
    """Return the radical inverses of 1 to `count`, in [0, 1): their digits mirrored at the point."""
    rest = np.arange(1, count + 1)
    inverse, worth = np.zeros(count), 1.0 / base
    while rest.any():
        inverse += (rest % base) * worth
        rest //= base
        worth /= base
    return inverse


def _primes(number: int) -> list[int]:
    """Return the first primes."""
    primes = (n for n in count(2) if all(n % divisor for divisor in range(2, isqrt(n) + 1)))
    return list(islice(primes, number))


def surface(
    system: Inferable,
    x: str | None = None,
    y: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    output: str | None = None,
    num_points: int = 61,
) -> Surface:
    """Evaluate a system over a grid of two of its inputs.

    Parameters
    ----------
    system : FuzzySystem or FuzzyTree
        Without problems, with two inputs or more.
    x, y : str, optional
        The inputs along the axes; by default the first two that are free.
    fixed : mapping, optional
        Values of other inputs; those not given are held in the middle of their universe.
    output : str, optional
        Which output; by default the first.
    num_points : int
        Along each axis.

    Raises
    ------
    ValueError
        If a name is unknown, two roles fall on one input, or there are fewer than two inputs.
    """
    held = dict(fixed or {})
    names = [variable.name for variable in system.inputs]
    x, y = _axes(system, x, y, held)
    concluded = output_named(system, output)
    for variable in system.inputs:
        if variable.name not in (x, y):
            held.setdefault(variable.name, 0.5 * (variable.minimum + variable.maximum))
    x_variable, y_variable = system.variable(x), system.variable(y)
    x_points = np.linspace(x_variable.minimum, x_variable.maximum, num_points)
    y_points = np.linspace(y_variable.minimum, y_variable.maximum, num_points)
    columns = {x: np.tile(x_points, num_points), y: np.repeat(y_points, num_points)}
    columns |= {name: np.full(num_points**2, float(value)) for name, value in held.items()}
    answers = evaluate(system, np.stack([columns[name] for name in names], axis=1))
    values = answers[:, system.outputs.index(concluded)].reshape(num_points, num_points)
    values = np.where(np.isfinite(values), values, np.nan)
    return Surface(x_variable, y_variable, concluded, x_points, y_points, values, held)


def output_named(system: Inferable, name: str | None = None) -> Variable:
    """Return the output of a name, or the first output if no name is given.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    names = [variable.name for variable in system.outputs]
    if name is None:
        return system.outputs[0]
    require_known([name], names, f"system {system.name!r} has no output", ValueError)
    return system.outputs[names.index(name)]


def _axes(system: Inferable, x: str | None, y: str | None, held: dict[str, float]) -> tuple[str, str]:
    """Return the two inputs that span a surface: those named, else the first that are not held."""
    names = [variable.name for variable in system.inputs]
    inputs_named = (*held, *(axis for axis in (x, y) if axis is not None))
    require_known(inputs_named, names, f"system {system.name!r} has no input", ValueError)
    if x is not None and x == y:
        raise ValueError(f"both axes are {x!r}; choose two different inputs")
    for name in held:
        if name in (x, y):
            raise ValueError(f"input {name!r} is an axis and is held as well; drop one of the two")
    free = [name for name in names if name not in held and name not in (x, y)]
    chosen = [axis if axis is not None else (free.pop(0) if free else None) for axis in (x, y)]
    if chosen[0] is None or chosen[1] is None:
        raise ValueError(
            f"a surface needs two free inputs; system {system.name!r} has {', '.join(names)}"
            + (f" with {', '.join(held)} held" if held else "")
            + ("; free one" if held else "; with one input, draw the output's curve (fis_tools plot)")
        )
    return chosen[0], chosen[1]


@lru_cache(maxsize=64)
def coverage(variable: Variable) -> Coverage:
    """Return the value of a variable at which its highest membership in any term is lowest.

    A variable is well covered where each value has a membership of, say, 0.5 in some term.
    """
    functions = variable.memberships
    if len(functions) > MOST_PAIRED:
        return _sunken(variable.universe, functions)
    points = np.union1d(variable.universe, crossings(variable.universe, functions))
    highest = np.max([np.interp(points, variable.universe, function) for function in functions], axis=0)
    worst = int(np.argmin(highest))
    return Coverage(float(highest[worst]), float(points[worst]))


#: Terms of which all pairs are looked at for where they cross.
MOST_PAIRED = 300


def _sunken(universe: Floats, functions: Floats) -> Coverage:
    """Return where the highest of many functions is lowest: convex between points, so thirds find it."""
    left, right = functions[:, :-1], functions[:, 1:]
    low, high = np.zeros(left.shape[1]), np.ones(left.shape[1])

    def highest(share: Floats) -> Floats:
        return np.asarray((left + (right - left) * share).max(axis=0))

    for _ in range(80):
        first, second = low + (high - low) / 3.0, high - (high - low) / 3.0
        is_left = highest(first) <= highest(second)
        low, high = np.where(is_left, low, first), np.where(is_left, second, high)
    candidates = np.stack([np.zeros_like(low), 0.5 * (low + high), np.ones_like(low)])
    heights = np.stack([highest(share) for share in candidates])
    row, segment = np.unravel_index(int(np.argmin(heights)), heights.shape)
    step = universe[segment + 1] - universe[segment]
    return Coverage(float(heights[row, segment]), float(universe[segment] + candidates[row, segment] * step))


def distinguishability(variable: Variable) -> Distinguishability:
    """Compute how similar the terms of a variable are to one another.

    A term whose sampled membership is zero everywhere is like no other, itself included.
    """
    points = np.union1d(variable.universe, crossings(variable.universe, variable.memberships))
    fine = np.stack([np.interp(points, variable.universe, function) for function in variable.memberships])
    shared, joint, highest = np.empty((3, len(fine), len(fine)))
    for index, function in enumerate(fine):  # a row at a time: all pairs at once would fill the memory
        lower = np.minimum(function, fine)
        shared[index], highest[index] = np.trapezoid(lower, points), lower.max(axis=1)
        joint[index] = np.trapezoid(np.maximum(function, fine), points)
    similarity = np.divide(shared, joint, out=np.zeros_like(shared), where=joint > 0)
    return Distinguishability(similarity, highest)


def crossings(universe: Floats, functions: Floats) -> Floats:
    """Return where two sampled functions cross between two points of a universe."""
    crossings_x = [np.empty(0)]
    for index, function in enumerate(functions):
        difference = functions[index + 1 :] - function
        left, right = difference[:, :-1], difference[:, 1:]
        pair, segment = np.nonzero(left * right < 0)
        fraction = left[pair, segment] / (left[pair, segment] - right[pair, segment])
        crossings_x.append(universe[segment] + fraction * (universe[segment + 1] - universe[segment]))
    return np.concatenate(crossings_x)


def rule_usage(strengths: Floats, threshold: float = FIRED) -> RuleUsage:
    """Summarise how rules fire over samples.

    Parameters
    ----------
    strengths : (n, num_rules)
        Firing strengths, one row per sample.
    threshold : float
        The firing strength from which a rule counts as fired.

    Raises
    ------
    ValueError
        If there are no samples.
    """
    if strengths.ndim != 2 or len(strengths) == 0:
        raise ValueError(f"strengths have shape {strengths.shape}; pass one row per sample, at least one")
    strongest = strengths.max(axis=1, keepdims=True)
    fired = np.mean(strengths >= threshold, axis=0)
    leading = np.mean((strengths == strongest) & (strengths > 0), axis=0)
    return RuleUsage(fired, leading, max_strength=strengths.max(axis=0))
