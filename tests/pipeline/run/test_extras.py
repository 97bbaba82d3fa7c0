"""Packages that only some settings need: a run that lacks one is refused before its folder is made."""

import sys

import pytest

from pipeline.command_line.cli import main
from pipeline.run.extras import PACKAGES


@pytest.mark.parametrize(
    ("module", "words"),
    [
        (
            "optuna",
            ["+experiment=train", "stages=[scenario,search]", "+hparams_search.space.seed={choices: [1, 2]}"],
        ),
        ("tensorboardX", ["+experiment=train", "logger=tensorboard"]),
        ("onnx", ["+experiment=fly", "controller=docs/examples/policy.onnx"]),
        ("trimesh", ["+experiment=fly", "controller=lqr", "chief=satellite", "chief.path=docs/home.stl"]),
    ],
)
def test_a_package_that_is_missing_is_told_before_a_folder_is_made(
    module, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, module, None)
    folder = tmp_path / "run"
    assert main([*words, f"hydra.run.dir={folder}"]) == 2
    error = capsys.readouterr().err
    assert "pip install" in error
    assert PACKAGES.get(module, module).split(maxsplit=1)[0] in error
    assert not folder.exists()
