"""Wired systems inferred step by step, for one sample."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines.inference import Inference, OutputInference, infer
from fis_tools.engines.inputs import as_rows
from fis_tools.model import FuzzyTree, Inferable


@dataclass(frozen=True)
class TreeInference:
    """All steps of one inference of a tree.

    Parameters
    ----------
    system : FuzzyTree
    inputs : (num_inputs,)
        As given.
    parts : tuple of Inference
        In the order of its systems.
    outputs : tuple of OutputInference
        In the order of its outputs.
    """

    system: FuzzyTree
    inputs: Floats
    parts: tuple[Inference, ...]
    outputs: tuple[OutputInference, ...]


def infer_tree(tree: FuzzyTree, inputs: Any) -> TreeInference:
    """Evaluate a tree for one sample, keeping every step; parameters and errors as of `infer`."""
    given = as_rows(tree, inputs)
    if given.shape != (len(tree.inputs),):
        raise ValueError(
            f"inputs have shape {given.shape}; {tree.name!r} has {len(tree.inputs)} inputs, pass one number "
            "for each"
        )
    values, parts = given.tolist(), []
    steps: list[OutputInference | None] = [None] * len(values)
    for system, columns in zip(tree.systems, tree.columns, strict=True):
        for column in columns:
            if np.isnan(values[column]):
                raise ValueError(
                    f"{tree.source(column)} is no number there, and {system.name} needs it; give it a default"
                )
        parts.append(infer(system, np.array([values[column] for column in columns])))
        values += [output.value for output in parts[-1].outputs]
        steps += parts[-1].outputs
    outputs = tuple(step for column in tree.output_columns if (step := steps[column]) is not None)
    return TreeInference(tree, given, tuple(parts), outputs)


def infer_whole(system: Inferable, inputs: Any) -> Inference | TreeInference:
    """Evaluate a system or a tree for one sample."""
    return infer_tree(system, inputs) if isinstance(system, FuzzyTree) else infer(system, inputs)
