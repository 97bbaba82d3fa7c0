"""Which pictures a report has, what they are called, and what is written under each."""

import re
from collections.abc import Iterator
from functools import partial

import numpy as np

from pipeline.evaluation import published
from pipeline.evaluation.worlds import worlds_of
from pipeline.flight.state.log import points_needed
from pipeline.flight.world.pack import inspection_points
from pipeline.report.beside_optimum import Pair
from pipeline.report.comparison_tables import marks_of, squares_of
from pipeline.report.contents import Contents, FlightSet, ShownFlight
from pipeline.report.figures.by_world import by_world
from pipeline.report.figures.control import controls
from pipeline.report.figures.convergence import convergence
from pipeline.report.figures.delta_v_and_rate import LINEAR, compared
from pipeline.report.figures.distributions import METRICS, Sample, distributions
from pipeline.report.figures.front import front_of_training
from pipeline.report.figures.side_by_side import side_by_side
from pipeline.report.figures.spent_beside_optimum import beside_optimum
from pipeline.report.figures.style import BLUE, ORANGE, PALETTE, PURPLE
from pipeline.report.figures.trajectories import MOST_TOLD_APART, Tracks, trajectories
from pipeline.report.figures.with_and_without import with_and_without
from pipeline.report.illustration import Illustration, Sketch, illustrate
from pipeline.report.without_safety import Without
from pipeline.settings.experiment import Mission

#: the files that this stage writes into the folder of figures, or once did, and no other
OWN_FILES = re.compile(
    r"(control|trajectories|distributions|convergence|front|optimum|comparison|safety|system)"
    r"(-[a-z0-9-]+)?\.png"
)


def draw(contents: Contents) -> list[Illustration]:
    """Draw every picture for which the run has what it takes, in the order of the page."""
    dots_per_inch = contents.experiment.report.dots_per_inch
    return [illustrate(sketch, dots_per_inch) for sketch in _sketches(contents)]


def _sketches(contents: Contents) -> Iterator[Sketch]:
    mission = contents.experiment.mission
    if contents.comparison:
        yield _comparison_sketch(contents, mission)
    for flight in contents.shown:
        yield from _flight_sketches(flight, mission)
    if contents.training is not None:
        yield _training_sketch(contents.training, mission)
    if contents.evaluation is not None and contents.evaluation.tracks_m is not None:
        yield _evaluation_sketch(contents.evaluation, mission)
    if contents.without_safety is not None:
        yield _safety_sketch(contents.without_safety, mission)
    if contents.beside.columns is not None:
        yield _optimum_sketch(contents)
    for pair in contents.pairs:
        yield _pair_sketch(pair, mission)
    samples = list(_samples(contents))
    if samples:
        yield _distributions_sketch(samples, mission)
    if contents.logbook is not None:
        caption = (
            "Training: the best and the mean fitness of each generation, and the parts of the best one's "
            "fitness, means and counts over the training flights. Dotted lines part the rounds."
        )
        figure = partial(convergence, contents.logbook, len(inspection_points(mission)), _needed(mission))
        yield Sketch("convergence", caption, figure)
    if contents.front is not None:
        yield _front_sketch(contents)


def _front_sketch(contents: Contents) -> Sketch:
    assert contents.front is not None  # noqa: S101 - asked before
    experiment = contents.experiment
    threshold = experiment.mission.inspection_threshold_percent
    caption = (
        "The front: delta-v and inspection rate of its controllers, means over "
        f"{experiment.optimizer.validation_cases:,} starts that no training has flown, and how many of these "
        f"flights reach {threshold:g} % or leave the distance limits. Open circles are dominated there by "
        "others of the front. Numbers are those of the controller files. The paper's "
        f"{published.TEST.means['delta_v_m_s']:g} m/s for "
        f"{published.TEST.means['inspection_rate_percent']:g} % are not drawn."
    )
    return Sketch("front", caption, partial(front_of_training, contents.front, threshold))


def _comparison_sketch(contents: Contents, mission: Mission) -> Sketch:
    if worlds_of(contents.comparison):
        caption = (
            "Share of successful flights and mean delta-v (m/s) of each controller in each world. A red "
            "frame: it breaks, for its success rate lies below that in the first world, or it leaves the "
            "limits more often, by more than both intervals."
        )
        return Sketch("comparison", caption, partial(by_world, squares_of(contents.comparison)))
    caption = (
        "Delta-v against inspection rate, without the safety layer: mean and standard deviation of each "
        f"controller. The dotted line is at {mission.inspection_threshold_percent:g} %, which makes a "
        f"success. Delta-v is linear up to {LINEAR:g} m/s and logarithmic beyond."
    )
    figure = partial(compared, marks_of(contents.comparison), mission.inspection_threshold_percent)
    return Sketch("comparison", caption, figure)


def _flight_sketches(flight: ShownFlight, mission: Mission) -> Iterator[Sketch]:
    caption = (
        f"{flight.title}: the force in Hill axes and the torque in the deputy's body axes, both as applied. "
        "The torque is shown apart for the first turn to the chief and for the rest, on scales of their own."
    )
    yield Sketch(f"control-{flight.name}", caption, partial(controls, flight.log, mission))
    if flight.is_alone:
        tracks = Tracks(flight.log.position_m[np.newaxis], [BLUE], {})
        caption = (
            f"{flight.title}: the trajectory around the chief in the Hill frame, from 0 on, in space, in the "
            "orbit plane and across it, and the distance over time."
        )
        yield Sketch(f"trajectories-{flight.name}", caption, partial(trajectories, tracks, mission))


def _training_sketch(training: FlightSet, mission: Mission) -> Sketch:
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
    return Sketch("trajectories-training", caption, partial(trajectories, tracks, mission))


def _evaluation_sketch(evaluation: FlightSet, mission: Mission) -> Sketch:
    assert evaluation.tracks_m is not None  # noqa: S101 - asked before
    caption = (
        f"The {len(evaluation.tracks_m):,} flights of the evaluation, overlapped, in the Hill frame: in "
        "space, in the orbit plane and across it, and their distance over time. Colours tell how each ended; "
        "flights that left the distance limits are drawn over the others, and what lies outside the frame "
        "of the picture is not drawn."
    )
    figure = partial(trajectories, _tracks_by_outcome(evaluation, mission), mission)
    return Sketch("trajectories-evaluation", caption, figure)


def _safety_sketch(without: Without, mission: Mission) -> Sketch:
    caption = (
        f"Case {without.case} with the safety layer and without: the path about the sample at which it is "
        "farthest outside the limits without it, or nearest to them, in the plane of its position and "
        "velocity there; the distance over time; and the delta-v by which the layer changed each period's "
        "force. The limits are dotted."
    )
    return Sketch("safety", caption, partial(with_and_without, without.guarded, without.unguarded, mission))


def _optimum_sketch(contents: Contents) -> Sketch:
    assert contents.beside.columns is not None  # noqa: S101 - asked before
    mission = contents.experiment.mission
    needed = _needed(mission)
    caption = (
        "Delta-v and points of the controller (filled) and of the plan of least fuel (open) in the same "
        "cases, by their ratio; the least, the middle and the greatest stand over their cases. The dotted "
        f"line is at {needed} points. The plans know the whole flight beforehand, the controller only the "
        "moment."
    )
    return Sketch("optimum", caption, partial(beside_optimum, contents.beside.columns, needed))


def _pair_sketch(pair: Pair, mission: Mission) -> Sketch:
    needed = _needed(mission)
    caption = (
        f"Case {pair.case}, {pair.which} ratio: {pair.times:.1f} times the optimum. The controller and the "
        "plan of least fuel from the same start, in the orbit plane and across it: the path, broad where new "
        "points come into sight (at most two minutes apart); circles are burns, their area the delta-v; the "
        "arc is the Sun's way. Dotted are the distance limits. Beside them, delta-v and points over time."
    )
    figure = partial(side_by_side, pair.controller, pair.plan, mission, needed)
    return Sketch(f"optimum-case-{pair.case}", caption, figure)


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
    pairs = (
        ("Training", contents.training, published.TRAINING),
        ("Evaluation", contents.evaluation, published.TEST),
    )
    for word, flights, reported in pairs:
        if flights is not None and flights.episodes is not None:
            values = {name: np.asarray(flights.episodes[name], dtype=np.float64) for name in METRICS}
            count = len(values["delta_v_m_s"])
            yield Sample(f"{word}, {count:,} flights", values, reported.means)


def _distributions_sketch(samples: list[Sample], mission: Mission) -> Sketch:
    caption = (
        "Distributions of delta-v, inspection rate and mean distance. Of few flights each is a dot, over a "
        "box from quartile to quartile with the median, its whiskers reaching to the ends; many are a "
        "histogram. "
        "The solid line is the mean, the dashed one the paper's; arrows point to what is off the scale."
    )
    figure = partial(distributions, samples, len(inspection_points(mission)))
    return Sketch("distributions", caption, figure)
