"""The engines of the readable reference flight: our own, or any callable where it runs in plain Python."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.guidance import ClusterMemory, choose_centroid, choose_cluster
from pipeline.flight.reference import inference as reference_inference
from pipeline.flight.reference.inference import PackedSystems

Floats = NDArray[np.float64]

#: place of a system in the channels, inputs of shape (3,) -> output, N
Infer = Callable[[int, Floats], float]
#: candidates (3, P), how many, position (3,), memory -> p_u of shape (3,), m
ChooseTarget = Callable[[Floats, int, Floats, ClusterMemory], Floats]


def infer(inference: Any, system_index: int, inputs: Floats) -> float:
    """Infer an output by packed systems, or by a callable of the place and the inputs."""
    if isinstance(inference, PackedSystems):
        return reference_inference.infer(inference, system_index, inputs)
    return float(inference(system_index, inputs))


def choose_target(
    guidance: Any, candidates: Floats, num_candidates: int, position_h: Floats, memory: ClusterMemory
) -> Floats:
    """Choose a target by our own guidance (with or without clusters), or by a callable like it."""
    if isinstance(guidance, bool):
        return _choose_target(guidance, candidates, num_candidates, position_h, memory)
    target: Floats = guidance(candidates, num_candidates, position_h, memory)
    return target


@compiled
def _choose_target(
    is_clustered: bool, candidates: Floats, num_candidates: int, position_h: Floats, memory: ClusterMemory
) -> Floats:
    if is_clustered:
        return choose_cluster(candidates, num_candidates, position_h, memory)
    return choose_centroid(candidates, num_candidates, position_h, memory)


# Compiled code knows only our own engines. Passing compiled functions as arguments instead would keep the
# episode out of numba's cache.
@overload(infer)
def _infer_compiled(inference: Any, system_index: Any, inputs: Any) -> Callable[[Any, Any, Any], Any]:
    def infer_packed(inference: Any, system_index: Any, inputs: Any) -> Any:
        return reference_inference.infer(inference, system_index, inputs)

    return infer_packed


@overload(choose_target)
def _choose_compiled(
    guidance: Any, candidates: Any, num_candidates: Any, position_h: Any, memory: Any
) -> Callable[[Any, Any, Any, Any, Any], Any]:
    def choose(guidance: Any, candidates: Any, num_candidates: Any, position_h: Any, memory: Any) -> Any:
        return _choose_target(guidance, candidates, num_candidates, position_h, memory)

    return choose
