"""Pages that are a player alone, and what the product flies of their cases."""

import base64
from functools import cache

import numpy as np

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.control.controller import PlanningController
from pipeline.flight.fly.simulation import fly_logged
from pipeline.player.flown import looks_ahead
from pipeline.player.panel import panel
from pipeline.player.runs import Carried, CaseColumn, PlayedCases, PlayedPage, PlayedRun
from pipeline.report.case_measures import MEASURES
from pipeline.report.played import carried_of
from pipeline.report.scene import recorded_table
from pipeline.scenarios import evaluation_scenarios
from plain_files.document.html import policy

NUM_CASES = 16
#: tenths of a second that a busy machine may take for a picture
PAINTS = 100
NUMBER = f"monte_carlo.num_cases={NUM_CASES}"
#: a module flies any mission of its types: controllers, limits, masses, durations and layers differ
FLOWN = (
    ("champion_27",),
    ("champion_27", "safety=filter", "deputy.mass_kg=20", "duration_s=2400"),
    ("champion_27_parking",),
)
#: light other than the paper's
ELEVATED = "sun.elevation_range_deg=[-30,30]"
#: cases of controllers that look ahead or plan, each of which takes long to choose
NUM_AHEAD = 4
TURNING = "chief.initial_angular_velocity_rad_s=[0.001,0,0.002]"
#: bytes of an array as text
TEXT = """array => {
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength); let out = "";
    for (const byte of bytes) out += String.fromCharCode(byte);
    return btoa(out);
}"""
LOG = """async row => {
    const side = player.sides[0], text = TEXT;
    const log = await side.ask(side.caseOf(row));
    return Object.fromEntries(Object.entries(log).map(([name, array]) => [name, text(array)]));
}""".replace("TEXT", TEXT)


@cache
def run_of(*words):
    """Return a mission, a controller, fresh starts, and their flights as the product flies and logs them."""
    name, *others = words
    job = compose_experiment(
        [
            "+experiment=evaluate",
            f"controller={name}",
            *(() if any(word.startswith(("world=", "sun=")) for word in others) else ("sun=random",)),
            "seed=91",
            f"monte_carlo.num_cases={NUM_CASES}",
            *others,
        ]
    ).experiment
    controller = source.load(job.controller, job.mission)
    chooses = looks_ahead(controller) or isinstance(controller, PlanningController)
    starts = evaluation_scenarios(job)[: NUM_AHEAD if chooses else NUM_CASES]
    return job.mission, controller, starts, [fly_logged(job.mission, controller, start) for start in starts]


def cases_of(logs):
    """Return cases as a player takes them."""
    far = np.array([np.linalg.norm(log.position_m, axis=1) for log in logs])
    fuel = np.array([log.delta_v_m_s[-1] for log in logs])
    rate = np.array([100.0 * log.is_inspected[-1].mean() for log in logs])
    columns = [
        CaseColumn("delta_v_m_s", "Δv, m/s", 3, fuel),
        CaseColumn("inspection_rate_percent", "inspected, %", 1, rate),
        CaseColumn("min_distance_m", "nearest, m", 1, far.min(axis=1)),
        CaseColumn("max_distance_m", "farthest, m", 1, far.max(axis=1)),
    ]
    return PlayedCases(np.arange(len(logs)) + 100, [rate >= 95.0], columns, MEASURES["inspection"].plots)


@cache
def page_of(*words, recorded=()):
    mission, controller, starts, logs = run_of(*words)
    run = PlayedRun("A", "trial", mission, controller, starts, [3], "fly RUN case=CASE")
    carried = carried_of(run)
    if recorded:
        tables = {row: recorded_table(logs[row], controller, mission) for row in recorded}
        carried = Carried(recorded=tables, why="it is a trial")
    return as_page(panel(PlayedPage("", "trial", [(run, carried)], cases_of(logs), 3)))


def as_page(shown):
    """Return a panel as a page of its own."""
    head = f'<!doctype html><html lang="en"><meta charset="utf-8">{policy(scripts=shown.scripts, flies=True)}'
    head += '<meta name="viewport" content="width=device-width"><title>A run</title>'
    ours = ":root { color-scheme: light dark; } body { margin: 8px; background: var(--card); }"
    body = f"<body class=page><main><h1>A run</h1><h2>Cases</h2>{shown.body}</main>"
    return f"{head}<style>{ours} {shown.style}</style>{body}<script>{shown.script}</script>"


def shows(page, number):
    page.wait_for_function(
        """number => player.cases.numbers[player.row] === number
            && player.part('which').textContent.endsWith(`Case ${number}`)""",
        arg=number,
    )


def decoded(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)
