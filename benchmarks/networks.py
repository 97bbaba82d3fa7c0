"""Networks as ONNX files that fly as ``controller=PATH``; ``python -m benchmarks networks`` writes one.

It writes that of ARCH-COMP's *Docking* (AINNCS; Ravaioli et al., 2022), from JuliaReach's file
``models/SpacecraftDocking/SpacecraftDocking_controller.polar`` (ClosedLoopReachability.jl).
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, checker, helper, numpy_helper

from pipeline.flight.fly.stepping import NUM_SEEN

#: what follows a layer
LINEAR, TANH, RELU, CLIP = "Affine", "tanh", "relu", "clip"
#: of an observation, what ARCH's network sees: position and velocity, radial and along the track
ARCH_SEES: Final = (0, 1, 3, 4)

Layer = tuple[NDArray[np.float64], NDArray[np.float64]]


def write_policy(
    layers: Sequence[Layer], kinds: Sequence[str], force_n: float, path: Path, facts: Mapping[str, str]
) -> None:
    """Write a network of weights and what is added, from observations to shares of a force, as ONNX."""
    constants: dict[str, Any] = {"low": np.array(-1.0), "high": np.array(1.0), "force": np.array(force_n)}
    nodes, name = [], "observed"
    for index, ((weights, added), kind) in enumerate(zip(layers, kinds, strict=True)):
        constants |= {f"weights{index}": weights, f"added{index}": added}
        inputs, name = [name, f"weights{index}", f"added{index}"], f"sum{index}"
        nodes.append(helper.make_node("Gemm", inputs, [name], transB=1))
        if kind in (TANH, RELU):
            nodes.append(helper.make_node(kind.capitalize(), [name], [f"value{index}"]))
            name = f"value{index}"
        elif kind == CLIP:
            nodes.append(helper.make_node("Clip", [name, "low", "high"], [f"value{index}"]))
            name = f"value{index}"
    nodes.append(helper.make_node("Mul", [name, "force"], ["force_n"]))
    ends = [
        helper.make_tensor_value_info(label, TensorProto.FLOAT, [None, size])
        for label, size in (("observed", NUM_SEEN), ("force_n", 3))
    ]
    tensors = [
        numpy_helper.from_array(values.astype(np.float32), label) for label, values in constants.items()
    ]
    graph = helper.make_graph(nodes, "policy", ends[:1], ends[1:], tensors)
    whole = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(whole, dict(facts))
    checker.check_model(whole)
    onnx.save(whole, path)


def note_time(path: Path, begun: float) -> None:
    """Write beside a policy how much processor time its training took, which differs from run to run."""
    path.with_suffix(".json").write_text(
        json.dumps({"processor_s": time.process_time() - begun}) + "\n", encoding="utf-8"
    )


def silenced(layers: Sequence[Layer], kinds: Sequence[str], silent: float) -> tuple[list[Layer], list[str]]:
    """Return a network after which every share of a force is less by one that is too small to fire."""
    if not silent > 0.0:
        return list(layers), list(kinds)
    both = np.vstack([np.eye(3), -np.eye(3)])  # what is above it, forwards and backwards; their difference
    after = [(both, np.full(6, -silent)), (both.T, np.zeros(3))]
    return [*layers, *after], [*kinds, RELU, LINEAR]


def read_polar(path: Path) -> tuple[list[Layer], list[str]]:
    """Return what a file of POLAR has: sizes, what follows each layer, then weights and what is added."""
    lines = path.read_text(encoding="ascii").split()
    inputs, outputs, num_hidden = map(int, lines[:3])
    sizes = [inputs, *map(int, lines[3 : 3 + num_hidden]), outputs]
    kinds, rest = lines[3 + num_hidden : 4 + 2 * num_hidden], lines[4 + 2 * num_hidden :]
    numbers, layers = np.array(rest, dtype=np.float64), []
    for size, rows in pairwise(sizes):
        layer = numbers[: rows * (size + 1)].reshape(rows, size + 1)
        numbers = numbers[layer.size :]
        layers.append((layer[:, :-1], layer[:, -1]))
    if numbers.tolist() != [0.0, 1.0]:  # offset and scale of the outputs
        raise ValueError(f"{path} scales its outputs, which is not read here")
    return layers, kinds


def main(arguments: Sequence[str]) -> int:
    """Write ARCH's network as a policy."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks networks", description=__doc__)
    parser.add_argument("network", type=Path, help="SpacecraftDocking_controller.polar")
    parser.add_argument("policy", type=Path, help="the ONNX file to write")
    options = parser.parse_args(arguments)
    layers, kinds = read_polar(options.network)
    sees = np.eye(NUM_SEEN)[list(ARCH_SEES)]
    first, added = layers[0]
    layers[0] = first @ sees, added
    layers.append((np.eye(3, 2), np.zeros(3)))
    write_policy(layers, [*kinds, LINEAR], 1.0, options.policy, {})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
