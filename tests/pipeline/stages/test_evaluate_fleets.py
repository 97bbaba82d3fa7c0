"""An evaluation of fleets in miniature: its starts, its tables and its summary."""

import csv
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

import telemetry
from pipeline.command_line.cli import main
from pipeline.controllers.source import load
from pipeline.evaluation import merging, parts
from pipeline.evaluation.after import coasting_pairs
from pipeline.evaluation.monte_carlo import fly_fleets
from pipeline.evaluation.statistics import statistic
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.fleet_logs import DeputyLog, fly_logged_fleet
from pipeline.flight.fly.fleets import OF_DEPUTIES
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.flight.state.log import APART
from pipeline.preflight import check_before
from pipeline.recording.fleets import fleet_events
from pipeline.recording.reflight import fly_again
from pipeline.run import artifacts
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.checks import SettingError
from pipeline.settings.fleet import SHARING
from telemetry import RecordingError
from telemetry.file.reader import read
from telemetry.file.topics import DEPUTY_STATE, MISSION
from telemetry.page import recorded
from tests.browser import serious_violations
from tests.pipeline.evaluation.propagated import linear
from tests.pipeline.stages.cases import MINIATURE, carried_out, composed, prepared

FLEET = ("controller=champion_27", "sun=random", "fleet.deputies=3")


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleets")
    return carried_out(prepared(folder, *FLEET, experiment="evaluate_fleet"), folder), folder


def test_a_row_each_fleet_and_a_row_each_deputy(evaluated):
    _, folder = evaluated
    episodes = pq.read_table(folder / artifacts.EPISODES).to_pydict()
    deputies = pq.read_table(folder / artifacts.DEPUTIES).to_pydict()
    assert episodes["case"] == list(range(5))
    assert deputies["case"] == [case for case in range(5) for _ in range(3)]
    assert deputies["deputy"] == [1, 2, 3] * 5
    by_fleet = {name: np.reshape(values, (5, 3)) for name, values in deputies.items()}
    for name, join in {
        **dict.fromkeys(("delta_v_m_s", "inspected_count", "safety_periods"), np.sum),
        **dict.fromkeys(("max_distance_m",), np.max),
        **dict.fromkeys(("min_distance_m", "stays_orbit", "passively_safe"), np.min),
    }.items():
        np.testing.assert_allclose(episodes[name], join(by_fleet[name], axis=1), err_msg=name)
    np.testing.assert_array_equal(episodes["greatest_delta_v_m_s"], by_fleet["delta_v_m_s"].max(axis=1))
    np.testing.assert_array_equal(episodes["violated"], by_fleet["violated"].any(axis=1))
    assert not (folder / artifacts.TRAJECTORIES).exists()


def test_starts_are_listed_by_deputy(evaluated):
    _, folder = evaluated
    with (folder / artifacts.SCENARIOS).open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["set"], row["case"], row["deputy"]) for row in rows] == [
        ("evaluation", str(case), str(deputy)) for case in range(5) for deputy in (1, 2, 3)
    ]
    deputies = pq.read_table(folder / artifacts.DEPUTIES)["position_x_m"].to_pylist()
    assert [float(row["position_x_m"]) for row in rows] == deputies
    assert len({row["sun_angle_rad"] for row in rows}) == 5


def test_the_summary_tells_of_the_fleet(evaluated):
    run, folder = evaluated
    summary = artifacts.read_json(folder, artifacts.SUMMARY)
    episodes = pq.read_table(folder / artifacts.EPISODES).to_pydict()
    assert summary["fleet"] == {
        "deputies": 3,
        "sharing": "nearer",
        "delay_periods": 0,
        "lost_percent": 0.0,
        "keep_apart_m": 0.0,
    }
    assert summary["optimum"] == {"not_compared": "the plans are of one deputy"}
    for name in ("delta_v_m_s", "greatest_delta_v_m_s", "nearest_pair_m"):
        assert summary[name]["mean"] == statistic(np.array(episodes[name]), 95.0).mean
    assert run.experiment.mission.fleet.deputies == 3


def test_a_controller_that_plans_is_refused_before_a_folder_is_made():
    run = composed(*FLEET[1:], "controller=champion_27_one_push", experiment="evaluate_fleet")
    with pytest.raises(ControllerError, match="such as champion_27"):
        check_before(run.experiment)


def test_each_deputy_is_recorded_as_it_flew(evaluated):
    _, folder = evaluated
    paths = sorted((folder / artifacts.RECORDINGS).iterdir())
    assert len(paths) == 9
    episodes = pq.read_table(folder / artifacts.EPISODES).to_pydict()
    deputies = pq.read_table(folder / artifacts.DEPUTIES).to_pydict()
    for path in paths:
        case, deputy = map(int, re.fullmatch(r"\w+-case-(\d+)-deputy-(\d)\.mcap", path.name).groups())
        recording = telemetry.read(path)
        episode, row = recording.episode, 3 * case + deputy - 1
        assert (episode.deputy, episode.fleet_deputies, episode.fleet_sharing) == (deputy, 3, "nearer")
        assert episode.position_m[0] == deputies["position_x_m"][row]
        mission = recording[MISSION]
        assert mission["inspected_count"][-1] == episodes["inspected_count"][case]
        assert mission["delta_v_m_s"][-1] == pytest.approx(deputies["delta_v_m_s"][row], abs=1e-12)
        assert mission["distance_m"].max() == pytest.approx(deputies["max_distance_m"][row])
        with pytest.raises(RecordingError, match=r"is of one deputy of a fleet"):
            fly_again(path)


@pytest.mark.parametrize("keep_apart_m", [0, 95])
@pytest.mark.parametrize("link", [(), ("fleet.delay_periods=2", "fleet.lost_percent=30")], ids=["", "late"])
@pytest.mark.parametrize("sharing", SHARING)
def test_a_deputys_log_has_the_bits_of_the_fleet(sharing, link, keep_apart_m):
    words = ["controller=champion_27", "sun=random", f"fleet.sharing={sharing}", *link]
    words += ["safety=filter", f"fleet.keep_apart_m={keep_apart_m}"] if keep_apart_m else []
    experiment = composed(*words, experiment="evaluate_fleet").experiment
    mission = replace(experiment.mission, duration_s=1800.0)
    controller, scenario = load(experiment.controller, mission), evaluation_scenarios(experiment)[2]
    tracks = np.zeros((1, 2, mission.num_controls + 1, NUM_TRACKED), np.float32)
    outcomes = fly_all(mission, controller, [scenario], 1, tracks)
    logs = fly_logged_fleet(mission, controller, scenario)
    for row, log in enumerate(logs):
        np.testing.assert_array_equal(log.flight.position_m.astype(np.float32), tracks[0, row, :, :3])
        assert log.flight.delta_v_m_s[-1] == outcomes.of_deputies[0, row, 0]
        acted = outcomes.of_deputies[0, row, OF_DEPUTIES.index("safety_periods")]
        assert np.count_nonzero(log.flight.safety_limit) == acted
    if keep_apart_m:
        assert any((log.flight.safety_limit == APART).any() for log in logs)
    assert np.count_nonzero(logs[0].seen_by[-1]) == outcomes.inspected_count[0]
    assert any(log.left_to.any() for log in logs) == (sharing in ("leave", "nearer"))


def test_what_is_left_is_told_in_words():
    seen_by, left_to = np.zeros((5, 4), np.uint8), np.zeros((4, 4), np.uint8)
    seen_by[3:, :2], seen_by[4, 2] = 2, 1
    left_to[1:3, :2], left_to[1:, 3] = 2, 3
    left_to[3, 2] = 2
    undecided = {"tour_costs_m_s": np.zeros((0, 0)), "foresight_at": np.zeros(0, np.int64)}
    flight = SimpleNamespace(is_inspectable=np.ones(4, np.bool_), **undecided)
    heard = np.zeros((4, 2, 4), np.uint8), *np.zeros((2, 4, 2, 3)), np.zeros((4, 2), np.uint8)
    log = DeputyLog(1, flight, seen_by, left_to, *heard)
    events = fleet_events(SimpleNamespace(control_period_s=60.0), log, 3)
    assert [(event.sample, event.text) for event in events] == [
        (1, "left to deputy 2: 2 points, seen from 2 min later on"),
        (1, "left to deputy 3: 1 point, which nobody saw"),
        (3, "left to deputy 2: 1 point, seen from 1 min later on"),
        (3, "coasts: all 2 unseen points are left to deputy 2 and deputy 3, and coasting keeps the limits"),
        (4, "deputy 1 ends; seen first by deputy 1 1, deputy 2 2, deputy 3 0"),
    ]


@pytest.mark.slow
def test_deputies_of_a_fleet_show_each_others_paths(opened, axe, evaluated):
    files = sorted((evaluated[1] / artifacts.RECORDINGS).glob("best-*"))
    page = opened(recorded.write(*files), 1400, reduced_motion="reduce")
    page.wait_for_function("() => globalThis.player?.sides?.[0].flight")
    # two of the three stand beside each other
    first, second = page.evaluate(
        """k => {
            player.lead.view.show(k);
            const at = ({ letter, flight }) => [letter, flight.position(k)];
            return player.shownSides.map(({ view }) => view.fellows.map(at));
        }""",
        20,
    )
    flown = [read(file)[DEPUTY_STATE]["position_m"][20] for file in files]
    for seen, others in ((first, (1, 2)), (second, (0, 2))):
        assert [letter for letter, _ in seen] == ["ABC"[other] for other in others]
        for (_, position), other in zip(seen, others, strict=True):
            np.testing.assert_allclose(position, flown[other], rtol=1e-6)
    assert "The deputies fly together" in page.locator("main").inner_text()
    assert serious_violations(page, axe) == []


def test_rules_along_the_deputys_axes_are_not_said_of_other_axes(tmp_path):
    run = prepared(tmp_path, "controller=paper_champion", "duration_s=1200", experiment="fly")
    carried_out(run, tmp_path)
    recording = read(next((tmp_path / artifacts.RECORDINGS).iterdir()))
    assert {recording.fis_description(name).output_axes for name in recording.fis_names} == {"body"}
    _, table = recorded.table_of(recording)
    texts = [text for text in table["texts"] if text.startswith(("Rule ", "Along the deputy's axes: Rule "))]
    assert texts
    assert all(text.startswith("Along") for text in texts)
    assert all(len(set(of_axes)) == 1 for of_axes in table["reasons"])


#: what a run of fleets writes of all flights
WRITTEN = (artifacts.EPISODES, artifacts.DEPUTIES, artifacts.SUMMARY)


def unlike(folder, other):
    return [name for name in WRITTEN if (folder / name).read_bytes() != (other / name).read_bytes()]


@pytest.mark.parametrize("engine", ["local", "dask"])
def test_fleets_in_parts_are_those_at_once(evaluated, tmp_path, engine):
    words = [*FLEET, *MINIATURE, "+experiment=evaluate_fleet", "stages=[scenario,evaluate]"]
    assert main([*words, "engine.part_cases=2", f"engine.kind={engine}", f"hydra.run.dir={tmp_path}"]) == 0
    assert unlike(tmp_path, evaluated[1]) == []


def test_a_part_without_its_deputies_is_flown_again(evaluated, tmp_path, monkeypatch):
    run = prepared(tmp_path, *FLEET, "engine.part_cases=2", experiment="evaluate_fleet")
    monkeypatch.setattr(parts, "join", lambda *_: 1 / 0)  # killed once all parts are flown
    with pytest.raises(ZeroDivisionError):
        carried_out(run, tmp_path, "evaluate")
    monkeypatch.undo()
    folders = [tmp_path / parts.FOLDERS[name] for name in (artifacts.EPISODES, artifacts.DEPUTIES)]
    assert [len(list(folder.iterdir())) for folder in folders] == [3, 3]
    parts.path_of(folders[1], 2, 4).unlink()
    flown, fly_part = [], parts.fly_part
    monkeypatch.setattr(parts, "fly_part", lambda *task: flown.append(task[2]) or fly_part(*task))
    carried_out(replace(run, experiment=replace(run.experiment, resume=True)), tmp_path, "evaluate")
    assert flown == [(2, 4)]
    assert unlike(tmp_path, evaluated[1]) == []


def test_the_shards_of_fleets_are_the_whole(evaluated, tmp_path, monkeypatch, ran):
    monkeypatch.setattr(merging, "BLOCK_ROWS", 2)
    words = [*FLEET, *MINIATURE, "+experiment=evaluate_fleet", "stages=[scenario,evaluate]"]
    for name, cases in (("a", "[0,4]"), ("b", "[3,5]")):
        ran(*words, f"monte_carlo.only_cases={cases}", f"hydra.run.dir={tmp_path / name}")
    ran("merge", str(tmp_path / "b"), str(tmp_path / "a"), "-o", str(tmp_path / "merged"))
    assert unlike(tmp_path / "merged", evaluated[1]) == []


def test_fleets_stop_at_an_asked_width(tmp_path):
    words = *FLEET, "monte_carlo.num_cases=60", "monte_carlo.stop_width=3", "stages=[scenario,evaluate]"
    carried_out(prepared(tmp_path, *words, experiment="evaluate_fleet"), tmp_path)
    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)
    assert summary["stop"]["most_cases"] == 60
    assert len(pq.read_table(tmp_path / artifacts.DEPUTIES)) == 3 * summary["num_cases"]


def test_the_starts_of_a_run_are_a_table_of_starts(evaluated, tmp_path):
    words = (
        *FLEET,
        "starts=file",
        f"starts.path={evaluated[1] / artifacts.SCENARIOS}",
        "stages=[scenario,evaluate]",
    )
    carried_out(prepared(tmp_path, *words, experiment="evaluate_fleet"), tmp_path)
    assert (tmp_path / artifacts.DEPUTIES).read_bytes() == (evaluated[1] / artifacts.DEPUTIES).read_bytes()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: rows[:-1], r"the last case has 2 of 3 deputies"),
        (lambda rows: [*rows[:2], rows[3], *rows[4:]], r"row 3 is of deputy 1, and deputy 3 of 3 is due"),
        (
            lambda rows: [row | {"sun_angle_rad": str(n)} for n, row in enumerate(rows)],
            "row 2 has another Sun",
        ),
        (lambda rows: [row for row in rows if row["deputy"] != "3"], "is 3, and the starts are of 2 each"),
        (
            lambda rows: [row | {"case": "0"} for row in rows],
            "row 4 is case '0', but would be flown as case 1",
        ),
    ],
)
def test_a_table_of_unequal_fleets_is_refused(evaluated, tmp_path, change, words):
    with (evaluated[1] / artifacts.SCENARIOS).open(newline="") as stream:
        rows = change(list(csv.DictReader(stream)))
    if words.startswith("row 3"):
        rows = [{name: row[name] for name in row if name != "case"} for row in rows]
    with (tmp_path / "starts.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    with pytest.raises(SettingError, match=words):
        composed(*FLEET, "starts=file", f"starts.path={tmp_path / 'starts.csv'}", experiment="evaluate_fleet")


def test_how_near_two_would_drift_is_what_scipy_says():
    """Of a few samples' relative motion, integrated; the least over all of a fleet is among all of them."""
    experiment = composed(*FLEET, "duration_s=900", experiment="evaluate_fleet").experiment
    mission, rate = experiment.mission, experiment.mission.orbit.mean_motion_rad_s
    scenarios = evaluation_scenarios(experiment)[:2]
    controller, shape = load(experiment.controller, mission), (2, 3, mission.num_controls + 1, NUM_TRACKED)
    tracks = np.zeros(shape, np.float32)
    fly_all(mission, controller, scenarios, 1, tracks)
    times = np.linspace(0.0, 2.0 * np.pi / rate, 700)
    for fleet, nearest in zip(tracks, coasting_pairs(mission, tracks), strict=True):
        each = [
            linear(rate, (fleet[first, k, :6] - fleet[other, k, :6]).astype(np.float64), times).min()
            for first, other in ((0, 1), (0, 2), (1, 2))
            for k in range(1, mission.num_controls + 1)
        ]
        assert nearest == pytest.approx(min(each), abs=0.05)
    episodes, _ = fly_fleets(mission, controller, scenarios, 1)
    np.testing.assert_array_equal(episodes["coasting_pair_m"], coasting_pairs(mission, tracks))
