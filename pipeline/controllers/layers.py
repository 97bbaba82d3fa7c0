"""The layers of a policy, built up operator by operator, and counted before anything is allocated."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pipeline.array_types import Floats
from pipeline.controllers.learned import LINEAR, Network
from pipeline.flight.fly.stepping import NUM_SEEN

#: limits of a network: numbers in its layers, and multiplications to read it
MOST_NUMBERS, MOST_STEPS = 8 << 20, 4_000_000_000
#: what a policy gives: a force along each axis; or for each axis how good each of three levels is;
NUM_FORCES: Final = 3
NUM_LEVELS: Final = 3
#: or, where it turns the deputy, a force along each body axis and a torque about each
NUM_TURNING: Final = 6
#: the same in words
GIVEN: Final[Mapping[int, str]] = {
    NUM_FORCES: "three forces along Hill axes",
    NUM_FORCES * NUM_LEVELS: "three numbers for each of three forces along Hill axes",
    NUM_TURNING: "three forces along body axes and three torques",
}


class UnreadableError(ValueError):
    """Why a file cannot fly, without its name."""


@dataclass(frozen=True)
class NetworkLayer:
    """An affine map ``x @ weights + bias`` and what is applied to its outputs, see `Network`."""

    weights: Floats
    bias: Floats
    kind: int
    low: float
    high: float


@dataclass
class Chain:
    """A network under construction: its finished layers, and the affine map after them.

    `weights` is None where the map has none yet, and stands for the identity.
    """

    num_seen: int = NUM_SEEN
    bias: Floats = field(init=False)
    weights: Floats | None = None
    layers: list[NetworkLayer] = field(default_factory=list)
    num_numbers: int = 0
    num_steps: int = 0

    def __post_init__(self) -> None:
        self.bias = np.zeros(self.num_seen)

    @property
    def width(self) -> int:
        """Width of the present values."""
        return len(self.bias)

    def close(self, kind: int, low: float = 0.0, high: float = 0.0) -> None:
        """Finish the present layer with an activation."""
        num_before = self.width if self.weights is None else len(self.weights)
        self._count(numbers=(num_before + 1) * self.width)
        weights = np.eye(self.width) if self.weights is None else self.weights
        if not (np.isfinite(weights).all() and np.isfinite(self.bias).all()):
            raise UnreadableError("its constants multiply to infinity; export a policy with finite weights")
        self.layers.append(NetworkLayer(weights, self.bias, kind, low, high))
        self.weights, self.bias = None, np.zeros(self.width)

    def multiply(self, matrix: Floats) -> None:
        """Apply a matrix."""
        if matrix.ndim != 2 or len(matrix) != self.width:
            raise UnreadableError(
                f"weights of shape {matrix.shape} follow {self.width} numbers; the first layer takes "
                f"the {self.num_seen} numbers that are observed"
            )
        num_rows = 1 if self.weights is None else len(self.weights)
        self._count(steps=num_rows * matrix.size, largest=num_rows * matrix.shape[1])
        self.weights = matrix if self.weights is None else self.weights @ matrix
        self.bias = self.bias @ matrix

    def scale(self, factor: Floats, offset: Floats) -> None:
        """Apply a factor and an offset to each number."""
        width = self.width
        for values in (factor, offset):
            if values.size not in (1, width) or values.shape[-1:] not in ((), (values.size,)):
                raise UnreadableError(f"constants of shape {values.shape} follow {width} numbers")
        factor, offset = factor.reshape(-1), offset.reshape(-1)
        is_shift = self.weights is None and bool(np.all(factor == 1.0))
        num_rows = width if self.weights is None else len(self.weights)
        self._count(steps=width * (1 if is_shift else num_rows), largest=0 if is_shift else width * num_rows)
        if not is_shift:
            self.weights = (
                np.diag(np.broadcast_to(factor, width)) if self.weights is None else (self.weights * factor)
            )
        self.bias = self.bias * factor + offset

    def _count(self, numbers: int = 0, steps: int = 0, largest: int = 0) -> None:
        """Count the numbers and steps of an operation; refuse too many before anything is allocated."""
        self.num_numbers, self.num_steps = self.num_numbers + numbers, self.num_steps + steps
        if self.num_numbers + largest > MOST_NUMBERS or self.num_steps > MOST_STEPS:
            raise UnreadableError(
                f"its layers have more than {MOST_NUMBERS:,} numbers; a policy is a small network"
            )

    def network(self, num_outputs: int = NUM_FORCES) -> Network:
        """Finish the last layer and return the network."""
        self.close(LINEAR)
        layers = self.layers
        if self.width != num_outputs:
            raise UnreadableError(
                f"it answers with {self.width} numbers; a policy gives {GIVEN[num_outputs]}"
            )
        widths = [self.num_seen, *(len(layer.bias) for layer in layers)]
        return Network(
            np.array(widths, dtype=np.int64),
            np.concatenate([part.ravel() for layer in layers for part in (layer.weights, layer.bias)]),
            np.array([layer.kind for layer in layers], dtype=np.int64),
            np.array([layer.low for layer in layers]),
            np.array([layer.high for layer in layers]),
        )
