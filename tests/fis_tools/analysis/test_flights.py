"""Fuzzy systems along flights that the telemetry's own writer logged."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import telemetry
from fis_tools.__main__ import main
from fis_tools.analysis import tables
from fis_tools.analysis.arrays import rule_usage
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
from tests.fis_tools.sample_controllers import (
    force_x_system,
    force_z_system,
    general_controller,
    paper_like_controller,
)


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


def log_flight(path: Path, controller: FuzzyController, num_samples: int = 4, seed: int = 0) -> Path:
    """Log inferences at random inputs, some of them outside the universes."""
    generator = np.random.default_rng(seed)
    metadata = {f"fis.{system.name}": description(system) for system in controller.systems}
    attachments = {"controller.json": dump_json(controller).encode()}
    with EpisodeWriter(path, metadata=metadata, attachments=attachments) as writer:
        for sample in range(num_samples):
            for system in controller.systems:
                inputs = np.array(
                    [generator.uniform(1.2 * v.minimum, 1.2 * v.maximum) for v in system.inputs]
                )
                log_inference(writer, 10.0 * sample, system, inputs)
    return path


def test_a_flight_gives_back_its_controller_and_every_inference(tmp_path):
    controller = paper_like_controller()
    path = log_flight(tmp_path / "a.mcap", controller)
    assert read_controller(path) == controller
    flown_systems = read_flight(path)
    assert [flown.system for flown in flown_systems] == list(controller.systems)
    for flown in flown_systems:
        np.testing.assert_array_equal(flown.time_s, [0.0, 10.0, 20.0, 30.0])
        for inputs, strengths, output in zip(flown.inputs, flown.firing_strengths, flown.output, strict=True):
            step = infer(flown.system, inputs)
            assert step.values[0] == output
            np.testing.assert_allclose(strengths, step.firing_strengths, rtol=1e-7, atol=0)


def test_inputs_are_those_of_all_flights(tmp_path):
    controller = paper_like_controller()
    paths = [log_flight(tmp_path / f"{seed}.mcap", controller, seed=seed) for seed in (1, 2)]
    flown = [read_flight(path)[1] for path in paths]
    sensed = np.concatenate([one.inputs for one in flown])
    np.testing.assert_array_equal(inputs_along(paths)["force_z"], sensed)
    strengths = np.concatenate([one.firing_strengths for one in flown])
    usage = rule_usage(strengths, 0.3)
    np.testing.assert_array_equal(usage.fired, np.mean(strengths >= 0.3, axis=0))
    assert 0 < usage.fired.sum() < 45


def test_a_system_that_never_decides_is_left_out(tmp_path):
    path = log_flight(tmp_path / "a.mcap", paper_like_controller(), num_samples=0)
    assert inputs_along([path])["force_x"].shape == (0, 2)


def test_flights_that_cannot_be_used_are_refused_with_a_sentence(tmp_path):
    controller = paper_like_controller()
    path = log_flight(tmp_path / "a.mcap", controller)
    other = log_flight(
        tmp_path / "b.mcap", FuzzyController("b", (replace(force_z_system(), name="force_x"),))
    )
    with pytest.raises(ControllerFileError, match="another system 'force_x'"):
        inputs_along([path, other])
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ControllerFileError, match="recover"):
        read_flight(tmp_path / "cut.mcap")
    with pytest.raises(ControllerFileError, match="cannot be opened"):
        read_controller(tmp_path / "missing.mcap")


def test_a_log_that_does_not_fit_its_controller_is_refused(tmp_path):
    system = force_x_system()
    metadata = {"fis.force_x": description(system)}
    for name, content, words in (
        ("none", {}, "carries no controller.json"),
        ("coast", {"controller.json": b'{"kind": "coast"}'}, "not a fuzzy controller"),
        ("latin", {"controller.json": b"\xff"}, "controller.json"),
        ("others", {"controller.json": dump_json(general_controller()).encode()}, "no topic /fis/room"),
        (
            "wide",
            {
                "controller.json": dump_json(
                    FuzzyController("w", (replace(force_z_system(), name="force_x"),))
                ).encode()
            },
            "holds 2 inputs",
        ),
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
    metadata = {f"fis.{system.name}": description(system) for system in controller.systems}
    attachments = {"controller.json": dump_json(controller).encode()}
    generator = np.random.default_rng(4)
    with EpisodeWriter(path, metadata=metadata, attachments=attachments) as writer:
        for sample, (is_inferred, x, z) in enumerate(PERIODS):
            time_s = 10.0 * sample
            force = np.array([x == Reason.FIRED, 0.0, z == Reason.FIRED], dtype=np.float64)
            told = {"force_asked_n": force, "reason": [x, Reason.SILENT, z]} if has_reasons else {}
            writer.record(DEPUTY_CONTROL, time_s, force_body_n=force, force_hill_n=force, **told)
            for system in controller.systems if is_inferred else ():
                inputs = np.array([generator.uniform(v.minimum, v.maximum) for v in system.inputs])
                log_inference(writer, time_s, system, inputs)
    return path


def test_inferences_count_whose_force_was_fired(tmp_path):
    path = log_periods(tmp_path / "a.mcap", paper_like_controller())
    times = {one.system.name: one.time_s.tolist() for one in read_flight(path)}
    assert times == {"force_x": [0.0, 10.0, 50.0], "force_z": [10.0]}
    for flown in read_flight(path, all_periods=True):
        assert flown.time_s.tolist() == [0.0, 10.0, 30.0, 50.0]
    assert len(inputs_along([path])["force_x"]) == 3
    assert len(inputs_along([path], all_periods=True)["force_z"]) == 4


def test_a_recording_without_reasons_counts_where_any_force_was_fired(tmp_path):
    path = log_periods(tmp_path / "a.mcap", paper_like_controller(), has_reasons=False)
    control = telemetry.read(path)["/deputy/control"]
    assert control["reason"].shape == control["force_asked_n"].shape == (6, 0)
    assert np.isnan(control["coasting_missed"]).all()
    for flown in read_flight(path):
        assert flown.time_s.tolist() == [0.0, 10.0, 50.0]


def test_each_period_tells_what_became_of_each_system(tmp_path):
    path = log_periods(tmp_path / "a.mcap", paper_like_controller())
    for sample, (is_inferred, *reasons) in enumerate(PERIODS):
        for time_s in (10.0 * sample, 10.0 * sample + 9.9):
            for period, reason in zip(read_periods(path, time_s), reasons, strict=True):
                assert (period.time_s, period.reason) == (10.0 * sample, reason.name.lower())
                assert (period.row is not None) == is_inferred
                if period.row is not None:
                    assert period.flown.time_s[period.row] == period.time_s


def test_points_are_read_as_they_are_at_a_time_and_told_with_the_inputs(tmp_path, capsys):
    """Three points on the axes; a cloud holds until the next, and what nobody asks is not told."""
    system = force_x_system()
    axes, parts = 10.0 * np.diag([1.0, 1.0, -1.0]), np.array([[30.0, 0.0, 40.0], [1.0, 2.0, 3.0]])
    metadata = {"fis.force_x": description(system), "pulls": {"distance": "m"}}
    attachments = {"controller.json": dump_json(replace(paper_like_controller(), systems=(system,))).encode()}
    path, times, nothing = tmp_path / "x.mcap", np.array([0.0, 10.0, 20.0]), np.zeros((3, 3))
    with EpisodeWriter(path, metadata=metadata, attachments=attachments) as writer:
        fired = np.full((3, 3), Reason.FIRED)
        writer.record(
            DEPUTY_CONTROL,
            times,
            force_hill_n=nothing + 1.0,
            reason=fired,
            coasting_missed=[1.0, np.nan, 0.0],
        )
        is_missed = np.array([[False, True, False], [False] * 3])
        writer.pulls(times[:2], axes, {"distance": parts}, np.array([60.0, 120.0, 5.0]), is_missed)
        steps = [infer(system, [value, 0.0]) for value in (70.0, 6.0, 6.0)]
        strengths = np.array([step.firing_strengths for step in steps])
        inputs, output = np.array([[70.0, 0.0], [6.0, 0.0], [6.0, 0.0]]), [step.values[0] for step in steps]
        writer.record(
            fis_topic("force_x"), times, inputs=inputs, firing_strengths=strengths, output_n=np.array(output)
        )
    first, second, third = (read_points(path, time) for time in times)
    assert first is not None
    assert second is not None
    assert third is not None
    np.testing.assert_allclose(first.latitude_deg, [0.0, 0.0, -90.0], atol=1e-9)
    np.testing.assert_allclose(first.longitude_deg[:2], [0.0, 90.0], atol=1e-9)
    np.testing.assert_array_equal(third.dark_in_s, [40.0, 100.0, -15.0])
    np.testing.assert_array_equal([one.parts["distance"] for one in (first, second, third)], parts[[0, 1, 1]])
    assert first.is_missed is not None
    assert first.is_missed.tolist() == [False, True, False]
    assert second.is_missed is None
    assert read_points(tmp_path / "table.csv", 0.0) is None
    (flown,) = read_flight(path, all_periods=True)
    (carried,) = flight_data(Flight("x", {"force_x": flown}, is_own=True), [system], 1)["systems"]
    first_two = "point 2 (90° S 0° E, dark in 0.1 min) +40 m, point 0 (0° N 0° E, dark in 1.0 min) +30 m"
    assert carried["points"][0] == f"distance = 70 m: {first_two}"
    for all_of_them, words in (((), "+40 m 2 90° S 0° E 0.1 min"), (("--json",), '"part": 40.0')):
        assert main(["explain", str(path), "--time", "0", *all_of_them]) == 0
        assert words in " ".join(capsys.readouterr().out.split())


def test_a_table_that_was_learned_from_goes_by_its_own_headings(tmp_path):
    table = tmp_path / "flowers.csv"
    table.write_text("petal length (cm),width[mm],kind\n1.5,2,a\n4.0,3,b\n")
    labels = {"width": "width (mm)", "petal_length": "petal_length (cm)"}
    values, _ = tables.read(table, list(labels), labels)
    assert values.tolist() == [[2.0, 1.5], [3.0, 4.0]]
    with pytest.raises(ControllerFileError, match="it has no 'petal_length'"):
        tables.read(table, ["petal_length"], {"petal_length": "petal_length (m)"})
