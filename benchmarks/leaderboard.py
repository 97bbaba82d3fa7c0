"""Rules, plans and learners on the same held-out starts: ``python -m benchmarks leaderboard``.

Learners are those of `benchmarks.contenders`, some of them in an environment with Stable-Baselines3; each
trains from several seeds, for at most so many control periods. Their intervals are over trainings (Student's
t), those of the others over starts. What the product's rules were trained for, `benchmarks.budget` tells.

``--rows FILE`` keeps what was judged: a row each controller or policy. What it holds is not trained again, so
that a run goes on where another ended, or only prints. ``--page FILE`` writes the table into a page, behind
its line `MARK`; ``--picture FILE`` draws fuel and success over control periods and processor time.
"""

import argparse
import json
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.contenders import CONTENDERS, VARIANTS, told_of
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.statistics import statistic
from pipeline.flight.fly.simulation import fly_all
from pipeline.gym.judge import BY_RULES, judge
from pipeline.gym.suite import FLEETS, TASKS, VERSION
from pipeline.scenarios import validation_scenarios
from plain_files.document import Document, Table, text
from plain_files.file_access import write_text

#: controllers that come with the product: the guess that searches begin from, rules, rules that park,
#: foresight, and a regulator
FIXED: Final = ("aim", "champion_27", "champion_27_parked", "champion_27_rehearsed", "lqr")
#: stands before the table of a page
MARK: Final = "<!-- leaderboard -->"
#: what a flight costs that fails, m/s, where settings are compared
FAILED_M_S: Final = 1.0
#: starts of that comparison, and the seed of its trainings, which no others have
TUNING_CASES, TUNING_SEED = 300, 101
#: columns: what is told of each, and its decimals
COLUMNS: Final[Mapping[str, tuple[str, int]]] = {
    "delta_v_m_s": ("delta-v (m/s)", 3),
    SUCCESS: ("success (%)", 1),
    "violated": ("outside (%)", 1),
    "stays_orbit": ("stays an orbit (%)", 1),
    "regret_m_s": ("beyond the best plan (m/s)", 3),
}
#: between which their means are, if not shares
LIMITS: Final = {"delta_v_m_s": (0.0, np.inf), "regret_m_s": (-np.inf, np.inf)}
Interval = tuple[float, float | None, float | None]


def figures_of(judged: Mapping[str, Any]) -> dict[str, Interval]:
    """Return the mean of each column with its interval over starts; shares in percent."""
    measures = judged["figures"] | judged["regret"]
    figures: dict[str, Interval] = {}
    for name in COLUMNS:
        if (measure := measures.get(name)) is None:
            continue
        if "fraction" in measure:
            figures[name] = tuple(100.0 * measure[part] for part in ("fraction", "low", "high"))
        else:
            figures[name] = (measure["mean"], measure["low"], measure["high"])
    return figures


def over_trainings(each: Sequence[Mapping[str, Interval]]) -> dict[str, Interval]:
    """Return the mean over trainings with its 95 % interval; none of a single one."""
    figures: dict[str, Interval] = {}
    for name in each[0]:
        limits = LIMITS.get(name, (0.0, 100.0))
        spread = statistic(np.array([training[name][0] for training in each]), 95.0, *limits)
        figures[name] = (spread.mean, spread.low, spread.high)
    return figures


def cell(figures: Mapping[str, Interval], name: str) -> str:
    """Return a figure with its interval."""
    if name not in figures:
        return "-"
    decimals, (mean, low, high) = COLUMNS[name][1], figures[name]
    if low is None or high is None:
        return f"{mean:.{decimals}f}"
    return f"{mean:.{decimals}f} ({low:.{decimals}f} to {high:.{decimals}f})"


@dataclass
class Rows:
    """What was judged, a row each: of a controller, or of a policy with how it was trained.

    Parameters
    ----------
    path : Path, optional
        The file that keeps them.
    """

    path: Path | None
    rows: list[dict[str, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.path is not None and self.path.exists():
            self.rows = json.loads(self.path.read_text(encoding="utf-8"))

    def of(self, **facts: Any) -> list[dict[str, Any]]:
        """Return the rows with these facts."""
        return [row for row in self.rows if all(row.get(name) == value for name, value in facts.items())]

    def add(self, judged: Mapping[str, Any], **facts: Any) -> dict[str, Any]:
        """Add and keep a row of what `pipeline.gym.judge.judge` gives."""
        row = facts | {
            "suite": judged["suite"],
            "sha256": judged["controller"]["sha256"],
            "figures": figures_of(judged),
            "fuel_by_rules_percent": judged.get(BY_RULES[0]),
        }
        self.rows.append(row)
        if self.path is not None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            lines = ",\n".join(json.dumps(each) for each in self.rows)
            write_text(self.path, f"[\n{lines}\n]\n")
        return row


def learn(rows: Rows, name: str, task: str, cases: int, budget: float, seed: int, folder: Path) -> None:
    """Train one policy, unless its rows are there, and judge it and those written on the way."""
    facts = {"name": name, "task": task, "cases": cases, "budget": budget, "seed": seed}
    if rows.of(**facts, is_last=True):
        return
    title, _, train = CONTENDERS[name]
    print(f"  {title}, {budget:g} control periods, seed {seed}", file=sys.stderr, flush=True)
    folder /= f"{name}-{budget:g}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)  # of a training that was cut off
    paths = train({}, task, budget, seed, folder)
    rows.rows = [row for row in rows.rows if row not in rows.of(**facts)]
    for path in paths:
        told = told_of(path)
        kept = {"periods": told["done"], "processor_s": round(told["processor_s"], 1)}
        row = rows.add(judge(str(path), task, cases), **facts, **kept, is_last=path == paths[-1])
    print(f"    {cell(row['figures'], 'delta_v_m_s')} m/s", file=sys.stderr, flush=True)


def table(rows: Rows, task: str, cases: int) -> str:
    """Return a row of each controller, and of each learner and budget."""
    judged = rows.of(task=task, cases=cases)
    body = []
    for row in judged:
        if "budget" not in row:
            by_rules = row["fuel_by_rules_percent"]
            figures = [cell(row["figures"], column) for column in COLUMNS]
            told = "" if by_rules is None else f"{by_rules:.{BY_RULES[2]}f}"
            body.append([row["name"], "", "", *figures, told])
    for budget in sorted({row["budget"] for row in judged if "budget" in row}):
        for name, (title, *_) in CONTENDERS.items():
            of_each = rows.of(task=task, cases=cases, name=name, budget=budget, is_last=True)
            if of_each:
                figures_of_all = over_trainings([row["figures"] for row in of_each])
                seconds = np.mean([row["processor_s"] for row in of_each])
                periods = max(row["periods"] for row in of_each)
                cells = [cell(figures_of_all, column) for column in COLUMNS]
                label = f"{title}, {len(of_each)} training{'s' * (len(of_each) > 1)}"
                body.append([label, f"{periods:,}", f"{seconds:.0f}", *cells, ""])
    heads = ["", "control periods", "processor time (s)", *(words for words, _ in COLUMNS.values())]
    heads.append(BY_RULES[1])
    return text.write_markdown(Document([Table(heads, body, numbers=range(1, len(heads)))]))


def tune(names: Sequence[str], task: str, budget: float, folder: Path) -> None:
    """Train one policy by each of the settings that may be tried, and print what their flights cost."""
    words = [*TASKS[task], f"monte_carlo.num_cases={TUNING_CASES}"]
    experiment: Any = compose_experiment(["+experiment=evaluate", "controller=coast", *words]).experiment
    mission, starts = experiment.mission, validation_scenarios(experiment, TUNING_CASES)
    for name in names:
        title, _, train = CONTENDERS[name]
        for number, changes in enumerate(VARIANTS[name]):
            *_, path = train(changes, task, budget, TUNING_SEED, folder / f"tuned-{name}-{number}")
            flown = fly_all(mission, named(str(path), mission), starts)
            is_success = flown.is_success(mission.inspection_threshold_percent) & ~flown.is_violated
            cost = flown.delta_v_m_s.mean() + FAILED_M_S * (1.0 - is_success.mean())
            told = ", ".join(f"{key}={value}" for key, value in changes.items()) or "as it is"
            print(
                f"{title}: {told}: {cost:.3f}, of which {flown.delta_v_m_s.mean():.3f} m/s; "
                f"success {100.0 * is_success.mean():.1f} %",
                flush=True,
            )


def with_table(page: str, made: str) -> str:
    """Return a page with its table behind `MARK` replaced by another.

    Raises
    ------
    ValueError
        If it has none there.
    """
    pattern = re.compile(rf"({re.escape(MARK)}\n\n)(?:\|.*\n)+")
    if not pattern.search(page):
        raise ValueError(f"the page has no table behind {MARK}; write that line, an empty one and a table")
    return pattern.sub(lambda match: match[1] + made, page)


def main(arguments: Sequence[str]) -> int:
    """Judge all of them, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks leaderboard", description=__doc__)
    parser.add_argument(
        "--budget", type=float, action="append", help="control periods of a training; 1e6 unless given"
    )
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each learner; 0 leaves them out")
    parser.add_argument(
        "-l", "--learner", action="append", choices=CONTENDERS, help="all of them unless given"
    )
    parser.add_argument(
        "-c", "--controller", action="append", help=f"beside them; {', '.join(FIXED)} unless given"
    )
    parser.add_argument("--cases", type=int, default=1000, help="the first so many held-out starts")
    parser.add_argument("--task", choices=TASKS, default="paper")
    parser.add_argument("--folder", type=Path, default=Path("outputs/leaderboard"), help="of the policies")
    parser.add_argument("--rows", type=Path, help="what was judged, kept; in the folder unless given")
    parser.add_argument("--page", type=Path, help="a page of Markdown whose table is written anew")
    parser.add_argument("--picture", type=Path, help="draws what trainings come to with time")
    parser.add_argument("--tune", action="store_true", help="compare each learner's settings instead")
    options = parser.parse_args(arguments)
    names, budgets = options.learner or list(CONTENDERS), options.budget or [1e6]
    lacking = [name for name in names if find_spec(CONTENDERS[name][1]) is None]
    if lacking and (options.seeds or options.tune):
        package = CONTENDERS[lacking[0]][1].replace("_", "-")
        parser.error(
            f"{', '.join(lacking)} need {package}; install it: python -m pip install {package}, or choose "
            "other learners by -l"
        )
    if options.task in FLEETS and (options.seeds or options.tune):
        parser.error(
            f"task {options.task} is of fleets, and these learners train one deputy; give --seeds 0, and "
            f"judge their policies by python -m pipeline.gym.judge --task {options.task}"
        )
    rows = Rows(options.rows or options.folder / "rows.json")
    if options.tune:
        tune(names, options.task, budgets[0], options.folder)
        return 0
    for name in options.controller or FIXED:
        if not rows.of(name=name, task=options.task, cases=options.cases):
            print(f"  {name}", file=sys.stderr, flush=True)
            judged = judge(name, options.task, options.cases)
            rows.add(judged, name=name, task=options.task, cases=options.cases)
    for budget, name, seed in product(budgets, names, range(1, options.seeds + 1)):
        learn(rows, name, options.task, options.cases, budget, seed, options.folder)
    made = table(rows, options.task, options.cases)
    print(f"{VERSION}, {options.task}, {options.cases} starts\n\n{made}")
    if options.page is not None:
        write_text(options.page, with_table(options.page.read_text(encoding="utf-8"), made))
    if options.picture is not None:
        from benchmarks.curves import draw  # noqa: PLC0415 - brings matplotlib

        titles = {name: title for name, (title, *_) in CONTENDERS.items()}
        draw(rows.of(task=options.task, cases=options.cases), titles, options.picture)
    return 0
