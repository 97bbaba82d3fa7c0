"""Functions of a layer's numbers that exporters write as several operators."""

import math
from typing import Any

from pipeline.controllers.graph import Graph, input_of, whole_attributes
from pipeline.controllers.learned import CUBIC, GELU, GELU_TANH, SILU, SLOPE


def softplus_input(graph: Graph, node: Any) -> str | None:
    """Return the input of a softplus that is written as ``x if x > threshold else softplus(x)``."""
    condition, name, other = (*node.input, "", "", "")[:3]
    above, smooth = graph.maker(condition, "Greater"), graph.maker(other, "Softplus")
    is_softplus = above and smooth and list(smooth.input) == [name] and input_of(above, 0) == name
    return str(name) if is_softplus else None


def gate(graph: Graph, node: Any) -> tuple[str, int, float] | None:
    """Return the values that a product gates by a function of them, the kind of layer, and a factor.

    That is x times its logistic function, or x times one plus the error function of x over the root of two,
    or the hyperbolic tangent near it, as exporters write SiLU and twice GELU; None of other products.
    """
    for name, other in (node.input[:2], node.input[1::-1]):
        if (made := graph.maker(other, "Sigmoid", "Add")) is None or graph.is_constant(other):
            continue
        if (made.op_type, list(made.input)) == ("Sigmoid", [name]):
            return str(name), SILU, 1.0
        for added, number in _either_way(made):
            if made.op_type == "Add" and graph.is_number(number, 1.0):
                if _is_erf(graph, added, name):
                    return str(name), GELU, 2.0
                if _is_tanh_near_erf(graph, added, name):
                    return str(name), GELU_TANH, 2.0
    return None


def normalised_input(graph: Graph, node: Any) -> tuple[str, float] | None:
    """Return the values that a quotient normalises, and what is added to their variance.

    That is their difference from their mean, over the root of its mean square plus something, as layer
    normalisation is written before version 17 of the format; None of other quotients.
    """
    away, root = graph.maker(input_of(node, 0), "Sub"), graph.maker(input_of(node, 1), "Sqrt")
    plus = root and graph.maker(input_of(root, 0), "Add")
    if away is None or not plus:
        return None
    name = input_of(away, 0)
    for mean_square, number in _either_way(plus):
        mean = graph.maker(mean_square, "ReduceMean")
        square = mean and graph.maker(input_of(mean, 0), "Pow")
        is_square = square and input_of(square, 0) == input_of(node, 0)
        added = graph.constant(number)
        if (
            is_square
            and graph.is_number(input_of(square, 1), 2.0)
            and _is_of_row(graph, mean)
            and _is_mean_of(graph, input_of(away, 1), name)
            and added is not None
            and added.size == 1
        ):
            return name, float(added.item())
    return None


def _either_way(node: Any) -> list[tuple[str, str]]:
    """Return the two inputs of an operator, in both orders."""
    first, second = input_of(node, 0), input_of(node, 1)
    return [(first, second), (second, first)]


def _is_mean_of(graph: Graph, name: str, values: str) -> bool:
    mean = graph.maker(name, "ReduceMean")
    return mean is not None and input_of(mean, 0) == values and _is_of_row(graph, mean)


def _is_of_row(graph: Graph, mean: Any) -> bool:
    """Return whether a mean is over the last axis, which it keeps."""
    is_last = graph.integers(mean, "axes") in ([1], [-1])
    return is_last and whole_attributes(mean).get("keepdims", 1) == 1


def _is_erf(graph: Graph, name: str, values: str) -> bool:
    """Return whether a name is the error function of values over the root of two."""
    erf = graph.maker(name, "Erf")
    scaled = erf and graph.maker(input_of(erf, 0), "Div", "Mul")
    if not scaled or input_of(scaled, 0) != values:
        return False
    return graph.is_number(input_of(scaled, 1), math.sqrt(2.0 if scaled.op_type == "Div" else 0.5))


def _is_tanh_near_erf(graph: Graph, name: str, values: str) -> bool:
    """Return whether a name is ``tanh(SLOPE * (x + CUBIC * x * (x * x)))`` of values x."""
    tanh = graph.maker(name, "Tanh")
    cubic = tanh and _times(graph, input_of(tanh, 0), SLOPE)
    total = cubic and graph.maker(cubic, "Add")
    if not total:
        return False
    for other, term in _either_way(total):
        cube = _times(graph, term, CUBIC) if other == values else None
        product = cube and graph.maker(cube, "Mul")
        for factor, square in _either_way(product) if product else ():
            squared = graph.maker(square, "Mul") if factor == values else None
            if squared is not None and list(squared.input) == [values, values]:
                return True
    return False


def _times(graph: Graph, name: str, number: float) -> str | None:
    """Return the values that are multiplied by a number to give a name; None if they are not."""
    product = graph.maker(name, "Mul")
    for values, factor in _either_way(product) if product else ():
        if graph.is_number(factor, number):
            return values
    return None
