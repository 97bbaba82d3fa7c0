"""Explanations: the share of each rule in an output, what would flip it, and the shares over a flight."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fis_tools.analysis import shapley
from fis_tools.analysis.contribution import contributions, holding_back
from fis_tools.engines.inference import infer
from fis_tools.findings.explanation.flips import Flip, class_flips, compiled_once, flips, is_classifier, row
from fis_tools.findings.explanation.report import ExplainedOutput, Explanation, Move
from fis_tools.findings.explanation.shares import RuleShare, Shares, shares

__all__ = [
    "ExplainedOutput",
    "Explanation",
    "Flip",
    "Move",
    "RuleShare",
    "Shares",
    "explain",
    "flips",
    "shares",
]


def explain(system: object, inputs: ArrayLike | Mapping[str, float], crossing: float = 0.0) -> Explanation:
    """Explain one inference: the share of each rule in the outputs, and what would flip them.

    Parameters
    ----------
    system : FuzzySystem, CompiledSystem, or what `fis_tools.engines.compiler.compile` takes
    inputs : (num_inputs,) array, or mapping of names to numbers
        Clipped to the universes.
    crossing : float
        The value to be crossed, in the unit of the outputs; 0 asks for the sign.

    Raises
    ------
    ValueError
        If inputs are missing, unknown or NaN, `crossing` is not finite, or a formula has no value there.
    """
    compiled = compiled_once(system)
    given = row(compiled, inputs)
    inference = infer(compiled.system, given)
    for output in inference.outputs:
        if not np.isfinite(output.value):
            raise ValueError(
                f"{output.variable.name} is {output.value} there: a formula that a rule concludes has no "
                "value; ask at other inputs"
            )
    shared, error = shapley.shares(compiled, given[np.newaxis])
    needed = contributions(compiled, given[np.newaxis])
    found = flips(compiled, given, crossing)
    outputs = []
    for place, output in enumerate(inference.outputs):
        strengths = inference.firing_strengths
        concluding = [
            number
            for number, rule in enumerate(compiled.system.rules)
            if strengths[number] > 0.0
            and any(c.variable == output.variable.name and c.weight > 0.0 for c in rule.consequents)
        ]
        moves = [
            Move(
                number + 1,
                float(strengths[number]),
                float(shared[0, number, place]),
                float(needed[0, number, place]),
            )
            for number in concluding
        ]
        moves.sort(key=lambda move: (-abs(move.share), -move.strength))
        of_output = tuple(flip for flip in found if flip.output == output.variable)
        outputs.append(
            ExplainedOutput(
                output.variable,
                output.value,
                output.is_default,
                tuple(moves),
                float(error[0, place]),
                frozenset(holding_back(compiled, place)),
                float(crossing),
                of_output,
            )
        )
    turned = class_flips(compiled, given) if is_classifier(compiled.system) else ()
    return Explanation(compiled.system, tuple(given.tolist()), tuple(outputs), turned)
