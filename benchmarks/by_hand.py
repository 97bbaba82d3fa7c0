"""Flights computed with pencil and paper, and as flown: ``python -m benchmarks by_hand [CONTROLLER]``.

For controllers with triangular terms, antecedents joined by the minimum, and outputs by
centroid. Inference is done as by hand, on the corners of the cut triangles, independently of the
product's inference.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.model import And, FuzzySystem, Is, Term, Triangular, Variable
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission

Corners = list[tuple[float, float]]

#: the first starts of this seed under a random Sun, not selected
SEED, STARTS = 777, 3
#: most pushes reported per flight
TOLD = 8
AXES = ("radial", "along the track", "across")


def main(arguments: Sequence[str]) -> None:
    """Print the flights as Markdown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks by_hand", description=__doc__)
    parser.add_argument(
        "controller", nargs="?", default="champion_27", help="as in controller=NAME, or a file"
    )
    print("\n".join(pages(parser.parse_args(arguments).controller)))


def pages(controller: str) -> Iterator[str]:
    """Yield the lines on the beginnings of the flights."""
    overrides = ["+experiment=evaluate", f"controller={controller}", "sun=random", f"seed={SEED}"]
    experiment = compose_experiment(overrides).experiment
    flown = source.load(experiment.controller, experiment.mission)
    starts = evaluation_scenarios(experiment)[:STARTS]
    for case, start in enumerate(starts):
        log = fly_logged(experiment.mission, flown, start)
        position = ", ".join(f"{value:.1f}" for value in start.position_m)
        yield f"## Start {case + 1}\n"
        yield f"At ({position}) m, the Sun at {np.degrees(start.sun_angle_rad) % 360:.0f}°: case {case}.\n"
        for number, (system, words) in enumerate(zip(flown.systems, AXES, strict=True)):
            yield from decision(experiment.mission, system, words, log, number)
        yield from rest_of(experiment.mission, log)


class Worked(NamedTuple):
    """An inference by hand: degrees by input; firing rules: number, terms, conclusion, degree; corners."""

    degrees: list[dict[str, float]]
    rules: list[tuple[int, tuple[str, ...], str, float]]
    corners: Corners

    @property
    def force(self) -> float:
        """The centroid."""
        area, moment = area_and_moment(self.corners)
        return moment / area


def work_out(system: FuzzySystem, values: Iterable[float]) -> Worked:
    """Return an inference by hand."""
    degrees = [degrees_of(variable, value) for variable, value in zip(system.inputs, values, strict=True)]
    rules = []
    for number, rule in enumerate(system.rules, start=1):
        terms = tuple(each.term for each in statements(rule.antecedent))
        strength = min(
            degrees_of_term.get(name, 0.0) for degrees_of_term, name in zip(degrees, terms, strict=True)
        )
        if strength > 0.0:
            (then,) = rule.consequents
            rules.append((number, terms, then.term, strength))
    cuts: dict[str, float] = {}
    for _, _, then, strength in rules:
        cuts[then] = max(cuts.get(then, 0.0), strength)
    return Worked(degrees, rules, outline(system.outputs[0], cuts))


def decision(mission: Mission, system: FuzzySystem, words: str, log: FlightLog, number: int) -> Iterator[str]:
    """Yield the lines on the first decision of one system."""
    values = log.fis_input[0, number, : len(system.inputs)].tolist()
    worked = work_out(system, values)
    yield f"**{words.capitalize()}.** " + "; ".join(
        f"`{variable.name}` is {value:.4g} {variable.unit}: {format_degrees(degrees)}"
        for variable, value, degrees in zip(system.inputs, values, worked.degrees, strict=True)
    )
    yield "\n| rule | if | then | firing strength |\n|---|---|---|---|"
    for index, terms, then, strength in worked.rules:
        joined = " and ".join(
            f"{variable.name} is {name}" for variable, name in zip(system.inputs, terms, strict=True)
        )
        yield f"| {index} | {joined} | {then} | {strength:.3f} |".replace("_", " ")
    yield "\nThe outline of the cut terms has the corners (N, degree) " + ", ".join(
        f"({x + 0.0:.4f}, {degree:.3f})".replace("-0.0000", "0.0000") for x, degree in worked.corners
    )
    area, moment = area_and_moment(worked.corners)
    flown = float(log.fis_output_n[0, number])
    commanded, fired = (speed_mm_s(mission, each) for each in (flown, log.force_hill_n[0, number]))
    yield (
        f"Area {area:.4g} N, moment {moment:.4g} N², centroid {worked.force:.5f} N. Recorded: "
        f"{flown:.5f} N, asked of the thruster as a push of {commanded:.1f} mm/s; fired: {fired:.1f} mm/s.\n"
    )


def speed_mm_s(mission: Mission, force_n: float) -> float:
    """Return the velocity change by a force held over a control period, mm/s."""
    return 1000 * force_n * mission.control_period_s / mission.deputy.mass_kg


def statements(antecedent: object) -> tuple[Is, ...]:
    """Return the statements joined by an antecedent, one or more."""
    parts = antecedent.operands if isinstance(antecedent, And) else (antecedent,)
    conditions = tuple(part for part in parts if isinstance(part, Is))
    if len(conditions) != len(parts):
        raise SystemExit("by hand go rules that join plain statements by and; this one does not")
    return conditions


def triangle(term: Term) -> Triangular:
    """Return the term's triangle."""
    if not isinstance(term.membership, Triangular):
        raise SystemExit(f"by hand go triangles; the term {term.name!r} is another shape")
    return term.membership


def height(shape: Triangular, x: float) -> float:
    """Return the degree of membership, from the equation of the flank at x."""
    flank = (
        (x - shape.left, shape.peak - shape.left)
        if x < shape.peak
        else (shape.right - x, shape.right - shape.peak)
    )
    return max(0.0, flank[0] / flank[1]) if flank[1] > 0.0 else float(x == shape.peak)


def degrees_of(variable: Variable, value: float) -> dict[str, float]:
    """Return the degrees of a value's nonzero terms; beyond the range as at its end."""
    inside = min(max(value, variable.minimum), variable.maximum)
    degrees = {term.name: height(triangle(term), inside) for term in variable.terms}
    return {name: degree for name, degree in degrees.items() if degree > 0.0}


def format_degrees(degrees: dict[str, float]) -> str:
    """Return degrees in words."""
    return " and ".join(f"{name.replace('_', ' ')} by {degree:.3f}" for name, degree in degrees.items())


def outline(output: Variable, cuts: dict[str, float]) -> Corners:
    """Return the corners of the maximum of the cut terms, from left to right."""
    shapes = [(triangle(term), cuts[term.name]) for term in output.terms if term.name in cuts]

    def highest(x: float) -> float:
        return max(min(height(shape, x), cut) for shape, cut in shapes)

    xs = {output.minimum, output.maximum}
    for index, (shape, _) in enumerate(shapes):
        # where the flanks cross this cut and its neighbours', and each other
        for _, level in shapes[max(index - 1, 0) : index + 2]:
            xs |= {
                shape.left + level * (shape.peak - shape.left),
                shape.right - level * (shape.right - shape.peak),
            }
        xs |= {shape.left, shape.right}
        for other, _ in shapes[index + 1 : index + 2]:
            fall, rise = shape.right - shape.peak, other.peak - other.left
            xs.add((shape.right * rise + other.left * fall) / (fall + rise))
    # points that differ only by rounding would hide a bend
    inside = sorted({round(x, 12) for x in xs if output.minimum <= x <= output.maximum})
    corners = [(x, highest(x)) for x in inside]
    return [
        corner
        for index, corner in enumerate(corners)
        if index in (0, len(corners) - 1) or is_bent(*corners[index - 1 : index + 2])
    ]


def is_bent(before: tuple[float, float], at: tuple[float, float], after: tuple[float, float]) -> bool:
    """Return whether three points are not on a line."""
    share = (at[0] - before[0]) / (after[0] - before[0]) if after[0] > before[0] else 0.0
    return abs(before[1] + share * (after[1] - before[1]) - at[1]) > 1e-9


def area_and_moment(corners: Corners) -> tuple[float, float]:
    """Return the area under an outline and its moment about zero, trapezoid by trapezoid."""
    area = moment = 0.0
    for (x, a), (y, b) in pairwise(corners):
        area += (y - x) * (a + b) / 2
        moment += (y - x) * (x * (2 * a + b) + y * (a + 2 * b)) / 6
    return area, moment


def rest_of(mission: Mission, log: FlightLog) -> Iterator[str]:
    """Yield the lines on the pushes that follow, and the end of a flight."""
    seen = log.is_inspected.sum(axis=1)
    pushes: NDArray[np.float64] = log.force_hill_n * speed_mm_s(mission, 1.0)
    fired = np.flatnonzero(np.abs(pushes).max(axis=1) > 0.0)
    yield "| at (min:s) | push radial, along, across (mm/s) | points seen by then |\n|---|---|---|"
    for k in fired[:TOLD]:
        push = ", ".join(f"{value:.1f}" if value else "0" for value in pushes[k])
        yield f"| {clock(mission, k)} | {push} | {seen[k]} |"
    rest = fired[TOLD:]
    if len(rest):
        large = rest[np.abs(pushes[rest]).sum(axis=1).argmax()]
        yield (
            f"\n{len(rest)} more follow, the largest at {clock(mission, large)} "
            f"({np.abs(pushes[large]).sum():.0f} mm/s), the last at {clock(mission, rest[-1])}."
        )
    yield f"\nAt the end: {seen[-1]} points, {log.delta_v_m_s[-1]:.3f} m/s.\n"


def clock(mission: Mission, k: int) -> str:
    """Return the start of a control period, in minutes and seconds."""
    minutes, seconds = divmod(int(k * mission.control_period_s), 60)
    return f"{minutes}:{seconds:02d}"


if __name__ == "__main__":
    main(sys.argv[1:])
