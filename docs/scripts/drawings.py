"""Drawings of the ideas behind the pages, by the product's own laws: ``python -m docs drawings``."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from docs.scripts import flown_drawings, mission_drawing, onboard_drawing
from docs.scripts.drawing import Drawing
from fis_tools.compiled.decorator import plainly
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.signals import TOUR_WAVES
from pipeline.physics.motion import state_transition
from pipeline.scenarios import evaluation_scenarios

FOLDER = Path(__file__).resolve().parents[1] / "images" / "drawings"
MEAN_MOTION, RADIUS_M, PERIOD_S = 0.0011068, 10.0, 2.0 * math.pi / 0.0011068


def coasted(position: Sequence[float], velocity: Sequence[float], times: Any) -> Any:
    """Return positions of free motion, (n, 3), m, Hill axes."""
    state = np.r_[position, velocity]
    with plainly("pipeline"):
        return np.array([np.asarray(state_transition(MEAN_MOTION, float(t)))[:3] @ state for t in times])


def motion() -> Drawing:
    """Draw free motion: an ellipse twice as long as high, and what a push ahead does to it."""
    drawing = Drawing(760, 340, "Free motion around the chief, and a push ahead", (430.0, 165.0), 3.6)
    high, times = 30.0, np.linspace(0.0, PERIOD_S, 121)
    path = coasted((high, 0.0, 0.0), (0.0, -2.0 * MEAN_MOTION * high, 0.0), times)
    pushed = coasted((high, 0.0, 0.0), (0.0, -2.0 * MEAN_MOTION * high + 0.002, 0.0), times)
    drawing.line(((y, x) for x, y, _ in path))
    drawing.line(((y, x) for x, y, _ in pushed), "push dash")
    for x, y, _ in path[::20]:
        drawing.dot((y, x), 3.5)
    drawing.dot((0.0, 0.0), 9.0, "shade")
    drawing.word("chief", (0.0, 0.0), "small", 13.0, 5.0)
    drawing.arrow((0.0, 0.0), (0.0, high - 1.0))
    drawing.word("30 m", (0.0, high / 2), "small", 6.0)
    drawing.arrow((0.0, 0.0), (-2 * high + 1.0, 0.0))
    drawing.word("60 m: twice as long as high", (-high, 0.0), "small", 0.0, -6.0, "middle")
    drawing.arrow((0.0, high), (22.0, high), "push")
    drawing.word("push ahead, 2 mm/s", (22.0, high), "push", 6.0, 5.0)
    end = pushed[-1]
    drawing.dot((end[1], end[0]), 4.5, "dot")
    drawing.word(
        f"an orbit later {path[-1, 1] - end[1]:.0f} m further back",
        (end[1], end[0]),
        "push",
        0.0,
        -14.0,
        "middle",
    )
    drawing.arrow((55.0, -36.0), (75.0, -36.0))
    drawing.word("ahead", (75.0, -36.0), "small", 4.0, 4.0)
    drawing.arrow((55.0, -36.0), (55.0, -18.0))
    drawing.word("up", (55.0, -18.0), "small", -6.0, -6.0)
    drawing.word(
        "Without a push the deputy goes round the chief once an orbit; dots every quarter of an hour",
        (-115.0, 42.0),
        "title",
        0.0,
        4.0,
    )
    return drawing


def aim() -> Drawing:
    """Draw the aim: free motion that misses a point about to go dark, and the push that shows it."""
    drawing = Drawing(760, 330, "The push that still shows what is about to go dark", (0.0, 0.0), 5.0)
    normal = np.array([math.cos(math.radians(62)), math.sin(math.radians(62))])
    along = np.array([-normal[1], normal[0]])
    for left, is_pushed in ((105.0, False), (485.0, True)):
        drawing.origin = (left, 195.0)
        title = (
            "With a push the path crosses the horizon"
            if is_pushed
            else "Coasting stays below the point's horizon"
        )
        drawing.word(title, (0.0, 0.0), "title", -85.0, -162.0)
        drawing.add("circle", cx=left, cy=195.0, r=RADIUS_M * 5.0, class_="body")
        point = RADIUS_M * normal
        drawing.line([point - 42 * along, point + 16 * along], "lit dash")
        drawing.word("its horizon", point - 18 * along, "lit", 8.0, -6.0)
        drawing.dot(point, 6.0, "seen" if is_pushed else "lit")
        drawing.word(
            "seen" if is_pushed else "soon dark", point, "seen" if is_pushed else "lit", -12.0, -6.0, "end"
        )
        drawing.word("chief", (0.0, 0.0), "small", 0.0, 5.0, "middle")
        x = np.linspace(46.0, -14.0 if is_pushed else 0.0, 60)
        rise = 0.0115 * (46.0 - x) ** 2 if is_pushed else 0.0 * x
        path = np.c_[x, -13.0 + 0.06 * (46.0 - x) + rise]
        drawing.line(path[:48] if is_pushed else path)
        drawing.dot(path[0])
        drawing.word("deputy", path[0], "small", 0.0, 22.0, "middle")
        if is_pushed:
            drawing.arrow(path[0], path[0] + [-1.0, 14.0], "push")
            drawing.word("push", path[0] + [-1.0, 14.0], "push", 8.0, 2.0)
        else:
            near = path[28]
            foot = near + (RADIUS_M - near @ normal) * normal
            drawing.arrow(near, foot, "muted")
            drawing.word("falls short", near, "small", 4.0, 20.0)
            drawing.dot(near, 3.5)
    return drawing


def axes() -> Drawing:
    """Draw Hill's axes over the Earth."""
    drawing = Drawing(760, 300, "Hill's axes: up, ahead and north", (300.0, 168.0), 1.0)
    drawing.add("path", d="M0,300 A900,900 0 0 1 760,300 Z", class_="shade")
    drawing.add("path", d="M0,215 Q380,95 760,215", class_="muted dash")
    drawing.word("orbit", (420.0, -42.0), "small", -40.0, 0.0)
    drawing.word("Earth", (80.0, -112.0), "small", 0.0, 0.0, "middle")
    for end, text, shift in (
        ((0, 120), "up (i, radial): away from the Earth", (12.0, 4.0)),
        ((150, 12), "ahead (j, along track): as the chief flies", (10.0, -6.0)),
        ((-95, -38), "north (k, cross track): i × j", (-10.0, 18.0)),
    ):
        drawing.arrow(
            (0.0, 0.0), end, "push" if text.startswith("up") else "lit" if text.startswith("ahead") else ""
        )
        drawing.word(text, end, "", *shift, "end" if end[0] < 0 else "start")
    drawing.dot((0.0, 0.0), 15.0, "body")
    drawing.word("chief", (0.0, 0.0), "small", 16.0, 26.0)
    drawing.dot((-70.0, 65.0), 6.0)
    drawing.word("deputy", (-70.0, 65.0), "small", -10.0, -8.0, "end")
    return drawing


def light() -> Drawing:
    """Draw how the lit half of the chief turns: the Sun goes round once an orbit."""
    drawing = Drawing(760, 300, "What is lit, as the Sun goes round", (0.0, 0.0), 8.0)
    angles = np.radians(np.arange(0, 360, 30) + 15)
    last_lit = {}
    for minutes in (40, 20, 0):
        for index, angle in enumerate(angles):
            if math.cos(angle - sun_angle(minutes)) > 0.0:
                last_lit[index] = max(last_lit.get(index, minutes), minutes)
    for column, minutes in enumerate((0, 20, 40)):
        drawing.origin = (140.0 + 240.0 * column, 165.0)
        sun = sun_angle(minutes)
        x, y = drawing.origin
        # up is radial, ahead to the right: an angle from up towards ahead
        turn = math.degrees(sun)
        drawing.add("circle", cx=x, cy=y, r=80.0, class_="shade")
        drawing.add(
            "path",
            d="M-80,0 A80,80 0 0 1 80,0 Z",
            class_="body",
            transform=f"translate({x:.1f} {y:.1f}) rotate({turn:.1f})",
        )
        towards = np.array([math.sin(sun), math.cos(sun)])
        drawing.arrow(10.5 * towards, 14.5 * towards, "lit")
        drawing.word("Sun", 16.0 * towards, "lit", 0.0, 5.0, "middle")
        for index, angle in enumerate(angles):
            position = 8.9 * np.array([math.sin(angle), math.cos(angle)])
            is_lit = math.cos(angle - sun) > 0.0
            leaves = is_lit and last_lit[index] == minutes and minutes < 40
            drawing.dot(position, 7.0 if leaves else 6.0, "lit" if is_lit else "dark")
            if leaves:
                drawing.dot(position, 2.5, "dot")
        drawing.word(
            f"after {minutes} min" if minutes else "at the start", (0.0, 0.0), "", 0.0, 5.0, "middle"
        )
    drawing.word(
        "○ lit   ● dark   ◉ lit now, dark in 20 minutes: what is urgent", (0.0, 0.0), "", -480.0 + 20.0, 120.0
    )
    drawing.word("up is up, ahead is right", (0.0, 0.0), "small", 70.0, -128.0, "end")
    return drawing


def sun_angle(minutes: float) -> float:
    """Return the Sun's angle from up, towards ahead, rad, if it begins ahead and above."""
    return math.radians(50.0) - MEAN_MOTION * 60.0 * minutes


def tour() -> Drawing:
    """Draw the tour of champion_leo with the Sun's angle, from ahead-and-up and from above."""
    mission = compose_experiment(
        ["+experiment=fly", "controller=champion_leo", "world=leo"]
    ).experiment.mission
    fuzzy = source.named("champion_leo", mission).fuzzy
    assert fuzzy is not None  # noqa: S101 - it has rules
    constants = dict(fuzzy.attributes)
    drawing = Drawing(760, 360, "The tour of champion_leo by the Sun's angle", (0.0, 0.0), 2.0)
    angles = np.radians(np.linspace(112.0, -112.0, 97))

    def point_at(angle: float) -> Any:
        waves = [1.0, *(turn(order * angle) for order in (1, 2) for turn in (math.cos, math.sin))]
        return np.array(
            [
                sum(
                    float(constants[f"tour_{part}_{name}_m"]) * wave
                    for name, wave in zip(TOUR_WAVES, waves, strict=True)
                )
                for part in ("radial", "along_track", "cross_track")
            ]
        )

    path = np.array([point_at(angle) for angle in angles])
    views = (
        ("from the north: up, and ahead to the right", 190.0, (1, 0)),
        ("from above: north, and ahead to the right", 570.0, (1, 2)),
    )
    for title, left, (across, up) in views:
        drawing.origin = (left, 195.0)
        drawing.word(title, (0.0, 0.0), "title", 0.0, -165.0, "middle")
        drawing.dot((0.0, 0.0), RADIUS_M * 2.0, "shade")
        drawing.line(path[:, [across, up]])
        for degrees in (112.0, 60.0, 0.0, -60.0, -112.0):
            here = point_at(math.radians(degrees))[[across, up]]
            drawing.dot(here, 5.0)
            drawing.word(f"{degrees:.0f}°", here, "lit", 9.0, -7.0)
    drawing.word(
        "The Sun at 0° is above the chief; beyond ±112° the Earth hides it and the deputy coasts",
        (0.0, 0.0),
        "small",
        -190.0,
        152.0,
        "middle",
    )
    return drawing


def stop() -> Drawing:
    """Draw a flight with and without the safety layer: its distance from the chief against time."""
    words = ("+experiment=evaluate", f"controller={STOPPED}", "sun=random")
    drawing = Drawing(
        760, 340, "The safety layer's stop before the keep-out sphere", (70.0, 290.0), (43.0, 3.2)
    )
    x, y = drawing.at((0.0, 15.0))
    drawing.add("rect", x=x, y=y, width=645, height=15.0 * 3.2, class_="shade", opacity="0.45")
    drawing.word("keep-out: 15 m", (END_MIN, 15.0), "small", -6.0, -6.0, "end")
    drawing.line([(0.0, RADIUS_M), (END_MIN, RADIUS_M)], "muted dash")
    drawing.word("the chief's surface", (END_MIN, RADIUS_M), "small", -6.0, 17.0, "end")
    for kind in ("none", "filter"):
        experiment = compose_experiment([*words, f"safety={kind}"]).experiment
        (start,) = evaluation_scenarios(experiment, [STOPPED_CASE])
        log = fly_logged(experiment.mission, source.named(STOPPED, experiment.mission), start)
        distance = np.linalg.norm(log.position_m, axis=1)
        minutes = np.arange(len(distance)) * experiment.mission.control_period_s / 60.0
        is_shown = (minutes <= END_MIN) & (distance <= TOP_M)
        drawing.line(np.c_[minutes, distance][is_shown], "push dash" if kind == "none" else "")
        for k in np.flatnonzero(log.safety_limit):
            drawing.dot((minutes[k], distance[k]), 3.2, "seen")
        nearest = int(np.argmin(distance))
        point, text = (minutes[nearest], distance[nearest]), f"{distance[nearest]:.1f} m"
        if kind == "none":
            drawing.word(f"without the layer: {text}", point, "push", 0.0, 20.0, "end")
        else:
            drawing.word(f"with it: {text}", point, "seen", 14.0, 8.0)
    drawing.line([(0.0, 0.0), (END_MIN, 0.0)], "muted")
    drawing.line([(0.0, 0.0), (0.0, TOP_M)], "muted")
    for minute in range(0, int(END_MIN) + 1, 3):
        drawing.word(f"{minute}", (float(minute), 0.0), "small", 0.0, 17.0, "middle")
    drawing.word("minutes", (END_MIN, 0.0), "small", 0.0, 33.0, "end")
    for metres in (20, 40, 60):
        drawing.word(f"{metres} m", (0.0, float(metres)), "small", -6.0, 4.0, "end")
    drawing.word(
        "Distance from the chief; dots: the layer changes the force", (0.0, TOP_M), "title", 0.0, -10.0
    )
    return drawing


TOP_M, END_MIN = 80.0, 15.0
#: a controller, and a case in which it passes the chief at arm's length
STOPPED, STOPPED_CASE = "lqr", 369
DRAWINGS: dict[str, Callable[[], Drawing]] = {
    each.__name__: each
    for each in (
        *(motion, aim, axes, light, tour, stop, *flown_drawings.DRAWINGS),
        *(mission_drawing.missions, onboard_drawing.way_to_c),
    )
}


def main() -> None:
    """Write all drawings."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWINGS.items():
        (FOLDER / f"{name}.svg").write_text(draw().text(), encoding="utf-8")


if __name__ == "__main__":
    main()
