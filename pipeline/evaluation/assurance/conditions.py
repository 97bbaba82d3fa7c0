"""The conditions under which evidence is gathered, as data and in words: starts, Sun, errors, settings."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.groups import names_of
from pipeline.settings.keys import value_at
from pipeline.settings.mission import START_M, Sun
from pipeline.settings.schema import present, schema

#: coordinates of a start and their units
COORDINATES = ("x", "y", "z", "x'", "y'", "z'")
COORDINATE_UNITS = ("m", "m", "m", "m/s", "m/s", "m/s")


def conditions_of(experiment: Experiment, config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the conditions of an experiment's flights as plain data.

    Parameters
    ----------
    experiment : Experiment
    config : mapping
        Its configuration as plain data, of which the settings that differ from the defaults are kept.
    """
    mission = experiment.mission
    (near, far, speed), deputies = start_bounds(experiment), mission.fleet.deputies
    return {
        "num_cases": experiment.assurance.num_cases,
        **({} if (width := experiment.assurance.stop_width) is None else {"stop_width": width}),
        "seed": experiment.seed,
        **({"deputies": deputies} if mission.has_fleet else {}),
        "starts": starts_in_words(experiment)
        + (f", of each of {deputies} deputies" if mission.has_fleet else ""),
        "start_distance_m": [near, far],
        "start_speed_m_s": speed,
        # where nothing is to be inspected, the Sun changes no flight
        "sun": None if mission.problem.kind == "reach" else experiment.sun.mode,
        "safety": "robust" if mission.safety.probability else mission.safety.kind,
        "navigation": mission.navigation.mode,
        "thrusters": mission.actuators.kind,
        "dynamics": mission.dynamics.model,
        "dispersed": sorted([each.key for each in distributions(mission.dispersions)] + [*mission.varying]),
        "duration_s": mission.duration_s,
        "sample_period_s": mission.control_period_s,
        "settings": changed_settings(config),
    }


def start_bounds(experiment: Experiment) -> tuple[float, float, float]:
    """Return the least and the greatest distance of starts, m, and their greatest speed, m/s."""
    cases = experiment.monte_carlo
    if cases.parked:  # along the track by twice the radial distance in the time of a radian
        fastest = 2.0 * experiment.mission.orbit.mean_motion_rad_s * cases.max_distance_m
        return cases.min_distance_m, cases.max_distance_m, fastest
    if cases.box is None:
        return cases.min_distance_m, cases.max_distance_m, cases.max_speed_m_s
    low, high = np.array(cases.box)
    nearest, farthest = np.clip(0.0, low, high), np.maximum(np.abs(low), np.abs(high))
    near, far, speed = (np.linalg.norm(part) for part in (nearest[:3], farthest[:3], farthest[3:]))
    return float(near), float(far), float(speed)


def starts_in_words(experiment: Experiment) -> str:
    """Describe the set from which starts are drawn, to follow "starts" or "every start"."""
    cases = experiment.monte_carlo
    if cases.parked:
        return f"at {cases.min_distance_m:g} to {cases.max_distance_m:g} m, parked"
    if cases.box is not None:
        return f"with {box_in_words(*cases.box)}"
    return shell_in_words(*start_bounds(experiment))


def shell_in_words(near_m: float, far_m: float, speed_m_s: float) -> str:
    """Describe starts between two distances, at rest or up to a speed."""
    return f"at {near_m:g} to {far_m:g} m and " + (f"up to {speed_m_s:g} m/s" if speed_m_s else "at rest")


def box_in_words(low: Sequence[float], high: Sequence[float]) -> str:
    """Describe a box of starts, (6,) each in m and m/s, Hill axes: coordinates with equal ends together."""
    names: dict[tuple[float, float, str], list[str]] = defaultdict(list)
    for name, unit, least, greatest in zip(COORDINATES, COORDINATE_UNITS, low, high, strict=True):
        names[least, greatest, unit if (least, greatest) != (0.0, 0.0) else ""].append(name)
    words, zero = [], names.pop((0.0, 0.0, ""), [])
    for (least, greatest, unit), group in names.items():
        extent = f"= {least:g} {unit}" if least == greatest else f"from {least:g} to {greatest:g} {unit}"
        words.append(f"{' and '.join(group)} {extent}")
    if zero:
        words.append(f"{' and '.join(zero)} = 0")
    return ", ".join(words)


def changed_settings(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of the mission and the Sun that differ from the defaults, by their keys."""
    config, groups = present(config), {*names_of(Mission), "sun"}
    keys = [key for key in schema().values() if key.name.partition(".")[0] in groups]
    values = [(key, value_at(config, key.name, key.default)) for key in keys]
    # what is left to the mission and the orbit is the paper's in the paper's
    sun = Sun()
    defaults = {
        "deputy.initial_position_m": list(START_M),
        "sun.angle_deg": sun.angle_deg,
        "sun.elevation_deg": sun.elevation_deg,
    }
    return {key.name: value for key, value in values if value not in (key.default, defaults.get(key.name))}
