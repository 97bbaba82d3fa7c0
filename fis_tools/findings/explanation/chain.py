"""The explanation of one inference of wired systems: each of them, and what their rules do to the outputs."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fis_tools.analysis.contribution import contributions
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.engines.tree_inference import infer_tree
from fis_tools.engines.trees import CompiledTree
from fis_tools.findings.explanation.flips import flips
from fis_tools.findings.explanation.one_system import (
    WORTH_TELLING,
    ExplainedOutput,
    Explanation,
    crossing_blocks,
    explain_system,
    plain_output,
    stays_in_range,
)
from fis_tools.model import FuzzyTree, Variable
from fis_tools.words.text import amount, inferred_as, sentence, signed
from plain_files.document import Block, Document, Heading, Items, Paragraph, Result, Table

#: rules that are told of an output, unless all are asked for
MOST_RULES = 12


@dataclass(frozen=True)
class ChainMove:
    """What one rule of a tree does to one of the tree's outputs.

    Parameters
    ----------
    system : int
        Which of the tree's systems it belongs to.
    rule : int
        Its number there, from 1.
    output : int
        Which of the tree's outputs.
    needed : float
        What would be missing without it: the output minus the output without the rule, through all wires.
    """

    system: int
    rule: int
    output: int
    needed: float


@dataclass(frozen=True, repr=False)
class ChainExplanation(Result):
    """Why wired systems give their outputs.

    Parameters
    ----------
    system : FuzzyTree
    inputs : tuple of float
        As given, in the order of the tree's inputs.
    values : tuple of float
        Of the inputs, then of all outputs, as `FuzzyTree` counts them.
    outputs : tuple of ExplainedOutput
        Those of the tree, with the changes of one input that flip them; their moves are in `moves`.
    moves : tuple of ChainMove
        The greatest first.
    parts : tuple of Explanation
        Of each system, at what came to it.
    """

    system: FuzzyTree
    inputs: tuple[float, ...]
    values: tuple[float, ...]
    outputs: tuple[ExplainedOutput, ...]
    moves: tuple[ChainMove, ...]
    parts: tuple[Explanation, ...]

    def document(self, *, everything: bool = False) -> Document:
        """Render the whole, then each system; `everything` adds rules with hardly any effect."""
        pairs = zip(self.system.inputs, self.inputs, strict=True)
        words = ", ".join(f"{variable.name} = {amount(variable, value)}" for variable, value in pairs)
        blocks: list[Block] = [Heading(f"{self.system.name} at {words}{inferred_as(self.system.semantics)}")]
        for index, output in enumerate(self.outputs):
            blocks.append(Paragraph(f"{output.variable.name} = {amount(output.variable, output.value)}"))
            rows = [*self._rows(index, output.variable, everything)]
            caption = "needed: what the output would lose without the rule, through all wires"
            if rows:
                blocks.append(Table(["needed", "system", "rule"], rows, numbers=(0,), caption=caption))
            blocks += crossing_blocks(output)
        carried = [
            f"{target} = {amount(variable, value)}, from {source}"
            for source, target, variable, value in self._carried()
        ]
        blocks += [Heading("Through the wires", 3), Items(carried)]
        for part in self.parts:
            blocks += part.document(everything=everything).blocks
        return Document(blocks)

    def _rows(self, index: int, output: Variable, everything: bool) -> Iterator[list[str]]:
        """Yield a row for each rule that moves an output of the whole, the largest first."""
        moves = [move for move in self.moves if move.output == index]
        worth = [move for move in moves if not abs(move.needed) < WORTH_TELLING * output.span]
        for move in moves if everything else worth[:MOST_RULES]:
            system = self.system.systems[move.system]
            words = f"{move.rule}. {sentence(system.rules[move.rule - 1])}"
            yield [signed(output, move.needed), system.name, words]

    def _carried(self) -> Iterator[tuple[str, str, Variable, float]]:
        """Yield each wire from an output in words: its ends and its value."""
        for system, columns in zip(self.system.systems, self.system.columns, strict=True):
            for variable, column in zip(system.inputs, columns, strict=True):
                if column >= len(self.inputs):
                    target = f"{system.name}/{variable.name}"
                    yield self.system.source(column), target, variable, self.values[column]

    def plain(self) -> dict[str, Any]:
        """Return the explanation as plain JSON data; numbers are in the units of their variables.

        Keys are ``system``, ``inputs`` (by name), ``outputs``, each with its ``unit``, ``value``, the
        ``rules`` of all systems and what is ``needed`` of each, and ``flips`` as of one system; ``wires``
        (``from``, ``to``, ``value``); ``parts``: the explanation of each system, at what came to it.
        """
        names = [variable.name for variable in self.system.inputs]
        return {
            "system": self.system.name,
            "inputs": dict(zip(names, self.inputs, strict=True)),
            "outputs": [
                plain_output(
                    output,
                    rules=[
                        {"system": self.system.systems[move.system].name}
                        | {"rule": move.rule, "needed": move.needed}
                        for move in self.moves
                        if move.output == index
                    ],
                )
                for index, output in enumerate(self.outputs)
            ],
            "wires": [
                {"from": source, "to": target, "value": value} for source, target, _, value in self._carried()
            ],
            "parts": [part.plain() for part in self.parts],
        }


def explain_chain(
    compiled: CompiledTree, inputs: ArrayLike | Mapping[str, float], crossing: float
) -> ChainExplanation:
    """Explain one inference of a tree; see `fis_tools.findings.explanation.explain`."""
    tree = compiled.system
    inference = infer_tree(tree, inputs)
    systems = [compile(system) for system in tree.systems]
    ends = set(map(id, inference.outputs))
    parts = [
        explain_system(system, part.inputs, crossing if ends & set(map(id, part.outputs)) else 0.0, None)
        for system, part in zip(systems, inference.parts, strict=True)
    ]
    values = [*inference.inputs.tolist(), *(value for part in inference.parts for value in part.values)]
    all_flips = flips(compiled, inference.inputs, crossing)
    outputs = tuple(
        ExplainedOutput(
            variable,
            step.value,
            step.is_default,
            (),
            0.0,
            frozenset(),
            float(crossing),
            tuple(flip for flip in all_flips if flip.output == variable),
            any(stays_in_range(system, variable) for system in tree.systems if variable in system.outputs),
        )
        for variable, step in zip(tree.outputs, inference.outputs, strict=True)
    )
    moves = sorted(_moves(compiled, inference.inputs, values, parts), key=lambda move: -abs(move.needed))
    return ChainExplanation(
        tree, tuple(inference.inputs.tolist()), tuple(values), outputs, tuple(moves), tuple(parts)
    )


def _moves(
    compiled: CompiledTree, inputs: Floats, values: list[float], parts: list[Explanation]
) -> Iterator[ChainMove]:
    """Yield each output's change without each firing rule; nothing where there is then no number."""
    tree = compiled.system
    for index, (system, first) in enumerate(zip(tree.systems, tree.first_outputs, strict=True)):
        firing = sorted({move.rule for output in parts[index].outputs for move in output.moves})
        if not firing:
            continue
        needed = contributions(compile(system), np.array(parts[index].inputs)[np.newaxis])[0]
        rows = np.tile(inputs, (len(firing), 1))
        chosen = [rule - 1 for rule in firing]
        fixed_values = {first + n: values[first + n] - needed[chosen, n] for n in range(len(system.outputs))}
        without = compiled.values(rows, fixed_values)
        for number, column in enumerate(tree.output_columns):
            for rule, value in zip(firing, without[:, column], strict=True):
                change = float(values[column] - value)
                if np.isfinite(change) and change != 0.0:
                    yield ChainMove(index, rule, number, change)
