"""An evaluation as a scene: all trajectories by outcome, extreme ones labelled."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import rerun as rr

from telemetry.array_types import Booleans, Bytes
from telemetry.scene import blueprint, curves
from telemetry.scene.runs import CaseOutcome, EvaluatedCases, read_evaluation
from telemetry.scene.viewer import Scene

OUTCOME_COLOURS: Final[dict[CaseOutcome, curves.Colour]] = {
    CaseOutcome.SUCCESS: (0, 190, 130),
    CaseOutcome.SHORT: (255, 170, 60),
    CaseOutcome.OUTSIDE: (240, 60, 60),
}
UNKNOWN_COLOUR: Final[curves.Colour] = (120, 140, 175)
NAMED_COLOUR: Final[curves.Colour] = curves.PLAIN_COLOUR


@dataclass(frozen=True)
class Extreme:
    """A case that is extreme in some quantity.

    Parameters
    ----------
    what : str
        The quantity.
    row : int
        Row of the evaluation.
    sample : int
        Position of its label.
    label : str
    """

    what: str
    row: int
    sample: int
    label: str


def scene(path: Path) -> Scene:
    """Make a scene of an evaluation.

    Parameters
    ----------
    path : Path
        A run's folder, or its table of trajectories.

    Raises
    ------
    RecordingError
        If there are no trajectories, or they cannot be read.
    """
    evaluation = read_evaluation(path)
    distance = distance_plot(evaluation)
    farthest_m = float(np.percentile(evaluation.distance_m.max(axis=1), 90))
    layout = blueprint.campaign(distance, farthest_m=farthest_m)

    def send_all(recording_stream: rr.RecordingStream) -> None:
        stream = blueprint.Stream(recording_stream)
        surroundings = evaluation.surroundings
        blueprint.send_chief(stream, surroundings.chief_radius_m)
        blueprint.send_limits(stream, surroundings.min_distance_m, surroundings.max_distance_m)
        blueprint.send_curves(stream, [distance])
        _send_paths(stream, evaluation)
        _send_deputies(stream, evaluation)
        for extreme in extremes(evaluation):
            _send_extreme(stream, evaluation, extreme)
        text = rr.TextDocument(in_words(evaluation), media_type="text/markdown")
        stream.log(blueprint.SUMMARY, text, static=True)

    return Scene(
        "evaluation", f"{curves.drawable(evaluation.name)}: {len(evaluation.case)} cases", layout, send_all
    )


def extremes(evaluation: EvaluatedCases) -> list[Extreme]:
    """Return the cases with the largest delta-v, the fewest points, and the smallest and largest distance."""
    distance = evaluation.distance_m
    num_samples = distance.shape[1]
    cases = [
        ("nearest", int(distance.argmin()), f"{distance.min():.1f} m"),
        ("farthest", int(distance.argmax()), f"{distance.max():.1f} m"),
    ]
    if evaluation.episodes:
        delta_v, count = evaluation.episodes["delta_v_m_s"], evaluation.episodes["inspected_count"]
        picked = [("most delta-v", int(delta_v.argmax()), f"{delta_v.max():.3f} m/s")]
        if evaluation.surroundings.threshold_percent is not None:
            picked.append(("least inspected", int(count.argmin()), f"{count.min()} points"))
        for what, row, how_much in picked:
            # the label stands where the flight ends
            cases.append((what, (row + 1) * num_samples - 1, how_much))
    extremes = []
    for what, case, how_much in cases:
        row, sample = divmod(case, num_samples)
        extremes.append(Extreme(what, row, sample, f"{what}: case {evaluation.case[row]}, {how_much}"))
    return extremes


def in_words(evaluation: EvaluatedCases) -> str:
    """Summarise the outcomes of an evaluation as Markdown."""
    num_cases = len(evaluation.case)
    rows = [("cases", str(num_cases))]
    outcome = evaluation.outcome
    if outcome is None:
        rows.append(("outcome", "unknown: there is no episodes.parquet next to the trajectories"))
    else:
        for kind, words in _outcomes_in_words(evaluation).items():
            count = int(np.sum(outcome == kind))
            rows.append((words, f"{count} ({100 * count / num_cases:.1f} %)"))
        measures = [("delta-v", "delta_v_m_s", "m/s", 3), ("inspected", "inspection_rate_percent", "%", 1)]
        num_measures = 1 if evaluation.surroundings.threshold_percent is None else 2
        for title, name, unit, digits in measures[:num_measures]:
            values = evaluation.episodes[name]
            spread = values.std(ddof=min(1, num_cases - 1))
            text = f"{values.mean():.{digits}f} ± {spread:.{digits}f} {unit}"
            rows.append((title, f"{text}, {values.min():.{digits}f} to {values.max():.{digits}f}"))
    for extreme in extremes(evaluation):
        rows.append((extreme.what, extreme.label.removeprefix(f"{extreme.what}: ")))
    legend = "White: the cases named above. Dots: the deputies at the selected time."
    return f"{curves.table(rows)}\n\n{legend}"


def _outcomes_in_words(evaluation: EvaluatedCases) -> dict[CaseOutcome, str]:
    """Return the meaning of each colour of the flights."""
    around = evaluation.surroundings
    goal = "the goal" if around.threshold_percent is None else f"{around.threshold_percent:g} % inspected"
    limits = "the limits"
    if around.min_distance_m is not None and around.max_distance_m is not None:
        limits = f"{around.min_distance_m:g} to {around.max_distance_m:g} m"
    return {
        CaseOutcome.SUCCESS: f"green: success, {goal}",
        CaseOutcome.SHORT: f"orange: short of {goal.removesuffix(' inspected')}",
        CaseOutcome.OUTSIDE: f"red: outside {limits}",
    }


def distance_plot(evaluation: EvaluatedCases) -> curves.Plot:
    """Plot the smallest, median and largest distance of all cases over time, with the limits."""
    distance, time_s = evaluation.distance_m, evaluation.time_s
    spread = np.column_stack((distance.max(axis=0), np.median(distance, axis=0), distance.min(axis=0)))
    colours = (curves.SIGNAL_COLOURS[3], curves.PLAIN_COLOUR, curves.SIGNAL_COLOURS[2])
    lines = [curves.Curves("spread", time_s, spread, ("farthest", "median", "nearest"), colours)]
    around = evaluation.surroundings
    limits = [limit for limit in (around.min_distance_m, around.max_distance_m) if limit is not None]
    lines += [
        curves.level(f"limit_{limit:g}", float(time_s[-1]), limit, curves.LIMIT_COLOUR) for limit in limits
    ]
    top = 1.05 * max(float(spread.max()), *limits, 0.0)
    return curves.Plot("distance", "Distance of all cases (m)", tuple(lines), (0.0, top))


def _colours(evaluation: EvaluatedCases) -> Bytes:
    """Return each case's colour by its outcome, (n, 3)."""
    outcome = evaluation.outcome
    if outcome is None:
        return np.tile(np.array(UNKNOWN_COLOUR, dtype=np.uint8), (len(evaluation.case), 1))
    return np.array([OUTCOME_COLOURS[kind] for kind in CaseOutcome], dtype=np.uint8)[outcome]


def _send_paths(stream: blueprint.Stream, evaluation: EvaluatedCases) -> None:
    """Send the paths of all cases, coloured by outcome."""
    outcome = evaluation.outcome
    kinds: Sequence[tuple[str, curves.Colour, Booleans]]
    if outcome is None:
        kinds = [("all", UNKNOWN_COLOUR, np.ones(len(evaluation.case), dtype=np.bool_))]
    else:
        kinds = [(kind.name.lower(), OUTCOME_COLOURS[kind], outcome == kind) for kind in CaseOutcome]
    for name, colour, chosen in kinds:
        if not chosen.any():
            continue
        is_faint = name in ("all", "success")
        opacity, width = (90, 0.3) if is_faint else (255, 0.7)
        strips = list(evaluation.position_m[chosen])
        radii = rr.Radius.ui_points(width)
        lines = rr.LineStrips3D(strips, colors=[(*colour, opacity)], radii=radii)
        stream.log(f"{blueprint.SCENE}/paths/{name}", lines, static=True)


def _send_deputies(stream: blueprint.Stream, evaluation: EvaluatedCases) -> None:
    """Send the deputies' positions of all cases at each time."""
    entity = f"{blueprint.SCENE}/deputies"
    num_cases, num_samples = evaluation.position_m.shape[:2]
    style = rr.Points3D.from_fields(colors=_colours(evaluation), radii=rr.Radius.ui_points(2.8))
    stream.log(entity, style, static=True)
    positions = np.ascontiguousarray(evaluation.position_m.transpose(1, 0, 2)).reshape(-1, 3)
    columns = rr.Points3D.columns(positions=positions)
    blueprint.send(stream, entity, evaluation.time_s, columns.partition([num_cases] * num_samples))


def _send_extreme(stream: blueprint.Stream, evaluation: EvaluatedCases, extreme: Extreme) -> None:
    """Send the path of an extreme case and a label where it is most extreme."""
    entity = f"{blueprint.SCENE}/named/{extreme.what.replace(' ', '_').replace('-', '_')}"
    track = evaluation.position_m[extreme.row]
    lines = rr.LineStrips3D([track], colors=[NAMED_COLOUR], radii=rr.Radius.ui_points(1.4))
    stream.log(entity, lines, static=True)
    point = rr.Points3D(
        [track[extreme.sample]],
        labels=[extreme.label],
        colors=[NAMED_COLOUR],
        radii=rr.Radius.ui_points(4.0),
        show_labels=True,
    )
    stream.log(f"{entity}/label", point, static=True)
