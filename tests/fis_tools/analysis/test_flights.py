"""Fuzzy systems along flights that the telemetry's own writer logged."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import telemetry
from fis_tools.analysis import tables
from fis_tools.analysis.flights import inputs_along, read_controller, read_flight, read_periods, read_points
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.formats.serialize import dump_json
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.review.carried import flight_data
from fis_tools.review.flown import Flight
from fis_tools.words.text import sentences
from telemetry import EpisodeWriter
from telemetry.file.metadata import FisDescription
from telemetry.file.topics import DEPUTY_CONTROL, Reason, fis_topic
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL, PAPER_LIKE
from tests.fis_tools.step_by_step import ends


def description(system: FuzzySystem) -> dict[str, str]:
    return FisDescription(
        input_names=tuple(variable.name for variable in system.inputs),
        input_units=tuple(variable.unit for variable in system.inputs),
        output_name=system.outputs[0].name,
        output_unit=system.outputs[0].unit,
        rules=tuple(sentences(system)),
    ).to_metadata()


def log_inference(writer: EpisodeWriter, time_s: float, system: FuzzySystem, inputs: np.ndarray) -> None:
    step = infer(system, inputs)
    topic, (output,) = fis_topic(system.name), step.values
    writer.record(topic, time_s, inputs=inputs, firing_strengths=step.firing_strengths, output_n=output)


def writing(path: Path, controller: FuzzyController, **more: dict[str, str]) -> EpisodeWriter:
    """A recording of a controller, to be written, with more metadata by name."""
    metadata = {f"fis.{system.name}": description(system) for system in controller.systems} | more
    path.parent.mkdir(parents=True, exist_ok=True)
    attachments = {"controller.json": dump_json(controller).encode()}
    return EpisodeWriter(path, metadata=metadata, attachments=attachments)


def log_along(path: Path, controller: FuzzyController, samples: Iterable[Iterable[np.ndarray]]) -> Path:
    """Log inferences every 10 s, a sample the inputs of each system."""
    with writing(path, controller) as writer:
        for index, sample in enumerate(samples):
            for system, inputs in zip(controller.systems, sample, strict=True):
                log_inference(writer, 10.0 * index, system, inputs)
    return path


def log_flight(path: Path, controller: FuzzyController, num_samples: int = 4, seed: int = 0) -> Path:
    """Log inferences at random inputs, some of them outside the universes."""
    generator = np.random.default_rng(seed)
    ranges = [1.2 * np.array(ends(system)) for system in controller.systems]
    samples = ([generator.uniform(low, high) for low, high in ranges] for _ in range(num_samples))
    return log_along(path, controller, samples)


#: three inputs under the name of a system with two
MISNAMED = FuzzyController("misnamed", (replace(FORCE_Z, name="force_x"),))


def test_a_flight_gives_back_its_controller_and_every_inference(tmp_path):
    path = log_flight(tmp_path / "a.mcap", PAPER_LIKE)
    assert read_controller(path) == PAPER_LIKE
    flown_systems = read_flight(path)
    assert [flown.system for flown in flown_systems] == list(PAPER_LIKE.systems)
    for flown in flown_systems:
        np.testing.assert_array_equal(flown.time_s, [0.0, 10.0, 20.0, 30.0])
        for inputs, strengths, output in zip(flown.inputs, flown.firing_strengths, flown.output, strict=True):
            step = infer(flown.system, inputs)
            assert step.values[0] == output
            np.testing.assert_allclose(strengths, step.firing_strengths, rtol=1e-7, atol=0)


def test_inputs_are_those_of_all_flights(tmp_path):
    paths = [log_flight(tmp_path / f"{seed}.mcap", PAPER_LIKE, seed=seed) for seed in (1, 2)]
    flown = [read_flight(path)[1] for path in paths]
    sensed = np.concatenate([inferences.inputs for inferences in flown])
    np.testing.assert_array_equal(inputs_along(paths)["force_z"], sensed)


def test_a_system_that_never_decides_is_left_out(tmp_path):
    path = log_flight(tmp_path / "a.mcap", PAPER_LIKE, num_samples=0)
    assert inputs_along([path])["force_x"].shape == (0, 2)


def test_flights_that_cannot_be_used_are_refused_with_a_sentence(tmp_path):
    path = log_flight(tmp_path / "a.mcap", PAPER_LIKE)
    other = log_flight(tmp_path / "b.mcap", MISNAMED)
    with pytest.raises(ControllerFileError, match="another system 'force_x'"):
        inputs_along([path, other])
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ControllerFileError, match="recover"):
        read_flight(tmp_path / "cut.mcap")
    with pytest.raises(ControllerFileError, match="cannot be opened"):
        read_controller(tmp_path / "missing.mcap")


def test_a_log_that_does_not_fit_its_controller_is_refused(tmp_path):
    metadata = {"fis.force_x": description(FORCE_X)}
    for name, content, words in (
        ("none", {}, "carries no controller.json"),
        ("coast", {"controller.json": b'{"kind": "coast"}'}, "not a fuzzy controller"),
        ("latin", {"controller.json": b"\xff"}, "controller.json"),
        ("others", {"controller.json": dump_json(GENERAL).encode()}, "no topic /fis/room"),
        ("wide", {"controller.json": dump_json(MISNAMED).encode()}, "holds 2 inputs"),
    ):
        path = tmp_path / f"{name}.mcap"
        with EpisodeWriter(path, metadata=metadata, attachments=content) as writer:
            writer.record(fis_topic("force_x"), 0.0, inputs=[1.0, 2.0], firing_strengths=np.zeros(25))
        with pytest.raises(ControllerFileError, match=words):
            read_flight(path)


#: what became of force_x and force_z, one row a control period of 10 s; the controller infers in those marked
PERIODS = (
    (True, Reason.FIRED, Reason.DEAD_BAND),
    (True, Reason.CLIPPED, Reason.FIRED),
    (False, Reason.COASTING, Reason.COASTING),
    (True, Reason.SAFETY, Reason.SILENT),
    (False, Reason.WAITING, Reason.WAITING),
    (True, Reason.FIRED, Reason.SAFETY),
)


def log_periods(path: Path, controller: FuzzyController, has_reasons: bool = True) -> Path:
    """Log control periods, as a recording of today or as one from before reasons were recorded."""
    generator = np.random.default_rng(4)
    with writing(path, controller) as writer:
        for sample, (is_inferred, x, z) in enumerate(PERIODS):
            time_s = 10.0 * sample
            force = np.array([x == Reason.FIRED, 0.0, z == Reason.FIRED], dtype=np.float64)
            fields = {"force_asked_n": force, "reason": [x, Reason.SILENT, z]} if has_reasons else {}
            writer.record(DEPUTY_CONTROL, time_s, force_body_n=force, force_hill_n=force, **fields)
            for system in controller.systems if is_inferred else ():
                log_inference(writer, time_s, system, generator.uniform(*ends(system)))
    return path


def test_inferences_count_whose_force_was_fired(tmp_path):
    path = log_periods(tmp_path / "a.mcap", PAPER_LIKE)
    times = {inferences.system.name: inferences.time_s.tolist() for inferences in read_flight(path)}
    assert times == {"force_x": [0.0, 10.0, 50.0], "force_z": [10.0]}
    for flown in read_flight(path, all_periods=True):
        assert flown.time_s.tolist() == [0.0, 10.0, 30.0, 50.0]
    assert len(inputs_along([path])["force_x"]) == 3
    assert len(inputs_along([path], all_periods=True)["force_z"]) == 4


def test_a_recording_without_reasons_counts_where_any_force_was_fired(tmp_path):
    path = log_periods(tmp_path / "a.mcap", PAPER_LIKE, has_reasons=False)
    control = telemetry.read(path)["/deputy/control"]
    assert control["reason"].shape == control["force_asked_n"].shape == (6, 0)
    assert np.isnan(control["coasting_missed"]).all()
    for flown in read_flight(path):
        assert flown.time_s.tolist() == [0.0, 10.0, 50.0]


def test_each_period_tells_what_became_of_each_system(tmp_path):
    path = log_periods(tmp_path / "a.mcap", PAPER_LIKE)
    for sample, (is_inferred, *reasons) in enumerate(PERIODS):
        for time_s in (10.0 * sample, 10.0 * sample + 9.9):
            for period, reason in zip(read_periods(path, time_s), reasons, strict=True):
                assert (period.time_s, period.reason) == (10.0 * sample, reason.name.lower())
                assert (period.row is not None) == is_inferred
                if period.row is not None:
                    assert period.flown.time_s[period.row] == period.time_s


def test_points_are_read_as_they_are_at_a_time_and_told_with_the_inputs(tmp_path, run):
    """Three points on the axes; a cloud holds until the next, and what nobody asks is not told."""
    axes, parts = 10.0 * np.diag([1.0, 1.0, -1.0]), np.array([[30.0, 0.0, 40.0], [1.0, 2.0, 3.0]])
    controller = replace(PAPER_LIKE, systems=(FORCE_X,))
    path, times, nothing = tmp_path / "x.mcap", np.array([0.0, 10.0, 20.0]), np.zeros((3, 3))
    with writing(path, controller, pulls={"distance": "m"}) as writer:
        fired = np.full((3, 3), Reason.FIRED)
        missed = [1.0, np.nan, 0.0]
        writer.record(DEPUTY_CONTROL, times, force_hill_n=nothing + 1.0, reason=fired, coasting_missed=missed)
        is_missed = np.array([[False, True, False], [False] * 3])
        writer.pulls(times[:2], axes, {"distance": parts}, np.array([60.0, 120.0, 5.0]), is_missed)
        for time_s, distance in zip(times, (70.0, 6.0, 6.0), strict=True):
            log_inference(writer, time_s, FORCE_X, np.array([distance, 0.0]))
    first, second, third = (read_points(path, time) for time in times)
    np.testing.assert_allclose(first.latitude_deg, [0.0, 0.0, -90.0], atol=1e-9)
    np.testing.assert_allclose(first.longitude_deg[:2], [0.0, 90.0], atol=1e-9)
    np.testing.assert_array_equal(third.dark_in_s, [40.0, 100.0, -15.0])
    np.testing.assert_array_equal(
        [points.parts["distance"] for points in (first, second, third)], parts[[0, 1, 1]]
    )
    assert first.is_missed.tolist() == [False, True, False]
    assert second.is_missed is None
    assert read_points(tmp_path / "table.csv", 0.0) is None
    (flown,) = read_flight(path, all_periods=True)
    (carried,) = flight_data(Flight("x", {"force_x": flown}, is_own=True), [FORCE_X], 1)["systems"]
    first_two = "point 2 (90° S 0° E, dark in 0.1 min) +40 m, point 0 (0° N 0° E, dark in 1.0 min) +30 m"
    assert carried["points"][0] == f"distance = 70 m: {first_two}"
    for all_of_them, words in (((), "+40 m 2 90° S 0° E 0.1 min"), (("--json",), '"part": 40.0')):
        printed = run("explain", path, "--time", "0", *all_of_them).out
        assert words in " ".join(printed.split())


def test_a_table_that_was_learned_from_goes_by_its_own_headings(tmp_path):
    table = tmp_path / "flowers.csv"
    table.write_text("petal length (cm),width[mm],kind\n1.5,2,a\n4.0,3,b\n")
    labels = {"width": "width (mm)", "petal_length": "petal_length (cm)"}
    values, _ = tables.read(table, list(labels), labels)
    assert values.tolist() == [[2.0, 1.5], [3.0, 4.0]]
    with pytest.raises(ControllerFileError, match="it has no 'petal_length'"):
        tables.read(table, ["petal_length"], {"petal_length": "petal_length (m)"})
    table.write_text("width,width (mm)\n1,2\n", encoding="utf-8")
    with pytest.raises(ControllerFileError, match=r"'width' and 'width \(mm\)' for 'width'; leave out one"):
        tables.read(table, ["width"], labels)
