"""Times, reasons and rules of a recording's page, from a few messages that are written by hand."""

import base64
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file import topics
from telemetry.file.metadata import FisDescription
from telemetry.file.recording import TopicColumns
from telemetry.page import recorded


def state(times):
    return TopicColumns(topics.DEPUTY_STATE, "x", np.array(times, dtype=np.float64), {}, {})


@pytest.mark.parametrize(
    ("times", "end_s", "expected"),
    [
        ([0.0, 10.0, 20.0, 30.0], np.inf, [0.0, 10.0, 20.0, 30.0]),
        ([5.0, 15.0, 15.0, 25.0, 45.0], np.inf, [5.0, 15.0, 25.0, 35.0, 45.0]),
        ([0.0, 10.0, 20.0, 30.0], 20.0, [0.0, 10.0, 20.0]),
        # at least two samples, wherever the flight ended
        ([0.0, 10.0, 20.0], 3.0, [0.0, 10.0]),
    ],
)
def test_samples_are_evenly_spaced_up_to_the_end(times, end_s, expected):
    np.testing.assert_allclose(recorded._times(state(times), end_s), expected)


def test_long_recordings_are_thinned_and_those_of_one_time_refused(monkeypatch):
    monkeypatch.setattr(recorded, "MOST_SAMPLES", 5)
    np.testing.assert_allclose(recorded._times(state(np.arange(9.0)), np.inf), [0.0, 2.0, 4.0, 6.0, 8.0])
    with pytest.raises(RecordingError, match="all messages have one time"):
        recorded._times(state([3.0, 3.0]), np.inf)


def test_a_sample_has_the_last_message_until_then():
    topic = TopicColumns("/x", "x", np.array([1.0, 2.0, 4.0]), {"y": np.array([10, 20, 40])}, {})
    times = np.array([0.0, 1.0, 1.999_999_9, 3.9, 4.0, 9.0])
    assert recorded._at(topic, "y", times).tolist() == [10.0, 10.0, 20.0, 20.0, 40.0, 40.0]


def test_vectors_turn_as_scipy_turns_them():
    draw = np.random.default_rng(1)
    for _ in range(5):
        turn, vectors = Rotation.random(random_state=draw), draw.normal(size=(7, 3))
        np.testing.assert_allclose(recorded._turned(turn.as_quat(), vectors), turn.apply(vectors), atol=1e-12)


def test_where_nothing_is_fired_the_reason_that_says_most_is_shown_alone():
    reasons = np.array([[0, 1, 2], [2, 1, 0], [3, 0, 2], [2, 2, 2], [3, 2, 3], [1, 0, 3]])
    is_idle = np.array([[True], [True], [True], [True], [True], [False]])
    shown = recorded.with_a_single_reason(reasons, is_idle, [2, 3])
    # the first of those that are not told last; of these two says more than three
    assert shown.tolist() == [[0, 0, 0], [1, 1, 1], [0, 0, 0], [2, 2, 2], [2, 2, 2], [1, 0, 3]]


def test_pushes_along_hill_have_the_rule_of_the_largest_force_along_the_deputy():
    rules = np.array([[4, 5, -1], [-1, -1, -1], [7, -1, 8]])
    sizes = np.array([[0.1, -0.3, 0.9], [0.0, 0.0, 0.0], [-0.2, 5.0, 0.1]])
    are_pushes = np.array([[True, False, True], [True, True, True], [False, True, False]])
    shown = recorded.along_hill(rules, sizes, are_pushes)
    assert shown.tolist() == [[5, -1, 5], [-1, -1, -1], [-1, 7, -1]]


def described(name, output, rules=("if far then pull", "if near then push"), **others):
    words = {"input_names": ("range",), "input_units": ("m",), "rules": rules, "output_unit": "N"}
    return {f"fis.{name}": FisDescription(**words, output_name=output, **others).to_metadata()}


@pytest.fixture
def pushed(tmp_path):
    """Four periods: pushed by the second rule, by the first, by none, and nothing at all."""
    path = tmp_path / "pushed.mcap"
    with EpisodeWriter(path, metadata=described("pilot", "force_y"), attachments={}) as writer:
        for k in range(5):
            writer.record(
                topics.DEPUTY_STATE,
                10.0 * k,
                position_m=[30.0 + k, 0.0, -40.0],
                velocity_m_s=[0.0, 0.1 * k, 0.0],
                quaternion=[0, 0, 0, 1],
                angular_velocity_rad_s=[0, 0, 0],
            )
        forces = (-0.04, 0.03, 0.02, 0.0)
        reasons = (topics.Reason.FIRED, topics.Reason.FIRED, topics.Reason.SAFETY, topics.Reason.DEAD_BAND)
        for k, (force, reason) in enumerate(zip(forces, reasons, strict=True)):
            of_axes = [topics.Reason.SILENT, reason, topics.Reason.SILENT]
            writer.record(
                topics.DEPUTY_CONTROL,
                10.0 * k,
                force_hill_n=[0.0, force, 0.0],
                force_asked_n=[0.0, force, 0.0],
                reason=of_axes,
                command_reason=of_axes,
            )
            shares = [[0.01, -0.05], [0.04, -0.01], [0.0, 0.0], [0.0, 0.0]][k]
            writer.record(
                topics.fis_topic("pilot"),
                10.0 * k,
                inputs=[50.0],
                firing_strengths=[0.9, 0.25],
                output_n=force,
                shares_n=shares,
            )
    return telemetry.read(path)


def test_reasons_of_a_page_are_rules_where_these_were_fired(pushed):
    flight, samples = recorded.table_of(pushed)
    texts = [[samples["texts"][index] for index in row] for row in samples["reasons"]]
    assert texts[0][1] == "Rule 2 of pilot: if near then push."
    assert texts[1][1] == "Rule 1 of pilot: if far then pull."
    assert texts[2] == ["Silent.", "Safety.", "Silent."]
    # nothing was fired: what says most stands for all
    assert texts[3] == ["Dead band."] * 3
    assert texts[4] == texts[3]
    assert (flight["numSamples"], flight["periodS"], flight["numPoints"]) == (5, 10.0, 0)
    # a ball stands for a chief without points, of half the nearest distance
    assert flight["radius"] == pytest.approx(25.0)
    spent = np.frombuffer(base64.b64decode(samples["spent"]), "<f4")
    assert len(spent) == 5
    assert np.isnan(spent).all()
    velocity = np.frombuffer(base64.b64decode(samples["velocity"]), "<f4").reshape(5, 3)
    np.testing.assert_allclose(velocity[:, 1], 0.1 * np.arange(5), rtol=1e-6)
    force = np.frombuffer(base64.b64decode(samples["force"]), "<f4").reshape(5, 3)
    np.testing.assert_allclose(force[:, 1], [-0.04, 0.03, 0.02, 0.0, 0.0], rtol=1e-6)


def test_what_a_recording_lacks_is_said(pushed, tmp_path):
    flight, _ = recorded.table_of(pushed)
    words = recorded._about(pushed, flight, tmp_path / "pushed.mcap")
    assert words == (
        "pushed.mcap: 1 minutes, a sample every 10 s. It does not tell points of the chief, "
        "where the Sun is, or what was spent."
    )
    bare = replace(pushed, topics={topics.DEPUTY_STATE: pushed[topics.DEPUTY_STATE]})
    flight, samples = recorded.table_of(bare)
    assert "points of the chief, forces, where the Sun is" in recorded._about(bare, flight, tmp_path)
    assert samples["texts"] == [recorded.UNKNOWN]
    assert samples["reasons"] == [[0, 0, 0]] * 5
    single = replace(
        pushed[topics.DEPUTY_STATE], time_s=np.zeros(1), columns={"position_m": np.zeros((1, 3))}
    )
    with pytest.raises(RecordingError, match="no two messages on /deputy/state"):
        recorded.table_of(replace(pushed, topics={topics.DEPUTY_STATE: single}))


def recording_of(deputy, scenario="s", seed=1):
    episode = SimpleNamespace(deputy=deputy, scenario_id=scenario, seed=seed, fleet_deputies=2)
    return SimpleNamespace(episode=episode)


def test_recordings_are_a_fleet_if_they_are_of_its_different_deputies():
    first, second = recording_of(1), recording_of(2)
    assert recorded._is_fleet([first, second])
    assert not recorded._is_fleet([first])
    assert not recorded._is_fleet([first, recording_of(1)])
    assert not recorded._is_fleet([first, recording_of(None)])
    assert not recorded._is_fleet([first, recording_of(2, seed=2)])
    assert not recorded._is_fleet([first, recording_of(2, scenario="t")])
