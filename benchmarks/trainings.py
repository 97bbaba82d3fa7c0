"""What a training ends at, over its seeds: ``python -m benchmarks trainings SWEEP...`` reads evaluated runs.

A training is one draw: a table of one training says little about the next. For each setting of the sweeps,
made for instance by

    python -m pipeline -m +experiment=train 'seed=range(21,41)' 'stages=[scenario,train,evaluate]'

it prints each training's flights from test starts, the interquartile mean over trainings with its bootstrap
interval (Agarwal et al., NeurIPS 34, 2021), and how many trainings are good enough. It computes with NumPy
and SciPy from the files of the runs, and with nothing of `pipeline.evaluation`.
"""

import argparse
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pyarrow import parquet
from scipy import stats

COLUMNS = ["success", "violated", "delta_v_m_s"]
#: of the bootstrap over trainings
NUM_RESAMPLES, CONFIDENCE = 10_000, 0.95
#: share of trainings left out at either end by the interquartile mean
TRIMMED = 0.25


class Training(NamedTuple):
    """One training's flights from test starts: shares in per cent, mean delta-v in m/s."""

    setting: str
    seed: int
    success: float
    outside: float
    delta_v: float


def main(arguments: Sequence[str]) -> int:
    """Print Markdown tables: each training, then a line for each setting."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks trainings", description=__doc__)
    parser.add_argument("sweeps", nargs="+", type=Path, help="folders of evaluated trainings")
    parser.add_argument("--least-success", type=float, default=90.0, help="of a good training, per cent")
    parser.add_argument("--most-outside", type=float, default=1.0, help="of a good training, per cent")
    parser.add_argument("--most-delta-v", type=float, default=1.5, help="of a good training, m/s")
    options = parser.parse_args(arguments)
    trainings = sorted(read(path) for folder in options.sweeps for path in evaluated(folder))
    if not trainings:
        parser.error(f"no run below {', '.join(map(str, options.sweeps))} was evaluated; run the sweep first")
    print("| setting | seed | success (%) | outside (%) | delta-v (m/s) |\n|---|---|---|---|---|")
    for setting, seed, success, outside, delta_v in trainings:
        print(f"| {setting} | {seed} | {success:.1f} | {outside:.1f} | {delta_v:.3f} |")
    print("\n| setting | trainings | success (%) | outside (%) | delta-v (m/s) | good enough |")
    print("|---|---|---|---|---|---|")
    for setting in dict.fromkeys(each.setting for each in trainings):
        group = [each for each in trainings if each.setting == setting]
        good = sum(
            each.success >= options.least_success
            and each.outside <= options.most_outside
            and each.delta_v <= options.most_delta_v
            for each in group
        )
        cells = [spread([getattr(each, name) for each in group], digits) for name, digits in MEASURES.items()]
        print(f"| {setting} | {len(group)} | {' | '.join(cells)} | {good} of {len(group)} |")
    print(
        f"\nInterquartile means over trainings ({100 * CONFIDENCE:g} % bootstrap intervals), least to "
        f"greatest. Good enough: success at least {options.least_success:g} %, outside at most "
        f"{options.most_outside:g} %, delta-v at most {options.most_delta_v:g} m/s."
    )
    return 0


#: of a training, and the decimals that they are told with
MEASURES = {"success": 1, "outside": 1, "delta_v": 3}


def evaluated(folder: Path) -> list[Path]:
    """Return the evaluated runs in a folder, or the folder if it is one."""
    return sorted(path.parents[1] for path in folder.glob("**/evaluate/episodes.parquet"))


def read(run: Path) -> Training:
    """Return a run's results, counted flight by flight."""
    seed = json.loads((run / "manifest.json").read_text(encoding="utf-8"))["seed"]
    setting = re.sub(r"\+?seed=\d+", "", run.name).strip("+") if "seed=" in run.name else run.parent.name
    table = parquet.read_table(run / "evaluate" / "episodes.parquet", columns=COLUMNS)
    flown = {name: table[name].to_numpy() for name in COLUMNS}
    succeeds = flown["success"] & ~flown["violated"]
    shares = 100.0 * succeeds.mean(), 100.0 * flown["violated"].mean()
    return Training(setting or "all", int(seed), *map(float, (*shares, flown["delta_v_m_s"].mean())))


def middle(values: Sequence[float]) -> float:
    """Return the interquartile mean over trainings."""
    return float(stats.trim_mean(values, TRIMMED))


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the bootstrap interval of the interquartile mean; its ends are among what is drawn."""
    draws = np.random.default_rng(0).choice(values, (NUM_RESAMPLES, len(values)))
    tail = 50.0 * (1.0 - CONFIDENCE)
    ends = np.percentile(stats.trim_mean(draws, TRIMMED, axis=1), (tail, 100.0 - tail), method="nearest")
    return float(ends[0]), float(ends[1])


def spread(values: Sequence[float], decimals: int) -> str:
    """Return the interquartile mean with its interval, the least and the greatest."""
    words = f"{middle(values):.{decimals}f}"
    if min(values) < max(values):
        low, high = interval(values)
        words += f" ({low:.{decimals}f}–{high:.{decimals}f})"
    return f"{words}, {min(values):.{decimals}f} to {max(values):.{decimals}f}"
