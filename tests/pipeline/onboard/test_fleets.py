"""The on-board function of each deputy of a fleet; what others have seen and tell is an input."""

import re

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.fleets import lost_messages
from pipeline.flight.period.decide.exchange import LEAVE
from pipeline.onboard import export, program
from pipeline.onboard.recorded import Library, differing, recorded
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.fleet import SHARING
from tests import programs

WORDS = ["controller=champion_27", "fleet.lost_percent=30", "duration_s=900"]
FLEET = ["+experiment=evaluate_fleet", *WORDS, "monte_carlo.num_cases=2", "attitude=ideal"]
MASK = [*FLEET, "fleet.sharing=mask"]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    programs.program("gcc", "gcc")
    from pipeline.command_line.cli import main  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("fleet") / "c"
    assert main(["export_c", *MASK, "--flights", "2", "-o", str(folder)]) == 0
    return folder


def test_each_deputy_flies_in_c_what_it_flew(exported, capsys):
    """Also where a deputy hears late: the input is what it knew. Without what it heard it flies otherwise."""
    experiment = compose_experiment(MASK).experiment
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


@pytest.mark.parametrize("sharing", SHARING[LEAVE:])
def test_what_is_left_to_others_is_decided_on_board(tmp_path, sharing):
    """It tells what the others heard of it, leaves what it left, and flies what it flew, bit for bit."""
    programs.program("gcc", "gcc")
    words = [*FLEET, f"fleet.sharing={sharing}", "fleet.deputies=3", "monte_carlo.parked=true"]
    experiment = compose_experiment(words).experiment
    mission = experiment.mission
    controller = load(experiment.controller, mission)
    translated = program.translate(mission.of_each, controller, fleet=mission.fleet)
    scenarios = evaluation_scenarios(experiment)
    export.export(translated, scenarios[:1], tmp_path / "c", fleet=mission.fleet)
    library, num_left, num_heard = Library(tmp_path / "c"), 0, 0
    lost = lost_messages(mission, scenarios)
    for case, missed in zip(scenarios, lost, strict=True):
        logs = fly_logged_fleet(mission, controller, case)
        for log, start in zip(logs, case.fleet, strict=True):
            flight = recorded(translated, start, log.flight, log)
            shown, left_to, outputs = library.shares(flight)
            np.testing.assert_array_equal(left_to, log.left_to)
            assert len(differing(outputs, log.flight)) == 0
            num_left += np.count_nonzero(left_to)
            for other in logs:
                hears = missed[: len(shown), other.deputy - 1, log.deputy - 1] == 0
                np.testing.assert_array_equal(shown[hears], other.shown[hears, log.deputy - 1])
                num_heard += np.count_nonzero(shown[hears])
    assert num_left > 100
    assert num_heard > 100


def test_nothing_is_left_or_promised_by_what_is_not_fit(tmp_path):
    programs.program("gcc", "gcc")
    experiment = compose_experiment([*FLEET, "fleet.sharing=nearer"]).experiment
    mission = experiment.mission
    controller = load(experiment.controller, mission)
    translated = program.translate(mission.of_each, controller, fleet=mission.fleet)
    case = evaluation_scenarios(experiment)[0]
    export.export(translated, [case], tmp_path / "c", fleet=mission.fleet)
    library = Library(tmp_path / "c")
    log = fly_logged_fleet(mission, controller, case)[0]
    flight = recorded(translated, case.fleet[0], log.flight, log)
    k = int(np.flatnonzero(log.left_to.any(axis=1))[0])
    step, heard = flight.steps[k : k + 1].copy(), flight.sharing.heard[k : k + 1].copy()
    step["unseen"] = flight.sharing.known[k]
    points = np.zeros((2, step["unseen"].shape[1]), dtype=np.uint8)
    library.start(flight.start)
    assert library.tell(step, points[0]) == 0
    assert library.leave(step, heard, points[1]) == 0
    np.testing.assert_array_equal(points[1], log.left_to[k])
    for field in ("position_m", "velocity_m_s"):
        broken = step.copy()
        broken[field] = np.nan
        assert library.tell(broken, points[0]) != 0
        assert library.leave(broken, heard, points[1]) != 0
        assert not points.any()
    for number in (0, mission.fleet.deputies + 1, -1):
        heard["deputy"] = number
        library.leave(step, heard, points[1])
        assert not points[1].any()


def test_how_deputies_are_kept_apart_is_refused(ran, tmp_path):
    words = "safety=filter", "fleet.keep_apart_m=10"
    error = ran("export_c", *FLEET, *words, "-o", tmp_path / "c", code=2).err
    assert not (tmp_path / "c").exists()
    assert re.search("fleet.keep_apart_m is 10, and nothing on board .*; leave it out", error)
