"""Which pictures a report has, what they are called, and what is written under each."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.evaluation.blocks import blocks_of, number_of
from pipeline.evaluation.comparison import ComparisonRow, worlds_of
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.evaluation.statistics import Column, Columns
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.state.log import FlightLog, points_needed
from pipeline.flight.world.pack import inspection_points
from pipeline.report.comparisons import marks_of
from pipeline.report.contents import Contents, FlightSet, ShownFlight
from pipeline.report.figures import style
from pipeline.report.figures.comparison import (
    ENDS,
    LINEAR,
    beside_optimum,
    by_world,
    compared,
    flight_endings,
    front_of_runs,
)
from pipeline.report.figures.flights import METRICS, Sample, approach, controls, distributions
from pipeline.report.figures.training import convergence
from pipeline.report.figures.trajectories import MOST_TOLD_APART, Tracks, trajectories, trajectories_apart
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission

#: the files that this stage writes into the folder of figures, or once did, and no other
OWN_FILES = re.compile(
    r"(approach|control|trajectories|distributions|convergence|front|optimum|comparison|safety|system)"
    r"(-[a-z0-9-]+)?\.png"
)

#: flights in the picture of an approach to a goal
MOST_DRAWN = 200
#: flights whose distributions are drawn; of more, one in so many
MOST_SPREAD = 1_000_000
#: the name, the caption and the figure of a picture
Drawn = tuple[str, str, style.Figure]


def draw(contents: Contents) -> list[style.Illustration]:
    """Draw every picture that the run has data for, in the order of the page."""
    has_goal = contents.experiment.mission.problem.kind == "reach"
    dots_per_inch = contents.experiment.report.dots_per_inch
    with style.style():
        drawn = _approach(contents) if has_goal else _drawn(contents)
        return [style.illustrate(*drawing, dots_per_inch) for drawing in drawn]


def _captioned(name: str, figure: style.Figure, caption: str, **words: Any) -> Drawn:
    return name, style.caption_of(caption, **words), figure


def _drawn(contents: Contents) -> Iterator[Drawn]:
    """Yield every picture that the run has data for."""
    mission = contents.experiment.mission
    num_points = len(inspection_points(mission))
    needed = int(points_needed(num_points, mission.inspection_threshold_percent))
    if contents.comparison:
        yield _comparison(contents.comparison, mission.inspection_threshold_percent)
    for flight in contents.shown:
        yield from _flight(flight, mission_of_case(mission, flight.scenario))
    if contents.training is not None and contents.training.tracks_m is not None:
        yield _training(contents.training, mission)
    if contents.evaluation is not None and contents.evaluation.tracks_m is not None:
        count, figure = len(contents.evaluation.tracks_m), _by_outcome(contents.evaluation, mission)
        yield _captioned("trajectories-evaluation", figure, "evaluation", count=count)
    if (unsafe := contents.without_safety) is not None:
        figure = _two({"with": unsafe.guarded, "without": unsafe.unguarded}, mission)
        which = f"Case {unsafe.case}" + (f", deputy {unsafe.deputy}," if unsafe.deputy else "")
        yield _captioned("safety", figure, "safety", which=which)
    if contents.beside.columns is not None:
        yield _captioned("optimum", beside_optimum(contents.beside.columns, needed), "optimum", needed=needed)
    for pair in contents.pairs:
        figure = _two({"controller": pair.controller, "plan of least fuel": pair.plan}, mission)
        yield _captioned(f"optimum-case-{pair.case}", figure, "optimum_case", **vars(pair))
    if samples := list(_samples(contents, num_points)):
        alone = "distributions_beside_paper" if contents.is_beside_paper else "distributions"
        caption = "distributions_of_fleets" if mission.has_fleet else alone
        yield _captioned("distributions", distributions(samples, num_points), caption)
    if contents.logbook is not None:
        yield _captioned("convergence", convergence(contents.logbook, num_points, needed), "convergence")
    yield from _front(contents)


def _front(contents: Contents) -> Iterator[Drawn]:
    """Draw the front of a training: how well flights end, over what is spent."""
    if (front := contents.front) is None:
        return
    is_reach = contents.experiment.mission.problem.kind == "reach"
    measure, label = (
        ("success_percent", "success rate (%)")
        if is_reach
        else ("inspection_rate_percent", "mean inspection rate (%)")
    )
    names = [f"{number:02.0f}" for number in front["controller"]]
    spent, rates = (np.repeat(front[name][:, np.newaxis], 3, axis=1) for name in ("delta_v_m_s", measure))
    beaten = "beaten by another, as faults have a price"
    figure = front_of_runs(names, spent, rates, front["stands"] == 1, label, beaten)
    yield _captioned("front", figure, "front_of_training")


def _comparison(rows: Sequence[ComparisonRow], threshold: float) -> Drawn:
    """Draw the compared controllers: in the worlds they flew in, or rate over delta-v."""
    if worlds_of(rows):
        return _captioned("comparison", by_world(rows), "worlds")
    figure = compared(marks_of(rows), threshold)
    return _captioned("comparison", figure, "comparison", threshold=threshold, linear=LINEAR)


def _flight(flight: ShownFlight, mission: Mission) -> Iterator[Drawn]:
    """Yield the pictures of a flight: its controls and, of one alone, its trajectory."""
    title = flight.title
    for part in flight.parts:
        yield _captioned(f"control-{part.name}", controls(part.log, mission), "control", title=part.title)
    if flight.fleet:
        paths = {f"deputy {each.deputy}": each.flight.position_m for each in flight.fleet}
        colours = dict(zip(paths, style.PALETTE, strict=False))
        tracks = Tracks(np.stack(list(paths.values())), list(colours.values()), colours)
        yield _captioned(f"trajectories-{flight.name}", trajectories(tracks, mission), "fleet", title=title)
    elif flight.is_alone:
        figure = trajectories(Tracks(flight.log.position_m[np.newaxis], [style.BLUE], {}), mission)
        yield _captioned(f"trajectories-{flight.name}", figure, "trajectory", title=title)


def _training(training: FlightSet, mission: Mission) -> Drawn:
    """Draw the training flights: each in its own colour if they are few, else coloured by outcome."""
    assert training.tracks_m is not None  # noqa: S101 - so is it asked
    count = len(training.tracks_m)
    if count > MOST_TOLD_APART:
        figure, words = _by_outcome(training, mission), "Flights that ended otherwise stand apart."
    else:
        figure = trajectories(Tracks(training.tracks_m, style.PALETTE[:count], {}), mission)
        words = "Each start bears the number of its case."
    return _captioned("trajectories-training", figure, "training", count=count, words=words)


def _approach(contents: Contents) -> Iterator[Drawn]:
    """Draw speed over distance of the first flights of an evaluation."""
    experiment, controller = contents.experiment, contents.controller
    mission = experiment.mission
    yield from _front(contents)
    if contents.evaluation is None or controller is None:
        return
    shown = experiment.monte_carlo.cases[:MOST_DRAWN]
    starts = evaluation_scenarios(experiment, shown)
    _, tracks = fly_tracked(mission, controller, starts, experiment.monte_carlo.workers)
    yield _captioned("approach", approach(tracks, mission.problem), "approach")


def _two(flights: Mapping[str, FlightLog], mission: Mission) -> style.Figure:
    """Draw two flights in the same axes."""
    names = [f"{name}: {log.delta_v_m_s[-1]:.3f} m/s" for name, log in flights.items()]
    colours = dict(zip(names, (style.BLUE, style.VERMILION), strict=True))
    paths = np.stack([log.position_m for log in flights.values()])
    return trajectories(Tracks(paths, list(colours.values()), colours), mission)


def _by_outcome(flights: FlightSet, mission: Mission) -> style.Figure:
    """Draw flights by outcome, side by side where they ended in several ways: none hides another."""
    assert flights.episodes is not None  # noqa: S101 - flights with tracks have episodes
    assert flights.tracks_m is not None  # noqa: S101
    threshold = f"{mission.inspection_threshold_percent:g} %"
    labels = f"at least {threshold} inspected", f"less than {threshold}", "outside the limits"
    groups = {}
    for label, (colour, _), is_so in zip(
        labels, ENDS.values(), flight_endings(flights.episodes), strict=True
    ):
        if count := int(is_so.sum()):
            title = f"{label}: {count:,}"
            groups[title] = Tracks(flights.tracks_m[is_so], [colour] * count, {title: colour})
    if len(groups) > 1:
        return trajectories_apart(groups, mission)
    (tracks,) = groups.values()
    return trajectories(tracks, mission)


def _samples(contents: Contents, num_points: int) -> Iterator[Sample]:
    """Yield the quantities whose distributions are drawn."""
    for word, flights, reported in contents.sets:
        if flights.episodes is not None:
            count = number_of(flights.episodes)
            every = -(-count // MOST_SPREAD)
            drawn: dict[str, list[Column]] = {name: [] for name in METRICS}
            for block in blocks_of(flights.episodes):
                for name, of in drawn.items():
                    of.append(np.asarray(block[name][::every], dtype=np.float64))
            values = {name: np.concatenate(of) for name, of in drawn.items()}
            share = f", one in {every:,} drawn" if every > 1 else ""
            means = {name: float(flights.summary[name]["mean"]) for name in METRICS}
            paper_means = reported.means if reported else {}
            yield Sample(f"{word}, {count:,} flights{share}", values, paper_means, means)
            if flights.is_of_fleets and flights.deputies is not None:
                yield _deputies(word, flights.deputies, num_points)


def _deputies(word: str, deputies: Columns, num_points: int) -> Sample:
    """Return what each deputy of the fleets spent, saw first, and how far it was."""
    spent, seen, far = (
        np.asarray(deputies[name], dtype=np.float64)
        for name in ("delta_v_m_s", "inspected_count", "mean_distance_m")
    )
    values = dict(zip(METRICS, (spent, 100.0 * seen / num_points, far), strict=True))
    return Sample(f"{word}, their {len(spent):,} deputies", values, {})
