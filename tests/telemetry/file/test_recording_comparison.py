"""Two flights: where they part, by how much, and what one has alone."""

from collections.abc import Callable

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter
from telemetry.commands import main
from telemetry.file.compare import LoneMessages, Parting, compare, in_words
from tests.telemetry import synthetic_flight
from tests.telemetry.synthetic_flight import SyntheticFlight

Change = Callable[[SyntheticFlight], None]


def changed(flight: SyntheticFlight, **where: tuple[object, object]) -> SyntheticFlight:
    """The same flight with some numbers replaced: ``field=(index, value)``."""
    fields = {}
    for name, (index, value) in where.items():
        fields[name] = getattr(flight, name).copy()
        fields[name][index] = value
    return flight.but(**fields)


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    flight = synthetic_flight.fly(20)
    return flight, synthetic_flight.record(flight, tmp_path_factory.mktemp("base") / "base.mcap")


def test_a_flight_is_the_same_as_itself(base):
    recording = telemetry.read(base[1])
    comparison = compare(recording, recording)
    assert comparison.is_equal
    assert comparison.parting is None
    assert comparison.num_samples == 21
    assert {field.greatest for field in comparison.fields} == {0.0}
    assert len({(field.topic, field.field) for field in comparison.fields}) == sum(
        len(topic.columns) for topic in recording.topics.values() if len(topic)
    )


def test_the_first_number_that_differs_is_named_with_its_sample_and_its_size(base, tmp_path):
    flight, path = base
    other = changed(
        flight, force_hill_n=((slice(7, None), 1), 0.5), torque_n_m=((9, 3, 2), 1.0), delta_v_m_s=(8, -1.0)
    )
    comparison = compare(
        telemetry.read(path), telemetry.read(synthetic_flight.record(other, tmp_path / "other.mcap"))
    )
    assert not comparison.is_equal
    first = comparison.parting
    assert first == Parting(
        "/deputy/control", "force_hill_n", "N", 7, 70.0, (1,), flight.force_hill_n[7, 1], 0.5
    )
    (force,) = [field for field in comparison.fields if field.parting == first]
    expected = np.abs(flight.force_hill_n[7:, 1] - 0.5)
    assert force.greatest == expected.max()
    assert force.greatest_time_s == 70.0 + 10.0 * expected.argmax()
    differing = {(f.topic, f.field): f.parting for f in comparison.fields if f.parting is not None}
    assert set(differing) == {
        ("/deputy/control", "force_hill_n"),
        ("/deputy/attitude", "torque_n_m"),
        ("/mission", "delta_v_m_s"),
    }
    assert differing["/deputy/attitude", "torque_n_m"].component == (3, 2)  # type: ignore[union-attr]
    assert differing["/mission", "delta_v_m_s"].sample == 8  # type: ignore[union-attr]


def test_of_what_parts_at_once_the_cause_comes_first(base, tmp_path):
    flight, path = base
    other = changed(
        flight, force_hill_n=((5, 0), 0.5), fis_output_n=((1, 5), 0.5), force_body_n=((5, 1), 1.0)
    )
    recorded = synthetic_flight.record(other, tmp_path / "other.mcap")
    first = compare(telemetry.read(path), telemetry.read(recorded)).parting
    assert isinstance(first, Parting)
    assert (first.topic, first.field) == ("/fis/f_y", "output_n")


def test_a_tolerance_is_for_quantities_and_not_for_counts(base, tmp_path):
    flight, path = base
    nearly = changed(flight, velocity_m_s=((4, 0), flight.velocity_m_s[4, 0] + 1e-9))
    recorded = telemetry.read(synthetic_flight.record(nearly, tmp_path / "nearly.mcap"))
    whole = telemetry.read(path)
    assert not compare(whole, recorded).is_equal
    assert not compare(whole, recorded, 1e-10).is_equal
    within = compare(whole, recorded, 1e-8)
    assert within.is_equal
    assert max(field.greatest for field in within.fields) == pytest.approx(1e-9, rel=1e-6)
    counted = changed(flight, num_candidates=(3, flight.num_candidates[3] + 1))
    recorded = telemetry.read(synthetic_flight.record(counted, tmp_path / "counted.mcap"))
    assert not compare(whole, recorded, 10.0).is_equal


def test_numbers_that_are_none_part_from_those_that_are(base, tmp_path):
    flight, path = base
    other = changed(flight, lambda_u_rad=(6, np.nan))
    recorded = telemetry.read(synthetic_flight.record(other, tmp_path / "other.mcap"))
    assert compare(recorded, recorded).is_equal
    comparison = compare(telemetry.read(path), recorded, 1e9)
    (angle,) = [field for field in comparison.fields if field.parting is not None]
    assert (angle.field, angle.greatest, angle.greatest_time_s) == ("lambda_u_rad", np.inf, 60.0)
    assert in_words(comparison)[0].endswith("rad in the first and nan rad in the second")


def test_flights_of_different_lengths_and_topics(base, tmp_path):
    flight, path = base
    metadata = synthetic_flight.metadata(flight)
    del metadata["fis.f_x"], metadata["fis.f_y"], metadata["fis.f_z"]
    with EpisodeWriter(tmp_path / "short.mcap", metadata=metadata, attachments={}) as writer:
        for k in range(12):
            synthetic_flight.write_state(writer, flight, k)
        writer.log(110.0, "info", "the end")
    comparison = compare(telemetry.read(path), telemetry.read(tmp_path / "short.mcap"))
    assert comparison.num_samples == 21
    lone = {(item.topic, item.is_in_first): item for item in comparison.lone}
    assert lone["/deputy/state", True] == LoneMessages("/deputy/state", True, 9, 12, 120.0)
    assert lone["/fis/f_x", True] == LoneMessages("/fis/f_x", True, 20, 0, 0.0)
    assert lone["/tf", True].num_messages == 18
    assert lone["/log", False] == LoneMessages("/log", False, 1, 11, 110.0)
    assert all(field.parting is None for field in comparison.fields)
    assert comparison.parting == lone["/fis/f_x", True]
    assert "/fis/f_x has a message only in the first" in in_words(comparison)[0]


def test_what_is_said_of_flights_tells_them_apart_but_does_not_count(base, tmp_path):
    flight, path = base
    metadata = synthetic_flight.metadata(flight)
    metadata["episode"]["seed"] = "8"
    attachments = {"config.yaml": b"seed: 8\n"}
    with EpisodeWriter(tmp_path / "other.mcap", metadata=metadata, attachments=attachments) as writer:
        for k in range(21):
            synthetic_flight.write_sample(writer, flight, k)
    comparison = compare(telemetry.read(path), telemetry.read(tmp_path / "other.mcap"))
    assert comparison.is_equal
    assert comparison.told_apart == ("episode seed", "config.yaml", "controller.json")
    assert "  described differently: episode seed, config.yaml, controller.json" in in_words(comparison)


def test_another_number_of_rules_is_a_difference(base, tmp_path):
    flight, path = base
    fewer = flight.but(firing_strengths=flight.firing_strengths[:, :, :9])
    recorded = telemetry.read(synthetic_flight.record(fewer, tmp_path / "fewer.mcap"))
    first = compare(telemetry.read(path), recorded).parting
    assert first == Parting("/fis/f_x", "firing_strengths", "", 0, 0.0, (), "25 values", "9 values")


def test_the_command_answers_by_its_exit_code(base, tmp_path, capsys):
    flight, path = base
    other = synthetic_flight.record(changed(flight, position_m=((2, 0), 80.0)), tmp_path / "other.mcap")
    assert main(["compare", str(path), str(path)]) == 0
    assert f"{path} and {path} are the same: 21 samples, " in capsys.readouterr().out
    assert main(["compare", str(path), str(other)]) == 1
    text = capsys.readouterr().out
    number = flight.position_m[2, 0]
    assert "differ from sample 2 of 0 to 20 (20 s): /deputy/state position_m[0] is " in text
    assert (
        f"is {float(number)!r} m in the first and 80.0 m in the second, {80.0 - number:.6g} m apart" in text
    )
    assert main(["compare", str(path), str(other), "--tolerance", "100"]) == 0
    assert "are the same to within 100" in capsys.readouterr().out
    assert main(["compare", str(path), str(tmp_path / "none.mcap")]) == 2
    for tolerance in ("nan", "-1.0"):
        assert main(["compare", str(path), str(path), f"--tolerance={tolerance}"]) == 2
        told = f"the tolerance is {tolerance}, but zero or a positive number is expected"
        assert told in capsys.readouterr().err
