"""Small runs of every kind, whose results are stored: what they print, and what they write."""

import contextlib
import io
import re

from pipeline.command_line.config import compose_experiment
from pipeline.report.figures import style
from tests.pipeline.proof.cases import NEAR
from tests.pipeline.stages.cases import carried_out

FEW = ("monte_carlo.workers=1", "optimizer.workers=1", "report.dots_per_inch=40")
DRAWN = (
    "+dispersions.deputy.mass_kg={kind:normal,mean:12,std:0.4}",
    "+dispersions.sensor.half_angle_deg={kind:uniform,low:12,high:18}",
)
EVALUATED = (
    "controller=champion_27",
    "sun=random",
    "inspection_threshold_percent=30",
    "deputy.max_distance_m=120",
)
ASSURED = (
    "assurance.num_cases=24",
    "assurance.searches=2",
    "assurance.search_starts=6",
    "assurance.workers=1",
)
ASSURED += ("assurance.search_population=5", "assurance.search_generations=2", "assurance.domain_cases=4")
OPTIMUM = (
    "+experiment=optimum",
    "optimum.points=30",
    "optimum.restarts=2",
    "optimum.kicks=0",
    "optimum.workers=1",
)
#: by name the stages and what is typed
RUNS = {
    "evaluation": (
        ("scenario", "evaluate", "record"),
        (
            "+experiment=evaluate",
            *EVALUATED,
            *DRAWN,
            "safety=filter",
            "duration_s=600",
            "monte_carlo.num_cases=9",
        ),
    ),
    "fleet": (
        ("scenario", "evaluate", "record"),
        (
            "+experiment=evaluate_fleet",
            *EVALUATED,
            "fleet.deputies=3",
            "fleet.lost_percent=20",
            "duration_s=600",
            "monte_carlo.num_cases=5",
        ),
    ),
    "docking": (
        ("evaluate", "record"),
        (
            "+experiment=evaluate",
            "problem=docking",
            "controller=champion_docking",
            "duration_s=900",
            "monte_carlo.num_cases=5",
        ),
    ),
    "comparison": (
        ("compare",),
        (
            "+experiment=baselines",
            "compare.controllers=[coast,lqr,champion_27]",
            "sun=random",
            "duration_s=600",
            "monte_carlo.num_cases=6",
        ),
    ),
    "worlds": (
        ("compare",),
        (
            "+experiment=baselines",
            "compare.controllers=[lqr,champion_27]",
            "+compare.worlds.near={sensor:{max_range_m:60}}",
            "+compare.worlds.high={sun:{elevation_deg:30}}",
            "compare.suns=[random]",
            "duration_s=600",
            "monte_carlo.num_cases=6",
        ),
    ),
    "training": (
        ("scenario", "train"),
        (
            "+experiment=train_paper",
            "optimizer.population_size=6",
            "optimizer.generations=3",
            "duration_s=300",
            "starts.num_cases=8",
        ),
    ),
    "optimum": (("optimum",), (*OPTIMUM, "sun=random", "monte_carlo.num_cases=2")),
    "assurance": (("assure",), ("+experiment=assure", "controller=champion_any_sun", "sun=random", *ASSURED)),
    "proof": (("prove",), NEAR),
}
#: what differs from run to run, machine to machine or version to version
UNSTEADY = re.compile(r"(?:(?<=cases in )|(?<=judged in ))[\d.]+ s|[\d.]+ (MB|kB|bytes)|, \d+ (s|min) left")
#: that tell how far something is
PROGRESS = re.compile(r"^ *(flights|followed|solved|generation) \d+/\d+.*\n", re.MULTILINE)


def made(folder, name):
    """Carry out the stages of a run; return the experiment and what they printed."""
    stages, words = RUNS[name]
    job, printed = compose_experiment([*words, *FEW]), io.StringIO()
    with contextlib.redirect_stderr(printed), contextlib.redirect_stdout(printed):
        done = carried_out(job, folder, *stages)
    lines = re.sub(r".*\r", "", printed.getvalue().replace(str(folder), "RUN"))
    return done.experiment, UNSTEADY.sub("SO MUCH", PROGRESS.sub("", lines))


def without_pictures(monkeypatch):
    """Save empty pictures, as drawing takes longest."""
    empty = style.Picture(b"", '<svg width="1" viewBox="0 0 1 1"></svg>')
    monkeypatch.setattr(style, "save", lambda *_: empty)
