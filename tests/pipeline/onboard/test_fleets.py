"""The on-board function of each deputy of a fleet; what others are known to have seen is an input."""

import re

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.onboard import program
from pipeline.onboard.recorded import Library, differing, recorded
from pipeline.scenarios import evaluation_scenarios
from tests import programs

WORDS = ["controller=champion_27", "fleet.sharing=mask", "fleet.lost_percent=30", "duration_s=900"]
FLEET = ["+experiment=evaluate_fleet", *WORDS, "monte_carlo.num_cases=2", "attitude=ideal"]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    programs.program("gcc", "gcc")
    from pipeline.command_line.cli import main  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("fleet") / "c"
    assert main(["export_c", *FLEET, "--flights", "2", "-o", str(folder)]) == 0
    return folder


def test_each_deputy_flies_in_c_what_it_flew(exported, capsys):
    """Also where a deputy hears late: the input is what it knew. Without what it heard it flies otherwise."""
    experiment = compose_experiment(FLEET).experiment
    mission = experiment.mission
    controller = load(experiment.controller, mission)
    translated, library = program.translate(mission.of_each, controller), Library(exported)
    num_otherwise = 0
    for case in evaluation_scenarios(experiment):
        logs = fly_logged_fleet(mission, controller, case)
        for log, start in zip(logs, case.fleet, strict=True):
            flight = recorded(translated, start, log.flight)
            assert len(differing(library.answers(flight), log.flight)) == 0
            is_seen_by_others = (log.seen_by[:-1] > 0) & (log.seen_by[:-1] != log.deputy)
            flight.steps["unseen"] |= is_seen_by_others
            num_otherwise += len(differing(library.answers(flight), log.flight))
    assert num_otherwise > 0


def test_the_readme_says_what_deputies_send(exported):
    readme = (exported / "README.md").read_text()
    assert "## One of 2 deputies" in readme
    assert "0 of 360 commands of 4 recorded flights differ in any bit" in readme


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("fleet.sharing=nearer",), "fleet.sharing is nearer; on board .*: choose mask"),
        (("safety=filter", "fleet.keep_apart_m=10"), "fleet.keep_apart_m is 10; on board .*: leave it out"),
    ],
)
def test_what_no_function_on_board_decides_is_refused(ran, tmp_path, words, message):
    error = ran("export_c", *FLEET, *words, "-o", tmp_path / "c", code=2).err
    assert not (tmp_path / "c").exists()
    assert re.search(message, error)
