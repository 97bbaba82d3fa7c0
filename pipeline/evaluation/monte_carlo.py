"""An evaluation: one controller from many starts, as a table and as statistics."""

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.processors import num_processors
from pipeline.constants import STANDARD_GRAVITY_M_S2
from pipeline.evaluation import blocks
from pipeline.evaluation.after import Aftermath, aftermath, coasting_pairs, joined
from pipeline.evaluation.statistics import Column, Columns, statistic, succeeds
from pipeline.flight.cases.dispersions import OF_MOTION, drawn, groups_of, thresholds_of
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleets import NO_MESSAGES, OF_DEPUTIES, FleetOutcomes
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.goals.reach import ReachOutcomes
from pipeline.flight.state.arrays import NUM_PLACED, NUM_TRACKED, TRACK_LEFT
from pipeline.flight.state.log import Outcomes, Scenario, combined, inspectable_rate
from pipeline.flight.world.pack import inspection_points
from pipeline.scenarios import columns_of
from pipeline.settings.dispersions import distributions
from pipeline.settings.equipment import RealActuators
from pipeline.settings.experiment import Mission

#: what a summary calls the share of flights that succeed; its ``success`` counts those outside the limits too
SUCCESS = "success_and_within_limits"
#: flights whose tracks are held at a time, to tell what follows them
FOLLOWED = 4096
#: columns of deputies that are whole numbers
COUNTED = ("inspected_count", "safety_periods")
#: columns of flights that must reach a goal, besides those of all
OF_REACHED = ("end_s", "end_speed_m_s", "excess_m_s")


def fly_tracked(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None,
    num_tracked: int = NUM_TRACKED,
) -> tuple[Outcomes, NDArray[np.float32]]:
    """Fly all cases; return their outcomes, and their tracks, (n, K+1, num_tracked).

    Those of fleets are (n, D, K+1, num_tracked).

    A track's columns are those of `pipeline.flight.fly.population.fly_population`, first the position (m).
    """
    deputies = (mission.fleet.deputies,) if mission.has_fleet else ()
    shape = len(scenarios), *deputies, mission.num_controls + 1, num_tracked
    tracks = np.empty(shape, dtype=np.float32)
    return fly_all(mission, controller, scenarios, workers, tracks), tracks


def fly_tracked_fleets(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None
) -> tuple[Outcomes, NDArray[np.float32]]:
    """Fly fleets; return their outcomes, and the tracks of their deputies, (n, D, K+1, 15).

    Points that are left are those that no deputy has seen, whether the others know of it or not.
    """
    num_points, num_samples = len(inspection_points(mission)), mission.num_controls + 1
    tracks = np.empty((len(scenarios), mission.fleet.deputies, num_samples, NUM_TRACKED), dtype=np.float32)
    seen_by = np.zeros((len(scenarios), num_samples, num_points), dtype=np.uint8)
    messages = NO_MESSAGES._replace(seen_by=seen_by)
    outcomes = fly_all_fleets(mission, controller, scenarios, workers, tracks, messages=messages)
    tracks[..., TRACK_LEFT] = num_points - np.count_nonzero(seen_by, axis=2)[:, np.newaxis]
    return outcomes, tracks


def fly_cases(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None = None
) -> tuple[dict[str, Column], NDArray[np.float32]]:
    """Fly all cases.

    Returns
    -------
    episodes : dict of (n,) arrays
        A column for each quantity of a case, see `episode_columns`.
    tracks : (n, K+1, 3) float32
        Positions, m, Hill axes.
    """
    if mission.problem.kind == "reach":
        outcomes, tracks = fly_tracked(mission, controller, scenarios, workers, num_tracked=NUM_PLACED)
        return episode_columns(mission, scenarios, outcomes), tracks
    outcomes, tracks = fly_tracked(mission, controller, scenarios, workers)
    after = _aftermath(mission, scenarios, tracks, workers or num_processors())
    return episode_columns(mission, scenarios, outcomes, after), tracks[..., :NUM_PLACED]


def fly_fleets(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None = None
) -> tuple[dict[str, Column], dict[str, Column]]:
    """Fly a fleet from each case's starts.

    Returns
    -------
    episodes : dict of (n,) arrays
        A column for each quantity of a fleet, see `episode_columns`.
    deputies : dict of (n D,) arrays
        A column for each quantity of a deputy.
    """
    flown = fly_tracked(mission, controller, scenarios, workers)
    outcomes, after = _followed(mission, scenarios, *flown, workers)
    assert isinstance(outcomes, FleetOutcomes)  # noqa: S101 - of a mission of fleets
    episodes = episode_columns(mission, scenarios, outcomes, after)
    return episodes, deputy_columns(scenarios, outcomes, after)


def deputy_columns(
    scenarios: list[Scenario], outcomes: FleetOutcomes, after: Aftermath | None
) -> dict[str, Column]:
    """Return the columns of `evaluate/deputies.parquet`, one entry per deputy of each case."""
    case, deputy = np.indices(outcomes.of_deputies.shape[:2])
    values = dict(zip(OF_DEPUTIES, outcomes.of_deputies.reshape(-1, len(OF_DEPUTIES)).T, strict=True))
    starts = [start for scenario in scenarios for start in scenario.fleet]
    return {
        "case": case.ravel(),
        "deputy": deputy.ravel() + 1,
        **columns_of(starts),
        **{name: part.astype(np.int64) if name in COUNTED else part for name, part in values.items()},
        "violated": values["outside_m"] > 0.0,
        **({} if after is None else {name: so.ravel() for name, so in after._asdict().items()}),
    }


def fly_followed(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None
) -> tuple[Outcomes, Aftermath | None]:
    """Fly all cases, in parts so that memory stays small; return their outcomes, and what follows them."""
    if mission.problem.kind == "reach":
        return fly_all(mission, controller, scenarios, workers), None
    outcomes, after = [], []
    for first in range(0, len(scenarios), FOLLOWED):
        some = scenarios[first : first + FOLLOWED]
        part, following = _followed(mission, some, *fly_tracked(mission, controller, some, workers), workers)
        outcomes.append(part)
        after.append(following)
    return combined(outcomes), joined(after)


def _followed(
    mission: Mission,
    scenarios: list[Scenario],
    outcomes: Outcomes,
    tracks: NDArray[np.float32],
    workers: int | None,
) -> tuple[Outcomes, Aftermath | None]:
    """Return outcomes with what free motion of fleets would lead to, and what follows flights."""
    workers = workers or num_processors()
    if isinstance(outcomes, FleetOutcomes):
        outcomes = replace(outcomes, coasting_pair_m=coasting_pairs(mission, tracks, workers))
    return outcomes, _aftermath(mission, scenarios, tracks, workers)


def _aftermath(
    mission: Mission, scenarios: list[Scenario], tracks: NDArray[np.float32], workers: int
) -> Aftermath | None:
    """Return what follows flights, each by the motion and within the limits that its case has drawn."""
    groups = groups_of(mission, scenarios, (*OF_MOTION, "deputy.min_distance_m", "deputy.max_distance_m"))
    if len(groups) == 1:
        return aftermath(groups[0][0], tracks, workers, scenarios)
    parts = ((of_group, rows, [scenarios[row] for row in rows]) for of_group, rows in groups)
    after = joined([aftermath(of_group, tracks[rows], workers, some) for of_group, rows, some in parts])
    order = np.argsort([row for _, rows in groups for row in rows])
    return after and Aftermath(*(column[order] for column in after))


def episode_columns(
    mission: Mission, scenarios: list[Scenario], outcomes: Outcomes, after: Aftermath | None = None
) -> dict[str, Column]:
    """Return the columns of `evaluate/episodes.parquet`, one entry per case."""
    counts, num_points = outcomes.inspected_count, len(inspection_points(mission))
    if isinstance(outcomes, ReachOutcomes):
        counts, num_points = outcomes.is_success(100.0).astype(np.int64), 1
    settings = [dict(drawn(mission, scenario)) for scenario in scenarios]
    return {
        "case": np.arange(len(scenarios)),
        **({} if mission.has_fleet else columns_of(scenarios)),  # those of fleets are of their deputies
        "sun_angle_rad": np.array([scenario.sun_angle_rad for scenario in scenarios]),
        "delta_v_m_s": outcomes.delta_v_m_s,
        "inspected_count": counts,
        "inspection_rate_percent": 100.0 * counts / num_points,
        "mean_distance_m": outcomes.mean_distance_m,
        "min_distance_m": outcomes.min_distance_m,
        "max_distance_m": outcomes.max_distance_m,
        "success": outcomes.is_success(thresholds_of(mission, scenarios)),
        "violated": outcomes.is_violated,
        "safety_periods": outcomes.safety_periods,
        "safety_delta_v_m_s": outcomes.safety_delta_v_m_s,
        "ahead_delta_v_m_s": outcomes.ahead_delta_v_m_s,
        "sun_elevation_rad": np.array([scenario.sun_elevation_rad for scenario in scenarios]),
        "inspectable_count": outcomes.inspectable_count,
        "inspectable_rate_percent": inspectable_rate(counts, outcomes.inspectable_count),
        **{name: vars(outcomes)[name] for name in OF_REACHED if isinstance(outcomes, ReachOutcomes)},
        **(_of_fleet(outcomes) if isinstance(outcomes, FleetOutcomes) else {}),
        **({} if after is None else {name: _of_all(so) for name, so in after._asdict().items()}),
        **_propellant(mission, settings, outcomes),
        **({} if mission.deputy.max_momentum_n_m_s is None else {"full_wheel_s": outcomes.full_wheel_s}),
        **{
            distribution.key: np.array([of[distribution.key] for of in settings])
            for distribution in distributions(mission.dispersions)
        },
    }


def _of_all(is_so: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return what is so in each case: of fleets, (n, D), what is so of all deputies."""
    return np.asarray(is_so.all(axis=1)) if is_so.ndim > 1 else is_so


def _of_fleet(outcomes: FleetOutcomes) -> dict[str, Column]:
    """Return the columns that fleets alone have."""
    spent = outcomes.of_deputies[..., OF_DEPUTIES.index("delta_v_m_s")]
    return {
        "greatest_delta_v_m_s": spent.max(axis=1),
        "nearest_pair_m": outcomes.nearest_pair_m,
        "enough_s": outcomes.enough_s,
        **({} if np.isnan(pairs := outcomes.coasting_pair_m).any() else {"coasting_pair_m": pairs}),
    }


def _propellant(mission: Mission, settings: list[dict[str, float]], outcomes: Outcomes) -> dict[str, Column]:
    """Return the propellant used in each case, by the rocket equation, as a column, if the mass falls."""
    actuators = mission.actuators
    if not isinstance(actuators, RealActuators) or actuators.specific_impulse_s is None:
        return {}
    impulse, mass = actuators.specific_impulse_s, mission.deputy.mass_kg
    impulses = np.array([of.get("actuators.specific_impulse_s", impulse) for of in settings])
    masses = np.array([of.get("deputy.mass_kg", mass) for of in settings])
    used = -np.expm1(-outcomes.delta_v_m_s / (STANDARD_GRAVITY_M_S2 * impulses))
    return {"propellant_kg": masses * used}


def summarise(episodes: Columns, confidence_percent: float) -> dict[str, Any]:
    """Return means with standard deviations and intervals, and shares of cases with Wilson intervals."""
    return summarise_blocks(blocks.cut(episodes), confidence_percent)


def summarise_blocks(parts: Iterable[Columns], confidence_percent: float) -> dict[str, Any]:
    """Return what `summarise` does of flights that come in blocks, see `pipeline.evaluation.blocks`."""
    means, shares = defaultdict[str, list[blocks.Part]](list), defaultdict[str, list[tuple[int, int]]](list)
    for part in parts:
        names, is_so = summarised(part)
        for name in names:
            values = part[name]
            means[name].append((len(values), statistic(values, confidence_percent, 0.0, greatest_mean(name))))
        for name, share in is_so.items():
            shares[name].append((int(np.sum(share)), len(share)))
    return {
        name: asdict(blocks.joined(of, confidence_percent, 0.0, greatest_mean(name)))
        for name, of in means.items()
    } | {name: asdict(blocks.joined_share(of, confidence_percent)) for name, of in shares.items()}


def summarised(episodes: Columns) -> tuple[list[str], dict[str, NDArray[np.bool_]]]:
    """Return the columns whose means are told, and what flights share."""
    names = ["delta_v_m_s", "inspection_rate_percent", "mean_distance_m"]
    shares = {"success": episodes["success"], "violated": episodes["violated"], SUCCESS: succeeds(episodes)}
    if "safety_periods" in episodes:  # missing in those of earlier versions
        names += ["safety_periods", "safety_delta_v_m_s"]
        shares["safety_acted"] = episodes["safety_periods"] > 0
    if "ahead_delta_v_m_s" in episodes:
        names.append("ahead_delta_v_m_s")
    # missing where nothing follows, as after docking
    shares |= {name: episodes[name] for name in Aftermath._fields if name in episodes}
    if "end_s" in episodes:
        names += OF_REACHED
        shares["held"] = episodes["excess_m_s"] == 0.0
    if "nearest_pair_m" in episodes:  # of fleets
        names += ["greatest_delta_v_m_s", "nearest_pair_m"]
    if "coasting_pair_m" in episodes:
        names.append("coasting_pair_m")
    if "propellant_kg" in episodes:
        names.append("propellant_kg")
    if "full_wheel_s" in episodes:
        names.append("full_wheel_s")
        shares["wheel_full"] = episodes["full_wheel_s"] > 0.0
    if "inspectable_count" in episodes:  # these too
        names += ["inspectable_count", "inspectable_rate_percent"]
    return names, shares


def greatest_mean(name: str) -> float:
    """Return the most that the mean of a quantity can be; the least is 0 for all that are summarised."""
    return 100.0 if name.endswith("_percent") else math.inf
