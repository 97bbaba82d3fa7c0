"""Figures of reports are as they were when somebody last looked: data, words, lines, and where they are."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.comparison import ComparisonRow
from pipeline.report.figures import comparison, flights, style, training, trajectories
from pipeline.report.figures.comparison import ControllerMark
from pipeline.report.figures.flights import METRICS, Sample
from pipeline.report.figures.trajectories import Tracks
from tests import drawn
from tests.pipeline.recording import cases
from tests.pipeline.report.test_drawn_numbers import made_track
from tests.pipeline.report.test_side_by_side import made_up

MISSION = cases.composed("duration_s=600.0").experiment.mission
DOCKING = compose_experiment(["+experiment=fly", "problem=docking"]).experiment.mission


def paths(count, length=61):
    """Flights around the chief, each in a plane of its own; the first leaves the limits."""
    angles = np.linspace(0.3, 5.9, length)[np.newaxis] + 0.7 * np.arange(count)[:, np.newaxis]
    radii = 55.0 + 9.0 * np.arange(count)[:, np.newaxis] + 4.0 * angles
    tilt = 0.25 * np.arange(count)[:, np.newaxis]
    tracks = np.stack(
        [radii * np.cos(angles), radii * np.sin(angles), radii * np.sin(angles + tilt) / 3.0], -1
    )
    tracks[0, -9:] *= np.linspace(1.3, 4.2, 9)[:, np.newaxis]
    return tracks


def flight(duration_s=600, scale=1.0):
    """A flight whose forces and torques differ in size and sign along each axis."""
    mission = cases.composed(f"duration_s={duration_s}.0").experiment.mission
    log = cases.flown(f"duration_s={duration_s}.0")
    forces = np.outer(np.cos(np.arange(len(log.force_hill_n)) / 7.0), (0.31, -0.17, 0.05)) * scale
    shape = log.torque_b_n_m.shape
    fading = np.exp(-np.arange(shape[0] * shape[1]) / 40.0).reshape(*shape[:2], 1)
    return log._replace(force_hill_n=forces, torque_b_n_m=fading * (4e-3, -2.5e-3, 1.5e-3) * scale), mission


def spread(*counts, shift=0.0):
    samples = []
    for number, count in enumerate(counts):
        k = np.arange(count)
        values = (
            1.3 + 0.4 * np.sin(1.7 * k) ** 3 + shift,
            100.0 * (92 + k % 8) / 99.0,
            61.0 + (k * 7 % 23) / 3.0,
        )
        values[0][-1] += 40.0 * (count > 100)
        values[0][1] -= 30.0 * (count > 100)
        paper = dict(zip(METRICS, ((1.21, 3.0, 65.5), (0.5, 97.25, 80.5))[number % 2], strict=True))
        means = dict(zip(METRICS, (1.375, 96.5, 64.25), strict=True)) if number else {}
        samples.append(
            Sample(f"of {count}", dict(zip(METRICS, values, strict=True)), paper if number < 2 else {}, means)
        )
    return flights.distributions(samples, 99)


def trained(rounds, **others):
    count = len(rounds)
    columns = {"round": np.array(rounds), "best": 3.0 * np.geomspace(2e5, 11.0, count)}
    columns |= {"mean": 37.0 * columns["best"], "delta_v_m_s": np.linspace(9.5, 3.25, count)}
    columns |= {"points": np.linspace(51.5, 98.75, count), "outside": np.arange(count)[::-1] / 3.0}
    columns |= {"short": (count - np.arange(count)) * 1.5}
    return training.convergence(columns | others, 99, 95)


def side_by_side(count=5, limits=None):
    marks = [
        ControllerMark(f"law_{i}", (0.07 + 0.33 * i * i, 0.04 + 0.01 * i), (97.5 - 7.0 * i, 1.5 + i))
        for i in range(count)
    ]
    marks.append(ControllerMark("all seen", (0.6, 0.0), (99.95, 0.01)))
    return comparison.compared([("one", marks), ("two", marks[:2])], 94.0, limits)


def row(name, world, layer, success, spent, sun="random", source="flown"):
    share = {"count": 4, "low": 0.0, "high": 1.0}
    summary = {"success_and_within_limits": {"fraction": success, **share}, "delta_v_m_s": {"mean": spent}}
    summary |= {"violated": {"fraction": 0.5 - success / 2.0, **share}}
    return ComparisonRow(
        controller=name,
        world=world,
        safety=layer,
        source=source,
        sun=sun,
        num_cases=10,
        rules=None,
        summary=summary,
    )


def worlds():
    rows = [
        row(name, world, layer, 0.9 - 0.2 * i - 0.15 * j - 0.05 * k, 0.625 + 0.3 * i + 0.1 * j + 0.05 * k)
        for i, name in enumerate("abc")
        for j, world in enumerate(("leo", "geo", "molniya"))
        for k, layer in enumerate(("none", "filter"))
    ]
    return comparison.by_world([*rows[:-1], row("paper", "leo", "none", 1.0, 9.0, source="published")])


def front(count, label="mean inspection rate (%)"):
    k = np.arange(count)
    spent, rates = 0.25 + 0.11 * k, 71.0 + 23.0 * (k / count) ** 0.5
    is_front = k % 3 != 1
    rates = rates - 9.0 * ~is_front
    low_high = np.array([0.0, -0.03, 0.05])
    intervals = spent[:, None] + low_high, rates[:, None] + 25.0 * low_high
    names = [f"s{i}" for i in k]
    return comparison.front_of_runs(names[::-1], *(each[::-1] for each in intervals), is_front[::-1], label)


def plans(count, **others):
    columns = made_up(count)
    columns |= {
        "inspected_count": 90 + np.arange(count) % 9,
        "optimum_inspected_count": 95 + np.arange(count) % 4,
    }
    columns |= {name: np.full(count, value) for name, value in others.items()}
    return comparison.beside_optimum(columns, 96)


def descents():
    states = np.zeros((3, 50, 6), dtype=np.float32)
    states[:, :, 0] = np.geomspace(140.0, 2.0, 50)
    states[:, :, 1] = 0.1 * states[:, :, 0]
    states[:, :, 3] = -0.004 * states[:, :, 0] * np.array([[0.5], [0.7], [0.9]])
    states[:, :, 5] = 0.001
    return states


def around(tracks, names=(), mission=MISSION):
    colours = (
        style.PALETTE[: len(tracks)] if len(tracks) <= len(style.PALETTE) else [style.BLUE] * len(tracks)
    )
    return trajectories.trajectories(
        Tracks(tracks, colours, dict(zip(names, colours, strict=False))), mission
    )


def shared_starts():
    tracks = paths(3)[1:]
    return around(np.concatenate([tracks, tracks[:1] * (1.0, 1.0, -1.0)]))


def groups():
    tracks = {"kept": paths(62)[1:], "left": paths(3)[:1], "short": paths(2, 40)[1:]}
    colours = zip((style.BLUE, style.PURPLE, style.ORANGE), tracks.items(), strict=True)
    made = {name: Tracks(each, [colour] * len(each), {}) for colour, (name, each) in colours}
    return trajectories.trajectories_apart(made, MISSION)


FIGURES = {
    "controls": lambda: flights.controls(*flight()),
    "controls_near_their_limits": lambda: flights.controls(*flight(scale=2.9)),
    "controls_of_a_minute": lambda: flights.controls(*flight(60)),
    "distributions": lambda: spread(7, 300, 120),
    "distributions_of_few": lambda: spread(5, 4, shift=-1.0),
    "convergence": lambda: trained([0, 0, 0, 1, 1, 2, 2, 2]),
    "convergence_at_once": lambda: trained([0], best=np.zeros(1)),
    "compared": side_by_side,
    "compared_within": lambda: side_by_side(19, ((0.0, 4.0), (60.0, 0.2))),
    "worlds": worlds,
    "front": lambda: front(7),
    "front_of_many": lambda: front(14, "success rate (%)"),
    "plans": lambda: plans(9),
    "plans_of_many": lambda: plans(31, delta_v_m_s=0.0),
    "plans_of_a_crowd": lambda: plans(66),
    "approach": lambda: flights.approach(descents(), DOCKING.problem),
    "alone": lambda: around(paths(2)[1:]),
    "four": lambda: around(paths(4)),
    "two": lambda: around(paths(3)[1:], ("with", "without")),
    "twelve": lambda: around(paths(12)),
    "shared_starts": shared_starts,
    "apart": groups,
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_as_it_was(name, file_regression):
    with style.style():
        text = drawn.figure(FIGURES[name]())
    file_regression.check(text, extension=".txt", basename=name)


@pytest.fixture
def illustrated(monkeypatch):
    """What would have been saved, as text."""
    kept = []

    def save(figure, name, dots_per_inch):
        kept.append(f"{name}, {dots_per_inch} dots per inch\n{drawn.figure(figure)}")
        return style.Picture(b"", '<svg width="1" viewBox="0 0 1 1"></svg>')

    monkeypatch.setattr(style, "save", save)
    return kept


@pytest.mark.parametrize("mission", [MISSION, DOCKING], ids=["inspection", "docking"])
def test_a_strip_is_as_it_was(mission, illustrated, file_regression):
    strip = flights.draw_flight(made_track(), 90, mission, 70)
    file_regression.check(f"{strip.caption}\n{illustrated[-1]}", extension=".txt")


def test_a_tube_is_as_it_was(illustrated, file_regression):
    step, axis = np.repeat(np.arange(5.0), 3), np.tile([0.0, 1.0, 2.0], 5)
    low = 40.0 - 7.0 * step - 11.0 * axis
    tube = {
        "step": step,
        "axis": axis,
        "low_m": low,
        "high_m": low + 3.0 + axis,
        "shear_per_s": 0.001 * (1 + axis),
    }
    tube |= {"least_m_s": -0.05 - 0.01 * step, "greatest_m_s": 0.02 + 0.015 * axis}
    picture = flights.draw_tube(tube, descents(), replace(DOCKING, control_period_s=3.0), 80)
    file_regression.check(f"{picture.caption}\n{illustrated[-1]}", extension=".txt")


def test_an_element_of_a_page_is_as_it_was(file_regression):
    svg = """<?xml version="1.0"?>
<svg width="72pt" height="36pt" viewBox="0 0 72.5 36" version="1.1">
 <metadata><x/></metadata> <style>*{a: b}</style> <!-- made -->
 <path id="p1" d="M 1.23456 2.3 L 9.87654 0.12" style="fill: #0072b2; stroke: #d55e00"/>
 <use href="#p1" clip-path="url(#p1)"/>
 <text style="font-family: 'DejaVu Sans', sans; font-size: 8px">a 1.23456</text>
</svg>"""
    text = style.inline(svg, "mine", 'it is "so"')
    file_regression.check(text.replace("><", ">\n<"), extension=".svg")
