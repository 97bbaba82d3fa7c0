"""One inference at a time, in a few microseconds, with everything prepared beforehand.

For control loops in Python. The arrays for inputs and outputs are reused, so a prepared
function must be used by one thread only.
"""

from collections.abc import Callable
from functools import partial
from math import isfinite, isnan

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines import interpreter, number_kernel
from fis_tools.engines.program import Program

Floats = NDArray[np.float64]


def prepare(program: Program, ends: Floats) -> Callable[..., list[float]]:
    """Return a function from the inputs of one sample, numbers in their order, to its outputs.

    Parameters
    ----------
    program : Program
        A system as numbers.
    ends : (num_inputs, 2)
        The first and the last point of each input.

    Returns
    -------
    callable
        It raises a ValueError for a wrong number of inputs or NaN.
    """
    row = np.zeros((1, len(ends)))
    run, outputs = _runner(program, row)
    run()  # compiles, or loads compiled code
    limits = [(float(low), float(high)) for low, high in ends]
    flat = row.reshape(-1)

    def infer(*values: float) -> list[float]:
        if len(values) != len(limits):
            raise ValueError(f"{len(values)} inputs are given; pass {len(limits)} numbers, in their order")
        if not isfinite(sum(values)):
            values = tuple(map(_finite, values, limits))
        for place, value in enumerate(values):
            flat[place] = value
        run()
        found: list[float] = outputs.tolist()
        return found

    return infer


def _finite(value: float, ends: tuple[float, float]) -> float:
    """Return a number, or the end of its range if it is infinite."""
    if isnan(value):
        raise ValueError("an input is NaN; pass numbers, those out of range are clipped")
    return value if isfinite(value) else ends[value > 0.0]


def _runner(program: Program, row: Floats) -> tuple[Callable[[], None], Floats]:
    """Return a function that infers from a row, (1, num_inputs), and the array that it writes into."""
    if number_kernel.covers(program):
        out = np.empty(1)
        words = number_kernel.arguments(program)
        return partial(number_kernel.infer_rows, *(*words, row, out)), out
    outputs = np.empty(len(program.conclusions))
    firing = np.empty((1, program.num_rules))
    fire = partial(interpreter.fire_rows, *program.antecedents, row, firing)
    conclude = [
        interpreter.concluding(
            program, conclusion, firing, row, outputs[:place, np.newaxis], outputs[place : place + 1]
        )
        for place, conclusion in enumerate(program.conclusions)
    ]

    def run() -> None:
        fire()
        for write in conclude:
            write()

    return run, outputs
