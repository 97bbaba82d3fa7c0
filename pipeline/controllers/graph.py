"""A graph of ONNX operators: which of them makes each value, and which values are constants."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from numpy.typing import NDArray

from pipeline.controllers.layers import UnreadableError

#: the names of the format's domain of operators
STANDARD: Final = ("", "ai.onnx")


class Graph:
    """A graph of operators, and which of them makes each of its values.

    Parameters
    ----------
    graph : onnx.GraphProto
    tensors : mapping
        Its constants by name.
    values_of : callable
        Returns the values of a constant with a name: float64, or int64 for a shape.

    Attributes
    ----------
    made_by : dict
        The operator that makes each value, by the value's name.
    input : str
        The name of what the network is given.

    Raises
    ------
    UnreadableError
        If it has several inputs.
    """

    def __init__(
        self, graph: Any, tensors: Mapping[str, Any], values_of: Callable[[str, Any], NDArray[Any]]
    ) -> None:
        self.made_by = {name: node for node in graph.node for name in node.output}
        self._tensors, self._values_of = tensors, values_of
        inputs = [value.name for value in graph.input if value.name not in tensors]
        if len(inputs) != 1:
            raise UnreadableError(f"it has {len(inputs)} inputs; a policy has one")
        self.input = inputs[0]

    def maker(self, name: str, *operators: str) -> Any:
        """Return the operator that makes values if it is one of some; else None."""
        node = self.made_by.get(name)
        return node if node is not None and node.op_type in operators and node.domain in STANDARD else None

    def is_number(self, name: str, number: float) -> bool:
        """Return whether a name is a constant that is one number, up to its rounding."""
        values = self.constant(name)
        return values is not None and values.size == 1 and math.isclose(values.item(), number, rel_tol=1e-6)

    def is_constant(self, name: str) -> bool:
        """Return whether a name is a constant of the model, or a copy of one."""
        if name in self._tensors:
            return True
        node = self.made_by.get(name)
        return node is not None and node.op_type == "Identity" and input_of(node, 0) in self._tensors

    def constant(self, name: str) -> Any:
        """Return a constant's values, or None for what is a condition or a shape."""
        if not self.is_constant(name):
            return None
        if name not in self._tensors:
            name = self.made_by[name].input[0]
        return self._values_of(name, self._tensors[name])

    def integers(self, node: Any, attribute: str) -> list[int] | None:
        """Return whole numbers that are an operator's second input, or its attribute; None without them."""
        for each in node.attribute:
            if each.name == attribute:
                return list(each.ints)
        values = self.constant(input_of(node, 1))
        return None if values is None else [int(value) for value in values.ravel()]


def input_of(node: Any, index: int) -> str:
    """Return the name of an operator's input; empty if it has none there."""
    return str(node.input[index]) if index < len(node.input) else ""


def whole_attributes(node: Any) -> dict[str, int]:
    """Return the attributes of an operator that are one whole number."""
    return {each.name: int(each.i) for each in node.attribute if not each.ints}
