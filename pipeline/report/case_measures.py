"""What pages tell of cases: columns of numbers, and plots of them, by the kind of the mission."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pipeline.evaluation.blocks import number_of, values_at
from pipeline.evaluation.statistics import Columns
from pipeline.player.runs import CaseColumn, CasePlot
from pipeline.settings.experiment import Mission
from pipeline.settings.start_table import POSITION

#: cases that a page has at most
MOST_CASES = 10_000
SUCCESS_COLUMN = "success"
FUEL = "delta_v_m_s"
BARS = CasePlot("bars", "How the fuel spreads", (FUEL,))
#: of fleets: what the one that spends most spends, and how near two come
MOST_OF_ONE, NEAREST_PAIR = "greatest_delta_v_m_s", "nearest_pair_m"


class CaseMeasures(NamedTuple):
    """What a page tells of cases: columns by name, words and decimals, and plots of them.

    Of runs beside each other it has the first two columns; the second tells which case is worst, by its
    ``worst`` value.
    """

    columns: tuple[tuple[str, str, int], ...]
    plots: tuple[CasePlot, ...]
    titles: tuple[str, str]
    worst: Callable[[Any], Any]


MEASURES = {
    "inspection": CaseMeasures(
        (
            (FUEL, "Δv, m/s", 3),
            ("inspection_rate_percent", "inspected, %", 1),
            ("min_distance_m", "nearest, m", 1),
            ("max_distance_m", "farthest, m", 1),
        ),
        (
            CasePlot("fuel-dots", "Fuel and what was inspected", (FUEL, "inspection_rate_percent")),
            CasePlot("distance-dots", "Nearest and farthest", ("min_distance_m", "max_distance_m")),
            BARS,
        ),
        ("fuel", "what was inspected"),
        np.argmin,
    ),
    "fleet": CaseMeasures(
        (
            (FUEL, "Δv of all, m/s", 3),
            ("inspection_rate_percent", "inspected by any, %", 1),
            (NEAREST_PAIR, "nearest two, m", 1),
            (MOST_OF_ONE, "most of one, m/s", 3),
        ),
        (
            CasePlot("fuel-dots", "Fuel and what was inspected", (FUEL, "inspection_rate_percent")),
            CasePlot("pair-dots", "Fuel and how near two come", (FUEL, NEAREST_PAIR)),
            BARS,
        ),
        ("fuel", "what was inspected"),
        np.argmin,
    ),
    "reach": CaseMeasures(
        (
            (FUEL, "Δv, m/s", 3),
            ("end_s", "end, s", 0),
            ("end_speed_m_s", "speed at the end, m/s", 4),
            ("excess_m_s", "most above the limit, m/s", 4),
        ),
        (
            CasePlot("fuel-dots", "Fuel and when the flight ends", (FUEL, "end_s")),
            CasePlot("speed-dots", "When the flight ends, and how fast", ("end_s", "end_speed_m_s")),
            BARS,
        ),
        ("fuel", "when the flight ends"),
        np.argmax,
    ),
}


def measures_of(mission: Mission) -> CaseMeasures:
    """Return what pages tell of the cases of a mission."""
    return MEASURES["fleet" if mission.has_fleet else mission.problem.kind]


def has_columns(episodes: Columns, mission: Mission) -> bool:
    """Return whether episodes tell what a page shows of their cases."""
    names = (name for name, *_ in measures_of(mission).columns)
    starts = () if mission.has_fleet else POSITION  # those of fleets are of their deputies
    wanted = {"case", SUCCESS_COLUMN, *starts, *names}
    return wanted <= set(episodes) and number_of(episodes) > 0


def succeeds_in(episodes: Columns, rows: Sequence[int]) -> Any:
    """Return in which of some rows the flight succeeds, inside the limits."""
    reached, violated = (
        np.array(values_at(episodes, name, rows)).astype(bool) for name in (SUCCESS_COLUMN, "violated")
    )
    return reached & ~violated


def told_columns(measures: CaseMeasures, values: Mapping[str, Any]) -> list[CaseColumn]:
    """Return measured values, by name, as columns of cases."""
    return [CaseColumn(name, label, decimals, values[name]) for name, label, decimals in measures.columns]
