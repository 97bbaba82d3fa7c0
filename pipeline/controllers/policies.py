"""Learned policies from ONNX files: a chain of layers is read as numbers; anything else is an error.

Nothing in a file is executed: only the constants of its graph are read, and which of a few operators
connect them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.controllers.learned import CLIPPED, LINEAR, TANH, Network, Policy
from pipeline.flight.control.controller import Controller, ControllerError
from pipeline.flight.fly.stepping import NUM_SEEN

MOST_BYTES = 16 << 20
#: limits of a network, counted before anything is allocated: operators and constants, numbers in its layers,
#: and multiplications to read it
MOST_PARTS, MOST_NUMBERS, MOST_STEPS = 10_000, 8 << 20, 4_000_000_000
#: the operators, by the format's names
OPERATORS = ("Add", "Sub", "Mul", "Div", "Clip", "Flatten", "Gemm", "Identity", "MatMul", "Relu", "Tanh")
ONLY_CHAINS = f"only a chain of {', '.join(OPERATORS)} is flown"
#: attributes that are read; operators of early versions of the format have others
ATTRIBUTES = {"Flatten": {"axis"}, "Gemm": {"alpha", "beta", "transA", "transB"}}
#: the format's numbers of what tensors hold and where
FLOAT, DOUBLE, EXTERNAL = 1, 11, 1


class _UnreadableError(ValueError):
    """Why a file cannot fly, without its name."""


def read_policy(path: Path) -> Controller:
    """Read a policy.

    Raises
    ------
    ControllerError
        If the file cannot be read, or is not a chain of `OPERATORS` from the observations to three forces.
    """
    try:
        with path.open("rb") as stream:
            source = stream.read(MOST_BYTES + 1)
    except OSError as error:
        raise ControllerError(f"{path} cannot be read ({error.strerror}); give an ONNX file") from error
    return policy_of(path.stem, source, str(path))


def policy_of(name: str, source: bytes, label: str) -> Controller:
    """Return the controller of an ONNX file's content; `label` names the file in errors.

    Raises
    ------
    ControllerError
        As `read_policy`.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is refused
            network = _network(_graph(source))
    except _UnreadableError as error:
        raise ControllerError(f"{label} cannot fly: {error}") from error
    return Controller(name, (), "hill", pilot=Policy(network, source))


def _graph(source: bytes) -> Any:
    try:
        import onnx  # noqa: PLC0415 - an extra
        from google.protobuf.message import DecodeError  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise _UnreadableError(
            "policies are read by the package onnx; install it: python -m pip install onnx"
        ) from error
    if len(source) > MOST_BYTES:
        raise _UnreadableError(f"it is larger than {MOST_BYTES >> 20} MiB; a policy is a small network")
    try:
        return onnx.ModelProto.FromString(source).graph
    except DecodeError as error:
        raise _UnreadableError("it is no ONNX file; give one, as torch.onnx.export writes it") from error


@dataclass
class _Chain:
    """The layers found so far, and the affine map ``x @ weights + added`` after the last of them.

    `weights` is None where the map has none yet, and stands for the identity.
    """

    added: Floats = field(default_factory=lambda: np.zeros(NUM_SEEN))
    weights: Floats | None = None
    layers: list[tuple[Floats, Floats, int, float, float]] = field(default_factory=list)
    num_numbers: int = 0
    num_steps: int = 0

    def close(self, kind: int, low: float = 0.0, high: float = 0.0) -> None:
        """End a layer."""
        width = len(self.added)
        num_before = width if self.weights is None else len(self.weights)
        self._count(numbers=(num_before + 1) * width)
        weights = np.eye(width) if self.weights is None else self.weights
        if not (np.isfinite(weights).all() and np.isfinite(self.added).all()):
            raise _UnreadableError("its constants multiply to infinity; export a policy that learned numbers")
        self.layers.append((weights, self.added, kind, low, high))
        self.weights, self.added = None, np.zeros(width)

    def multiply(self, matrix: Floats) -> None:
        """Apply a matrix."""
        if matrix.ndim != 2 or len(matrix) != len(self.added):
            raise _UnreadableError(
                f"weights of shape {matrix.shape} follow {len(self.added)} numbers; the first layer takes "
                f"the {NUM_SEEN} numbers that are observed"
            )
        num_rows = 1 if self.weights is None else len(self.weights)
        self._count(steps=num_rows * matrix.size, largest=num_rows * matrix.shape[1])
        self.weights = matrix if self.weights is None else self.weights @ matrix
        self.added = self.added @ matrix

    def scale(self, factor: Floats, added: Floats) -> None:
        """Apply a factor and an offset to each number."""
        width = len(self.added)
        for values in (factor, added):
            if values.size not in (1, width) or values.shape[-1:] not in ((), (values.size,)):
                raise _UnreadableError(f"constants of shape {values.shape} follow {width} numbers")
        factor, added = factor.reshape(-1), added.reshape(-1)
        is_shift = self.weights is None and bool(np.all(factor == 1.0))
        num_rows = width if self.weights is None else len(self.weights)
        self._count(steps=width * (1 if is_shift else num_rows), largest=0 if is_shift else width * num_rows)
        if not is_shift:
            self.weights = (
                np.diag(np.broadcast_to(factor, width)) if self.weights is None else (self.weights * factor)
            )
        self.added = self.added * factor + added

    def _count(self, numbers: int = 0, steps: int = 0, largest: int = 0) -> None:
        """Count what is about to be done, before it is."""
        self.num_numbers, self.num_steps = self.num_numbers + numbers, self.num_steps + steps
        if self.num_numbers + largest > MOST_NUMBERS or self.num_steps > MOST_STEPS:
            raise _UnreadableError(
                f"its layers have more than {MOST_NUMBERS:,} numbers; a policy is a small network"
            )


def _network(graph: Any) -> Network:
    """Read the layers of a graph."""
    if len(graph.node) + len(graph.initializer) > MOST_PARTS:
        raise _UnreadableError(
            f"it has more than {MOST_PARTS:,} operators and constants; a policy is a small network"
        )
    constants = dict(_constants(graph))
    (now,) = _names([value.name for value in graph.input if value.name not in constants], "input")
    (end,) = _names([value.name for value in graph.output], "output")
    chain = _Chain()
    for node in graph.node:
        if node.op_type == "Constant" and not node.domain:
            continue
        if node.op_type not in OPERATORS or node.domain not in ("", "ai.onnx"):
            raise _UnreadableError(f"it has the operator {node.op_type}; {ONLY_CHAINS}")
        unknown = {attribute.name for attribute in node.attribute} - ATTRIBUTES.get(node.op_type, set())
        if unknown:
            raise _UnreadableError(
                f"its operator {node.op_type} has the attribute {min(unknown)!r}; use opset 13 or later"
            )
        is_chain = list(node.input).count(now) == 1 and len(node.output) == 1
        if not is_chain or not all(name == now or name in constants for name in node.input if name):
            raise _UnreadableError(
                f"its operator {node.op_type} does not take the numbers of the one before; {ONLY_CHAINS}"
            )
        values = [None if name == now or not name else constants[name] for name in node.input]
        _follow(chain, node, values)
        (now,) = node.output
    if now != end:
        raise _UnreadableError(f"its output is not what the last operator gives; {ONLY_CHAINS}")
    chain.close(LINEAR)
    return _packed(chain.layers)


def _names(names: Sequence[str], what: str) -> Sequence[str]:
    if len(names) != 1:
        raise _UnreadableError(f"it has {len(names)} {what}s; a policy has one")
    return names


def _constants(graph: Any) -> Iterator[tuple[str, Floats]]:
    """Yield the names and values of a graph's constants."""
    tensors = [(tensor.name, tensor) for tensor in graph.initializer]
    for node in graph.node:
        is_constant = node.op_type == "Constant" and len(node.output) == len(node.attribute) == 1
        if is_constant and node.attribute[0].name == "value":
            tensors.append((node.output[0], node.attribute[0].t))
    from onnx.numpy_helper import to_array  # noqa: PLC0415 - an extra

    for name, tensor in tensors:
        if tensor.data_location == EXTERNAL or tensor.external_data:
            raise _UnreadableError(
                "its weights are in another file; save them in it (torch.onnx.export: external_data=False)"
            )
        if tensor.data_type not in (FLOAT, DOUBLE):
            raise _UnreadableError(
                f"its constant {name} is not of floating point numbers; export it as float32"
            )
        try:
            values = np.asarray(to_array(tensor), dtype=np.float64)
        except ValueError as error:
            raise _UnreadableError(
                f"its constant {name} is not of the shape that it says; export the policy again"
            ) from error
        if not np.isfinite(values).all():
            raise _UnreadableError(f"its constant {name} is not finite; export a policy that learned numbers")
        yield name, values


def _follow(chain: _Chain, node: Any, values: Sequence[Floats | None]) -> None:
    """Apply a node; None stands for the output of the previous one."""
    one = np.ones(1)
    match node.op_type, values:
        case "Identity" | "Flatten", _ if all(axis.i == 1 for axis in node.attribute):
            pass
        case "Tanh", _:
            chain.close(TANH)
        case "Relu", _:
            chain.close(CLIPPED, 0.0, np.inf)
        case "Clip", [None, *limits] if all(limit is None or limit.size == 1 for limit in limits):
            low, high = (None if limit is None else limit.item() for limit in (*limits, None, None)[:2])
            chain.close(CLIPPED, -np.inf if low is None else low, np.inf if high is None else high)
        case "MatMul", [None, np.ndarray() as matrix]:
            chain.multiply(matrix)
        case "Gemm", [None, np.ndarray() as matrix, *bias]:
            _follow_gemm(chain, node, matrix, bias)
        case "Add", [None, np.ndarray() as other] | [np.ndarray() as other, None]:
            chain.scale(one, other)
        case "Sub", [None, np.ndarray() as other]:
            chain.scale(one, -other)
        case "Sub", [np.ndarray() as other, None]:
            chain.scale(-one, other)
        case "Mul", [None, np.ndarray() as other] | [np.ndarray() as other, None]:
            chain.scale(other, 0.0 * one)
        case "Div", [None, np.ndarray() as other] if other.all():
            chain.scale(1.0 / other, 0.0 * one)
        case _:
            raise _UnreadableError(
                f"its operator {node.op_type} does not take numbers and constants as layers do; export "
                "layers with constant weights"
            )


def _follow_gemm(chain: _Chain, node: Any, matrix: Floats, bias: Sequence[Floats | None]) -> None:
    attributes: Mapping[str, Any] = {one.name: one for one in node.attribute}
    alpha, beta = (attributes[name].f if name in attributes else 1.0 for name in ("alpha", "beta"))
    if "transA" in attributes and attributes["transA"].i:
        raise _UnreadableError("its operator Gemm turns its numbers about; export it with transA=0")
    if "transB" in attributes and attributes["transB"].i:
        matrix = matrix.T
    chain.multiply(alpha * matrix)
    if bias and bias[0] is not None:
        chain.scale(np.ones(1), beta * bias[0])


def _packed(layers: Sequence[tuple[Floats, Floats, int, float, float]]) -> Network:
    widths = np.array([NUM_SEEN, *(len(added) for _, added, *_ in layers)], dtype=np.int64)
    if widths[-1] != 3:
        raise _UnreadableError(
            f"it answers with {widths[-1]} numbers; a policy gives three forces, N, Hill axes"
        )
    return Network(
        widths,
        np.concatenate([part.ravel() for weights, added, *_ in layers for part in (weights, added)]),
        np.array([kind for _, _, kind, _, _ in layers], dtype=np.int64),
        np.array([low for *_, low, _ in layers]),
        np.array([high for *_, high in layers]),
    )
