from pathlib import Path

import pytest

from pipeline.run.runner import run_stages
from tests.pipeline.recording import cases
from tests.pipeline.recording.cases import Contents


def _recorded(folder: Path, *overrides: str) -> Contents:
    run = cases.composed(*overrides)
    run_stages(run.experiment, run.config, folder)
    return cases.contents(folder / "episodes" / "start.mcap")


@pytest.fixture(scope="session")
def full(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    """The whole flight of `+experiment=fly`, as the stage writes it."""
    return _recorded(tmp_path_factory.mktemp("full"))


@pytest.fixture(scope="session")
def coasting(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    """A flight that completes its inspection of a tumbling chief and then coasts."""
    return _recorded(tmp_path_factory.mktemp("coasting"), *cases.COASTING)
