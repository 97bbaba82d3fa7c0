"""A linear law in place of a controller's rules, flown by the compiled steps of every other flight.

Each force is a sum of the signals that the rules of its axis sense, each times a slope, limited at both ends.
Everything else stays the controller's: constants, dead bands, when it decides and when it coasts.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Final
from unittest.mock import patch

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import load_three, same, store_three
from fis_tools.compiled.vectors import borrowed, load, select, splat, store, width_of
from fis_tools.engines.packing import Packed
from fis_tools.genes.planes import plane_gains
from fis_tools.model import rule_table
from pipeline.array_types import Floats
from pipeline.flight.control.controller import Controller, has_constants
from pipeline.flight.fly import population, rehearsals, simulation, tours
from pipeline.flight.fly.many import (
    FlightBatch,
    Results,
    open_with,
    start_lanes,
    write_fired,
    write_outcomes,
    write_track,
)
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.period.decide.thrust import is_decision
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.steps import act, decide, look
from pipeline.flight.state.arrays import Control, FlightState, FullOptics, Moment, Workspace, constant_of
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.lanes import clip, clip_three, load_quaternion, load_row
from pipeline.flight.state.signals import BODY, CONSTANTS, FIRST_DEAD_BAND, SETTING, URGENCY
from pipeline.physics.quaternion import to_hill
from pipeline.training import judging

#: numbers of one axis, last in a row of values: a slope for each of up to three inputs, a constant, a limit
OFFSET, LIMIT, NUMBERS = 3, 4, 5
#: a slope of one takes the force from end to end of the rules' range as its input goes from end to end
STEEPEST: Final = 3.0
#: least and greatest limit, in those of the rules
LIMITS: Final = (0.3, 3.0)


@compiled(error_model="numpy", forceinline=True)
def command_linearly(now: Moment, control: Control, signals: Floats) -> None:
    """Command the linear law's forces in place of those that the rules have just asked for."""
    law, lanes = control.law, now.state.lanes
    width, behind = width_of(lanes), law.constants if law.constants >= 0 else len(control.values)
    first = behind - NUMBERS * len(law.axes)
    fires = load_row(lanes.coasts) == 0.0
    store_three(lanes.requested, 0, same(0.0, width))
    for system in range(len(law.axes)):
        numbers = control.values[first + NUMBERS * system : first + NUMBERS * (system + 1)]
        force = splat(numbers[OFFSET], width)
        for index in range(law.num_inputs[system]):
            force = force + numbers[index] * load(signals, law.signals[system, index], width)
        force, axis = clip(force, numbers[LIMIT]), law.axes[system]
        dead_band = constant_of(control, FIRST_DEAD_BAND + axis)
        store(lanes.requested, axis, select(fires & (abs(force) >= dead_band), force, 0.0))
    command = load_three(lanes.requested, 0)
    if law.force_axes == BODY:
        command = to_hill(load_quaternion(now.state.belief.attitude), command)
    store_three(lanes.commanded, 0, clip_three(command, now.world.max_force))


@compiled(nogil=True, error_model="numpy")
def fly_linearly(
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    flights: FlightBatch,
    state: FlightState,
    work: Workspace,
    results: Results,
    first: int,
    last: int,
) -> None:
    """Fly as `pipeline.flight.fly.many.fly_many` does, but under linear laws; nothing is logged."""
    width = width_of(state.lanes)
    flights, state, work, results = borrowed((flights, state, work, results))
    world, law, tracks = flights.world, flights.law, results.tracks
    num_starts, flight = len(flights.cases), first
    while flight < last:
        row, start = flight // num_starts, flight % num_starts
        num_lanes = min(width, num_starts - start, last - flight)
        control = Control(law, flights.values[row, 0], flights.rules[row])
        start_lanes(Moment(world, state, start, num_lanes, 0), flights.cases, flights.counted)
        if law.needs & (URGENCY | SETTING):
            note_deadlines(Moment(world, state, start, num_lanes, 0), optics, work.deadlines, work.lit)
        for k in range(world.num_controls + 1):
            now = Moment(world, state, start, num_lanes, k)
            look(now, work, optics, clusters, errors, law.plans)
            for lane in range(num_lanes if len(tracks) > 0 else 0):
                write_track(now, lane, tracks[flight + lane, k])
            if k == world.num_controls:
                write_outcomes(now, flight, results.outcomes)
                break
            decide(now, work, optics, control)
            if is_decision(law, k):
                command_linearly(now, control, work.signals)
            open_with(now, flights.openings)
            act(now, work, errors, law.plans)
            for lane in range(num_lanes if len(tracks) > 0 else 0):
                write_fired(state, lane, tracks[flight + lane, k])
        flight += num_lanes


@contextmanager
def flying() -> Iterator[None]:
    """Fly under linear laws, where controllers are those of `LinearLaw.decode`."""
    with (
        patch.object(population, "fly_many", fly_linearly),
        patch.object(rehearsals, "tour_images", images_of),
        patch.object(tours, "tour_images", images_of),
        patch.object(simulation, "tour_images", images_of),
        patch.object(judging, "from_fuzzy", lambda controller: controller),
    ):
        yield


def images_of(controller: Controller) -> list[Controller]:
    """Return a controller for each image of a tour, as `tour_images` does, but under its linear law."""
    return [
        with_law(image, controller.numbers.values[0, place_of(controller)])
        for image in tour_images(controller)
    ]


def place_of(controller: Controller) -> slice:
    """Return where a controller's numbers have those of its law: before its constants."""
    end = controller.numbers.values.shape[1] - len(CONSTANTS) * has_constants(controller)
    return slice(end - NUMBERS * len(controller.systems), end)


def with_law(controller: Controller, law: Floats) -> Controller:
    """Return a copy of a controller that has a linear law, (n,), before its constants."""
    copy, numbers = replace(controller), controller.numbers
    values = np.insert(numbers.values, [place_of(controller).stop] * len(law), law, axis=1)
    vars(copy)["numbers"] = replace(numbers, values=values)
    return copy


class LinearLaw:
    """The mapping from genes in [0, 1] to linear laws in place of a champion's rules.

    For each axis a slope for each input, a constant if a range of these is not symmetric about zero, and the
    limit, all relative to the ranges of the champion's variables.
    """

    def __init__(self, champion: Controller) -> None:
        self.template = with_law(champion, np.zeros(NUMBERS * len(champion.systems)))
        self._has_offset = [
            any(variable.minimum != -variable.maximum for variable in system.inputs)
            for system in champion.systems
        ]

    @property
    def num_genes(self) -> int:
        """Length of the vector."""
        return len(self.encode())

    def encode(self) -> Floats:
        """Return the genes of the planes that are nearest to the champion's rule tables."""
        low, high = LIMITS
        genes: list[float] = []
        for system, has_offset in zip(self.template.systems, self._has_offset, strict=True):
            table = rule_table(system)
            assert table is not None
            genes += (0.5 + 0.5 * plane_gains(system, table) / STEEPEST).tolist()
            genes += [0.5] * has_offset + [float(np.log(1.0 / low) / np.log(high / low))]
        return np.clip(np.array(genes), 0.0, 1.0)

    def pack(self, genomes: Floats) -> Packed:
        """Return a population, (n, num_genes), as the champion's numbers with those of the laws."""
        numbers = self.template.numbers
        values = np.repeat(numbers.values, len(genomes), axis=0)
        values[:, place_of(self.template)] = self._laws(genomes)
        return replace(numbers, values=values, rules=np.repeat(numbers.rules, len(genomes), axis=0))

    def decode(self, genome: Floats) -> Controller:
        """Return the champion with the law of one genome, to be flown while `flying`."""
        controller = replace(self.template)
        vars(controller)["numbers"] = self.pack(genome[np.newaxis])
        return controller

    def _laws(self, genomes: Floats) -> Floats:
        laws = np.zeros((len(genomes), len(self.template.systems), NUMBERS))
        low, high = LIMITS
        at = 0
        for index, (system, has_offset) in enumerate(
            zip(self.template.systems, self._has_offset, strict=True)
        ):
            ends = np.array([(variable.minimum, variable.maximum) for variable in system.inputs])
            reach, count = system.outputs[0].maximum, len(ends)
            half, middle = 0.5 * (ends[:, 1] - ends[:, 0]), ends.mean(axis=1)
            laws[:, index, :count] = STEEPEST * (2.0 * genomes[:, at : at + count] - 1.0) * reach / half
            at += count
            if has_offset:
                laws[:, index, OFFSET] = reach * (2.0 * genomes[:, at] - 1.0)
                laws[:, index, OFFSET] -= laws[:, index, :count] @ middle
                at += 1
            laws[:, index, LIMIT] = reach * low * (high / low) ** genomes[:, at]
            at += 1
        return laws.reshape(len(genomes), -1)
