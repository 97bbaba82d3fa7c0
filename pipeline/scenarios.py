"""The starts that an experiment flies, drawn case by case: a case does not depend on the number of cases.

Case i of a stage draws from ``SeedSequence(seed, spawn_key=(stage, i))``: direction, then distance, then the
Sun's angle, then its elevation, whether or not they are used. The same seed therefore gives the same
positions under any Sun setting.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Experiment, Sun
from pipeline.settings.fleet import SEED_STEP
from pipeline.settings.monte_carlo import MonteCarlo
from pipeline.settings.start_table import DEPUTY, POSITION, VELOCITY, numbers
from pipeline.settings.training import Starts

#: first part of the spawn key: evaluation; training round r as ``TRAINING + r``; the candidates for its hard
#: starts, ``HARD + r``; those on which the champion is chosen; and rung r of a fit as ``FITTING + r``
EVALUATION, TRAINING, HARD, VALIDATION, FITTING = 0, 1, 1 << 20, 1 << 21, 1 << 22

#: places in the spawn key of the random numbers for a start's velocity, for its points' priority, and for
#: where clusters begin that AFRL's agents observe
SPEED, PRIORITY, CLUSTERS = 3, 1 << 10, 1 << 11

OCTANTS = np.array(list(product((1.0, -1.0), repeat=3))) / np.sqrt(3.0)


def draw(seed: int, stage: int, case: int, starts: Starts | MonteCarlo, sun: Sun) -> Scenario:
    """Draw the start of a case, with its Sun.

    Its distance is uniform between the least and the greatest, its speed between 0 and the greatest, each in
    a direction of its own (`direction_of`). From a box, position and velocity are drawn uniformly between its
    rows. A Sun that alternates is fixed in even cases and random in odd ones.
    """
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stage, case)))
    direction = direction_of(generator, starts.directions)
    direction /= np.linalg.norm(direction)
    distance = generator.uniform(starts.min_distance_m, starts.max_distance_m)
    angle = generator.uniform(0.0, 2.0 * np.pi)
    share = generator.uniform()
    elevation_deg = sun.elevation_deg
    if sun.mode == "fixed" or (sun.mode == "mixed" and case % 2 == 0):
        angle = float(np.radians(sun.angle_deg))
    elif sun.elevation_range_deg is not None:
        low, high = sun.elevation_range_deg
        elevation_deg = low + share * (high - low)
    elevation = float(np.radians(elevation_deg))
    start = Scenario(distance * direction, np.zeros(3), angle, elevation, (seed, stage, case))
    if starts.box is not None:
        drawn = start.generator(SPEED).uniform(*np.array(starts.box))
        return replace(start, position_m=drawn[:3], velocity_m_s=drawn[3:])
    if not starts.max_speed_m_s > 0.0:
        return start
    generator = start.generator(SPEED)
    direction = direction_of(generator, starts.directions)
    speed = generator.uniform(0.0, starts.max_speed_m_s)
    return replace(start, velocity_m_s=speed * direction / np.linalg.norm(direction))


def direction_of(generator: np.random.Generator, directions: str = "angles") -> Floats:
    """Draw a direction, of any length: uniform on the sphere, or with uniform azimuth and elevation."""
    if directions == "even":
        return generator.standard_normal(3)
    azimuth, elevation = generator.uniform([0.0, -0.5 * np.pi], [2.0 * np.pi, 0.5 * np.pi])
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def _drawn(
    experiment: Experiment, starts: Starts | MonteCarlo, stage: int, cases: Sequence[int]
) -> list[Scenario]:
    """Draw the starts of some cases of a stage; in a mission of fleets, those of all deputies."""
    drawn = [
        started(experiment, starts, draw(experiment.seed, stage, case, starts, experiment.sun))
        for case in cases
    ]
    if not experiment.mission.has_fleet:
        return drawn
    return [replace(first, others=_others(experiment, starts, first)) for first in drawn]


def started(experiment: Experiment, starts: Starts | MonteCarlo, drawn: Scenario) -> Scenario:
    """Return a start with the velocity that closes its ellipse of free motion, if starts are parked."""
    if not (isinstance(starts, MonteCarlo) and starts.parked):
        return drawn
    along = -2.0 * experiment.mission.orbit.mean_motion_rad_s * float(drawn.position_m[0])
    return replace(drawn, velocity_m_s=np.array([0.0, along, 0.0]))


def _others(experiment: Experiment, starts: Starts | MonteCarlo, first: Scenario) -> tuple[Scenario, ...]:
    """Draw the starts of a fleet's other deputies, each with its own seed, under the Sun of the first."""
    (seed, stage, case), sun = first.noise, experiment.sun
    drawn = (
        draw(seed + SEED_STEP * deputy, stage, case, starts, sun)
        for deputy in range(1, experiment.mission.fleet.deputies)
    )
    angle, elevation = first.sun_angle_rad, first.sun_elevation_rad
    return tuple(
        replace(started(experiment, starts, other), sun_angle_rad=angle, sun_elevation_rad=elevation)
        for other in drawn
    )


def training_scenarios(experiment: Experiment, round_index: int = 0) -> list[Scenario]:
    """Return the starts of a round of training: its own with `starts.redraw`, else those of the first."""
    starts = experiment.starts
    if starts.rows is not None:
        return _given(starts.rows, experiment.seed, TRAINING)
    stage = TRAINING + (round_index if starts.is_redrawn else 0)
    drawn = _drawn(experiment, starts, stage, range(starts.num_cases))
    if starts.kind == "random":
        return drawn
    return [
        replace(case, position_m=starts.min_distance_m * direction)
        for direction, case in zip(OCTANTS, drawn, strict=True)
    ]


def hard_candidates(experiment: Experiment, round_index: int) -> list[Scenario]:
    """Return starts for a round of training; it also trains on those that the champion flies worst."""
    starts = experiment.starts
    return _drawn(experiment, starts, HARD + round_index, range(starts.hard_from))


def validation_scenarios(experiment: Experiment, num_cases: int, first: int = 0) -> list[Scenario]:
    """Return the starts on which the champion is chosen: drawn like those of training, but others."""
    return _drawn(experiment, experiment.starts, VALIDATION, range(first, first + num_cases))


def fitting_scenarios(
    experiment: Experiment, rung: int, num_cases: int, *, is_unseen: bool = False
) -> list[Scenario]:
    """Return the starts of a rung of a fit, drawn like those of the evaluation.

    Of starts that are given in a file, those of training in turn; all of the evaluation's where none may have
    been flown before.
    """
    cases, starts = experiment.monte_carlo, experiment.starts
    if starts.rows is None or cases.table is None:
        return _drawn(experiment, cases, FITTING + rung, range(num_cases))
    given = _given(cases.table if is_unseen else starts.rows, experiment.seed, FITTING + rung)
    return given if is_unseen else [given[case % len(given)] for case in range(num_cases)]


def given_start(experiment: Experiment) -> Scenario:
    """Return the configured start of the deputy, with the Sun of case 0 for uniform directions."""
    deputy = experiment.mission.deputy
    even = replace(experiment.monte_carlo, directions="even")
    drawn = draw(experiment.seed, EVALUATION, 0, even, experiment.sun)
    position, velocity = np.array(deputy.initial_position_m), np.array(deputy.initial_velocity_m_s)
    return replace(drawn, position_m=position, velocity_m_s=velocity)


def start_shown(experiment: Experiment) -> tuple[str, Scenario]:
    """Return the name and the start of the flight that is flown alone: configured, or a case."""
    case = experiment.case
    if case is None:
        return "start", given_start(experiment)
    return f"case-{case}", evaluation_scenarios(experiment, [case])[0]


def evaluation_scenarios(
    experiment: Experiment, cases: slice | Sequence[int] = slice(None)
) -> list[Scenario]:
    """Return the starts of the evaluation's cases, or of some: by number, or a slice of those flown."""
    monte_carlo = experiment.monte_carlo
    chosen = monte_carlo.cases[cases] if isinstance(cases, slice) else cases
    if monte_carlo.table is not None:
        return _given(monte_carlo.table, experiment.seed, EVALUATION, chosen)
    return _drawn(experiment, monte_carlo, EVALUATION, chosen)


class DrawnCases(Sequence[Scenario]):
    """The starts of the evaluation's cases, each drawn when it is asked for: a million take no memory.

    Parameters
    ----------
    experiment : Experiment
    cases : range, optional
        Some of the cases by number; those flown unless given.
    """

    def __init__(self, experiment: Experiment, cases: range | None = None) -> None:
        self._experiment = experiment
        self._cases = experiment.monte_carlo.cases if cases is None else cases

    @overload
    def __getitem__(self, index: int) -> Scenario: ...

    @overload
    def __getitem__(self, index: slice) -> "DrawnCases": ...

    def __getitem__(self, index: int | slice) -> "Scenario | DrawnCases":
        """Draw a start; of a slice, none is drawn yet."""
        if isinstance(index, slice):
            return DrawnCases(self._experiment, self._cases[index])
        return evaluation_scenarios(self._experiment, [self._cases[index]])[0]

    def __len__(self) -> int:
        """Return the number of cases."""
        return len(self._cases)


def _given(table: str, seed: int, stage: int, cases: Sequence[int] | None = None) -> list[Scenario]:
    """Return the starts in a table, or some of them; their random errors are those of a seed and a stage.

    Where cases are of fleets, those of further deputies are of further seeds, as those of drawn starts.
    """
    columns = _numbers(table)
    deputies = int(columns.get(DEPUTY, np.ones(1)).max())
    chosen = range(len(columns[POSITION[0]]) // deputies) if cases is None else cases
    rows = deputies * np.asarray(chosen, np.intp)
    fleets = [
        [
            replace(start, noise=(seed + SEED_STEP * deputy, stage, case))
            for case, start in zip(chosen, starts, strict=True)
        ]
        for deputy in range(deputies)
        for starts in [starts_in({name: column[rows + deputy] for name, column in columns.items()})]
    ]
    return [replace(first, others=tuple(others)) for first, *others in zip(*fleets, strict=True)]


@lru_cache(maxsize=2)  # of training and of the evaluation, each of whose parts asks for some rows
def _numbers(table: str) -> Mapping[str, NDArray[np.float64]]:
    return numbers(table, "the table of starts")


def starts_in(columns: Mapping[str, NDArray[Any]]) -> list[Scenario]:
    """Return the starts in a table of episodes or of solved cases, columns of shape (n,), row by row.

    They are ``position_x_m`` and so on (Hill axes), ``sun_angle_rad``; optionally ``velocity_x_m_s`` and so
    on (else at rest), and ``sun_elevation_rad`` (else the Sun is in the orbit plane).
    """
    angles = np.asarray(columns["sun_angle_rad"], dtype=np.float64)
    at_rest = np.zeros(len(angles))
    elevations = np.asarray(columns.get("sun_elevation_rad", at_rest), dtype=np.float64)
    positions = np.stack([columns[name] for name in POSITION], axis=1)
    velocities = np.stack([columns.get(name, at_rest) for name in VELOCITY], axis=1)
    states = positions.astype(np.float64), velocities.astype(np.float64)
    columns_of_starts = *states, angles.tolist(), elevations.tolist()
    return [
        Scenario(position, velocity, angle, elevation, (0, EVALUATION, row))
        for row, (position, velocity, angle, elevation) in enumerate(zip(*columns_of_starts, strict=True))
    ]


def columns_of(scenarios: Sequence[Scenario]) -> dict[str, Floats]:
    """Return positions as the columns that `starts_in` reads, and velocities unless all are at rest."""
    starts = np.array([[*scenario.position_m, *scenario.velocity_m_s] for scenario in scenarios]).reshape(
        -1, 6
    )
    names = (*POSITION, *VELOCITY) if starts[:, 3:].any() else POSITION
    return dict(zip(names, starts.T, strict=False))
