"""What is compiled beforehand: the runs that it takes exist, and each starts twice."""

from subprocess import CompletedProcess

import pytest

from pipeline.command_line import cli
from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment


@pytest.mark.parametrize("words", cli.WARMED, ids=" ".join)
def test_each_run_is_one_of_the_shipped_experiments(words):
    assert compose_experiment(list(words)).experiment.stages


def test_each_is_started_twice_in_new_folders_and_a_failure_ends_it(monkeypatch, capsys):
    started = []
    monkeypatch.setattr(
        cli.subprocess, "run", lambda command, **_: started.append(command) or CompletedProcess(command, 0)
    )
    assert main(["warm"]) == 0
    assert len({command[-1] for command in started}) == 2 * len(cli.WARMED)
    assert [command[3:-1] for command in started[::2]] == [list(words) for words in cli.WARMED]
    monkeypatch.setattr(cli.subprocess, "run", lambda command, **_: CompletedProcess(command, 2))
    assert main(["warm"]) == 2
    assert main(["warm", "champion_27"]) == 2
    assert "in the background" in capsys.readouterr().err
