"""The operators by which a network tells the best of three levels for each axis: ``argmax`` and around it.

Stable-Baselines3 and CleanRL export the action of a `MultiDiscrete` space so: the numbers of each axis are
split off, made into probabilities or not, and the index of the largest is written beside those of the others.
"""

from typing import Any, Final

from pipeline.controllers.graph import Graph, input_of, whole_attributes
from pipeline.controllers.layers import NUM_FORCES, NUM_LEVELS, UnreadableError
from pipeline.controllers.operators import FLOATS

#: the last axis of values of a shape (flights, numbers)
LAST: Final = (1, -1)
#: the format's numbers of types that hold an index: besides floating point, whole numbers of 32 and 64 bits
INDICES: Final = (*FLOATS, 6, 7)


def before_levels(graph: Graph, output: str) -> str:
    """Return the name of the values whose largest, for each axis, an output tells; its own if it does not.

    Raises
    ------
    UnreadableError
        If the output is an index, but not of the largest of three numbers for each of three axes.
    """
    name = _past_copies(graph, output)
    if (shaped := graph.maker(name, "Reshape")) and graph.integers(shaped, "shape") == [-1, NUM_FORCES]:
        name = _past_copies(graph, input_of(shaped, 0))
    if (node := graph.maker(name, "ArgMax", "Concat")) is None:
        return output
    values = _of_rows(graph, node) if node.op_type == "ArgMax" else _of_parts(graph, node)
    if values is None:
        raise UnreadableError(
            f"its operator {node.op_type} does not tell the largest of three numbers for each of three axes; "
            "export the nine numbers before it"
        )
    return values


def _of_rows(graph: Graph, node: Any) -> str | None:
    """Return the values that are shaped into three rows, of each of which the largest is told."""
    rows = graph.maker(_before_probabilities(graph, input_of(node, 0), (2, -1)), "Reshape")
    if rows is None or not _is_of_largest(node, (2, -1), keeps=False):
        return None
    shape = graph.integers(rows, "shape")
    return input_of(rows, 0) if shape in ([-1, NUM_FORCES, NUM_LEVELS], [1, NUM_FORCES, NUM_LEVELS]) else None


def _of_parts(graph: Graph, node: Any) -> str | None:
    """Return the values that are split, of each part of which the largest is told, in their order."""
    parts = [_before_largest(graph, name) for name in node.input]
    split = graph.maker(parts[0] or "", "Split") if len(parts) == NUM_FORCES else None
    if split is None or parts != list(split.output):
        return None
    is_even = graph.integers(split, "split") in (None, [NUM_LEVELS] * NUM_FORCES)
    axes = (whole_attributes(each).get("axis", 0) for each in (node, split))
    return input_of(split, 0) if is_even and all(axis in LAST for axis in axes) else None


def _before_largest(graph: Graph, name: str) -> str | None:
    """Return the values whose largest an index tells, in a column; None if it is another."""
    name = _past_copies(graph, name)
    if column := graph.maker(name, "Unsqueeze"):
        if graph.integers(column, "axes") not in ([LAST[0]], [LAST[1]]):
            return None
        name = _past_copies(graph, input_of(column, 0))
    node = graph.maker(name, "ArgMax")
    if node is None or not _is_of_largest(node, LAST, keeps=column is None):
        return None
    return _before_probabilities(graph, input_of(node, 0), LAST)


def _is_of_largest(node: Any, axes: tuple[int, ...], *, keeps: bool) -> bool:
    """Return whether an ArgMax tells the first index of the largest along an axis, and keeps that axis."""
    attributes = whole_attributes(node)
    is_along, is_kept = attributes.pop("axis", 0) in axes, bool(attributes.pop("keepdims", 1))
    return is_along and is_kept == keeps and not any(attributes.values())


def _before_probabilities(graph: Graph, name: str, axes: tuple[int, ...]) -> str:
    """Return the values that were made into probabilities, or their logarithms: in the same order."""
    for _ in graph.made_by:  # a file may lead in a circle
        node = graph.maker(name, "Softmax", "LogSoftmax", "Sub", "Identity")
        is_along = node is not None and whole_attributes(node).get("axis", -1) in axes
        if not is_along or (node.op_type == "Sub" and not _is_less_its_sum(graph, node)):
            break
        name = input_of(node, 0)
    return name


def _is_less_its_sum(graph: Graph, node: Any) -> bool:
    """Return whether the logarithm of the sum of their exponentials is subtracted from values."""
    total = graph.maker(input_of(node, 1), "ReduceLogSumExp")
    if total is None or input_of(total, 0) != input_of(node, 0):
        return False
    return (
        graph.integers(total, "axes") in ([LAST[0]], [LAST[1]])
        and whole_attributes(total).get("keepdims", 1) == 1
    )


def _past_copies(graph: Graph, name: str) -> str:
    """Return the name of the values before copies of them, in whatever type holds an index."""
    for _ in graph.made_by:
        node = graph.maker(name, "Identity", "Cast")
        if node is None or (node.op_type == "Cast" and whole_attributes(node).get("to") not in INDICES):
            break
        name = input_of(node, 0)
    return name
