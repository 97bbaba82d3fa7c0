"""What a newcomer is told."""

import re

import pytest

from pipeline.command_line.cli import main
from pipeline.command_line.config import conf_folder, options
from pipeline.flight.state.signals import SIGNALS
from pipeline.run import maker


@pytest.mark.parametrize(("arguments", "code"), [([], 2), (["--help"], 0), (["-h"], 0)])
def test_help_lists_experiments_controllers_and_signals_with_units(
    arguments, code, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == code
    text = capsys.readouterr().out
    groups = options([conf_folder()])
    for name in (*groups["experiment"], *groups["controller"]):
        # each with a sentence behind it
        assert re.search(rf"^  {re.escape(name)} +\S.*\.?$", text, re.MULTILINE), name
    for name, signal in SIGNALS.items():
        assert re.search(rf"^  {name} +\[{re.escape(signal.unit)}\] \w", text, re.MULTILINE), name
    assert "random" in text
    assert list(tmp_path.iterdir()) == []


def test_help_lists_the_users_own(capsys, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "own.yaml").write_text("# @package _global_\n# My own flight.\nname: own\n")
    assert main(["--help", "--config-dir", str(tmp_path)]) == 0
    assert re.search(r"^  own +My own flight\.$", capsys.readouterr().out, re.MULTILINE)


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"fuzzy-spacecraft-inspection {maker.product_version()}\n"
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*", maker.product_version())
