"""Commands as tests run them, and files for them."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fis_tools.__main__ import main
from fis_tools.formats.serialize import dump_yaml
from fis_tools.model import FuzzyController
from tests.fis_tools.sample_controllers import PAPER_LIKE


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command of `fis_tools`; return its exit status, what it printed, and its errors and notes."""

    def run(*words: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = main([str(word) for word in words])
        return status, *capsys.readouterr()

    return run


@pytest.fixture
def refused(run: Callable[..., tuple[int, str, str]]) -> Callable[..., str]:
    """Run a command of `fis_tools` that is refused; return what it says."""

    def refused(*words: object) -> str:
        status, _, complaint = run(*words)
        assert status == 2
        return complaint

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
