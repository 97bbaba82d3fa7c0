"""Dispersions: settings drawn for each case.

A case draws them after its start (`pipeline.scenarios`) and in the order of the sorted keys, so
that the same case always has the same settings. Settings that vary within a flight are drawn where it is
flown, see `pipeline.flight.cases.processes`.
"""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.state.log import Scenario
from pipeline.settings.checks import SettingError
from pipeline.settings.dispersions import distributions, in_time_alone
from pipeline.settings.experiment import Mission

#: keys with the values of one case, sorted
Drawn = tuple[tuple[str, float], ...]
#: beginnings of the keys on which free motion depends
OF_MOTION = ("orbit.", "dynamics.")


def drawn(mission: Mission, scenario: Scenario) -> Drawn:
    """Return the dispersed settings of a case, given or drawn; empty without dispersions.

    Raises
    ------
    SettingError
        If a case was given the wrong number of values.
    """
    dispersed = distributions(mission.dispersions)
    if scenario.settings is not None:
        if len(scenario.settings) != len(dispersed):
            raise SettingError(
                f"a case was given {len(scenario.settings)} settings of its own, but dispersions name "
                f"{len(dispersed)}; give one for each key, in their sorted order"
            )
        return tuple(zip((distribution.key for distribution in dispersed), scenario.settings, strict=True))
    if not dispersed:
        return ()
    seed, stage, case = scenario.noise
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stage, case)))
    # drawn first, as in the start: direction, distance, the Sun's angle and elevation
    generator.standard_normal(3)
    generator.uniform(size=3)
    return tuple((distribution.key, distribution.value(generator.uniform())) for distribution in dispersed)


def mission_of_case(mission: Mission, scenario: Scenario) -> Mission:
    """Return the mission that a case flies, with no dispersions except those that vary within the flight.

    Raises
    ------
    SettingError
        If a drawn value is not allowed.
    """
    return mission_with(mission, drawn(mission, scenario))


def thresholds_of(mission: Mission, scenarios: Sequence[Scenario]) -> Floats:
    """Return which rate of its inspectable points each case must reach, as set or drawn, (n,), %."""
    return values_of("inspection_threshold_percent", mission, scenarios)


def values_of(key: str, mission: Mission, scenarios: Sequence[Scenario]) -> Floats:
    """Return a number of the mission, by its dotted key, as it is set or drawn for each case, (n,)."""
    if key not in (each.key for each in distributions(mission.dispersions)):
        return np.full(len(scenarios), attrgetter(key)(mission))
    return np.array([dict(drawn(mission, scenario))[key] for scenario in scenarios])


def groups_of(
    mission: Mission, scenarios: Sequence[Scenario], beginnings: tuple[str, ...] = ("",)
) -> list[tuple[Mission, list[int]]]:
    """Return the missions that some cases fly, each with the indices of the cases that share it.

    Cases share a mission that draw the same for the settings whose keys begin with one of `beginnings`; where
    none of these is drawn, all fly one.
    """
    dispersed = distributions(mission.dispersions)
    if dispersed and not any(each.key.startswith(beginnings) for each in dispersed):
        return [(mission_with(mission, ()), [*range(len(scenarios))])]  # nothing of it need be drawn
    indices: dict[Drawn, list[int]] = {}
    for index, scenario in enumerate(scenarios):
        values = tuple(each for each in drawn(mission, scenario) if each[0].startswith(beginnings))
        indices.setdefault(values, []).append(index)
    return [(mission_with(mission, values), shared) for values, shared in indices.items()]


def missions_at_ends(mission: Mission) -> list[Mission]:
    """Return the missions with each dispersed setting at its low and at its high, or its median without one.

    Raises
    ------
    SettingError
        If one of these values is not allowed.
    """
    dispersed = distributions(mission.dispersions)
    return [
        mission_with(mission, tuple((distribution.key, distribution.ends[end]) for distribution in dispersed))
        for end in (0, 1)
    ]


def mission_with(mission: Mission, values: Drawn) -> Mission:
    """Return a mission with some settings of its own, and no dispersions but those in time.

    Raises
    ------
    SettingError
        If one of these values is not allowed.
    """
    if not distributions(mission.dispersions):
        return mission
    mission_changes: dict[str, Any] = {"dispersions": in_time_alone(mission.dispersions)}
    groups: dict[str, dict[str, float]] = {}
    for key, value in values:
        group, _, name = key.rpartition(".")
        (groups.setdefault(group, {}) if group else mission_changes)[name] = value
    try:
        mission_changes |= {
            group: replace(getattr(mission, group), **changes) for group, changes in groups.items()
        }
        return replace(mission, **mission_changes)
    except SettingError as error:
        raise SettingError(
            f"a case draws an impossible value: {error}; limit its distribution by low and high"
        ) from error
