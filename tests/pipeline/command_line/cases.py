"""Configurations and stages for the tests of the door."""

import copy
import sys
from collections.abc import Callable, Collection, Iterator
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.settings.experiment import Experiment
from pipeline.settings.stages import STAGES

#: with a controller that needs no file of ours
FLY = ["+experiment=fly", "controller=coast"]
EVALUATE = ["+experiment=evaluate", "controller=coast"]


@cache
def _composed(*overrides: str) -> dict[str, Any]:
    return compose_experiment([*EVALUATE, *overrides]).config


def plain_config(*overrides: str) -> dict[str, Any]:
    """A configuration as plain data, free to be changed."""
    return copy.deepcopy(_composed(*overrides))


def leaves(node: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """The keys of a configuration by their whole names, with their values."""
    for name, value in node.items():
        if isinstance(value, dict) and value:
            yield from leaves(value, f"{above}{name}.")
        else:
            yield above + name, value


def use_stages(
    monkeypatch: pytest.MonkeyPatch, real: Collection[str] = (), **stages: Callable[[Experiment, Path], None]
) -> list[tuple[str, Experiment, Path]]:
    """Put functions in the place of stages, but for some; the list fills with what was called, in order."""
    called: list[tuple[str, Experiment, Path]] = []

    def run_stage(name: str, experiment: Experiment, folder: Path) -> None:
        called.append((name, experiment, folder))
        if name in stages:
            stages[name](experiment, folder)
        else:
            (folder / f"{name}.txt").write_text(name)

    for name in real:
        monkeypatch.delitem(sys.modules, f"pipeline.stages.{name}", raising=False)
    for name in set(STAGES).difference(real):
        stand_in = SimpleNamespace(run=partial(run_stage, name))
        monkeypatch.setitem(sys.modules, f"pipeline.stages.{name}", stand_in)
    return called
