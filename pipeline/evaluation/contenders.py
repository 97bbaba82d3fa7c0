"""Who flies in a comparison: controllers by their labels, in missions under a Sun and a safety layer."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fis_tools.formats.serialize import EDITED, EDITED_NAME
from pipeline.flight.control.controller import Controller
from pipeline.settings.experiment import Experiment, Mission, Safety
from pipeline.settings.schema import in_world


def labelled(name: str, names: Sequence[str], controller: Controller) -> str:
    """Return what a table calls a controller; it tells where its file was changed after training."""
    changed = controller.fuzzy is not None and controller.fuzzy.name.endswith(EDITED_NAME)
    return label_of(name, names) + (EDITED_NAME if changed and EDITED not in Path(name).stem else "")


def label_of(name: str, names: Sequence[str]) -> str:
    """Return a controller's name in the table: its file's name if that is unique."""
    stem = Path(name).stem
    return stem if [Path(other).stem for other in names].count(stem) == 1 else name


def under(experiment: Experiment, world: str, sun: Any) -> Experiment:
    """Return an experiment in a world of the comparison, with a setting of the Sun."""
    in_that_world = in_world(experiment, world)
    return replace(in_that_world, sun=replace(in_that_world.sun, mode=sun))


def guarded(mission: Mission, layer: str) -> Mission:
    """Return a mission with a safety layer; the filter has the mission's own parameters.

    Without one nothing keeps deputies apart, which the layer does.
    """
    if layer == "none":
        return replace(mission, safety=Safety(), fleet=replace(mission.fleet, keep_apart_m=0.0))
    return replace(mission, safety=replace(mission.safety, kind="filter"))
