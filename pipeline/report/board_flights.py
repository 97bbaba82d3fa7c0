"""The distance of all flights that a board judges, with each limit that is named, and what follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.assurance.formula import OF_COASTING, kind_of, parse, predicates
from pipeline.evaluation.assurance.quantities import TrackFacts, units_for
from pipeline.flight.world.coasting import FreeMotion
from plain_files.document.html import element

#: flights that are drawn, of the first cases
MOST_DRAWN = 200
#: flights of which is told where they are after the end
MOST_FOLLOWED = 2000
#: how long free motion is followed, and where it is looked at, s
FOLLOWED_S, SPACING_S = 1800.0, 30.0
#: minutes after the end for which shares are told
TOLD_MIN = (5, 10, 20, 30)
#: samples of a drawn flight
NUM_DRAWN = 60
#: quantities that are a distance
DISTANCES = ("distance", *OF_COASTING)
#: the drawing, in its own units: width, height, and its margins left, right, above and below
WIDTH, HEIGHT, LEFT, RIGHT, ABOVE, BELOW = 720.0, 236.0, 40.0, 96.0, 14.0, 26.0
#: between the words of two limits
LINE = 22.0


@dataclass(frozen=True)
class Limit:
    """A distance that requirements name."""

    value_m: float
    names: tuple[str, ...]
    titles: tuple[str, ...]


@dataclass(frozen=True)
class BoardFlights:
    """Distances of flights, and of the free motion that follows them.

    Parameters
    ----------
    num_cases : int
        Of the evidence; of fleets, its deputies.
    time_s : (K+1,) array
    distance_m : (n, K+1) array
        Of the first cases, of which not all may be drawn.
    after_s : (J,) array
        From the end on; empty where free motion is not followed.
    after_m : (n, J) array
    noun : str
        What has a flight: a case, or a deputy of a fleet.
    """

    num_cases: int
    time_s: Floats
    distance_m: Floats
    after_s: Floats = field(default_factory=lambda: np.zeros(0))
    after_m: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    noun: str = "case"

    def percent_beyond(self, limit_m: float, minutes: float) -> float:
        """Return which share of the flights goes beyond a distance within some minutes after the end, %."""
        until, within = 60.0 * minutes, self.after_s <= 60.0 * minutes
        then = [np.interp(until, self.after_s, distances) for distances in self.after_m]
        return float(100.0 * np.mean(np.maximum(self.after_m[:, within].max(axis=1), then) > limit_m))


def flights_of_board(facts: TrackFacts, tracks: NDArray[np.floating], num_cases: int) -> BoardFlights:
    """Return the distances of some flights, (n, K+1, 6 or more), and of what follows them.

    What follows is told of inspections alone: a flight to a goal ends there. Of fleets, (n, D, K+1, 6 or
    more), each deputy counts.

    Parameters
    ----------
    facts : TrackFacts
        With the missions in which cases move, where they draw settings of free motion.
    tracks : array
        m, and m/s, Hill axes.
    num_cases : int
        Of the evidence.
    """
    mission = facts.mission
    if tracks.ndim == 4:
        of_each = tracks.reshape(-1, *tracks.shape[2:])
        flights = flights_of_board(
            facts._replace(mission=mission.of_each), of_each, num_cases * tracks.shape[1]
        )
        return replace(flights, noun="deputy")
    states = np.asarray(tracks[:, :, :6], dtype=np.float64)
    distances = _lengths(states[:, :, :3], 2)
    times = mission.control_period_s * np.arange(states.shape[1], dtype=np.float64)
    if mission.problem.kind != "inspection":
        return BoardFlights(num_cases, times, distances)
    after = FreeMotion(mission, FOLLOWED_S).times(FOLLOWED_S, SPACING_S)
    after_m = np.empty((len(states), len(after)))
    for of_some, rows in facts.moving:
        motion = FreeMotion(of_some, FOLLOWED_S)
        drifts = facts.drifts(motion, of_some, rows, FOLLOWED_S)
        path = motion.path(mission.num_controls, states[rows, -1], FOLLOWED_S, SPACING_S, drifts)
        after_m[rows] = _lengths(path, 1).T
    return BoardFlights(num_cases, times, distances, after, after_m)


def _lengths(vectors: Floats, axis: int) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=axis), dtype=np.float64)


def limits_of(requirements: Sequence[Mapping[str, Any]]) -> list[Limit]:
    """Return each distance that formulas of requirements compare with, from the nearest on."""
    named: dict[float, dict[str, str]] = {}
    for requirement in requirements:
        formula = requirement["formula"]
        for predicate in predicates(parse(formula, units_for(formula))) if formula else ():
            if len(predicate.factors) == 1 and kind_of(predicate.factors[0][0]) in DISTANCES:
                value = -predicate.constant / predicate.factors[0][1]
                named.setdefault(value, {})[requirement["id"]] = requirement["title"]
    return [Limit(value, tuple(names), tuple(names.values())) for value, names in sorted(named.items())]


def farthest_limit(limits: Sequence[Limit], flights: BoardFlights) -> Limit | None:
    """Return the limit that free motion is told of: the farthest, unless flights begin beyond it."""
    beyond = [limit for limit in limits if limit.value_m >= flights.distance_m[:, 0].max()]
    return beyond[-1] if beyond and flights.after_m.size else None


def draw_distances(flights: BoardFlights, limits: Sequence[Limit]) -> Markup:
    """Draw the distances as an SVG element that holds no style of its own."""
    end = float(flights.time_s[-1])
    last = end + (float(flights.after_s[-1]) if flights.after_m.size else 0.0)
    farthest = max(float(flights.distance_m.max()), *(limit.value_m for limit in limits), 1.0)
    top = (1.6 if flights.after_m.size else 1.12) * farthest

    def x(time_s: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * time_s / last

    def y(distance_m: float) -> float:
        return HEIGHT - BELOW - (HEIGHT - ABOVE - BELOW) * min(distance_m, top) / top

    def line(times: Floats, distances: Floats, kind: str) -> Markup:
        points = " ".join(f"{x(t):.1f},{y(d):.1f}" for t, d in zip(times, distances, strict=True))
        return element("polyline", points=points, class_=kind)

    parts = []
    if flights.after_m.size:
        after = {"x": f"{x(end):.1f}", "y": ABOVE, "width": f"{x(last) - x(end):.1f}"}
        parts.append(element("rect", **after, height=HEIGHT - ABOVE - BELOW, class_="after"))
    for value in _ticks(top, 4):
        at = f"{y(value):.1f}"
        parts.append(element("line", x1=LEFT, x2=WIDTH - RIGHT, y1=at, y2=at, class_="grid"))
        parts.append(element("text", f"{value:g}", x=LEFT - 6, y=f"{y(value) + 4:.1f}", class_="end"))
    for minute in _ticks(last / 60.0, 6):
        words = f"{minute:g} min" if not minute else f"{minute:g}"
        parts.append(element("text", words, x=f"{x(60 * minute):.1f}", y=HEIGHT - 8, class_="middle"))
    rows = np.unique(np.linspace(0, len(flights.time_s) - 1, NUM_DRAWN).round().astype(int))
    for case in (*range(1, min(MOST_DRAWN, len(flights.distance_m))), 0):
        kind = "one" if case else "first"
        parts.append(line(flights.time_s[rows], flights.distance_m[case, rows], kind))
        if flights.after_m.size:
            parts.append(line(end + flights.after_s[::2], flights.after_m[case, ::2], f"{kind} free"))
    parts += _limit_lines(limits, y)
    if flights.after_m.size:
        at = f"{x(end):.1f}"
        parts.append(element("line", x1=at, x2=at, y1=ABOVE, y2=HEIGHT - BELOW, class_="zero"))
        words = "free motion after the end"
        parts.append(element("text", words, x=f"{x(end) + 5:.1f}", y=ABOVE + 12, class_="small"))
    label = "Distance of the flights from the chief over time, m"
    return element("svg", *parts, viewBox=f"0 0 {WIDTH:g} {HEIGHT:g}", role="img", aria_label=label)


def _limit_lines(limits: Sequence[Limit], y: Any) -> list[Markup]:
    """Draw each limit, with its words at the right of it, apart from one another."""
    parts, lowest = [], HEIGHT
    for limit in limits:
        at = y(limit.value_m)
        parts.append(
            element("line", x1=LEFT, x2=WIDTH - RIGHT, y1=f"{at:.1f}", y2=f"{at:.1f}", class_="limit")
        )
        lowest = min(at + 4.0, lowest - LINE)
        words = f"{limit.value_m:g} m", ", ".join(limit.names)
        parts += [
            element("text", text, x=WIDTH - RIGHT + 6, y=f"{lowest + 11 * row:.1f}", class_="limit")
            for row, text in enumerate(words)
        ]
    return parts


def _ticks(last: float, count: int) -> list[float]:
    """Return about so many round numbers from zero to the last."""
    raw = last / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(next(factor * power for factor in (1.0, 1.5, 2.0, 3.0, 5.0, 10.0) if factor * power >= raw))
    return [step * index for index in range(ceil((last + 1e-9) / step))]


def in_words(flights: BoardFlights, limits: Sequence[Limit]) -> str:
    """Return what the drawing shows, and where free motion leads."""
    drawn, flown = min(MOST_DRAWN, len(flights.distance_m)), len(flights.distance_m)
    noun, nouns = flights.noun, {"case": "cases", "deputy": "deputies"}[flights.noun]
    all_but = f"The first {drawn:,} of {flights.num_cases:,} {nouns}"
    some = all_but if drawn < flights.num_cases else f"Each {noun}"
    words = f"{some}; bold: the first, not chosen for its outcome."
    named = "; ".join(f"{limit.value_m:g} m: {', '.join(limit.titles)}" for limit in limits)
    words += f" Lines: {named}." if named else ""
    limit = farthest_limit(limits, flights)
    if limit is None:
        return words
    shares = ", ".join(f"{flights.percent_beyond(limit.value_m, minutes):.1f}" for minutes in TOLD_MIN)
    within = ", ".join(str(minutes) for minutes in TOLD_MIN)
    of_which = f"{flown:,} {nouns}" if flown < flights.num_cases else nouns
    return (
        f"{words} Dashed: free motion after the last push. Beyond {limit.value_m:g} m within {within} min "
        f"after the end: {shares} % of {of_which}."
    )
