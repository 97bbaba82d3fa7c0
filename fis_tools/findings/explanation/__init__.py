"""Explanations: the share of each rule in an output, what would flip it, and the shares over a flight."""

from collections.abc import Mapping
from typing import overload

from numpy.typing import ArrayLike

from fis_tools.analysis.flight_data import Points
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.engines.trees import CompiledTree
from fis_tools.findings.explanation.chain import ChainExplanation, explain_chain
from fis_tools.findings.explanation.flips import Flip, flips
from fis_tools.findings.explanation.one_system import Explanation, explain_system
from fis_tools.findings.explanation.points import missed, rehearsed
from fis_tools.findings.explanation.shares import shares
from fis_tools.model import FuzzyTree

__all__ = ["ChainExplanation", "Explanation", "Flip", "explain", "flips", "missed", "rehearsed", "shares"]


@overload
def explain(  # type: ignore[overload-overlap]
    system: FuzzyTree | CompiledTree, inputs: ArrayLike | Mapping[str, float], crossing: float = 0.0
) -> ChainExplanation: ...
@overload
def explain(
    system: object,
    inputs: ArrayLike | Mapping[str, float],
    crossing: float = 0.0,
    points: Points | None = None,
) -> Explanation: ...
def explain(
    system: object,
    inputs: ArrayLike | Mapping[str, float],
    crossing: float = 0.0,
    points: Points | None = None,
) -> Explanation | ChainExplanation:
    """Explain one inference: the share of each rule in the outputs, and what would flip them.

    Parameters
    ----------
    system : FuzzySystem, FuzzyTree, or what `fis_tools.engines.compiler.compile` takes
    inputs : (num_inputs,) array, or mapping of names to numbers
        Clipped to the universes, where the system's program does so.
    crossing : float
        The value to be crossed, in the unit of the outputs; 0 asks for the sign.
    points : Points, optional
        Which points the inputs are made of, to be told with the explanation.

    Returns
    -------
    Explanation, or ChainExplanation of a tree

    Raises
    ------
    ValueError
        If inputs are missing, unknown or NaN, `crossing` is not finite, or a formula has no value there.
    """
    compiled: CompiledSystem | CompiledTree = compile(system)
    if isinstance(compiled, CompiledTree):
        return explain_chain(compiled, inputs, crossing)
    return explain_system(compiled, inputs, crossing, points)
