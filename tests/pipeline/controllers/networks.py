"""Small networks as ONNX files, as the reference of the format and the product read them."""

from collections.abc import Mapping

import numpy as np
from onnx import ModelProto, TensorProto, helper, numpy_helper

from pipeline.array_types import Floats


def network(
    layers: tuple[Floats, Floats], metadata: Mapping[str, str], kind: int = TensorProto.FLOAT
) -> ModelProto:
    """Return a network of two matrices, (n, h) and (h, m), the hyperbolic tangent between them.

    Its numbers are of single precision, whatever the kind that it computes in.
    """
    numbers = np.float32 if kind == TensorProto.FLOAT else np.float64
    tensors = [
        numpy_helper.from_array(each.astype(np.float32).astype(numbers), f"weights{index}")
        for index, each in enumerate(layers)
    ]
    nodes = [
        helper.make_node("MatMul", ["seen", "weights0"], ["sum"]),
        helper.make_node("Tanh", ["sum"], ["value"]),
        helper.make_node("MatMul", ["value", "weights1"], ["actions"]),
    ]
    ends = [
        helper.make_tensor_value_info(name, kind, [None, size])
        for name, size in (("seen", len(layers[0])), ("actions", layers[1].shape[1]))
    ]
    graph = helper.make_graph(nodes, "policy", ends[:1], ends[1:], tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, dict(metadata))
    return model
