"""Commands as tests run them, and files for them."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fis_tools.__main__ import main
from fis_tools.formats.serialize import dump_yaml
from fis_tools.model import FuzzyController
from tests.commands import CommandOutput, running
from tests.fis_tools.sample_controllers import PAPER_LIKE


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., CommandOutput]:
    """Run a command of `fis_tools`, see `running`."""
    return running(main, capsys)


@pytest.fixture
def refused(run: Callable[..., CommandOutput]) -> Callable[..., str]:
    """Run a command of `fis_tools` that is refused; return what it says."""

    def refused(*words: object) -> str:
        captured = run(*words, code=2)
        assert captured.out == ""
        return captured.err

    return refused


@pytest.fixture
def saved(tmp_path: Path) -> Callable[..., Path]:
    """Write a controller into a file; return the file."""

    def saved(controller: FuzzyController, name: str = "controller.yaml") -> Path:
        path = tmp_path / name
        path.write_text(dump_yaml(controller), encoding="utf-8")
        return path

    return saved


@pytest.fixture
def paper(saved: Callable[..., Path]) -> Path:
    """A file of the controller that is like the paper's."""
    return saved(PAPER_LIKE, "paper.yaml")
