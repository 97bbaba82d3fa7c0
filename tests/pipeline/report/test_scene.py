"""A logged flight as the player of a page takes it: what it shows is what was flown and recorded."""

import base64
import json

import numpy as np
import pytest
from playwright.sync_api import expect

import telemetry
from fis_tools.analysis import shapley
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model.thrust import COMPONENTS, REASONS, SILENT_N
from fis_tools.words.text import sentences
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.goals.reach import until_end
from pipeline.flight.state.log import REHEARSED
from pipeline.recording.firing import IN_EFFECT, delay_of
from pipeline.recording.recorder import FlightRecorder
from pipeline.report import played
from pipeline.report.contents import ShownFlight
from pipeline.report.played import player_of_flight
from pipeline.report.scene import recorded_table
from pipeline.scenarios import start_shown
from telemetry.page import recorded
from tests.browser import serious_violations
from tests.fis_tools.sample_controllers import SHIPPED

pytestmark = pytest.mark.slow

#: controllers with rules along Hill axes, in worlds that differ in light, motion and chief
FLOWN = (
    *(("champion_27",), ("champion_27_rehearsed",), ("champion_leo", "world=leo")),
    *(("champion_rso", "world=rso"), ("lqr",), ("champion_27", "actuators=real", "actuators.delay_s=20")),
)
#: shipped controllers whose rules ask along the deputy's axes, which turn with its camera
ALONG_DEPUTY = [
    name for name, path in SHIPPED.items() if dict(serialize.load(path).attributes)["force_axes"] == "body"
]


@pytest.fixture(scope="module", params=FLOWN, ids=" ".join)
def flown(request):
    """A job, a controller, its logged flight, and its table."""
    name, *words = request.param
    job = compose_experiment(["+experiment=fly", f"controller={name}", *words])
    mission = job.experiment.mission
    controller = source.named(name, mission)
    _, start = start_shown(job.experiment)
    log = fly_logged(mission, controller, start)
    shown = ShownFlight("start", "Flight", start, log)
    return job, controller, shown, recorded_table(log, controller, mission)


def floats(text):
    return np.frombuffer(base64.b64decode(text), "<f4")


def bits(text, shape):
    unpacked = np.unpackbits(np.frombuffer(base64.b64decode(text), np.uint8), bitorder="little")
    return unpacked[: np.prod(shape)].reshape(shape).astype(bool)


def test_a_table_holds_the_flight(flown):
    _, _, shown, table = flown
    log = shown.log
    assert np.array_equal(floats(table["position"]), log.position_m.astype(np.float32).ravel())
    assert np.array_equal(bits(table["isSeen"], log.is_inspected.shape), log.is_inspected)
    assert not np.any(bits(table["isLit"], log.is_inspected.shape) & log.is_inspected)
    assert len(json.dumps(table)) < 200_000


def test_a_push_names_the_rule_that_recordings_give_the_largest_share(flown, tmp_path):
    job, controller, shown, table = flown
    log, mission = shown.log, job.experiment.mission
    texts = [[table["texts"][index] for index in row] for row in table["reasons"]]
    recorder = FlightRecorder(job.experiment, controller, job.config)
    recorder.record(tmp_path / "flight.mcap", shown.scenario, log, "start")
    recording = telemetry.read(tmp_path / "flight.mcap")
    _, page_table = recorded.table_of(recording)
    num_named = 0
    for system in controller.systems:
        topic = recording.topics[f"/fis/{system.name}"]
        axis = ("force_x", "force_y", "force_z").index(system.outputs[0].name)
        words = list(sentences(system))
        for time_s, shares in zip(topic.time_s, topic.columns["shares_n"], strict=True):
            # of what was not fired a recording has no shares
            if not shares.any():
                continue
            k = round(time_s / mission.control_period_s) + delay_of(mission)
            force = log.force_hill_n[k, axis]
            if force and texts[k][axis].startswith("If "):
                rule = int(np.argmax(shares * np.sign(force)))
                assert texts[k][axis] == f"{words[rule]}."
                on_page = page_table["texts"][page_table["reasons"][k][axis]]
                assert on_page.startswith(f"Rule {rule + 1} of {system.name}: ")
                num_named += 1
    events = recording.topics["/log"]
    chosen = [text for text in events.columns["message"] if text.startswith(("planned", "rehearsed"))]
    is_first = np.any(log.force_hill_n[0] != 0.0) and log.command_reason[0, 0] == REHEARSED
    if is_first:
        assert texts[0][int(np.abs(log.force_hill_n[0]).argmax())].lower() == f"{chosen[0].lower()}."
    assert is_first or num_named > 0 or not controller.systems
    assert is_first == (controller.name == "champion_27_rehearsed")


def test_a_page_of_a_flight_is_of_what_its_case_has_drawn(monkeypatch):
    drawn = "+dispersions.deputy.mass_kg={kind:uniform,low:3.0,high:3.01}"
    experiment = compose_experiment(["+experiment=fly", "controller=champion_27", "case=3", drawn]).experiment
    controller, missions = source.named("champion_27", experiment.mission), []
    _, start = start_shown(experiment)
    log = fly_logged(experiment.mission, controller, start)

    def keep(log, controller, mission):
        missions.append(mission)
        return recorded_table(log, controller, mission)

    monkeypatch.setattr(played, "recorded_table", keep)
    player_of_flight(experiment, controller, log, "Flight", start)
    assert [mission.deputy.mass_kg for mission in missions] == [pytest.approx(3.005, abs=0.005)]


def test_a_thinned_page_names_a_rule_only_of_a_push_that_it_has(tmp_path, monkeypatch):
    job = compose_experiment(["+experiment=fly", "controller=champion_any_sun"])
    mission = job.experiment.mission
    controller = source.named("champion_any_sun", mission)
    start = start_shown(job.experiment)[1]
    log = fly_logged(mission, controller, start)
    FlightRecorder(job.experiment, controller, job.config).record(tmp_path / "a.mcap", start, log, "start")
    named = {}
    for most in (recorded.MOST_SAMPLES, mission.num_controls // 3 + 1):
        monkeypatch.setattr(recorded, "MOST_SAMPLES", most)
        flight, table = recorded.table_of(telemetry.read(tmp_path / "a.mcap"))
        step = round(flight["periodS"] / mission.control_period_s)
        forces = floats(table["force"]).reshape(-1, 3)
        assert np.array_equal(forces[:-1], log.force_hill_n[::step].astype(np.float32))
        is_rule = np.array(
            [[table["texts"][each].startswith("Rule ") for each in row] for row in table["reasons"]]
        )
        named[step] = is_rule[:-1]
        assert not np.any(is_rule[:-1] & (forces[:-1] == 0.0))
    assert np.array_equal(named[3], named[1][::3])
    assert named[3].any()


def test_a_page_of_a_recording_ends_where_a_flight_to_a_goal_does(tmp_path):
    job = compose_experiment(["+experiment=fly", "problem=docking", "controller=champion_docking"])
    mission = job.experiment.mission
    controller = source.named("champion_docking", mission)
    start = start_shown(job.experiment)[1]
    log = fly_logged(mission, controller, start)
    FlightRecorder(job.experiment, controller, job.config).record(tmp_path / "a.mcap", start, log, "start")
    recording = telemetry.read(tmp_path / "a.mcap")
    flight, table = recorded.table_of(recording)
    ended_log = until_end(mission, log)
    assert len(ended_log.delta_v_m_s) < len(log.delta_v_m_s)
    assert flight["numSamples"] == len(ended_log.delta_v_m_s)
    assert flight["numPoints"] == 0
    assert "It does not tell" not in recorded._about(recording, flight, tmp_path / "a.mcap")
    assert recording.end_s == (flight["numSamples"] - 1) * mission.control_period_s
    assert np.array_equal(floats(table["position"]), ended_log.position_m.astype(np.float32).ravel())
    assert floats(table["spent"])[-1] == np.float32(ended_log.delta_v_m_s[-1])


#: thrusters that fire as they are told, and others
THRUSTERS = ((), ("actuators=real", "actuators.delay_s=20"), ("actuators=real", "safety=filter"))


@pytest.mark.parametrize("words", THRUSTERS, ids="-".join)
@pytest.mark.parametrize("name", ALONG_DEPUTY)
def test_a_push_along_the_deputys_axes_is_that_of_the_largest_force_asked(name, words, tmp_path):
    job = compose_experiment(["+experiment=fly", f"controller={name}", "duration_s=900", *words])
    mission = job.experiment.mission
    controller, delay = source.named(name, mission), delay_of(mission)
    start = start_shown(job.experiment)[1]
    log = fly_logged(mission, controller, start)
    FlightRecorder(job.experiment, controller, job.config).record(tmp_path / "a.mcap", start, log, "start")
    _, of_recording = recorded.table_of(telemetry.read(tmp_path / "a.mcap"))
    table, names, num_pushes = recorded_table(log, controller, mission), list(REASONS), 0
    for k, axis in np.argwhere(np.abs(log.force_hill_n) >= SILENT_N):
        text, of_page = (each["texts"][each["reasons"][k][axis]] for each in (table, of_recording))
        if names[log.reason[k, axis]] == "safety":
            assert (text, of_page) == (f"T{REASONS['safety'][1:]}.", "Safety.")
            continue
        commanded = np.isin(log.command_reason[k - delay], IN_EFFECT)
        requested = np.where(commanded, log.force_asked_n[k - delay], 0.0)
        leading = int(np.argmax(np.abs(requested)))
        index = [system.outputs[0].name for system in controller.systems].index(COMPONENTS[leading])
        system = controller.systems[index]
        inputs = log.fis_input[k - delay : k - delay + 1, index, : len(system.inputs)]
        shares = shapley.shares(compile(system), inputs)
        rule = int(np.argmax(shares.values[0, :, 0] * np.sign(requested[leading])))
        assert text == f"Along the deputy's axes: {list(sentences(system))[rule]}."
        assert of_page.startswith(f"Along the deputy's axes: Rule {rule + 1} of {system.name}: ")
        num_pushes += 1
    assert num_pushes > 0


def test_a_push_along_the_deputys_axes_that_no_rule_asked_for_was_fired(tmp_path):
    job = compose_experiment(["+experiment=fly", "duration_s=600"])
    mission = job.experiment.mission
    controller = open_loop("turned", np.tile([0.02, 0.0, 0.0], (mission.num_controls, 1)), "body")
    start = start_shown(job.experiment)[1]
    log = fly_logged(mission, controller, start)
    FlightRecorder(job.experiment, controller, job.config).record(tmp_path / "a.mcap", start, log, "start")
    _, of_recording = recorded.table_of(telemetry.read(tmp_path / "a.mcap"))
    pushes = np.argwhere(np.abs(log.force_hill_n) >= SILENT_N)
    assert len(pushes) > mission.num_controls  # along more than one of Hill's axes
    for table, text in (
        (recorded_table(log, controller, mission), "It was fired."),
        (of_recording, "Fired."),
    ):
        assert {table["texts"][table["reasons"][k][axis]] for k, axis in pushes} == {text}


#: whether the deputy is in the picture of the scene, and before the eye, sample by sample
IS_HELD = """() => {
    const [{ view, flight }] = player.sides, [width, height] = view.size;
    return Array.from({ length: flight.numSamples }, (_, k) => {
        const [x, y, depth] = view.on(flight.position(k));
        return x > 0 && x < width && y > 0 && y < height && !view.isOutside([x, y, depth], [x, y, depth]);
    });
}"""


@pytest.mark.parametrize("width", [400, 1400])
def test_a_page_shows_it(flown, opened, axe, width):
    job, controller, shown, _ = flown
    log = shown.log
    player = player_of_flight(job.experiment, controller, log, shown.title, shown.scenario)
    head = f"<html lang=en><title>A flight</title><style>{player.style}</style>"
    body = f"<main><h1>A flight</h1><h2>Flight</h2>{player.body}</main><script>{player.script}</script>"
    page = opened(head + body, width, reduced_motion="reduce")
    page.wait_for_function("() => globalThis.player?.sides?.[0].view?.isPainted")
    assert page.evaluate(IS_HELD) == [True] * len(log.position_m)
    page.locator(".time").fill("30")
    count = int(log.is_inspected[30].sum())
    expect(page.locator(".count")).to_contain_text(f"{count} of {log.is_inspected.shape[1]} points")
    force = log.force_hill_n[30]
    printed = page.locator(".why").inner_text()
    assert printed.startswith("Push" if np.any(force) else "No push")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []
