"""Which pictures a report has, what they are called, and what is written under each."""

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pipeline.evaluation.comparison import ComparisonRow, worlds_of
from pipeline.flight.state.log import FlightLog, points_needed
from pipeline.flight.world.pack import inspection_points
from pipeline.report.comparisons import Pair, Without, marks_of, squares_of
from pipeline.report.contents import Contents, FlightSet, ShownFlight
from pipeline.report.figures.comparison import LINEAR, beside_optimum, by_world, compared
from pipeline.report.figures.flights import METRICS, Sample, controls, distributions
from pipeline.report.figures.style import (
    BLUE,
    ORANGE,
    PALETTE,
    PURPLE,
    VERMILION,
    Figure,
    Illustration,
    illustrate,
    style,
)
from pipeline.report.figures.training import convergence
from pipeline.report.figures.trajectories import MOST_TOLD_APART, Tracks, trajectories
from pipeline.settings.experiment import Mission

#: the files that this stage writes into the folder of figures, or once did, and no other
OWN_FILES = re.compile(
    r"(approach|control|trajectories|distributions|convergence|front|optimum|comparison|safety|system)"
    r"(-[a-z0-9-]+)?\.png"
)


#: the name, the caption and the figure of a picture
Drawn = tuple[str, str, Figure]


def draw(contents: Contents) -> list[Illustration]:
    """Draw every picture for which the run has what it takes, in the order of the page."""
    dots_per_inch = contents.experiment.report.dots_per_inch
    with style():
        return [illustrate(*drawn, dots_per_inch) for drawn in _drawn(contents)]


def _drawn(contents: Contents) -> Iterator[Drawn]:
    mission = contents.experiment.mission
    if contents.comparison:
        yield _comparison(contents.comparison, mission)
    for flight in contents.shown:
        yield from _flight(flight, mission)
    if contents.training is not None:
        yield _training(contents.training, mission)
    if contents.evaluation is not None and contents.evaluation.tracks_m is not None:
        yield _evaluation(contents.evaluation, mission)
    if contents.without_safety is not None:
        yield _safety(contents.without_safety, mission)
    if contents.beside.columns is not None:
        caption = (
            "Delta-v and points of the controller (filled) and of the plan of least fuel (open) in the same "
            "cases, by their ratio; the least, the middle and the greatest stand over their cases. The "
            f"dotted line is at {_needed(mission)} points. The plans know the whole flight beforehand, the "
            "controller only the moment."
        )
        yield "optimum", caption, beside_optimum(contents.beside.columns, _needed(mission))
    for pair in contents.pairs:
        yield _pair(pair, mission)
    if samples := list(_samples(contents)):
        caption = (
            "Distributions of delta-v, inspection rate and mean distance. Of few flights each is a dot, over "
            "a box from quartile to quartile with the median, its whiskers reaching to the ends; many are a "
            "histogram. The solid line is the mean, the dashed one the paper's; arrows point to what is off "
            "the scale."
        )
        yield "distributions", caption, distributions(samples, len(inspection_points(mission)))
    if contents.logbook is not None:
        caption = (
            "Training: the best and the mean fitness of each generation, and the parts of the best one's "
            "fitness, means and counts over the training flights. Dotted lines part the rounds."
        )
        figure = convergence(contents.logbook, len(inspection_points(mission)), _needed(mission))
        yield "convergence", caption, figure


def _comparison(rows: Sequence[ComparisonRow], mission: Mission) -> Drawn:
    if worlds_of(rows):
        caption = (
            "Share of successful flights and mean delta-v (m/s) of each controller in each world. A red "
            "frame: it breaks, for its success rate lies below that in the first world, or it leaves the "
            "limits more often, by more than both intervals."
        )
        return "comparison", caption, by_world(squares_of(rows))
    threshold = mission.inspection_threshold_percent
    caption = (
        "Delta-v against inspection rate, without the safety layer: mean and standard deviation of each "
        f"controller. The dotted line is at {threshold:g} %, which makes a success. Delta-v is linear up to "
        f"{LINEAR:g} m/s and logarithmic beyond."
    )
    return "comparison", caption, compared(marks_of(rows), threshold)


def _flight(flight: ShownFlight, mission: Mission) -> Iterator[Drawn]:
    caption = (
        f"{flight.title}: the force in Hill axes and the torque in the deputy's body axes, both as applied. "
        "The torque is shown apart for the first turn to the chief and for the rest, on scales of their own."
    )
    yield f"control-{flight.name}", caption, controls(flight.log, mission)
    if flight.is_alone:
        tracks = Tracks(flight.log.position_m[np.newaxis], [BLUE], {})
        caption = (
            f"{flight.title}: the trajectory around the chief in the Hill frame, from 0 on, in space, in the "
            "orbit plane and across it, and the distance over time."
        )
        yield f"trajectories-{flight.name}", caption, trajectories(tracks, mission)


def _training(training: FlightSet, mission: Mission) -> Drawn:
    assert training.tracks_m is not None  # noqa: S101 - they were flown for this
    count = len(training.tracks_m)
    if count > MOST_TOLD_APART:
        tracks, words = _tracks_by_outcome(training, mission), "Colours tell how each ended."
    else:
        tracks = Tracks(training.tracks_m, PALETTE[:count], {})
        words = "Each start bears the number of its case."
    caption = (
        f"The {count} training flights around the chief in the Hill frame: in space, in the orbit plane and "
        f"across it, and their distance over time. {words}"
    )
    return "trajectories-training", caption, trajectories(tracks, mission)


def _evaluation(evaluation: FlightSet, mission: Mission) -> Drawn:
    tracks = _tracks_by_outcome(evaluation, mission)
    caption = (
        f"The {len(tracks.positions_m):,} flights of the evaluation, overlapped, in the Hill frame: in "
        "space, in the orbit plane and across it, and their distance over time. Colours tell how each ended; "
        "flights that left the distance limits are drawn over the others, and what lies outside the frame "
        "of the picture is not drawn."
    )
    return "trajectories-evaluation", caption, trajectories(tracks, mission)


def _safety(without: Without, mission: Mission) -> Drawn:
    caption = (
        f"Case {without.case} with the safety layer and without, the one that comes farthest outside the "
        f"limits without it, or nearest to them: {_TWO}"
    )
    return "safety", caption, _two({"with": without.guarded, "without": without.unguarded}, mission)


def _pair(pair: Pair, mission: Mission) -> Drawn:
    caption = (
        f"Case {pair.case}, {pair.which} ratio: {pair.times:.1f} times the optimum. The controller and the "
        f"plan of least fuel from the same start: {_TWO}"
    )
    flights = {"controller": pair.controller, "plan of least fuel": pair.plan}
    return f"optimum-case-{pair.case}", caption, _two(flights, mission)


_TWO = "around the chief in space, in the orbit plane and across it, and their distance over time."


def _two(flights: Mapping[str, FlightLog], mission: Mission) -> Figure:
    """Draw two flights over one another."""
    names = [f"{name}: {log.delta_v_m_s[-1]:.3f} m/s" for name, log in flights.items()]
    colours = dict(zip(names, (BLUE, VERMILION), strict=True))
    paths = np.stack([log.position_m for log in flights.values()])
    return trajectories(Tracks(paths, list(colours.values()), colours), mission)


def _needed(mission: Mission) -> int:
    """Return the points that make a success."""
    return int(points_needed(len(inspection_points(mission)), mission.inspection_threshold_percent))


def _tracks_by_outcome(flights: FlightSet, mission: Mission) -> Tracks:
    """Colour flights by how they ended, those outside the limits last."""
    assert flights.episodes is not None  # noqa: S101 - flights with tracks have episodes
    assert flights.tracks_m is not None  # noqa: S101
    success, violated = (np.asarray(flights.episodes[name], dtype=bool) for name in ("success", "violated"))
    threshold = f"{mission.inspection_threshold_percent:g} %"
    kinds = [
        (f"at least {threshold} inspected", BLUE, success & ~violated),
        (f"less than {threshold}", ORANGE, ~success & ~violated),
        ("outside the distance limits", PURPLE, violated),
    ]
    colours = np.empty(len(success), dtype=object)
    legend = {}
    for label, colour, is_so in kinds:
        colours[is_so] = colour
        legend[f"{label}: {int(is_so.sum()):,}"] = colour
    order = np.argsort(violated, kind="stable")
    return Tracks(flights.tracks_m[order], colours[order].tolist(), legend, violated[order])


def _samples(contents: Contents) -> Iterator[Sample]:
    """Yield what the distributions are of."""
    for word, flights, reported in contents.sets:
        if flights.episodes is not None:
            values = {name: np.asarray(flights.episodes[name], dtype=np.float64) for name in METRICS}
            count = len(values["delta_v_m_s"])
            yield Sample(f"{word}, {count:,} flights", values, reported.means)
