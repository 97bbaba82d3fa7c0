"""Turns flown episodes into recordings: what the topics say about each sample, and what a file carries.

The words of the topics are `telemetry`'s; the numbers are a `FlightLog`'s.
"""

import base64
import json
import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis import shapley
from fis_tools.analysis.contribution import holding_back
from fis_tools.analysis.flights import CONTROLLER_ATTACHMENT
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import COMPONENTS, REASONS
from fis_tools.words.text import sentences
from pipeline.array_types import Floats
from pipeline.constants import MM_PER_M
from pipeline.controllers.played import to_mapping
from pipeline.flight.cases.dispersions import drawn, mission_of_case
from pipeline.flight.control.controller import (
    Controller,
    PilotController,
    PlanningController,
    RegulatorController,
    RuleController,
)
from pipeline.flight.control.law import decision_stride, rehearsed_pushes
from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.flight.fly.tours import following, rehearsal_samples, tour_names
from pipeline.flight.goals.reach import ended
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import CONSTANTS, SIGNALS
from pipeline.flight.world.pack import pack_world
from pipeline.flight.world.surface import surface_of
from pipeline.recording.events import events
from pipeline.recording.firing import delay_of, is_fired
from pipeline.recording.fleets import fleet_events
from pipeline.recording.foresight import along_axes, recorded_decisions
from pipeline.recording.points import lit_and_seen, parts_of_points, sensed_of_points
from pipeline.run import configuration, maker
from pipeline.settings.equipment import FilteredNavigation
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.schema import only_results
from telemetry import EpisodeWriter
from telemetry.file import topics
from telemetry.file.metadata import EpisodeDescription, FisDescription, Rehearsal

States = NDArray[np.uint8]

CONFIG_ATTACHMENT = "config.yaml"

#: what a recording calls the reasons that a `FlightLog` holds as indices into `REASONS`
REASON_OF = np.array([topics.Reason[word.upper()] for word in REASONS])

LIT, IN_VIEW_BUT_DARK, INSPECTED = np.array(
    [topics.PointState.LIT, topics.PointState.IN_VIEW_BUT_DARK, topics.PointState.INSPECTED], np.uint8
)


class FlightRecorder:
    """Records flights of one controller in an experiment's mission; what they share is prepared once.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
    config : mapping
        Of the run: resolved, plain data.
    """

    def __init__(self, experiment: Experiment, controller: Controller, config: Mapping[str, Any]) -> None:
        mission, self._fleet = experiment.mission.of_each, experiment.mission.fleet
        self.controller = controller
        self._seed = experiment.seed
        self._near_limit_m = experiment.telemetry.near_limit_m
        self._config_hash = configuration.config_hash(config)
        self._product_version = maker.product()["versions"]["product"]
        self._attachments = {
            CONFIG_ATTACHMENT: configuration.text(only_results(config)).encode(),
            CONTROLLER_ATTACHMENT: controller_text(controller).encode(),
        }
        self._compiled = [compile(system) for system in controller.systems]
        self._systems: dict[str, dict[str, str]] = {
            topics.FIS_METADATA_PREFIX + compiled.system.name: describe(
                compiled, controller.force_axes
            ).to_metadata()
            for compiled in self._compiled
        }
        attributes = controller.fuzzy.attributes if controller.fuzzy else ()
        meanings = {name: CONSTANTS[name].description for name, _ in attributes if name in CONSTANTS}
        if meanings:
            self._systems[topics.CONSTANTS_METADATA] = meanings
        self._enter(mission)
        if pulled := sensed_of_points(self._world, controller):
            self._systems[topics.PULLS_METADATA] = {name: SIGNALS[name].unit for name in pulled}
        if len(corners := surface_of(mission).corners):
            self._attachments[topics.CHIEF_ATTACHMENT] = stl_of(corners)
        # whether flights depend on what their cases have drawn besides the start
        has_errors = mission.navigation.mode == "fixes" or mission.actuators.kind == "real"
        draws = isinstance(controller, PilotController) and controller.pilot.draws
        loses = self._fleet.deputies > 1 and self._fleet.lost_percent > 0.0
        self._is_noisy = has_errors or draws or loses or bool(mission.dispersions)

    def _enter(self, mission: Mission) -> None:
        """Prepare what flights of a mission share."""
        self.mission, self._world, self._points = mission, pack_world(mission), surface_of(mission).points
        self._attitude_offsets: Floats = mission.attitude_period_s * np.arange(
            mission.num_attitude_steps, dtype=np.float64
        )
        self._delay = delay_of(mission)

    def record(
        self,
        path: Path,
        scenario: Scenario,
        log: FlightLog,
        scenario_id: str,
        of_fleet: DeputyLog | None = None,
    ) -> None:
        """Write a flight as one file, which appears under its name when it is complete.

        Parameters
        ----------
        path : Path
            In a folder that exists.
        scenario : Scenario
            From where it was flown.
        log : FlightLog
            Of this recorder's controller in its mission.
        scenario_id : str
            What the start is called.
        of_fleet : DeputyLog, optional
            Where the flight is that of a deputy of a fleet.

        Raises
        ------
        telemetry.RecordingError
            If the disk refuses.
        """
        settings = tuple(value for _, value in drawn(self.mission, scenario))
        of_case = self
        if settings:  # drawn for this flight alone
            of_case, scenario = copy(self), replace(scenario, settings=settings)
            of_case._enter(mission_of_case(self.mission, scenario))
        episode, num_deputies = of_case._episode(scenario, scenario_id, log), 1
        if of_fleet is not None:
            fleet, deputy, num_deputies = self._fleet, of_fleet.deputy, self._fleet.deputies
            episode |= {"deputy": json.dumps(deputy), "fleet_deputies": json.dumps(num_deputies)}
            episode["fleet_sharing"] = fleet.sharing
        metadata = {
            topics.EPISODE_METADATA: episode,
            **self._systems,
            **of_case._rehearsals(log, num_deputies),
        }
        with EpisodeWriter(path, metadata=metadata, attachments=self._attachments) as writer:
            of_case._write(writer, log, of_fleet)

    def _episode(self, scenario: Scenario, scenario_id: str, log: FlightLog) -> dict[str, str]:
        """Return the metadata that describes a flight: its start, settings, limits and camera."""
        mission = self.mission
        has_goal, is_rectangle = mission.problem.kind == "reach", mission.sensor.rectangle_deg is not None
        description = EpisodeDescription(
            scenario_id=scenario_id,
            epoch=mission.orbit.start_time,
            seed=self._seed,
            position_m=tuple(scenario.position_m.tolist()),
            velocity_m_s=tuple(scenario.velocity_m_s.tolist()),
            noise=scenario.noise if self._is_noisy else None,
            settings=scenario.settings,
            sun_angle_rad=float(scenario.sun_angle_rad),
            sun_elevation_rad=float(scenario.sun_elevation_rad),
            product_version=self._product_version,
            config_hash=self._config_hash,
            **_named(mission.deputy, "min_distance_m", "max_distance_m", "max_force_n", "max_torque_n_m"),
            half_angle_rad=None if is_rectangle else math.radians(mission.sensor.half_angle_deg),
            boresight=mission.sensor.boresight,
            keep_out_m=sum(mission.chief.keep_out_m, ()) or None,
            inspection_threshold_percent=mission.inspection_threshold_percent,
            end_s=mission.control_period_s * ended(mission, log)[0] if has_goal else None,
        )
        radius = json.dumps(mission.chief.inspection_radius_m)
        count = json.dumps(len(self._points))
        return {**description.to_metadata(), "inspection_radius_m": radius, "num_points": count}

    def _rehearsals(self, log: FlightLog, num_deputies: int) -> dict[str, dict[str, str]]:
        """Return the estimated cost of each alternative: first pushes, tours, and plans of pushes."""
        ways = [along_axes(MM_PER_M * push) for push in rehearsed_pushes(self.controller)]
        period, names = self.mission.control_period_s, tour_names(self.controller)
        is_rehearsed = len(log.push_costs_m_s) > 0
        rehearsals = {"first push": (ways, log.push_costs_m_s, 0.0, period)} if is_rehearsed else {}
        begins = [period * sample for sample in rehearsal_samples(self.controller, self.mission)]
        ends = [*begins[1:], self.mission.duration_s]
        for costs, begin, end in zip(log.tour_costs_m_s, begins, ends, strict=False):
            what = "image of the tour" + (f" from {begin:g} s" if begin else "")
            is_flown = np.isfinite(costs)
            rehearsals[what] = (list(compress(names, is_flown)), costs[is_flown], begin, end)
        records = {
            what: Rehearsal(names=tuple(names), costs_m_s=tuple(costs.tolist()), until_s=end, from_s=begin)
            for what, (names, costs, begin, end) in rehearsals.items()
        }
        records |= recorded_decisions(self.mission, log, num_deputies)
        return {
            topics.REHEARSAL_METADATA_PREFIX + what: record.to_metadata() for what, record in records.items()
        }

    def _write(self, writer: EpisodeWriter, log: FlightLog, of_fleet: DeputyLog | None) -> None:
        """Write topic by topic, and what happened, in words, as events of their time."""
        times: Floats = self.mission.control_period_s * np.arange(len(log.position_m), dtype=np.float64)
        position, quaternion = log.position_m, log.quaternion_b_from_h
        writer.poses(times, position, quaternion, log.quaternion_c_from_h)
        writer.record(
            topics.DEPUTY_STATE,
            times,
            **_named(log, "position_m", "velocity_m_s"),
            quaternion=quaternion,
            angular_velocity_rad_s=log.angular_velocity_b_rad_s,
        )
        writer.points(times, self._points, self._point_states(log))
        if isinstance(self.mission.navigation, FilteredNavigation):
            deviation = np.sqrt(np.diagonal(log.estimate_covariance, axis1=1, axis2=2))
            writer.record(
                topics.NAVIGATION,
                times,
                position_m=log.estimate[:, :3],
                velocity_m_s=log.estimate[:, 3:],
                position_deviation_m=deviation[:, :3],
                velocity_deviation_m_s=deviation[:, 3:],
                **_named(log, "fix_m", "innovation_m", "innovation_square"),
                fix_age_s=self.mission.navigation.delay_s,
                quaternion=log.sensed_quaternion_b_from_h,
            )
        self._write_pulls(writer, times, log)
        angles = _named(log, "num_candidates", "lambda_u_rad", "eta_u_rad")
        writer.record(topics.GUIDANCE, times, target_direction=directions(log.target_m), **angles)
        inspected_count = log.is_inspected.sum(axis=1)
        writer.record(
            topics.MISSION,
            times,
            **_named(log, "sun_angle_rad", "sun_elevation_rad", "delta_v_m_s", "mass_kg"),
            distance_m=np.linalg.norm(position, axis=1),
            inspected_count=inspected_count,
            inspection_rate_percent=100.0 * inspected_count / len(self._points),
            inspected_mask=log.is_inspected,
            sun_hidden_share=1.0 - log.visible_sun_share,
            inspectable_count=int(log.is_inspectable.sum()),
        )
        self._write_control(writer, times[: len(log.force_hill_n)], log)
        if (fuzzy := self.controller.fuzzy) is not None and (how := serialize.edited(fuzzy)) is not None:
            writer.log(times[0], "warning", f"{serialize.original_name(fuzzy)} was edited {how}")
        happened = events(self.mission, log, self._near_limit_m, self.controller)
        if of_fleet is not None:
            stride = decision_stride(self.controller, self.mission)
            happened += fleet_events(self.mission, of_fleet, self._fleet.deputies, stride)
        for event in sorted(happened, key=lambda event: event.sample):
            writer.log(times[event.sample], event.level, event.text)

    def _write_pulls(self, writer: EpisodeWriter, times: Floats, log: FlightLog) -> None:
        """Write which points the inputs made of points come from, and which ones coasting would miss."""
        if topics.PULLS_METADATA not in self._systems:
            return
        samples = np.arange(0, len(log.is_decided), decision_stride(self.controller, self.mission))
        flown = self.controller
        if len(log.tour_costs_m_s):
            flown = following(flown, self.mission, log.tour_costs_m_s.argmin(axis=1).tolist())
        parts = parts_of_points(self._world, flown, log, samples)
        columns = np.hstack([*parts.values(), log.is_missed[samples]])
        # while the deputy coasts little changes
        is_new = np.append(True, np.any(columns[1:] != columns[:-1], axis=1))[: len(samples)]
        parts = {name: values[is_new] for name, values in parts.items()}
        samples = samples[is_new]
        writer.pulls(times[samples], self._points, parts, log.last_light_s, log.is_missed[samples])

    def _write_control(self, writer: EpisodeWriter, times: Floats, log: FlightLog) -> None:
        """Write the forces of the control periods, and the inferences behind them."""
        writer.record(
            topics.DEPUTY_ATTITUDE,
            times,
            time_offset_s=self._attitude_offsets,
            quaternion=log.attitude_quaternion,
            angular_velocity_rad_s=log.attitude_rate_b_rad_s,
            torque_n_m=log.torque_b_n_m,
        )
        foreseen = np.where(np.isfinite(log.foreseen).all(axis=1, keepdims=True), log.foreseen, np.nan)
        missed, nearest, farthest = foreseen.T
        writer.record(
            topics.DEPUTY_CONTROL,
            times,
            **_named(log, "force_body_n", "force_hill_n", "force_asked_n", "force_commanded_n"),
            reason=REASON_OF[log.reason],
            coasting_missed=missed,
            coasting_nearest_m=nearest,
            coasting_farthest_m=farthest,
            command_reason=REASON_OF[log.command_reason],
            command_age_s=self._delay * self.mission.control_period_s,
        )
        decided = np.flatnonzero(log.is_decided)
        for index, compiled in enumerate(self._compiled):
            system = compiled.system
            inputs = log.fis_input[decided, index, : len(system.inputs)]
            strengths = compiled.firing_strengths(inputs)
            axis = COMPONENTS.index(system.outputs[0].name)
            has_effect = is_fired(log, decided, axis, self.controller.force_axes, self._delay)
            shares = np.zeros_like(strengths)
            contributions = shapley.shares(compiled, inputs[has_effect], firing=strengths[has_effect])
            shares[has_effect] = contributions.values[:, :, 0]
            writer.record(
                topics.fis_topic(system.name),
                times[decided],
                inputs=inputs,
                firing_strengths=strengths,
                output_n=log.fis_output_n[decided, index],
                shares_n=shares,
            )

    def _point_states(self, log: FlightLog) -> States:
        """Return each point's `PointState` at each sample, (K+1, P): the highest that applies."""
        is_lit, is_seen = lit_and_seen(self._world, log)
        # dark is zero, and of the others at most one applies
        return LIT * is_lit + IN_VIEW_BUT_DARK * is_seen + INSPECTED * log.is_inspected


def _named(owner: object, *names: str) -> dict[str, Any]:
    """Return attributes that recordings call by the same name."""
    return {name: getattr(owner, name) for name in names}


def stl_of(corners: Floats) -> bytes:
    """Return triangles, shape (T, 3, 3), as a binary STL file; its readers work out the normals."""
    rows = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    )
    rows["corners"] = corners
    return b" " * 80 + np.uint32(len(rows)).tobytes() + rows.tobytes()


def describe(compiled: CompiledSystem, force_axes: str) -> FisDescription:
    """Return the meaning of the numbers on a system's topic, and the axes of its output."""
    system = compiled.system
    output = system.outputs[0]
    return FisDescription(
        input_names=tuple(variable.name for variable in system.inputs),
        input_units=tuple(variable.unit for variable in system.inputs),
        output_name=output.name,
        output_unit=output.unit,
        rules=tuple(sentences(system)),
        holding=holding_back(system),
        output_axes=force_axes,
    )


def controller_text(controller: Controller) -> str:
    """Return a controller as JSON, which its kind's reader reads back.

    A fuzzy one is written whole, as `fis_tools.formats.serialize` reads it, and one that plays a flight with
    what it plays, as `pipeline.controllers.played` reads it; one without any force is of kind ``coast``, one
    that plans of the kind that it is named after, and of a policy the file stands in it, in base 64.
    """
    if isinstance(controller, PilotController):
        content = base64.b64encode(controller.pilot.source).decode("ascii")
        return json.dumps({"kind": "policy", "name": controller.name, "onnx": content}) + "\n"
    if isinstance(controller, PlanningController | RegulatorController):
        return json.dumps({"kind": controller.name, "name": controller.name}) + "\n"
    if isinstance(controller, RuleController):
        attributes = (("force_axes", controller.force_axes),)
        fuzzy = controller.fuzzy or FuzzyController(controller.name, controller.systems, attributes)
        return serialize.dump_json(fuzzy)
    played = to_mapping(controller)
    if not any(len(played) for played in (controller.plan, *controller.turns)):
        played = {"kind": "coast", "name": controller.name}
    return json.dumps(played, ensure_ascii=False) + "\n"


def directions(vectors: Floats) -> Floats:
    """Return unit vectors, shape (n, 3), of vectors of the same shape; zeros for zeros."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
