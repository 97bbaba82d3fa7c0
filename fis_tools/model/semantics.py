"""The programs whose inference a system can mean, and what they do differently.

The same terms and rules give other numbers in other programs. scikit-fuzzy integrates a polygon exactly and
clips inputs to their ranges. The others sum over points of an output's range and evaluate the formulas of
inputs at any value, also outside of the range. Their results always lie inside an output's range.
"""

from typing import Literal, NamedTuple, get_args

import numpy as np

from fis_tools.array_types import Floats

#: A program whose inference a system means; "fcl" is jFuzzyLogic's dialect of IEC 61131-7.
Semantics = Literal["scikit-fuzzy", "matlab", "fuzzylite", "fcl"]


class Tool(NamedTuple):
    """A program, and how it samples an output.

    Attributes
    ----------
    title : str
        Its name in sentences.
    points : {"ends", "middles", "left edges"}
        Where an output's range is sampled: at evenly spaced points from end to end, or in the middles or at
        the left edges of intervals of equal width.
    is_by_magnitude : bool
        Whether the smallest and largest of maximum are those of the absolute values.
    has_outputs_without_default : bool
        Whether an output may lack a default: it is then NaN where no rule fires.
    """

    title: str
    points: str
    is_by_magnitude: bool = False
    has_outputs_without_default: bool = False


TOOLS: dict[Semantics, Tool] = {
    "scikit-fuzzy": Tool("scikit-fuzzy", "ends"),
    "matlab": Tool("MATLAB", "ends", is_by_magnitude=True),
    "fuzzylite": Tool("fuzzylite", "middles", has_outputs_without_default=True),
    "fcl": Tool("jFuzzyLogic", "left edges", has_outputs_without_default=True),
}


def sampling_points(semantics: Semantics, minimum: float, maximum: float, num_points: int) -> Floats:
    """Return the points at which a program samples an output, ascending.

    Parameters
    ----------
    semantics : str
    minimum, maximum : float
        The output's range.
    num_points : int
        Of the output's universe; between two of them lies one of the intervals that some programs take.

    Returns
    -------
    (num_points,) or (num_points - 1,) array
    """
    where = TOOLS[semantics].points
    if where == "ends":
        return np.linspace(minimum, maximum, num_points)
    count = num_points - 1
    step = (maximum - minimum) / count
    if where == "middles":
        return np.add(minimum, np.multiply(np.arange(0.5, count), step))
    steps = np.array([minimum, *[step] * (count - 1)], dtype=np.float64)
    return np.cumsum(steps)  # jFuzzyLogic adds step to step, with its rounding


ALL_SEMANTICS: tuple[Semantics, ...] = get_args(Semantics)
