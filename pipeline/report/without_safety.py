"""What a report tells of the safety layer: how often it acted, what that cost, what it prevented."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.settings.experiment import Experiment, Safety

Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Without:
    """The flights of an evaluation in which the layer acted, flown without it.

    Parameters
    ----------
    num_outside : int
        So many of them would have left the limits.
    case : int
        The one that would have been farthest outside, or nearest to it.
    guarded, unguarded : FlightLog
        That case with the layer and without.
    """

    num_outside: int
    case: int
    guarded: FlightLog
    unguarded: FlightLog


def fly_without(experiment: Experiment, controller: Controller, episodes: Columns | None) -> Without | None:
    """Fly without the layer what it acted in; None where it is off or did not act.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
    episodes : mapping of (n,) arrays, optional
        The columns of ``evaluate/episodes.parquet``.
    """
    mission = experiment.mission
    # episodes of earlier versions do not tell
    if mission.safety.kind == "none" or episodes is None or "safety_periods" not in episodes:
        return None
    acted = np.flatnonzero(episodes["safety_periods"] > 0)
    if not acted.size:
        return None
    cases = episodes["case"][acted].tolist()
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed, cases)
    off = replace(mission, safety=Safety())
    outcomes = fly_all(off, controller, scenarios, experiment.monte_carlo.workers)
    limits = mission.deputy
    beyond = np.maximum(
        limits.min_distance_m - outcomes.min_distance_m, outcomes.max_distance_m - limits.max_distance_m
    )
    row = int(np.argmax(beyond))
    return Without(
        num_outside=int(outcomes.is_violated.sum()),
        case=int(episodes["case"][acted[row]]),
        guarded=fly_logged(mission, controller, scenarios[row]),
        unguarded=fly_logged(off, controller, scenarios[row]),
    )


def safety_words(flights: str, summary: Mapping[str, Any], without: Without | None) -> str:
    """Say what the layer did; empty where the summary does not tell.

    Parameters
    ----------
    flights : str
        Which, such as ``evaluation``.
    summary : mapping
        Of `pipeline.evaluation.monte_carlo.summarise`, with ``num_cases``.
    without : Without, optional
    """
    if "safety_acted" not in summary:
        return ""
    acted, num_cases = summary["safety_acted"], summary["num_cases"]
    text = (
        f"In the {flights} it acted in {acted['count']:,} of {num_cases:,} flights "
        f"({100 * acted['fraction']:.1f} %, {100 * acted['low']:.1f} to {100 * acted['high']:.1f} %)"
    )
    if not acted["count"]:
        return text + "."
    periods, changed = summary["safety_periods"], summary["safety_delta_v_m_s"]
    each = num_cases / acted["count"]
    text += (
        f", in these for {each * periods['mean']:.1f} control periods and by "
        f"{each * changed['mean']:.4f} m/s in the mean; over all flights its changes come to "
        f"{changed['mean']:.4f} m/s a flight, at most {changed['maximum']:.4f} m/s in one."
    )
    if without is not None:
        leave = {0: "none of these flights", 1: "one of these flights"}.get(
            without.num_outside, f"{without.num_outside:,} of these flights"
        )
        text += f" Without it, {leave} would have left the limits."
    return text
