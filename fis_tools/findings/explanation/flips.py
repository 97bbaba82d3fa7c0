"""The smallest change of one input that takes an output to the other side of a value."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fis_tools.array_types import Booleans, Floats
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.engines.inference import infer
from fis_tools.engines.tree_inference import infer_whole
from fis_tools.engines.trees import CompiledTree
from fis_tools.model import FuzzySystem, Variable

#: Steps of the search from one point of a universe to the next.
STEPS = 8
#: How near a flip is located, as a fraction of the input's range.
LOCATED = 1e-9
#: Nearer to a value than this, as a fraction of its range, an output is on neither side of it.
TOUCHING = 1e-12


@dataclass(frozen=True)
class Flip:
    """The first flip on the way from an input to one end of its range, the other inputs held.

    Parameters
    ----------
    output, input : Variable
    way : int
        1 towards the upper end, -1 towards the lower one; from beyond a range one way leads back to it.
    given : float
        The input where the way begins, in its unit.
    side : int
        The side of the value on which the output starts: 1, -1, or 0 for neither.
    last, first : float or None
        The input before and after the nearest value that takes the output to the other side (from neither:
        to either); they are `LOCATED` of the range apart at most. None where no value of the input does it.
    output_at_last, output_at_first : float or None
        The output at both.
    takes_default : bool
        Whether no rule fires at `first`, so that the output is its default.
    """

    output: Variable
    input: Variable
    way: int
    given: float
    side: int
    last: float | None = None
    first: float | None = None
    output_at_last: float | None = None
    output_at_first: float | None = None
    takes_default: bool = False

    @property
    def direction(self) -> str:
        """``up`` or ``down``."""
        return "up" if self.way > 0 else "down"

    @property
    def change(self) -> float | None:
        """How far the input must change, with its sign."""
        return None if self.first is None else self.first - self.given

    @property
    def share(self) -> float:
        """The size of the change as a share of the input's range; infinite if no change suffices."""
        return np.inf if self.change is None else abs(self.change) / self.input.span


def flips(system: object, inputs: ArrayLike | Mapping[str, float], value: float = 0.0) -> tuple[Flip, ...]:
    """Find for each output the smallest changes of one input that take it across a value.

    Each way is searched at `STEPS` values between neighbouring points of the universe, then halved; a visit
    to the other side that is shorter than such a step can be missed. Jumps count.

    Parameters
    ----------
    system : FuzzySystem, FuzzyTree, or what `fis_tools.engines.compiler.compile` takes
    inputs : (num_inputs,) array, or mapping of names to numbers
        Where to start; clipped to the universes.
    value : float
        What is to be crossed, in the unit of the outputs.

    Returns
    -------
    tuple of Flip
        By output; for each the smallest changes first, as shares of the ranges, and two for each input.

    Raises
    ------
    ValueError
        If inputs are missing, unknown or NaN, or the value is not finite.
    """
    compiled: CompiledSystem | CompiledTree = compile(system)
    given = infer_whole(compiled.system, inputs).inputs
    if not np.isfinite(value):
        raise ValueError(f"the value to cross is {value}; give a finite number")
    all_flips: list[Flip] = []
    for number, output in enumerate(compiled.system.outputs):

        def side_of(outputs: Floats, number: int = number, output: Variable = output) -> Floats:
            differences = outputs[:, number] - value
            return np.where(np.abs(differences) <= TOUCHING * output.span, 0.0, np.sign(differences))

        of_output = []
        for index, direction, side, ends in _searched(compiled, given, side_of):
            flip = Flip(output, compiled.system.inputs[index], direction, float(given[index]), int(side))
            if ends is not None:
                before, after = (infer_whole(compiled.system, end).outputs[number] for end in ends)
                numbers = (float(ends[0][index]), float(ends[1][index]), before.value, after.value)
                flip = Flip(output, flip.input, direction, flip.given, flip.side, *numbers, after.is_default)
            of_output.append(flip)
        all_flips += sorted(of_output, key=lambda flip: flip.share)
    return tuple(all_flips)


@dataclass(frozen=True)
class ClassFlip:
    """The first value of one input, the others held, at which another output is the greatest.

    Parameters
    ----------
    input : Variable
    given, first : float
        The input where the way begins, and where the class changes.
    other : Variable
        The output that is the greatest there.
    takes_default : bool
        Whether no rule fires there, so that all outputs are their defaults.
    """

    input: Variable
    given: float
    first: float
    other: Variable
    takes_default: bool

    @property
    def share(self) -> float:
        """The size of the change as a share of the input's range."""
        return abs(self.first - self.given) / self.input.span


def is_classifier(system: FuzzySystem) -> bool:
    """Return whether a system gives shares of classes: several weighted outputs from 0 to 1."""
    shares = [(output.minimum, output.maximum) == (0.0, 1.0) for output in system.outputs]
    return len(shares) > 1 and all(shares) and len(system.weighed) == len(shares)


def class_flips(compiled: CompiledSystem, given: Floats) -> tuple[ClassFlip, ...]:
    """Find the smallest changes of one input that flip the class, searched as in `flips`; smallest first."""
    system, all_flips = compiled.system, []
    winner = int(compiled(given[np.newaxis])[0].argmax())

    def side_of(outputs: Floats) -> Floats:
        return np.where(outputs.argmax(axis=1) == winner, 1.0, -1.0)

    for index, _, _, ends in _searched(compiled, given, side_of):
        if ends is not None:
            other = system.outputs[int(compiled(ends[1][np.newaxis])[0].argmax())]
            is_silent = all(output.is_default for output in infer(system, ends[1]).outputs)
            numbers = (float(given[index]), float(ends[1][index]))
            all_flips.append(ClassFlip(system.inputs[index], *numbers, other, is_silent))
    return tuple(sorted(all_flips, key=lambda flip: flip.share))


def _searched(
    compiled: CompiledSystem | CompiledTree, given: Floats, side_of: Callable[[Floats], Floats]
) -> Iterator[tuple[int, int, float, tuple[Floats, Floats] | None]]:
    """Yield input, direction, the side at the start, and the inputs just before and after it changes.

    Sides of outputs are 1, -1, or 0 for neither; from neither, either is another side.
    """
    for index, direction, rows in _ways(compiled, given):
        sides = side_of(compiled(rows))
        across, ends = np.flatnonzero(_is_across(sides, sides[0])), None
        if len(across):
            last, first = rows[across[0] - 1], rows[across[0]]
            while abs(first[index] - last[index]) > LOCATED * compiled.system.inputs[index].span:
                middle = last.copy()
                middle[index] = 0.5 * (last[index] + first[index])
                if middle[index] in (last[index], first[index]):  # beyond a range numbers may lie far apart
                    break
                is_there = _is_across(side_of(compiled(middle[np.newaxis])), sides[0])[0]
                last, first = (last, middle) if is_there else (middle, first)
            ends = (last, first)
        yield index, direction, float(sides[0]), ends


def _ways(compiled: CompiledSystem | CompiledTree, given: Floats) -> Iterator[tuple[int, int, Floats]]:
    """Yield, for each input and direction, samples from the present value to that end of the range."""
    variables = compiled.system.inputs
    start = np.clip(given, *np.transpose([compiled.system.limits_of(v) for v in variables]))
    for index, variable in enumerate(variables):
        parts = np.arange(STEPS) / STEPS
        universe = variable.universe
        fine = (universe[:-1, np.newaxis] + np.diff(universe)[:, np.newaxis] * parts).ravel()
        fine = np.append(fine, universe[-1])
        value = start[index]
        end = min(max(value, universe[0]), universe[-1])
        if end != value and np.isfinite(value):  # from beyond the range: on the way back to it, too
            fine = np.union1d(fine, np.linspace(value, end, len(fine)))
        for direction, samples in ((1, fine[fine > value]), (-1, fine[fine < value][::-1])):
            rows = np.tile(start, (1 + len(samples), 1))
            rows[1:, index] = samples
            yield index, direction, rows


def _is_across(sides: Floats, start: float) -> Booleans:
    """Return which samples are on another side than the start."""
    return sides != 0.0 if start == 0.0 else sides == -start
