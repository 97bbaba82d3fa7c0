"""Drawings of flights and of what decides them: paths, errors, distances, a rule's slice, genes, lanes."""

import math
from collections.abc import Sequence

import numpy as np

from docs.scripts.drawing import Drawing
from fis_tools.engines.compiler import compile
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.goals import flights
from pipeline.flight.state.log import FlightLog
from pipeline.optimum.solved import solved_for
from pipeline.scenarios import evaluation_scenarios


def flown(*words: str, case: int = 0) -> FlightLog:
    """Return the logged flight of a case of an evaluation."""
    job = compose_experiment(["+experiment=evaluate", *words])
    controller = source.load(job.config["controller"], job.experiment.mission)
    (start,) = evaluation_scenarios(job.experiment, [case])
    return flights.fly_logged(job.experiment.mission, controller, start)


def frame(drawing: Drawing, x: Sequence[float], y: Sequence[float], words: tuple[str, str]) -> None:
    """Draw axes with their ticks: the numbers along each, and what they are of."""
    drawing.line([(x[0], y[0]), (x[-1], y[0])], "muted")
    drawing.line([(x[0], y[0]), (x[0], y[-1])], "muted")
    for number in x:
        drawing.word(f"{number:g}", (number, y[0]), "small", 0.0, 17.0, "middle")
    for number in y:
        drawing.word(f"{number:g}", (x[0], number), "small", -6.0, 4.0, "end")
    drawing.word(words[0], (x[-1], y[0]), "small", 0.0, 34.0, "end")
    drawing.word(words[1], (x[0], y[-1]), "small", 0.0, -10.0)


def slice_of_rules() -> Drawing:
    """Draw what a rule table answers along one input, and what the dead band leaves out."""
    mission = compose_experiment(["+experiment=fly", "controller=champion_27"]).experiment.mission
    fuzzy = source.named("champion_27", mission).fuzzy
    assert fuzzy is not None  # noqa: S101 - it has rules
    system, dead_band = fuzzy.systems[0], 1000.0 * float(dict(fuzzy.attributes)["dead_band_force_x_n"])
    inputs = np.linspace(-0.06, 0.06, 121)
    force = 1000.0 * compile(system)(np.c_[inputs, np.zeros_like(inputs)])[:, 0]
    drawing = Drawing(
        760, 300, "From a signal to a force: a slice of a rule table", (390.0, 150.0), (5000.0, 0.85)
    )
    x, y = drawing.at((-0.06, dead_band))
    drawing.add("rect", x=x, y=y, width=600.0, height=2 * 0.85 * dead_band, class_="shade", opacity="0.45")
    drawing.line([(-0.06, 0.0), (0.06, 0.0)], "muted")
    drawing.line([(0.0, -130.0), (0.0, 130.0)], "muted")
    drawing.line(np.c_[inputs, force])
    for peak, words in ((-0.053, "negative"), (0.0, "zero"), (0.053, "positive")):
        drawing.word(words, (peak, 0.0), "lit", 0.0, 16.0, "middle")
        drawing.dot((peak, float(np.interp(peak, inputs, force))), 4.5)
    drawing.word("dead band: not fired", (-0.06, dead_band), "small", 6.0, 16.0)
    drawing.word("force_x, mN", (0.0, 130.0), "small", 6.0, 4.0)
    drawing.word("aim_radial, m/s", (0.06, 0.0), "small", 0.0, 34.0, "end")
    for number in (-100, 100):
        drawing.word(str(number), (0.0, float(number)), "small", -6.0, 4.0, "end")
    return drawing


def paths_from_one_start() -> Drawing:
    """Draw how a rule base, a regulator and linear programs fly from the same start, from the north."""
    drawing = Drawing(760, 340, "Three controllers from one start", (470.0, 170.0), 1.6)
    drawing.dot((0.0, 0.0), 17.5, "shade")
    drawing.word("chief", (0.0, 0.0), "small", 0.0, 4.0, "middle")
    kinds = (("champion_27", ""), ("lqr", "push dash"), ("receding_horizon", "lit dash"))
    for row, (name, kind) in enumerate(kinds):
        log = flown(f"controller={name}", "sun=random", case=3)
        drawing.line(log.position_m[:, [1, 0]], kind)
        text = f"{name}: {log.delta_v_m_s[-1]:.2f} m/s, {log.is_inspected[-1].sum()} points"
        drawing.word(text, (-285.0, -60.0), kind.split()[0] if kind else "", 0.0, 20.0 * row)
    drawing.dot(log.position_m[0, [1, 0]], 5.0)
    drawing.word("start", log.position_m[0, [1, 0]], "small", 9.0, 4.0)
    drawing.arrow((140.0, 62.0), (170.0, 62.0))
    drawing.word("ahead", (170.0, 62.0), "small", -26.0, 18.0)
    drawing.arrow((140.0, 62.0), (140.0, 92.0))
    drawing.word("up", (140.0, 92.0), "small", -18.0, 4.0)
    return drawing


def rules_and_plan() -> Drawing:
    """Draw the fuel spent over one hour by rules, with foresight, and by the best plan for the same start."""
    drawing = Drawing(
        760, 310, "Fuel of rules, of foresight and of a plan, for one start", (70.0, 260.0), (10.8, 400.0)
    )
    frame(drawing, range(0, 61, 10), (0.0, 0.1, 0.2, 0.3, 0.4, 0.5), ("minutes", "delta-v, m/s"))
    experiment = compose_experiment(["+experiment=evaluate", "sun=random"]).experiment
    mission, solved = experiment.mission, solved_for(experiment)
    for name, called, kind in (
        ("champion_27", "27 rules", ""),
        ("champion_27_rehearsed", "with foresight", "push"),
    ):
        log = flights.fly_logged(mission, source.named(name, mission), solved.scenarios[SOLVED_ROW])
        minutes = np.arange(len(log.delta_v_m_s)) * mission.control_period_s / 60.0
        drawing.line(np.c_[minutes, log.delta_v_m_s], kind)
        words = f"{called}, {log.is_inspected[-1].sum()} points"
        drawing.word(words, (60.0, log.delta_v_m_s[-1]), kind, 0.0, -8.0, "end")
    pushes = np.abs(solved.plan(SOLVED_ROW, mission)).sum(axis=1)
    spent = np.r_[0.0, np.cumsum(pushes)] * mission.control_period_s / mission.deputy.mass_kg
    drawing.line(np.c_[minutes, spent], "lit dash")
    needed = int(solved.cases["points_asked"][SOLVED_ROW])
    drawing.word(f"the best plan found, {needed} points", (60.0, spent[-1]), "lit", 0.0, 17.0, "end")
    return drawing


def estimate() -> Drawing:
    """Draw the error of the deputy's estimate in world=leo, and what its filter expects of it."""
    log = flown("controller=champion_leo", "world=leo", case=1)
    error = np.linalg.norm(log.estimate[:, :3] - log.position_m, axis=1)
    deviation = np.sqrt(np.trace(log.estimate_covariance[:, :3, :3], axis1=1, axis2=2))
    minutes = np.linspace(0.0, len(error) * 10.0 / 60.0, len(error))
    top = math.ceil(2.0 * float(max(error.max(), deviation.max()))) / 2.0
    drawing = Drawing(
        760,
        300,
        "The error of the estimate, and what the filter expects",
        (60.0, 250.0),
        (640.0 / minutes[-1], 200.0 / top),
    )
    frame(drawing, range(0, int(minutes[-1]) + 1, 20), np.linspace(0.0, top, 3), ("minutes", "m"))
    drawing.line(np.c_[minutes, error], "push")
    drawing.line(np.c_[minutes, deviation], "dash")
    drawing.word("error of the estimated position", (minutes[-1], top), "push", 0.0, 4.0, "end")
    drawing.word("dashed: the filter's standard deviation", (minutes[-1], top), "", 0.0, 24.0, "end")
    return drawing


def docking_flights() -> Drawing:
    """Draw docking from forty starts: the distance from the goal falls below half a metre."""
    job = compose_experiment(
        ["+experiment=evaluate", "controller=champion_docking", "problem=docking", "monte_carlo.num_cases=40"]
    )
    controller = source.load(job.config["controller"], job.experiment.mission)
    drawing = Drawing(760, 300, "Docking from forty starts", (60.0, 250.0), (640.0 / 40.0, 1.45))
    frame(drawing, range(0, 41, 10), (0, 50, 100, 150), ("minutes", "distance from the goal, m"))
    for start in evaluation_scenarios(job.experiment):
        log = flights.fly_logged(job.experiment.mission, controller, start)
        distance = np.linalg.norm(log.position_m, axis=1)
        minutes = np.arange(len(distance)) * job.experiment.mission.control_period_s / 60.0
        is_shown = (minutes <= 40.0) & (distance <= 155.0)
        # ten samples are half a pixel wide
        drawing.line(np.c_[minutes, distance][is_shown][::10], "muted")
    return drawing


def genes() -> Drawing:
    """Draw what training may move in a readable system: ranges, and what each rule concludes."""
    drawing = Drawing(760, 250, "What a genome holds of a readable system", (40.0, 170.0), (5.6, 90.0))
    for left in (0.0, 68.0):
        drawing.line([(left, 0.0), (left + 54.0, 0.0)], "muted")
        for peak in (0.0, 27.0, 54.0):
            corners = [(max(peak - 27.0, 0.0), 0.0), (peak, 1.0), (min(peak + 27.0, 54.0), 0.0)]
            shape = [(left + x, y if x != peak else 1.0) for x, y in corners]
            drawing.line(shape)
        drawing.arrow((left + 54.0, -0.25), (left + 60.0, -0.25), "push")
        drawing.arrow((left, -0.25), (left - 6.0, -0.25), "push")
    drawing.word(
        "an input: one gene stretches its range, its terms keep their shape", (0.0, 1.0), "", 0.0, -20.0
    )
    drawing.word("an output likewise", (68.0, 1.0), "", 0.0, -20.0)
    drawing.word("and a gene for each rule: which term it concludes", (0.0, 0.0), "push", 0.0, 62.0)
    return drawing


def lanes() -> Drawing:
    """Draw flights side by side in the lanes of a vector, one instruction for all."""
    drawing = Drawing(760, 220, "Flights side by side in the lanes of a vector", (40.0, 60.0), 1.0)
    for row, words in enumerate(
        ("position of flights 0 to 7", "velocity of flights 0 to 7", "position + velocity, one instruction")
    ):
        y = 44.0 * row
        for lane in range(8):
            drawing.add(
                "rect",
                x=40.0 + 52.0 * lane,
                y=30.0 + y,
                width=48,
                height=32,
                class_="seen-box" if row == 2 else "",
            )
            drawing.add(
                "text", f"{lane}", x=64.0 + 52.0 * lane, y=51.0 + y, class_="small", text_anchor="middle"
            )
        drawing.add("text", words, x=472.0, y=51.0 + y)
    drawing.add(
        "text",
        "A flight's numbers do not depend on its neighbours in the vector.",
        x=40.0,
        y=190.0,
        class_="small",
    )
    return drawing


#: of the plans that ship, one of about their mean fuel
SOLVED_ROW = 0
DRAWINGS = (slice_of_rules, paths_from_one_start, rules_and_plan, estimate, docking_flights, genes, lanes)
