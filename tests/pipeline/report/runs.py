"""Folders of small runs, made without training: flights of ten minutes, a hand-written logbook."""

from dataclasses import replace
from pathlib import Path

from fis_tools.formats import serialize
from pipeline.command_line.config import compose_experiment
from pipeline.run import artifacts, tables
from pipeline.settings.experiment import Experiment
from pipeline.stages import report
from tests.pipeline.stages.cases import carried_out
from tests.places import PROJECT

SMALL = ("monte_carlo.num_cases=30", "duration_s=600", "report.dots_per_inch=40", "optimizer.workers=1")
HOSTILE = '<script>alert("x")</script> & $\\frac{1}$'

LOGBOOK_COLUMNS = (
    *("round", "generation", "evaluations", "best", "mean", "std", "step_size"),
    *("delta_v_m_s", "points", "outside", "outside_m", "short"),
)

#: names of the sections of the page, in order
SECTIONS = (
    *("summary", "control", "training", "evaluation", "optimum"),
    *("distributions", "convergence", "controller", "recordings", "provenance"),
)


def run_of(folder: Path, stages: tuple[str, ...], *overrides: str) -> Experiment:
    """Run stages in a folder; return the experiment of its configuration."""
    return carried_out(compose_experiment([*overrides, *SMALL]), folder, *stages).experiment


def small_controller(folder: Path) -> Path:
    """Write a controller that has but the first of the paper's three systems, for fewer pictures."""
    paper = serialize.load(PROJECT / "conf" / "controller" / "paper.yaml")
    single_axis = replace(paper, name="one_axis", systems=paper.systems[:1], provenance=(("seed", "1"),))
    path = folder / "one_axis.json"
    path.write_text(serialize.dump_json(single_axis))
    return path


def write_training(folder: Path) -> None:
    """Write what a training of two rounds of three generations could have left behind."""
    small_controller(folder).rename(folder / artifacts.CHAMPION)
    rows = []
    for row in range(6):
        best = 10.0 ** (5 - row)
        spread = [best, 9 * best, best, 0.1]
        rows.append([row // 3, row % 3, 9 * row, *spread, 6.0 - row, 90 + row, 5 - row, 1, 3])
    tables.write_csv(folder / artifacts.LOGBOOK, LOGBOOK_COLUMNS, rows)


def page_of(experiment: Experiment, folder: Path) -> str:
    report.run(experiment, folder)
    return (folder / artifacts.REPORT).read_text(encoding="utf-8")
