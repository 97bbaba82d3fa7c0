"""Recorded flights as the inputs of the on-board function, and what it answers, by the C compiled here.

A flight is the same in closed loop if every command is the same: from equal states equal forces lead to
equal states. So commands are compared sample by sample, with the inputs that a flight recorded.
"""

import ctypes
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.flight.fly.tours import rehearsal_samples
from pipeline.flight.fly.workspace import points_of_cases
from pipeline.flight.period.look.optics import sun_after
from pipeline.flight.state.log import REHEARSED, FlightLog, Scenario
from pipeline.onboard.fields import InterfaceField
from pipeline.onboard.interface import dtype_of
from pipeline.onboard.messages import OUTPUT as ANSWERED
from pipeline.onboard.messages import START, STEP
from pipeline.onboard.prefix import USUAL
from pipeline.onboard.program import OnboardProgram
from pipeline.settings.fleet import Fleet

#: what the comparison of bits rests on: no fused operations, no reordering
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")


class RecordedSharing(NamedTuple):
    """What a deputy of a fleet knows and hears in each control period, and what it leaves by that."""

    known: Bytes  # (K, P) 1 where a point counts and is not inspected by anybody, as it knows
    heard: Any  # (K,) records of `heard_type`
    left_to: Bytes  # (K, P) to which deputy, or 0


class Recorded(NamedTuple):
    """A flight as the on-board function is given it."""

    start: Any  # one record of `start_type`
    steps: Any  # (K,) records of `step_type`
    choices: dict[int, int]  # from samples on, which of `OnboardProgram.choices` is followed
    parameters: list[list[float]]  # of each choice
    plans: bool = False  # on board, from the first sample on
    sharing: RecordedSharing | None = None  # of a deputy that leaves points to others


def start_type(num_points: int) -> np.dtype[Any]:
    """Return the layout of ``struct controller_start_input``."""
    return dtype_of(START, num_points)


def step_type(num_points: int, inputs: Sequence[InterfaceField] = STEP) -> np.dtype[Any]:
    """Return the layout of ``struct controller_step_input``, with other inputs if they are given."""
    return dtype_of(inputs, num_points)


def heard_type(num_deputies: int, num_points: int) -> np.dtype[Any]:
    """Return the layout of ``struct controller_heard_input``."""
    each = [("shown", "u1", (num_deputies, num_points)), ("position_m", "f8", (num_deputies, 3))]
    return np.dtype([("deputy", "i4"), *each], align=True)


def vector_type(step: np.dtype[Any]) -> np.dtype[Any]:
    """Return the layout of ``struct vector_step`` with an input of a `step_type`."""
    fields = [("input", step), ("choice", "i4"), ("force_n", "f8", 3)]
    return np.dtype(fields, align=True)


#: the layout of ``struct controller_output``
OUTPUT = dtype_of(ANSWERED, 0)


def recorded(
    program: OnboardProgram, scenario: Scenario, log: FlightLog, of_fleet: DeputyLog | None = None
) -> Recorded:
    """Return a logged flight as inputs of the on-board function, with what it heard if it is of a fleet."""
    mission, world = program.mission, program.world
    cases = cases_of(mission, [scenario])
    _, counted = points_of_cases(world, cases.starts)
    case, counts = cases.starts[0], counted[0, : world.num_points]
    angle = np.cos(case.sun_angle), np.sin(case.sun_angle)
    angle = float(angle[0]), float(angle[1])
    elevation = float(np.cos(case.sun_elevation)), float(np.sin(case.sun_elevation))
    start = np.zeros((), start_type(world.num_points))
    start["sun_angle"], start["sun_elevation"], start["counts"] = angle, elevation, counts
    steps = np.zeros(world.num_controls, step_type(world.num_points, program.inputs))
    steps["period"] = np.arange(world.num_controls)
    is_given = (log.command_reason == REHEARSED).any(axis=1) & (program.planner is None)
    steps["is_given"], steps["given_n"] = is_given, np.where(is_given[:, None], log.force_asked_n, 0.0)
    is_exact = mission.navigation.mode == "perfect"
    known = np.hstack([log.position_m, log.velocity_m_s]) if is_exact else log.estimate
    steps["position_m"], steps["velocity_m_s"] = known[:-1, :3], known[:-1, 3:6]
    steps["attitude"] = log.sensed_quaternion_b_from_h[:-1]
    with plainly("pipeline"):
        for k, step in enumerate(steps):
            step["sun_angle"], step["sun_elevation"] = sun_after(world, angle, elevation, k)
    if program.has_covariance:
        steps["covariance"] = log.estimate_covariance[:-1].reshape(-1, 36)
    steps["unseen"] = (counts > 0) & ~log.is_inspected[:-1]
    if program.is_kept_apart:
        _note_others(steps, program.fleet, of_fleet)
    rows = [[row[name] for name in program.parameters] for _, row in program.choices]
    flight = Recorded(start, steps, _chosen(program, log), rows, program.planner is not None)
    if of_fleet is None or not program.is_shared:
        return flight
    heard = np.zeros(len(steps), heard_type(program.fleet.deputies, world.num_points))
    heard["deputy"], heard["shown"] = of_fleet.deputy, of_fleet.shown
    heard["position_m"] = of_fleet.positions
    sharing = RecordedSharing(steps["unseen"].copy(), heard, of_fleet.left_to)
    steps["unseen"] &= of_fleet.left_to == 0
    return flight._replace(sharing=sharing)


def _note_others(steps: Any, fleet: Fleet, log: DeputyLog | None) -> None:
    """Write where a deputy heard that the others would stop, and how long before they told it."""
    if log is None:
        raise ValueError("a log of one deputy was given, and others are kept apart; give that of a fleet")
    others = [row for row in range(fleet.deputies) if row != log.deputy - 1]
    for number, row in enumerate(others, start=1):
        steps[f"other_{number}_stop_m"] = log.stops[:, row]
        steps[f"age_other_{number}"] = np.where(log.arrived[:, row] > 0, fleet.delay_periods, -1)


def _chosen(program: OnboardProgram, log: FlightLog) -> dict[int, int]:
    """Return which tour a flight's controller chose by rehearsals, from samples on."""
    if program.planner is not None or not len(log.tour_costs_m_s):
        return {}
    samples = rehearsal_samples(program.controller, program.mission)
    return dict(zip(samples, log.tour_costs_m_s.argmin(axis=1).tolist(), strict=True))


def vector_of(flights: Sequence[Recorded], logs: Sequence[FlightLog]) -> tuple[Any, Any]:
    """Return a test vector: (n,) records of `start_type` and (n, K) of `vector_type`."""
    steps = np.zeros((len(flights), len(flights[0].steps)), vector_type(flights[0].steps.dtype))
    for row, flight, log in zip(steps, flights, logs, strict=True):
        row["input"], row["force_n"] = flight.steps, log.force_commanded_n
        row["choice"] = [flight.choices.get(k, -1) for k in range(len(row))]
    return np.stack([flight.start for flight in flights]), steps


class Library:
    """The C of an on-board function, compiled for this machine."""

    def __init__(
        self, folder: Path, compiler: str = "gcc", flags: Sequence[str] = FLAGS, prefix: str = USUAL
    ) -> None:
        path = shutil.which(compiler)
        if path is None:
            raise FileNotFoundError(f"{compiler} was not found; install it to compile what was written")
        with TemporaryDirectory() as scratch:
            library = Path(scratch) / "controller.so"
            options: list[str | Path] = [
                *flags,
                "-fPIC",
                "-shared",
                "-o",
                library,
                folder / "controller.c",
                "-lm",
            ]
            subprocess.run([path, *options], check=True)  # noqa: S603
            self._functions = ctypes.CDLL(os.fspath(library))
        self._prefix = prefix
        self._state = (ctypes.c_double * (1 << 16))()

    def _function(self, name: str) -> Any:
        return getattr(self._functions, f"{self._prefix}_{name}")

    def start(self, start: Any) -> int:
        """Begin a flight, from a record of `start_type`; return the status."""
        start = np.ascontiguousarray(start)
        return int(self._function("start")(self._state, ctypes.c_void_p(start.ctypes.data)))

    def choose(self, parameters: Sequence[float]) -> None:
        """Change the constants that may be changed in flight."""
        self._state[: len(parameters)] = list(parameters)

    def plan_from(self, step: Any) -> int:
        """Begin a plan from a record of `step_type`; return the status."""
        return int(self._function("plan_from")(self._state, ctypes.c_void_p(step.ctypes.data)))

    def plan(self, budget: int = 1 << 20) -> int:
        """Search by so many parts of generations; return how many are left."""
        return int(self._function("plan")(self._state, budget))

    def change(self, change: Any, changed: Any) -> int:
        """Change a parameter, both records with the layout of the messages; return the status."""
        addresses = (ctypes.c_void_p(record.ctypes.data) for record in (change, changed))
        return int(self._function("change")(self._state, *addresses))

    def step(self, step: Any, output: Any) -> None:
        """Write what is answered to a record of `step_type` into one of `OUTPUT`, both of an array's."""
        addresses = (ctypes.c_void_p(record.ctypes.data) for record in (step, output))
        self._function("step")(self._state, *addresses)

    def tell(self, step: Any, shown: Bytes) -> int:
        """Write what a deputy tells of each point, (P,), by a record of `step_type`; return the status."""
        addresses = (ctypes.c_void_p(each.ctypes.data) for each in (step, shown))
        return int(self._function("tell")(self._state, *addresses))

    def tell_stop(self, step: Any, stop: Floats) -> int:
        """Write where a deputy tells that it would stop, (3,) m, by a `step_type`; return the status."""
        addresses = (ctypes.c_void_p(each.ctypes.data) for each in (step, stop))
        return int(self._function("tell_stop")(self._state, *addresses))

    def leave(self, step: Any, heard: Any, left_to: Bytes) -> int:
        """Write to which deputy each point is left, (P,), by a record of `heard_type`; return the status."""
        addresses = (ctypes.c_void_p(each.ctypes.data) for each in (step, heard, left_to))
        return int(self._function("leave")(self._state, *addresses))

    def _choose_at(self, flight: Recorded, k: int) -> None:
        """Let a flight follow what it chose at a sample, if it chose anything then."""
        if k in flight.choices:
            self.choose(flight.parameters[flight.choices[k]])

    def shares(self, flight: Recorded) -> tuple[Bytes, Bytes, Any]:
        """Return what a deputy of a fleet tells and leaves at samples, each (K, P), and answers."""
        sharing = flight.sharing
        if sharing is None:
            raise ValueError("a flight in which nothing is left to others was given; give one of a fleet")
        shown, left_to = np.zeros((2, *sharing.known.shape), dtype=np.uint8)
        outputs = np.zeros(len(flight.steps), OUTPUT)
        self.start(flight.start)
        for k in range(len(outputs)):
            step = flight.steps[k : k + 1].copy()
            step["unseen"] = sharing.known[k]
            self._choose_at(flight, k)
            self.tell(step, shown[k])
            self.leave(step, sharing.heard[k : k + 1], left_to[k])
            step["unseen"] &= left_to[k] == 0
            self.step(step, outputs[k : k + 1])
        return shown, left_to, outputs

    def answers(self, flight: Recorded) -> Any:
        """Return what the on-board function answers to a flight's samples, (K,) records of `OUTPUT`.

        Where points are left to others, it steps by what it leaves itself.
        """
        if flight.sharing is not None:
            return self.shares(flight)[2]
        outputs = np.zeros(len(flight.steps), OUTPUT)
        self.start(flight.start)
        if flight.plans:
            self.plan_from(flight.steps[:1])
            self.plan()
        for k in range(len(outputs)):
            self._choose_at(flight, k)
            self.step(flight.steps[k : k + 1], outputs[k : k + 1])
            if flight.plans:  # again, where it does so
                self.plan()
        return outputs


def differing(outputs: Any, log: FlightLog) -> Integers:
    """Return the samples at which a command differs from the logged one in any bit, or its reason does."""
    differs = (outputs["force_n"] != log.force_commanded_n).any(axis=1)
    differs |= outputs["safety_limit"] != log.safety_limit
    return np.flatnonzero(differs | (outputs["reason"] != log.command_reason).any(axis=1))
