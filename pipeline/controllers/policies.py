"""Learned policies from ONNX files: a chain of layers is read as numbers; anything else is an error.

Nothing in a file is executed: only the constants of its graph are read, and which of a few operators
connect them. Of several outputs that of the forces is read, and what leads to it.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.controllers.graph import Graph
from pipeline.controllers.layers import NUM_FORCES, NUM_LEVELS, NUM_TURNING, UnreadableError
from pipeline.controllers.learned import Network, Policy, Units
from pipeline.controllers.levels import before_levels
from pipeline.controllers.operators import ChainReader
from pipeline.controllers.turning import TurningPolicy
from pipeline.flight.control.controller import Controller, ControllerError, PilotController
from pipeline.flight.fly.published import NUM_OF_PRIORITY, NUM_OF_TURNING, NUM_PUBLISHED
from pipeline.flight.fly.six_dof import NUM_OBSERVED
from pipeline.flight.fly.stepping import NUM_SEEN
from plain_files.file_access import read_bytes

MOST_BYTES = 16 << 20
#: operators and constants of a graph, counted before anything else
MOST_PARTS = 10_000
#: the format's numbers of what tensors hold and where
FLOAT, INTEGER, DOUBLE, EXTERNAL = 1, 7, 11, 1
#: names by which an output is that of the forces
OUTPUT_NAMES: Final = ("actions", "action", "forces", "force")
#: the metadata that are read, and the values that they may have; the first is that of files without them
METADATA: Final[Mapping[str, tuple[str, ...]]] = {
    "forces": ("newtons", "shares", "levels"),
    "observations": ("physical", "normalized", "published"),
}
#: the metadata that are numbers: the force of a level, N, and the time between decisions, s
LEVELS, DECISION_PERIOD = "levels_n", "decision_period_s"
#: how many numbers AFRL's agents observe
PUBLISHED: Final = (NUM_PUBLISHED, NUM_PUBLISHED + NUM_OF_PRIORITY)
#: how many are observed with six degrees of freedom: by AFRL's agents, and by ours
SIX_DOF: Final = (*(width + NUM_OF_TURNING for width in PUBLISHED), NUM_OBSERVED)
#: the metadata that names the output of the forces
OUTPUT: Final = "output"
CURE: Final = "onnx.helper.set_model_props(model, {...}) sets it"


def read_policy(path: Path) -> Controller:
    """Read a policy.

    Raises
    ------
    ControllerError
        If the file cannot be read, or holds no chain of `pipeline.controllers.operators.OPERATORS` from the
        observations to three forces.
    """
    try:
        source = read_bytes(path, MOST_BYTES)
        data = path.with_name(f"{path.name}.data")
        weights = read_bytes(data, MOST_BYTES) if data.is_file() else None
    except OSError as error:
        raise ControllerError(f"{path} cannot be read ({error.strerror}); give an ONNX file") from error
    return policy_of(path.stem, source, str(path), weights)


def policy_of(name: str, source: bytes, label: str, weights: bytes | None = None) -> Controller:
    """Return the controller of an ONNX file's content.

    Parameters
    ----------
    name : str
    source : bytes
    label : str
        Names the file in errors.
    weights : bytes, optional
        Content of the file ``NAME.onnx.data`` beside it, into which PyTorch exports weights.

    Raises
    ------
    ControllerError
        As `read_policy`.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is refused
            model = _parse(source)
            if _take_in(model, Path(label).name, weights):
                source = model.SerializeToString()
            units = _units(model)
            network = _network(model, units)
    except UnreadableError as error:
        raise ControllerError(f"{label} cannot fly: {error}") from error
    kind = TurningPolicy if network.widths[-1] == NUM_TURNING else Policy
    return PilotController(name, kind(network, source, units))


def _parse(source: bytes) -> Any:
    """Return the model that the bytes of an ONNX file hold."""
    try:
        import onnx  # noqa: PLC0415 - an extra
        from google.protobuf.message import DecodeError  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise UnreadableError(
            "policies are read by the package onnx; install it: python -m pip install onnx"
        ) from error
    if len(source) > MOST_BYTES:
        raise UnreadableError(f"it is larger than {MOST_BYTES >> 20} MiB; a policy is a small network")
    try:
        return onnx.ModelProto.FromString(source)
    except DecodeError as error:
        raise UnreadableError("it is no ONNX file; give one, as torch.onnx.export writes it") from error


def _take_in(model: Any, name: str, weights: bytes | None) -> bool:
    """Load a model's external weights, the content of the file beside it; return whether it has any."""
    outside = [tensor for tensor in model.graph.initializer if tensor.data_location == EXTERNAL]
    for tensor in outside:
        entries = {entry.key: entry.value for entry in tensor.external_data}
        if weights is None or entries.get("location") != f"{name}.data":
            raise UnreadableError(
                f"its weights are in another file, which is not {name}.data beside it; save them in it "
                "(torch.onnx.export: external_data=False)"
            )
        try:
            first, length = int(entries.get("offset", "0")), int(entries["length"])
        except (KeyError, ValueError):
            first, length = -1, 0
        if not 0 <= first <= first + length <= len(weights) <= MOST_BYTES:
            raise UnreadableError(f"{name}.data does not hold its weights; export the policy again")
        tensor.raw_data = weights[first : first + length]
        tensor.ClearField("external_data")
        tensor.ClearField("data_location")
    return bool(outside)


def _metadata(model: Any) -> dict[str, str]:
    return {entry.key: entry.value for entry in model.metadata_props}


def _units(model: Any) -> Units:
    """Return the units that a model's metadata tell."""
    metadata = _metadata(model)
    for key, choices in METADATA.items():
        if (value := metadata.get(key, choices[0])) not in choices:
            raise UnreadableError(
                f"its metadata {key} is {value[:40]!r}; it must be {' or '.join(choices)} ({CURE})"
            )
    forces, observations = (metadata.get(key, choices[0]) for key, choices in METADATA.items())
    if (forces == "levels") != (LEVELS in metadata):
        raise UnreadableError(
            f"its metadata forces is {forces}, and {LEVELS} is {metadata.get(LEVELS, 'missing')[:40]}; "
            f"levels need their force in N, and other forces have none ({CURE})"
        )
    return Units(
        forces_are_shares=forces == "shares",
        observations_are_normalized=observations == "normalized",
        observations_are_published=observations == "published",
        levels_n=_positive(metadata, LEVELS),
        decision_period_s=_positive(metadata, DECISION_PERIOD),
    )


def _positive(metadata: Mapping[str, str], key: str) -> float | None:
    """Return a number above zero that metadata give; None if they do not."""
    if key not in metadata:
        return None
    text = metadata[key][:40]
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise UnreadableError(f"its metadata {key} is {text!r}; it must be a number above 0 ({CURE})")
    return number


def _network(model: Any, units: Units) -> Network:
    """Read the layers from a model's input to its output of forces, or to what tells which level is best."""
    if len(model.graph.node) + len(model.graph.initializer) > MOST_PARTS:
        raise UnreadableError(
            f"it has more than {MOST_PARTS:,} operators and constants; a policy is a small network"
        )
    graph = Graph(model.graph, dict(_tensors(model.graph)), _values)
    width, is_published = _input_width(model, graph.input), units.observations_are_published
    if width in SIX_DOF:
        _check_turning(width, units)
        return ChainReader(graph, width).follow(_output(model, NUM_TURNING), NUM_TURNING)
    reader = ChainReader(graph, _num_published(width) if is_published else NUM_SEEN)
    if units.levels_n is None:
        return reader.follow(_output(model, NUM_FORCES), NUM_FORCES)
    num_outputs = NUM_FORCES * NUM_LEVELS
    output = before_levels(graph, _output(model, num_outputs, NUM_FORCES))
    return reader.follow(output, num_outputs)


def _input_width(model: Any, name: str) -> int:
    (width,) = (_declared_width(value) for value in model.graph.input if value.name == name)
    return width


def _check_turning(width: int, units: Units) -> None:
    """Raise UnreadableError unless units are those of a policy that turns the deputy."""
    if (width != NUM_OBSERVED) != units.observations_are_published:
        are = "published" if width != NUM_OBSERVED else "physical"
        raise UnreadableError(
            f"it takes the {width} numbers of a deputy that turns itself; its metadata observations must be "
            f"{are} ({CURE})"
        )
    if units.levels_n is not None or units.observations_are_normalized:
        raise UnreadableError(
            "with six degrees of freedom observations are not normalized, nor forces levels; leave these "
            f"metadata out ({CURE})"
        )


def _num_published(width: int) -> int:
    """Return how many of the numbers that AFRL's agents observe an input of a declared width takes."""
    if width not in PUBLISHED:
        raise UnreadableError(
            f"its input has the declared width {width}; of AFRL's observations there are {PUBLISHED[0]}, or "
            f"{PUBLISHED[1]} where points have a priority"
        )
    return width


def _output(model: Any, *widths: int) -> str:
    """Return the name of the output of forces, which has one of some widths."""
    outputs = {output.name: output for output in model.graph.output}
    named = _metadata(model).get(OUTPUT)
    if named is not None:
        if named not in outputs:
            raise UnreadableError(f"its metadata {OUTPUT} is {named[:40]!r}, which is none of its outputs")
        return named
    if len(outputs) == 1:
        return next(iter(outputs))
    for name in OUTPUT_NAMES:
        if name in outputs:
            return name
    fitting = [name for name, output in outputs.items() if _declared_width(output) in widths]
    if len(fitting) != 1:
        raise UnreadableError(
            f"it has {len(outputs)} outputs, and none is clearly the one with the forces; name it: "
            f"output_names=['actions', ...] in torch.onnx.export, or the metadata {OUTPUT} ({CURE})"
        )
    return fitting[0]


def _declared_width(value: Any) -> int:
    """Return the second size of the shape of an input or output; zero if it declares none."""
    sizes = value.type.tensor_type.shape.dim
    return int(sizes[1].dim_value) if len(sizes) == 2 else 0


def _tensors(graph: Any) -> Iterator[tuple[str, Any]]:
    """Yield the names and tensors of a graph's constants."""
    for tensor in graph.initializer:
        yield tensor.name, tensor
    for node in graph.node:
        is_constant = node.op_type == "Constant" and len(node.output) == len(node.attribute) == 1
        if is_constant and node.attribute[0].name == "value" and not node.domain:
            yield node.output[0], node.attribute[0].t


def _values(name: str, tensor: Any) -> Any:
    """Return the values of a constant: float64, or int64 for a shape."""
    from onnx.numpy_helper import to_array  # noqa: PLC0415 - an extra

    if tensor.data_type not in (FLOAT, DOUBLE, INTEGER):
        raise UnreadableError(f"its constant {name} is not of floating point numbers; export it as float32")
    try:
        values = np.asarray(to_array(tensor))
    except ValueError as error:
        raise UnreadableError(
            f"its constant {name} does not have the shape that it states; export the policy again"
        ) from error
    if tensor.data_type == INTEGER:
        return values
    if not np.isfinite(values).all():
        raise UnreadableError(f"its constant {name} is not finite; export a policy with finite weights")
    return values.astype(np.float64)
