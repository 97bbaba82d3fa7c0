"""Contents of reports that nobody flew: all parts that a page may have, each number another one."""

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.beside_optimum import summarise_times
from pipeline.evaluation.comparison import FLOWN, PLANNED, ComparisonRow
from pipeline.evaluation.monte_carlo import summarise
from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.report import comparisons
from pipeline.report.contents import Contents, FlightSet, ShownFlight
from pipeline.report.figures import style
from pipeline.scenarios import evaluation_scenarios
from tests import drawn
from tests.pipeline.report.test_figures_as_stored import flight, paths
from tests.pipeline.report.test_side_by_side import made_up as beside_plans


@pytest.fixture
def illustrated(monkeypatch):
    """The figures that would have been saved, as text by their names."""
    kept = {}

    def save(figure, name, dots_per_inch):
        kept[name] = f"{name}, {dots_per_inch} dots per inch\n{drawn.figure(figure)}"
        return style.Picture(b"", '<svg width="1" viewBox="0 0 1 1"></svg>')

    monkeypatch.setattr(style, "save", save)
    return kept


def episodes(count, first=10):
    """Episodes of which some fail, each in a way of its own."""
    k = np.arange(count)
    seen = 90 + (5 * k) % 10
    columns = {
        "case": first + k,
        "sun_angle_rad": 0.3 + 0.37 * k,
        "delta_v_m_s": 0.8 + 0.21 * np.sin(2.1 * k),
    }
    columns |= {
        f"position_{axis}_m": factor * (40.0 + k)
        for axis, factor in zip("xyz", (1.0, -0.7, 0.3), strict=True)
    }
    columns |= {"inspected_count": seen, "inspection_rate_percent": 100.0 * seen / 99.0}
    columns |= {"inspectable_rate_percent": 100.0 * seen / 98.0, "mean_distance_m": 61.0 + k / 7.0}
    columns |= {"min_distance_m": 21.0 - k % 9, "max_distance_m": 150.0 + 8.5 * (k % 8)}
    columns |= {"inspectable_count": 97 + k % 3, "safety_delta_v_m_s": 0.01 * (k % 4)}
    columns |= {"ahead_delta_v_m_s": 0.125 * columns["delta_v_m_s"]}
    columns |= {"stays_orbit": k % 3 == 0, "passively_safe": k % 5 == 0}
    columns |= {"success": seen >= 94, "violated": (k % 8 == 7) | (k % 9 == 7), "safety_periods": k % 4}
    return columns


def flight_set(count, confidence=90.0, **others):
    columns = episodes(count) | others.pop("columns", {})
    summary = {"num_cases": count, "confidence_percent": confidence, "sun": "random", "seed": 7} | summarise(
        columns, confidence
    )
    return FlightSet(columns, paths(count, 31), summary | others, None)


def compared(world="", planned=True):
    rows = []
    for i, name in enumerate(("lqr", "champion_27")):
        for j, layer in enumerate(("none", "filter")):
            flown = summarise(episodes(17 + 5 * i + 3 * j), 90.0)
            times = summarise_times(beside_plans(6 + i), 90.0) if i else None
            rows.append(
                ComparisonRow(
                    name, FLOWN, "random", layer, 17 + 5 * i + 3 * j, 75 if i else None, flown, times, world
                )
            )
    if planned:
        rows.append(
            ComparisonRow("optimum", PLANNED, "random", "none", 9, None, summarise(episodes(9), 90.0))
        )
    return rows


FRONT = {"controller": [0.0, 1.0, 2.0], "handed_back": [0.0, 1.0, 0.0], "stands": [1.0, 1.0, 0.0]}
FRONT |= {"delta_v_m_s": [0.51, 0.62, 0.73], "inspection_rate_percent": [91.5, 98.25, 95.75]}
FRONT |= {
    "success_percent": [70.5, 85.25, 80.75],
    "outside_percent": [0.5, 0.25, 3.0],
    "fitness_m_s": [1.25, 1.5, 7.75],
}


def shares(name):
    return (
        {"value": 0.5, "low": -0.25, "high": 0.75}
        if name == "deputy.mass_kg"
        else {"value": -0.3, "low": -0.6, "high": -0.1}
    )


def spread(folder):
    keys = ("deputy.mass_kg", "sensor.half_angle_deg")
    ranked = [
        {"key": key, "delta_v_m_s": shares(key), "inspectable_rate_percent": shares(key[:3])} for key in keys
    ]
    percentiles = {
        "delta_v_m_s": [{"percent": 95.0, "value": 1.25, "low": 1.2, "high": None}],
        "max_distance_m": [{"percent": 5.0, "value": 99.5, "low": None, "high": 101.5}],
    }
    summary = flight_set(12).summary
    return comparisons.spread_of(
        folder,
        summary | {"percentiles": percentiles, "nominal": flight_set(9).summary, "sensitivity": ranked},
    )


def logbook(rounds=(0, 0, 0, 1, 1)):
    count = len(rounds)
    columns = {"round": np.array(rounds, float), "best": np.geomspace(2e5, 11.0, count)}
    columns |= {"mean": 37.0 * columns["best"], "delta_v_m_s": np.linspace(9.5, 3.25, count)}
    columns |= {"points": np.linspace(51.5, 98.75, count), "outside": np.arange(count)[::-1] / 3.0}
    return columns | {"short": (count - np.arange(count)) * 1.5}


def fleet_flight(experiment, count):
    start = evaluation_scenarios(experiment, [3])[0]
    log, _ = flight()
    seen = np.zeros((len(log.position_m), 99), dtype=np.int8)
    for deputy in range(1, count + 1):
        seen[10 * deputy :, 11 * deputy : 11 * deputy + 20 + deputy] = deputy
    unheard = dict.fromkeys(("left_to", "shown", "positions", "stops", "arrived"))
    flights = [
        log._replace(position_m=path, delta_v_m_s=log.delta_v_m_s * (k + 1))
        for k, path in enumerate(paths(count + 1)[1:])
    ]
    logs = [DeputyLog(k, each, seen, **unheard) for k, each in enumerate(flights, 1)]
    return ShownFlight("median-case-3", "Case 3, the median of the evaluation", start, logs[0].flight, logs)


def contents(folder, *words, **others):
    """Contents with all that a page of inspections may have."""
    overrides = words or ("+experiment=train_paper", "duration_s=600", "monte_carlo.confidence_percent=90")
    experiment = compose_experiment(
        [*overrides, "inspection_threshold_percent=94", "report.dots_per_inch=40"]
    ).experiment
    start = evaluation_scenarios(experiment, [0])[0]
    log, _ = flight()
    other = log._replace(position_m=paths(3)[2], delta_v_m_s=2.5 * log.delta_v_m_s)
    columns = beside_plans(9)
    beside = comparisons.BesideOptimum(columns, summarise_times(columns, 90.0), "")
    pairs = [comparisons.FlightBesidePlan(11, "the greatest", 8.0, other, log)]
    manifest = {"config_hash": "c" * 64, "seed": 7, "git_revision": "0123456789abcdef", "version": "1.2"}
    manifest |= {
        "finished_stages": ["scenario", "train", "evaluate"],
        "versions": {"numpy": "2.4", "python": "3.12"},
        "tags": {"who": "me", "why": "to see"},
    }
    parts = {
        "experiment": experiment,
        "controller": named("champion_27", experiment.mission),
        "training": flight_set(5),
        "evaluation": flight_set(23),
        "spread": spread(folder),
        "training_round": 2,
        "comparison": (),
        "compared": None,
        "beside": beside,
        "pairs": pairs,
        "without_safety": comparisons.Without(3, 7, 0, log, other),
        "shown": [
            ShownFlight("training-1", "Training case 1 of round 2", start, log),
            ShownFlight("start", "The given start", start, other),
        ],
        "logbook": logbook(),
        "front": {name: np.array(column) for name, column in FRONT.items()},
        "manifest": manifest,
        "config_text": "seed: 7\nname: made_up\n",
        "command": "python -m pipeline +experiment=train_paper seed=7",
        "recordings": {"episodes/start.mcap": 1234567, "episodes/case-3.mcap": 89012},
    }
    return Contents(**(parts | others))
