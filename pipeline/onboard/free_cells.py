"""The cells from which points of a chief are visible, on board: a bit each, or none for a convex body."""

from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.world.surface import ChiefSurface
from pipeline.onboard.arrays import Array
from pipeline.onboard.operations import whole
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression
from pipeline.physics.sight import Occlusion, is_above_horizon, note_free

#: in a byte, and which of them stands for which point
BITS = 8
MASKS = np.left_shift(1, np.arange(BITS)).astype(np.uint8)


class FreeCells:
    """What writes `pipeline.physics.sight.is_free`.

    On a convex body a point is visible from the cells above its horizon, which needs no table.

    Parameters
    ----------
    surface : ChiefSurface
    """

    def __init__(self, surface: ChiefSurface) -> None:
        is_free, edge = surface.occlusion
        above = np.zeros_like(is_free)
        note_free(surface.points, surface.normals, np.zeros((0, 3, 3)), 0.0, edge, above)
        self._normals: Floats | None = surface.normals if np.array_equal(is_free, above) else None
        self._bits = np.packbits(is_free, axis=1, bitorder="little")

    def __call__(self, translator: Translator, occlusion: Occlusion, cell: Any, point: Any) -> Any:
        """Return 1 where a point is visible from a cell, else 0."""
        if self._normals is not None:
            if isinstance(cell, Expression):
                cell = replace(cell, range=(0, len(occlusion.is_free) - 1))
            arguments = [self._normals, occlusion.edge, cell, point]
            return whole(translator, translator.invoked(is_above_horizon, arguments, {}))
        byte = translator.element(
            Array("free_cells", self._bits.shape, "int", self._bits), (cell, point // BITS)
        )
        mask = translator.element(Array("bits", MASKS.shape, "int", MASKS), point % BITS)
        byte, mask = (each.text if isinstance(each, Expression) else f"{each}U" for each in (byte, mask))
        return whole(translator, Expression(f"(({byte} & {mask}) != 0U)", "bool"))
