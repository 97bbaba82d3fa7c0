"""The on-board function of each deputy of a fleet; what others have seen and tell is an input."""

import subprocess
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from fis_tools.formats.c.text import WARNINGS
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.fly.fleets import lost_messages
from pipeline.flight.period.decide.exchange import LEAVE
from pipeline.flight.state.log import APART as LIMIT_APART
from pipeline.onboard import export, program
from pipeline.onboard.messages import FIELD_BITS
from pipeline.onboard.recorded import OUTPUT, Library, differing, recorded
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.fleet import SHARING
from tests import programs

WORDS = ["controller=champion_27", "fleet.lost_percent=30", "duration_s=900"]
FLEET = ["+experiment=evaluate_fleet", *WORDS, "monte_carlo.num_cases=2", "attitude=ideal"]
MASK = [*FLEET, "fleet.sharing=mask"]


def translated_fleet(words: list[str]) -> tuple[Any, ...]:
    """The mission, controller, on-board program and starts of a fleet."""
    experiment = compose_experiment(words).experiment
    mission = experiment.mission
    controller = load(experiment.controller, mission)
    translated = program.translate(mission.of_each, controller, fleet=mission.fleet)
    return mission, controller, translated, evaluation_scenarios(experiment)


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
    mission, controller, translated, scenarios = translated_fleet(words)
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


@pytest.mark.slow
def test_each_deputy_follows_its_tour_on_board(tmp_path):
    """Its choice comes from the ground, as the fleet made it; by another tour it flies otherwise."""
    programs.program("gcc", "gcc")
    words = [*FLEET, "world=leo", "controller=champion_leo", "duration_s=1800"]
    mission, controller, translated, scenarios = translated_fleet(words)
    export.export(translated, scenarios[:1], tmp_path / "c", fleet=mission.fleet)
    library, followed = Library(tmp_path / "c"), set()
    for case in scenarios:
        for log, start in zip(fly_logged_fleet(mission, controller, case), case.fleet, strict=True):
            flight = recorded(translated, start, log.flight, log)
            (tour,) = flight.choices.values()
            followed.add(tour)
            assert len(differing(library.answers(flight), log.flight)) == 0
            otherwise = flight._replace(choices={0: (tour + 1) % len(translated.choices)})
            assert len(differing(library.answers(otherwise), log.flight)) > 0
    assert len(followed) > 1


@pytest.mark.parametrize("words", [(), ("navigation=fixes", "actuators=real")], ids=" ".join)
def test_plans_of_fleets_are_an_input_on_board(tmp_path, capsys, words):
    """The planner in C knows one deputy, so it is refused; each flies its part of what all planned."""
    programs.program("gcc", "gcc")
    from pipeline.command_line.cli import main  # noqa: PLC0415

    keys = ["export_c", *FLEET, "controller=champion_27_rehearsed", "duration_s=1800", *words]
    assert main([*keys, "--flights", "1", "-o", str(tmp_path / "refused")]) != 0
    said = capsys.readouterr().err
    assert "plans on board for one deputy, and fleet.deputies is 2; add --bare" in said
    assert main([*keys, "--bare", "--flights", "1", "-o", str(tmp_path / "c")]) == 0
    assert "0 of 360 commands of 2 recorded flights differ" in capsys.readouterr().out


def test_nothing_is_left_or_promised_by_what_is_not_fit(tmp_path):
    programs.program("gcc", "gcc")
    mission, controller, translated, (case, *_) = translated_fleet([*FLEET, "fleet.sharing=nearer"])
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


APART = {
    "two": ["safety=filter", "fleet.keep_apart_m=80"],
    "three": ["safety=filter", "fleet.keep_apart_m=60", "fleet.deputies=3", "fleet.sharing=mask"],
    "late": ["safety=filter", "fleet.keep_apart_m=80", "fleet.delay_periods=2"],
    "errors": ["safety=robust", "fleet.keep_apart_m=60", "navigation=fixes", "actuators=real"],
    "late-errors": [
        *("safety=robust", "fleet.keep_apart_m=60", "navigation=fixes", "actuators=real"),
        *("fleet.delay_periods=1", "fleet.deputies=3"),
    ],
}


def kept_apart(folder, *words, start="monte_carlo.parked=true"):
    """The C of deputies that are kept apart, its missions, and each flight: inputs, and logs of the fleet."""
    programs.program("gcc", "gcc")
    mission, controller, translated, scenarios = translated_fleet([*FLEET, start, *words])
    exported = export.export(translated, scenarios[:1], folder, fleet=mission.fleet)
    assert exported.num_different == 0
    warned = ["gcc", "-std=c99", *WARNINGS, "-fsyntax-only", folder / "controller.c", folder / "packets.c"]
    subprocess.run(warned, check=True)  # noqa: S603
    fleets = [fly_logged_fleet(mission, controller, case) for case in scenarios]
    flights = [
        [recorded(translated, each, log.flight, log) for each, log in zip(case.fleet, logs, strict=True)]
        for case, logs in zip(scenarios, fleets, strict=True)
    ]
    return mission, Library(folder), flights, fleets


def stepped(library, flight, times=1):
    """What is answered to a flight's samples, each given so many times, and where the deputy would stop."""
    outputs, stops = np.zeros(len(flight.steps), OUTPUT), np.zeros((len(flight.steps), 3))
    library.start(flight.start)
    for k in range(len(outputs)):
        for _ in range(times):
            library.tell_stop(flight.steps[k : k + 1], stops[k])
            library.step(flight.steps[k : k + 1], outputs[k : k + 1])
    return outputs, stops


@pytest.mark.parametrize("words", APART.values(), ids=list(APART))
def test_deputies_are_kept_apart_on_board_as_in_flight(tmp_path, words):
    """Each tells the stop that the others went by, and fires what it fired; not without what it heard."""
    mission, library, flights, fleets = kept_apart(tmp_path / "c", *words)
    delay = mission.fleet.delay_periods
    num_kept, num_heard, num_otherwise = 0, 0, 0
    for deputies, logs in zip(flights, fleets, strict=True):
        sent = []
        for flight, log in zip(deputies, logs, strict=True):
            assert len(differing(library.answers(flight), log.flight)) == 0
            flight.steps["unseen"] = library_mask(flight, log)
            outputs, stops = stepped(library, flight)
            np.testing.assert_array_equal(outputs["force_n"], log.flight.force_commanded_n)
            sent.append(stops)
            num_kept += np.count_nonzero(log.flight.safety_limit == LIMIT_APART)
            for name in flight.steps.dtype.names:
                if name.startswith("age_other"):
                    flight.steps[name] = -1
            outputs, _ = stepped(library, flight)
            num_otherwise += np.count_nonzero(outputs["force_n"] != log.flight.force_commanded_n)
        for log in logs:
            for other, stops in enumerate(sent):
                hears = log.arrived[delay:, other] > 0
                np.testing.assert_array_equal(stops[: len(hears)][hears], log.stops[delay:][:, other][hears])
                num_heard += np.count_nonzero(hears)
    assert num_kept > 20
    assert num_heard > 100
    assert num_otherwise > 20


def library_mask(flight, log):
    """The points that a deputy looks for, less what it leaves to others."""
    unseen = flight.steps["unseen"] if flight.sharing is None else flight.sharing.known
    return unseen & (log.left_to == 0)


@pytest.fixture(scope="module")
def near(tmp_path_factory):
    """Deputies that are kept so far apart that few forces are left to them."""
    words = "safety=filter", "fleet.keep_apart_m=80", "fleet.lost_percent=0", "fleet.sharing=mask"
    return kept_apart(tmp_path_factory.mktemp("near") / "c", *words)


BAD_OTHERS, OLD_OTHERS = (FIELD_BITS[name] for name in ("BAD_OTHERS", "OLD_OTHERS"))


@pytest.mark.parametrize("stop", [np.nan, np.inf, 1e9])
def test_a_stop_that_is_none_is_a_lost_message(near, stop):
    _, library, flights, _ = near
    (flight, *_), *_ = flights
    lost, broken = flight._replace(steps=flight.steps.copy()), flight._replace(steps=flight.steps.copy())
    lost.steps["age_other_1"][20:40] = -1
    broken.steps["other_1_stop_m"][20:40, 1] = stop
    (expected, stops), (outputs, others) = stepped(library, lost), stepped(library, broken)
    np.testing.assert_array_equal(outputs["force_n"], expected["force_n"])
    np.testing.assert_array_equal(stops, others)
    heard, _ = stepped(library, flight)
    assert np.any(heard["force_n"] != expected["force_n"])
    assert set(expected["status"][20:40]) == {OLD_OTHERS}
    assert set(outputs["status"][20:40]) == {BAD_OTHERS}
    assert not outputs["status"][:20].any()


@pytest.mark.parametrize("age", [1, 7, -(2**31), 2**31 - 1])
def test_an_old_message_is_a_lost_one(near, age):
    _, library, flights, _ = near
    (flight, *_), *_ = flights
    lost, old = flight._replace(steps=flight.steps.copy()), flight._replace(steps=flight.steps.copy())
    lost.steps["age_other_1"][10:] = -1
    old.steps["age_other_1"][10:] = age
    (expected, _), (outputs, _) = stepped(library, lost), stepped(library, old)
    np.testing.assert_array_equal(outputs["force_n"], expected["force_n"])
    assert set(outputs["status"][10:]) == {OLD_OTHERS}


def test_who_knows_of_nobody_stays_where_it_would_stop(near):
    """After a period without a step, and after a restart: by SciPy's matrix exponential it stops there."""
    mission, library, flights, _ = near
    n, period, mass = mission.orbit.mean_motion_rad_s, mission.control_period_s, mission.deputy.mass_kg
    free = np.zeros((9, 9))
    free[:3, 3:6], free[3:6, 6:] = np.eye(3), np.eye(3) / mass
    free[3, 0], free[3, 4], free[4, 3], free[5, 2] = 3.0 * n * n, 2.0 * n, -2.0 * n, -n * n
    after = expm(free * period)
    num_moving = 0
    for flight in (flight for deputies in flights for flight in deputies):
        for begins in (0, 30):
            steps, k, output = flight.steps.copy(), 31, np.zeros(1, OUTPUT)
            steps["age_other_1"][k:] = -1
            library.start(flight.start)
            if not begins:
                for before in range(k - 1):
                    library.step(steps[before : before + 1], output)
            stop, again = np.zeros((2, 3))
            library.tell_stop(steps[k : k + 1], stop)
            library.step(steps[k : k + 1], output)
            state = np.concatenate([steps["position_m"][k], steps["velocity_m_s"][k], output["force_n"][0]])
            moved = steps[k + 1 : k + 2].copy()
            moved["position_m"], moved["velocity_m_s"] = (after @ state)[:3], (after @ state)[3:6]
            library.tell_stop(moved, again)
            np.testing.assert_allclose(again, stop, rtol=0.0, atol=1e-3)
            num_moving += np.linalg.norm(again - steps["position_m"][k]) > 0.01
    assert num_moving > 0


def test_where_another_starts_unknown_nobody_goes_near(near):
    """With a start that is none, the first force keeps the deputy where it would stop."""
    _, library, flights, _ = near
    (flight, *_), *_ = flights
    steps, output, stop, again = flight.steps.copy(), np.zeros(1, OUTPUT), np.zeros(3), np.zeros(3)
    steps["other_1_stop_m"][0] = np.nan
    library.start(flight.start)
    library.tell_stop(steps[:1], stop)
    library.step(steps[:1], output)
    held = output["force_n"].copy()
    library.start(flight.start)
    steps["other_1_stop_m"][0] = stop
    steps["age_other_1"][0] = -1
    library.step(steps[:1], output)
    np.testing.assert_array_equal(output["force_n"], held)
    library.tell_stop(np.zeros_like(steps[:1]), again)
    assert not again.any()


def test_a_step_that_is_made_twice_commands_the_same(tmp_path):
    words = APART["errors"], "fleet.lost_percent=0", "fleet.sharing=mask"
    _, library, flights, fleets = kept_apart(tmp_path / "c", *words[0], *words[1:])
    (flight, *_), ((log, *_), *_) = flights[0], fleets
    outputs, _ = stepped(library, flight, times=2)
    np.testing.assert_array_equal(outputs["force_n"], log.flight.force_commanded_n)
