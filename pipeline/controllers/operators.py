"""The operators of an ONNX graph that a policy may have, from its input to one of its outputs."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from pipeline.array_types import Floats
from pipeline.controllers.graph import STANDARD, Graph, input_of
from pipeline.controllers.layers import NUM_FORCES, Chain, UnreadableError
from pipeline.controllers.learned import (
    CLIPPED,
    ELU,
    GELU,
    GELU_TANH,
    LEAKY,
    NORMED,
    SIGMOID,
    SOFTPLUS,
    TANH,
    Network,
)
from pipeline.controllers.written_out import gate, normalised_input, softplus_input

#: the operators, by the format's names; the last five as exporters write an identity or a softplus
OPERATORS: Final = (
    *(
        "Add",
        "Sub",
        "Mul",
        "Div",
        "Gemm",
        "MatMul",
        "Clip",
        "Elu",
        "Gelu",
        "LayerNormalization",
        "LeakyRelu",
        "Relu",
        "Sigmoid",
        "Softplus",
    ),
    *("Tanh", "Flatten", "Identity", "Cast", "Expand", "Reshape", "Where"),
)
ONLY_CHAINS = f"only a chain of {', '.join(OPERATORS)} is flown"
#: attributes that are read; operators of early versions of the format have others
ATTRIBUTES: Mapping[str, set[str]] = {
    "Cast": {"to", "saturate"},
    "Elu": {"alpha"},
    "Flatten": {"axis"},
    "Gelu": {"approximate"},
    "Gemm": {"alpha", "beta", "transA", "transB"},
    "LayerNormalization": {"axis", "epsilon", "stash_type"},
    "LeakyRelu": {"alpha"},
    "Reshape": {"allowzero"},
}
#: the operators that end a layer, to its kind and parameters; `low` may be given as the attribute alpha
ACTIVATIONS: Final[Mapping[str, tuple[int, float, float]]] = {
    "Elu": (ELU, 1.0, 0.0),
    "LeakyRelu": (LEAKY, 0.01, 0.0),
    "Relu": (CLIPPED, 0.0, np.inf),
    "Sigmoid": (SIGMOID, 0.0, 0.0),
    "Softplus": (SOFTPLUS, 0.0, np.inf),
    "Tanh": (TANH, 0.0, 0.0),
}
#: the format's numbers of types of floating point, of single and double precision
FLOATS: Final = (1, 11)


class ChainReader:
    """Reads a chain of operators as the layers of a network.

    Parameters
    ----------
    graph : pipeline.controllers.graph.Graph
    num_seen : int
        How many numbers the network is given.
    """

    def __init__(self, graph: Graph, num_seen: int) -> None:
        self._graph, self._num_seen = graph, num_seen
        #: width of the values that the chain has come by
        self._widths: dict[str, int] = {}

    def follow(self, output: str, num_outputs: int = NUM_FORCES) -> Network:
        """Return the network from the input to an output.

        Raises
        ------
        UnreadableError
            If other operators than `OPERATORS` lead to it, or not in a chain.
        """
        path: list[tuple[Any, str]] = []
        name = output
        while name != self._graph.input:
            node = self._graph.made_by.get(name)
            if node is None or len(path) > len(self._graph.made_by):
                raise UnreadableError(f"its output is not what the last operator gives; {ONLY_CHAINS}")
            self._check(node)
            name = self._main_input(node)
            path.append((node, name))
        chain = Chain(self._num_seen)
        self._widths[self._graph.input] = chain.width
        for node, name in reversed(path):
            constants = [None if other in (name, "") else self._graph.constant(other) for other in node.input]
            self._apply(chain, node, name, constants)
            self._widths[node.output[0]] = chain.width
        return chain.network(num_outputs)

    def _check(self, node: Any) -> None:
        """Raise UnreadableError unless an operator, with its attributes, is known."""
        if node.op_type not in OPERATORS or node.domain not in STANDARD:
            raise UnreadableError(f"it has the operator {node.op_type}; {ONLY_CHAINS}")
        unknown = {attribute.name for attribute in node.attribute} - ATTRIBUTES.get(node.op_type, set())
        if unknown:
            raise UnreadableError(
                f"its operator {node.op_type} has the attribute {min(unknown)!r}; use opset 13 or later"
            )

    def _main_input(self, node: Any) -> str:
        """Return the one input of an operator that is no constant, nor a condition or a shape."""
        if node.op_type == "Where":
            if (name := softplus_input(self._graph, node)) is None:
                raise UnreadableError(f"its operator Where is no softplus with a threshold; {ONLY_CHAINS}")
            return name
        if node.op_type == "Mul" and (gated := gate(self._graph, node)):
            return gated[0]
        if node.op_type == "Div" and (normalised := normalised_input(self._graph, node)):
            return normalised[0]
        first = 1 if node.op_type in ("Expand", "Reshape") else len(node.input)
        names = [name for name in node.input[:first] if name and not self._graph.is_constant(name)]
        if len(names) != 1 or len(node.output) != 1:
            raise UnreadableError(
                f"its operator {node.op_type} does not take the numbers of the one before; {ONLY_CHAINS}"
            )
        return names[0]

    def _apply(self, chain: Chain, node: Any, name: str, constants: Sequence[Any]) -> None:
        """Apply an operator to the values that have a name; None stands for them among its inputs."""
        attributes = {attribute.name: attribute for attribute in node.attribute}
        match node.op_type:
            case "Reshape":
                shape = None if len(constants) < 2 or constants[1] is None else constants[1].tolist()
                fits = shape in ([-1, chain.width], [1, chain.width])
            case "Expand":
                fits = self._has_shape_of_width(input_of(node, 1), chain.width)
            case "Flatten":
                fits = "axis" not in attributes or attributes["axis"].i == 1
            case "Cast":
                fits = "to" in attributes and attributes["to"].i in FLOATS
            case "Where":
                threshold = self._graph.constant(input_of(self._graph.made_by[node.input[0]], 1))
                fits = threshold is not None and threshold.size == 1
                if fits:
                    chain.close(SOFTPLUS, high=threshold.item())
            case "Mul" if gated := gate(self._graph, node):
                fits = True
                chain.close(gated[1])
                chain.scale(np.full(1, gated[2]), np.zeros(1))
            case "Div" if normalised := normalised_input(self._graph, node):
                fits = True
                chain.close(NORMED, normalised[1])
            case _:
                fits = _follow(chain, node.op_type, constants, attributes)
        if not fits:
            raise UnreadableError(
                f"its operator {node.op_type} does not take numbers and constants as layers do; export "
                "layers with constant weights"
            )

    def _has_shape_of_width(self, name: str, width: int) -> bool:
        """Return whether a value is the shape of values of a width."""
        node = self._graph.made_by.get(name)
        return node is not None and node.op_type == "Shape" and self._width(input_of(node, 0), 0) == width

    def _width(self, name: str, depth: int) -> int:
        """Return the width of values beside the chain, made of it element by element; 0 if unknown."""
        if name in self._widths:
            return self._widths[name]
        node = self._graph.made_by.get(name)
        if node is None or depth > NUM_FORCES:
            return 0
        if node.op_type == "ConstantOfShape":
            shape = self._graph.made_by.get(input_of(node, 0))
            return self._width(input_of(shape, 0), depth + 1) if shape and shape.op_type == "Shape" else 0
        if node.op_type == "Add":
            return max((self._width(other, depth + 1) for other in node.input[:2]), default=0)
        return 0


def _follow(chain: Chain, operator: str, constants: Sequence[Any], attributes: Mapping[str, Any]) -> bool:
    """Apply an operator of a layer; return whether its constants fit. None stands for the chain's values."""
    if any(values is not None and values.dtype != np.float64 for values in constants):
        return False
    if activation := _activation(operator, constants, attributes):
        chain.close(*activation)
        return True
    unity = np.ones(1)
    match operator, constants:
        case "Identity", _:
            pass
        case "MatMul", [None, np.ndarray() as matrix]:
            chain.multiply(matrix)
        case "Gemm", [None, np.ndarray() as matrix, *bias]:
            _follow_gemm(chain, matrix, bias, attributes)
        case "Add", [None, np.ndarray() as other] | [np.ndarray() as other, None]:
            chain.scale(unity, other)
        case "Sub", [None, np.ndarray() as other]:
            chain.scale(unity, -other)
        case "Sub", [np.ndarray() as other, None]:
            chain.scale(-unity, other)
        case "Mul", [None, np.ndarray() as other] | [np.ndarray() as other, None]:
            chain.scale(other, 0.0 * unity)
        case "Div", [None, np.ndarray() as other] if other.all():
            chain.scale(1.0 / other, 0.0 * unity)
        case "LayerNormalization", [None, np.ndarray() as factor, *offset] if _is_of_last_axis(attributes):
            chain.close(NORMED, attributes["epsilon"].f if "epsilon" in attributes else 1e-5)
            chain.scale(factor, offset[0] if offset and offset[0] is not None else 0.0 * unity)
        case _:
            return False
    return True


def _is_of_last_axis(attributes: Mapping[str, Any]) -> bool:
    return "axis" not in attributes or attributes["axis"].i in (-1, 1)


def _activation(
    operator: str, constants: Sequence[Any], attributes: Mapping[str, Any]
) -> tuple[int, float, float] | None:
    """Return the kind of layer that an operator ends, with its parameters; None if it ends none."""
    if operator in ACTIVATIONS:
        kind, alpha, high = ACTIVATIONS[operator]
        return kind, attributes["alpha"].f if "alpha" in attributes else alpha, high
    match operator, constants:
        case "Gelu", _:
            approximate = attributes["approximate"].s if "approximate" in attributes else b"none"
            written = {b"none": GELU, b"tanh": GELU_TANH}
            return (written[approximate], 0.0, 0.0) if approximate in written else None
        case "Clip", [None, *limits] if all(limit is None or limit.size == 1 for limit in limits):
            least, most = (None if limit is None else limit.item() for limit in (*limits, None, None)[:2])
            return CLIPPED, -np.inf if least is None else least, np.inf if most is None else most
    return None


def _follow_gemm(
    chain: Chain, matrix: Floats, bias: Sequence[Floats | None], attributes: Mapping[str, Any]
) -> None:
    """Apply ONNX's Gemm to the chain: a matrix times alpha, then an offset times beta."""
    alpha, beta = (attributes[name].f if name in attributes else 1.0 for name in ("alpha", "beta"))
    if "transA" in attributes and attributes["transA"].i:
        raise UnreadableError("its operator Gemm transposes its input; export it with transA=0")
    if "transB" in attributes and attributes["transB"].i:
        matrix = matrix.T
    chain.multiply(alpha * matrix)
    if bias and bias[0] is not None:
        chain.scale(np.ones(1), beta * bias[0])
