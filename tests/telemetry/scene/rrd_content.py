"""What an .rrd file holds, read with rerun's own reader."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from telemetry.scene import viewer
from telemetry.scene.viewer import Scene

_VIEW_CLASS = "ViewBlueprint:class_identifier"
_VIEW_NAME = "ViewBlueprint:display_name"


class Content:
    """The columns of a recording in an .rrd file, or in several."""

    def __init__(self, *paths: Path):
        self.paths = paths
        self.batches: dict[str, list[pa.RecordBatch]] = {}
        for reader in (RrdReader(str(path)) for path in paths):
            for store in reader.recordings():
                for chunk in reader.stream(store=store):
                    self.batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())

    def column(self, entity: str, component: str) -> list[Any]:
        batches = [b for b in self.batches[entity] if component in b.schema.names]
        return [row for batch in batches for row in batch.column(component).to_pylist()]

    def numbers(self, entity: str, component: str) -> NDArray[np.float64]:
        return np.array(self.column(entity, component), dtype=np.float64)

    def times(self, entity: str, component: str) -> NDArray[np.float64]:
        batches = [b for b in self.batches[entity] if component in b.schema.names]
        return np.concatenate([b.column("time").cast(pa.int64()).to_numpy() for b in batches]) / 1e9


def views(path: Path) -> Iterator[tuple[str, str]]:
    """(class, title) of every view in the file's default blueprint."""
    reader = RrdReader(str(path))
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()
        if {_VIEW_CLASS, _VIEW_NAME} <= set(batch.schema.names):
            (kind,), (name,) = (batch.column(column).to_pylist()[0] for column in (_VIEW_CLASS, _VIEW_NAME))
            yield kind, name


def saved(scene: Scene, folder: Path) -> Content:
    """Save something, and read it back."""
    viewer.save(scene, folder / "x.rrd")
    return Content(folder / "x.rrd")
