"""Two flights: where they part, by how much, and what one has alone."""

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter
from telemetry.file.compare import FirstDifference, LoneMessages, compare, in_words
from tests.telemetry import synthetic_flight
from tests.telemetry.synthetic_flight import SyntheticFlight


def changed(**where: tuple[object, object]) -> SyntheticFlight:
    """The flight with some numbers replaced: ``field=(index, value)``."""
    fields = {name: getattr(FLIGHT, name).copy() for name in where}
    for name, (index, value) in where.items():
        fields[name][index] = value
    return FLIGHT.but(**fields)


FLIGHT = synthetic_flight.fly(20)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return synthetic_flight.record(FLIGHT, tmp_path_factory.mktemp("base") / "base.mcap")


@pytest.fixture
def compared(path, tmp_path):
    """Compare the flight with another one, or with what the writer is told of it."""

    def compared_with(other=FLIGHT, tolerance=0.0, **fields):
        recorded = synthetic_flight.record(other, tmp_path / "other.mcap", **fields)
        return compare(telemetry.read(path), telemetry.read(recorded), tolerance)

    return compared_with


def test_a_flight_is_the_same_as_itself(path):
    recording = telemetry.read(path)
    comparison = compare(recording, recording)
    assert (comparison.is_equal, comparison.first_difference, comparison.num_samples) == (True, None, 21)
    assert {field.greatest for field in comparison.fields} == {0.0}
    compared = {(field.topic, field.field) for field in comparison.fields}
    assert len(compared) == sum(len(topic.columns) for topic in recording.topics.values() if len(topic))


def test_the_first_number_that_differs_is_named_with_its_sample_and_its_size(compared):
    where = {"force_hill_n": ((slice(7, None), 1), 0.5), "torque_n_m": ((9, 3, 2), 1.0)}
    comparison = compared(changed(**where, delta_v_m_s=(8, -1.0)))
    assert not comparison.is_equal
    first, force_n = comparison.first_difference, FLIGHT.force_hill_n[7:, 1]
    assert first == FirstDifference("/deputy/control", "force_hill_n", "N", 7, 70.0, (1,), force_n[0], 0.5)
    (force,) = [field for field in comparison.fields if field.first_difference == first]
    expected = np.abs(force_n - 0.5)
    assert force.greatest == expected.max()
    assert force.greatest_time_s == 70.0 + 10.0 * expected.argmax()
    differences = [
        field.first_difference for field in comparison.fields if field.first_difference is not None
    ]
    assert {
        (difference.topic, difference.field, difference.sample, difference.component)
        for difference in differences
    } == {
        ("/deputy/control", "force_hill_n", 7, (1,)),
        ("/deputy/attitude", "torque_n_m", 9, (3, 2)),
        ("/mission", "delta_v_m_s", 8, ()),
    }


def test_of_what_parts_at_once_the_cause_comes_first(compared):
    other = changed(force_hill_n=((5, 0), 0.5), fis_output_n=((1, 5), 0.5), force_body_n=((5, 1), 1.0))
    first = compared(other).first_difference
    assert (first.topic, first.field) == ("/fis/force_y", "output_n")


def test_a_tolerance_is_for_quantities_and_not_for_counts(compared):
    nearly = changed(velocity_m_s=((4, 0), FLIGHT.velocity_m_s[4, 0] + 1e-9))
    assert not compared(nearly).is_equal
    assert not compared(nearly, 1e-10).is_equal
    within = compared(nearly, 1e-8)
    assert within.is_equal
    assert max(field.greatest for field in within.fields) == pytest.approx(1e-9, rel=1e-6)
    assert not compared(changed(num_candidates=(3, FLIGHT.num_candidates[3] + 1)), 10.0).is_equal


def test_numbers_that_are_none_part_from_those_that_are(compared, tmp_path):
    comparison = compared(changed(lambda_u_rad=(6, np.nan)), 1e9)
    recorded = telemetry.read(tmp_path / "other.mcap")
    assert compare(recorded, recorded).is_equal
    (angle,) = [field for field in comparison.fields if field.first_difference is not None]
    assert (angle.field, angle.greatest, angle.greatest_time_s) == ("lambda_u_rad", np.inf, 60.0)
    assert in_words(comparison)[0].endswith("rad in the first and nan rad in the second")


def test_flights_of_different_lengths_and_topics(path, tmp_path):
    metadata = {"episode": synthetic_flight.metadata(FLIGHT)["episode"]}
    with EpisodeWriter(tmp_path / "short.mcap", metadata=metadata, attachments={}) as writer:
        for k in range(12):
            synthetic_flight.write_state(writer, FLIGHT, k)
        writer.log(110.0, "info", "the end")
    comparison = compare(telemetry.read(path), telemetry.read(tmp_path / "short.mcap"))
    assert comparison.num_samples == 21
    lone = {(item.topic, item.is_in_first): item for item in comparison.lone}
    assert lone["/deputy/state", True] == LoneMessages("/deputy/state", True, 9, 12, 120.0)
    assert lone["/fis/force_x", True] == LoneMessages("/fis/force_x", True, 20, 0, 0.0)
    assert lone["/tf", True].num_messages == 18
    assert lone["/log", False] == LoneMessages("/log", False, 1, 11, 110.0)
    assert all(field.first_difference is None for field in comparison.fields)
    assert comparison.first_difference == lone["/fis/force_x", True]
    assert "/fis/force_x has a message only in the first" in in_words(comparison)[0]


def test_what_is_said_of_flights_tells_them_apart_but_does_not_count(compared):
    metadata = synthetic_flight.metadata(FLIGHT)
    metadata["episode"]["seed"] = "8"
    comparison = compared(metadata=metadata, attachments={"config.yaml": b"seed: 8\n"})
    assert comparison.is_equal
    assert comparison.told_apart == ("episode seed", "config.yaml", "controller.json")
    assert "  described differently: episode seed, config.yaml, controller.json" in in_words(comparison)


def test_another_number_of_rules_is_a_difference(compared):
    first = compared(FLIGHT.but(firing_strengths=FLIGHT.firing_strengths[:, :, :9])).first_difference
    assert first == FirstDifference(
        "/fis/force_x", "firing_strengths", "", 0, 0.0, (), "25 values", "9 values"
    )


def test_the_command_answers_by_its_exit_code(path, tmp_path, ran):
    other = synthetic_flight.record(changed(position_m=((2, 0), 80.0)), tmp_path / "other.mcap")
    assert f"{path} and {path} are the same: 21 samples, " in ran("compare", path, path).out
    text = ran("compare", path, other, code=1).out
    number = float(FLIGHT.position_m[2, 0])
    assert f"from sample 2 of 0 to 20 (20 s): /deputy/state position_m[0] is {number!r} m in the " in text
    assert f" and 80.0 m in the second, {80.0 - number:.6g} m apart" in text
    assert "are the same to within 100" in ran("compare", path, other, "--tolerance", "100").out
    ran("compare", path, tmp_path / "none.mcap", code=2)
    for tolerance in ("nan", "-1.0"):
        message = ran("compare", path, path, f"--tolerance={tolerance}", code=2).err
        assert f"the tolerance is {tolerance}, but zero or a pos" in message
