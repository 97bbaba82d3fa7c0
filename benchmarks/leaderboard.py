"""Rules, plans and learners on the same held-out starts: ``python -m benchmarks leaderboard``.

Learners train by PPO (`benchmarks.ppo`, in an environment with Stable-Baselines3), each from several seeds,
for at most so many control periods. Their intervals are over trainings (Student's t), those of the others
over starts. What rules were trained for, `benchmarks.budget` tells.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.statistics import statistic
from pipeline.gym import task_of
from pipeline.gym.judge import BY_RULES, fired_by_rules, judge
from pipeline.gym.suite import TASKS, VERSION
from plain_files.document import Document, Table, text
from plain_files.file_access import write_text

#: controllers that come with the product: rules, rules that park, foresight, and a regulator
FIXED: Final = ("champion_27", "champion_27_parked", "champion_27_rehearsed", "lqr")
#: settings of `benchmarks.ppo`, and what words they add to the task's
LEARNED: Final[Mapping[str, tuple[str, ...]]] = {"minute": (), "ours": ("deputy.max_force_n=0.05",)}
#: columns: what is told of each, and its decimals
COLUMNS: Final[Mapping[str, tuple[str, int]]] = {
    "delta_v_m_s": ("delta-v (m/s)", 3),
    SUCCESS: ("success (%)", 1),
    "violated": ("outside (%)", 1),
    "stays_orbit": ("stays an orbit (%)", 1),
    "regret_m_s": ("beyond the best plan (m/s)", 3),
}
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
        limits = (0.0, 100.0) if COLUMNS[name][0].endswith("(%)") else (-np.inf, np.inf)
        spread = statistic(np.array([training[name][0] for training in each]), 95.0, *limits)
        figures[name] = (spread.mean, spread.low, spread.high)
    return figures


def trained(name: str, task: str, budget: float, seed: int, folder: Path) -> tuple[Path, int]:
    """Train one policy within a budget of control periods, and return its file and what it took."""
    from benchmarks.ppo import SETTINGS, Training  # noqa: PLC0415 - brings torch

    settings = replace(SETTINGS[name], words=(*SETTINGS[name].words, *LEARNED[name], *TASKS[task]))
    num_periods = task_of(settings.words, decision_period_s=settings.decision_period_s).num_periods
    rollout = settings.num_envs * settings.model["n_steps"]
    rollouts = int(budget / num_periods) // rollout
    if rollouts < 1:
        raise ValueError(
            f"a budget of {budget:g} periods is less than one round of {rollout * num_periods:,}"
        )
    training = Training(folder, settings, seed, rollouts * rollout)
    return training.run(), rollouts * rollout * num_periods


def cell(figures: Mapping[str, Interval], name: str) -> str:
    """Return a figure with its interval."""
    if name not in figures:
        return "-"
    decimals, (mean, low, high) = COLUMNS[name][1], figures[name]
    if low is None or high is None:
        return f"{mean:.{decimals}f}"
    return f"{mean:.{decimals}f} ({low:.{decimals}f} to {high:.{decimals}f})"


def main(arguments: Sequence[str]) -> int:
    """Judge all of them, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks leaderboard", description=__doc__)
    parser.add_argument("--budget", type=float, default=1e6, help="control periods of a learner's training")
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each learner; 0 leaves them out")
    parser.add_argument(
        "-c", "--controller", action="append", help=f"beside them; {', '.join(FIXED)} unless given"
    )
    parser.add_argument("--cases", type=int, default=1000, help="the first so many held-out starts")
    parser.add_argument("--task", choices=TASKS, default="paper")
    parser.add_argument("--folder", type=Path, default=Path("outputs/leaderboard"), help="of the policies")
    options = parser.parse_args(arguments)
    if options.seeds and find_spec("stable_baselines3") is None:
        parser.error("learners need Stable-Baselines3; install it: python -m pip install stable-baselines3")
    rows: list[tuple[str, str, dict[str, Interval], str]] = []
    results: list[dict[str, Any]] = []
    for name in options.controller or FIXED:
        print(f"  {name}", file=sys.stderr, flush=True)
        results.append(judge(name, options.task, options.cases))
        rows.append((name, "", figures_of(results[-1]), fired_by_rules(results[-1])))
        print(f"    {cell(rows[-1][2], 'delta_v_m_s')} m/s", file=sys.stderr, flush=True)
    for name in LEARNED if options.seeds else ():
        each, periods = [], 0
        for seed in range(1, options.seeds + 1):
            print(f"  PPO {name}, seed {seed}", file=sys.stderr, flush=True)
            folder = options.folder / f"{name}-{seed}"
            path, periods = trained(name, options.task, options.budget, seed, folder)
            results.append(judge(str(path), options.task, options.cases) | {"periods": periods, "seed": seed})
            each.append(figures_of(results[-1]))
            print(f"    {cell(each[-1], 'delta_v_m_s')} m/s", file=sys.stderr, flush=True)
        rows.append((f"PPO {name}, {options.seeds} trainings", f"{periods:,}", over_trainings(each), ""))
    heads = ["controller", "periods", *(words for words, _ in COLUMNS.values()), BY_RULES[1]]
    body = [
        [name, periods, *(cell(figures, column) for column in COLUMNS), by_rules]
        for name, periods, figures, by_rules in rows
    ]
    print(f"{VERSION}, {options.task}, {options.cases} starts")
    print(text.write(Document([Table(heads, body, numbers=range(1, len(heads)))])))
    options.folder.mkdir(parents=True, exist_ok=True)
    write_text(options.folder / "judged.json", json.dumps(results, indent=1) + "\n")
    return 0
