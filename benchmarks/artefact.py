"""Reproduce the paper over seeds: ``python -m benchmarks artefact FOLDER`` trains, evaluates, and tells.

The arms, seeds, sizes and measures are those of docs/results/paper.md. Each arm is a sweep of
`+experiment=train_paper` in the folder; what is there goes on, so that the command may be stopped and typed
again. In the end ``trainings.parquet`` has a row for each training and ``generations.parquet`` the course of
each, and ``tables.md`` and ``trainings.png`` are made from them; ``SHA256SUMS`` tells them all.
``--tables`` makes these two anew from the two files of rows, and nothing else; ``--arms 2`` flies the first
two arms alone. ``--rows docs/results/trainings.parquet`` takes the trainings of that file as flown, and flies
the others.

Whatever is known by ``key=value`` goes to each sweep, such as ``engine=dask``.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter
from pyarrow import parquet
from scipy import stats

from benchmarks.trainings import CONFIDENCE, NUM_RESAMPLES, TRIMMED, interval, middle, spread
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Variable, rule_table, table_rules

FIRST_SEED = 1001
#: seeds of the arms that the paper's figures are held against, of the others, and generations
SEEDS, SEEDS_OF_OTHERS, GENERATIONS = 30, 10, 500
TRAININGS, COURSES, TABLES, PICTURE, SUMS, PROTOCOL = (
    *(
        "trainings.parquet",
        "generations.parquet",
        "tables.md",
        "trainings.png",
        "SHA256SUMS",
        "protocol.json",
    ),
)
WIDER = "three_inputs.json"
#: what counts as inspected, and as failed, in the protocol
COMPLETE_PERCENT, FAILED_PERCENT = 95.0, 1.0

#: what is crossed; the first of each is that of +experiment=train_paper
FACTORS: Mapping[str, Mapping[str, Sequence[str]]] = {
    "penalty": {
        "strict order": (),
        "prices": (
            "optimizer.penalty.outside_m_s=1e5",
            "optimizer.penalty.short_point_m_s=0.5",
            "optimizer.penalty.missed_point_m_s=0.1",
        ),
    },
    "outputs": {"to 0.3 N": (), "to 1 N": ("optimizer.encoding.output_range_n=[0.01,1.0]",)},
    "inputs": {"two": (), "three": ("controller=file", "controller.path={folder}/" + WIDER)},
}
#: the arms that the paper's figures are held against, by their levels in the order of `FACTORS`; the third
#: came as near to them, with the ten seeds of all arms, that it was flown with as many as the others
HELD = (
    ("strict order", "to 0.3 N", "two"),
    ("prices", "to 0.3 N", "two"),
    ("strict order", "to 1 N", "three"),
)
#: what is changed alone
ALONE: Mapping[str, Sequence[str]] = {
    "fires on once all is seen": ("coast_when_complete=false",),
    "test starts by even angles": ("monte_carlo.directions=angles",),
}
#: column of a training, the heading of its table, and decimals
MEASURES = {
    "success_percent": ("success (%)", 1),
    "outside_percent": ("outside (%)", 1),
    "delta_v_m_s": ("delta-v (m/s)", 2),
    "delta_v_deviation_m_s": ("its deviation (m/s)", 2),
    "inspected_percent": ("inspected (%)", 1),
    "mean_distance_m": ("distance (m)", 1),
    "training_delta_v_m_s": ("delta-v in training (m/s)", 2),
    "first_complete_generation": ("first generation with no start short", 0),
}
#: of the paper's tables 3 and 4; its standard deviations are over starts, not over trainings
PAPER = {
    "delta_v_m_s": 5.62,
    "delta_v_deviation_m_s": 0.715,
    "inspected_percent": 96.667,
    "mean_distance_m": 66.629,
    "training_delta_v_m_s": 4.799,
}


def main(arguments: Sequence[str]) -> int:
    """Train what is missing, then write rows, tables and the picture."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks artefact", description=__doc__)
    parser.add_argument("folder", type=Path, help="a new one, or one to go on with")
    parser.add_argument("keys", nargs="*", help="key=value for each sweep, before options")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="of the arms held against the paper")
    parser.add_argument("--seeds-of-others", type=int, default=SEEDS_OF_OTHERS)
    parser.add_argument("--generations", type=int, default=GENERATIONS)
    parser.add_argument("--arms", type=int, default=None, help="only the first so many of them")
    parser.add_argument("--tables", action="store_true", help="only read the rows of a folder")
    parser.add_argument("--rows", type=Path, default=None, help="rows of trainings that need no flying")
    options = parser.parse_args(arguments)
    if not options.tables:
        train_all(parser, options)
    if not (options.folder / TRAININGS).exists():
        parser.error(
            f"{options.folder / TRAININGS} is missing; leave --tables out, or name a folder that has it"
        )
    rows = parquet.read_table(options.folder / TRAININGS).to_pylist()
    text = tables(rows)
    (options.folder / TABLES).write_text(text, encoding="utf-8")
    picture(rows).savefig(options.folder / PICTURE, dpi=120)
    names = sorted((TRAININGS, COURSES, TABLES, PICTURE))
    sums = (hashlib.sha256((options.folder / name).read_bytes()).hexdigest() for name in names)
    lines = (f"{digest}  {name}\n" for digest, name in zip(sums, names, strict=True))
    (options.folder / SUMS).write_text("".join(lines), encoding="utf-8")
    print(text)
    return 0


def arms() -> dict[str, tuple[Mapping[str, str], list[str]]]:
    """Return each arm's name, its level of each factor, and its overrides; the first have most seeds."""
    crossed = {}
    for levels in product(*FACTORS.values()):
        chosen = dict(zip(FACTORS, levels, strict=True))
        words = [word for factor, level in chosen.items() for word in FACTORS[factor][level]]
        crossed[", ".join(f"{factor} {level}" for factor, level in chosen.items())] = chosen, words
    base, *_ = crossed.values()
    alone = {name: ({**base[0], "alone": name}, list(words)) for name, words in ALONE.items()}
    # those that the paper's figures are held against first, then those with few changes
    order = {name: (not is_main(chosen), len(words)) for name, (chosen, words) in crossed.items()}
    return {name: crossed[name] for name in sorted(crossed, key=order.__getitem__)} | alone


def train_all(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Fly the sweeps of all arms, and write a row for each training and each generation."""
    folder: Path = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    sizes = {name: getattr(options, name) for name in ("seeds", "seeds_of_others", "generations", "keys")}
    kept = folder / PROTOCOL
    if kept.exists() and json.loads(kept.read_text(encoding="utf-8")) != sizes:
        parser.error(f"{kept} has other sizes than {json.dumps(sizes)}; give those, or another folder")
    kept.write_text(json.dumps(sizes) + "\n", encoding="utf-8")
    paper = serialize.load(Path(__file__).parents[1] / "conf" / "controller" / "paper.yaml")
    (folder / WIDER).write_text(serialize.dump_json(with_three_inputs(paper)), encoding="utf-8")
    kept_rows = parquet.read_table(options.rows).to_pylist() if options.rows else []
    flown = {(row["arm"], row["seed"]): row for row in kept_rows}
    rows: list[dict[str, Any]] = []
    courses: list[dict[str, Any]] = []
    for index, (name, (levels, changes)) in enumerate(islice(arms().items(), options.arms)):
        sweep = folder / f"arm{index}"
        count = options.seeds if is_main(levels) else options.seeds_of_others
        seeds = range(FIRST_SEED, FIRST_SEED + count)
        missing = [seed for seed in seeds if (name, seed) not in flown]
        if missing:
            print(f"{name}: {len(missing)} seeds in {sweep}", file=sys.stderr, flush=True)
            listed = "seed=" + ",".join(map(str, missing))
            words = [word.format(folder=folder) for word in changes]
            fly(sweep, [listed, f"optimizer.generations={options.generations}", *words, *options.keys])
        runs = [sweep / f"seed={seed}" for seed in missing]
        if unfinished := [run.name for run in runs if not (run / "evaluate" / "episodes.parquet").exists()]:
            parser.error(f"of {name}, {', '.join(unfinished)} did not end; type the command again to go on")
        for run in runs:
            row, course = read(run)
            unchanged = dict.fromkeys((*FACTORS, "alone"), "as there")
            flown[name, row["seed"]] = {"arm": name, **unchanged, **levels, **row}
            courses += [{"arm": name, "seed": row["seed"], **generation} for generation in course]
        rows += [flown[name, seed] for seed in seeds]
        # after each arm, so that what is flown so far can be told
        parquet.write_table(pa.Table.from_pylist(rows), folder / TRAININGS)
        parquet.write_table(pa.Table.from_pylist(courses), folder / COURSES)


def fly(sweep: Path, words: Sequence[str]) -> None:
    """Train and evaluate what some words ask for in a sweep, or go on with what is there."""
    command = [
        *("-m", "+experiment=train_paper", "stages=[scenario,train,evaluate]"),
        *(f"hydra.sweep.dir={sweep}", *words),
    ]
    if (sweep / "sweep.json").exists():
        command = [f"resume={sweep}"]
    subprocess.run([sys.executable, "-m", "pipeline", *command], check=False)  # noqa: S603


def is_main(levels: Mapping[str, str]) -> bool:
    """Return whether an arm is one of those that the paper's figures are held against."""
    return "alone" not in levels and tuple(levels[factor] for factor in FACTORS) in HELD


def with_three_inputs(controller: FuzzyController) -> FuzzyController:
    """Return a controller whose forces all have a distance, a velocity and an angle, and the same outputs.

    The paper gives each force "two or three" of them. What is added does not change what a table concludes.
    """
    distance, first_angle = controller.systems[0].inputs[0], controller.systems[1].inputs[0]
    systems = [widened(controller.systems[0], first_angle, 1)]
    systems += [widened(system, distance, 0) for system in controller.systems[1:]]
    return replace(controller, name="paper_three_inputs", systems=tuple(systems))


def widened(system: FuzzySystem, added: Variable, place: int) -> FuzzySystem:
    """Return a system with one more input, on which nothing depends yet."""
    cells = rule_table(system)
    assert cells is not None
    (output,) = system.outputs
    cells = cells.reshape([len(variable.terms) for variable in system.inputs])
    cells = np.repeat(np.expand_dims(cells, place), len(added.terms), axis=place)
    inputs = (*system.inputs[:place], added, *system.inputs[place:])
    names = [output.terms[index].name for index in cells.reshape(-1).tolist()]
    return replace(system, inputs=inputs, rules=table_rules(inputs, output, names))


def read(run: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the row of a training, counted flight by flight, and its generations."""
    flights = parquet.read_table(run / "evaluate" / "episodes.parquet").to_pydict()
    inside = ~np.array(flights["violated"])
    course = parquet.read_table(run / "train" / "history.parquet").drop_columns(["genome"]).to_pylist()
    complete = [each["generation"] for each in course if each["short"] == 0 and each["outside"] == 0]
    delta_v = np.array(flights["delta_v_m_s"])
    row = {
        "seed": json.loads((run / "manifest.json").read_text(encoding="utf-8"))["seed"],
        "success_percent": 100.0 * float(np.mean(np.array(flights["success"]) & inside)),
        "outside_percent": 100.0 * float(np.mean(~inside)),
        "delta_v_m_s": float(delta_v.mean()),
        "delta_v_deviation_m_s": float(delta_v.std(ddof=1)),
        "inspected_percent": float(np.mean(flights["inspection_rate_percent"])),
        "mean_distance_m": float(np.mean(flights["mean_distance_m"])),
        "training_delta_v_m_s": course[-1]["delta_v_m_s"],
        "first_complete_generation": float(min(complete, default=np.inf)),
    }
    return row, course


def tables(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return three Markdown tables: the arms, the effects of changes, and the paper's figures."""
    names = list(dict.fromkeys(row["arm"] for row in rows))
    groups = {name: [row for row in rows if row["arm"] == name] for name in names}
    lines = [row_of(["", "trainings", *(heading for heading, _ in MEASURES.values())]), "|---" * 10 + "|"]
    for name, group in groups.items():
        cells = [spread(column(group, key), decimals) for key, (_, decimals) in MEASURES.items()]
        lines.append(row_of([name, str(len(group)), *cells]))
    lines += ["", row_of(["changed", "pairs", *(heading for heading, _ in MEASURES.values())])]
    lines.append("|---" * 10 + "|")
    # as many as the protocol has, whether they are flown yet or not
    base, num_shifts = groups[names[0]], len(arms()) - 1
    for name in names[1:]:
        seeds = {row["seed"]: row for row in groups[name]}
        pairs = [(row, seeds[row["seed"]]) for row in base if row["seed"] in seeds]
        cells = []
        for key, (_, decimals) in MEASURES.items():
            before, after = column([pair[0] for pair in pairs], key), column([pair[1] for pair in pairs], key)
            cells.append(shift(before, after, decimals, num_shifts))
        lines.append(row_of([name, str(len(pairs)), *cells]))
    held = [name for name, (levels, _) in arms().items() if is_main(levels) and name in groups]
    lines += ["", row_of(["", "the paper", *held]), "|---" * (2 + len(held)) + "|"]
    for key, value in PAPER.items():
        cells = [spread(column(groups[name], key), MEASURES[key][1]) for name in held]
        lines.append(row_of([MEASURES[key][0], f"{value:g}", *cells]))
    lines += ["", *(f"- {name}: {sentence(groups[name])}" for name in held)]
    return "\n".join(lines) + "\n"


def sentence(group: Sequence[Mapping[str, Any]]) -> str:
    """Return what the protocol counts: cheaper trainings, complete ones among them, and failed ones."""
    fuel, seen, outside = (
        column(group, key) for key in ("delta_v_m_s", "inspected_percent", "outside_percent")
    )
    is_cheaper = fuel < PAPER["delta_v_m_s"]
    is_complete = is_cheaper & (seen >= COMPLETE_PERCENT)
    return (
        f"{is_cheaper.sum()} of {len(group)} burn less than {PAPER['delta_v_m_s']:g} m/s, "
        f"{is_complete.sum()} of them inspect at least {COMPLETE_PERCENT:g} % on average; "
        f"{(outside > FAILED_PERCENT).sum()} leave the limits in more than {FAILED_PERCENT:g} % of flights"
    )


def row_of(cells: Sequence[str]) -> str:
    """Return a row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def column(rows: Sequence[Mapping[str, Any]], key: str) -> np.ndarray:
    """Return a measure of some trainings, shape (trainings,)."""
    return np.array([row[key] for row in rows], dtype=np.float64)


def shift(before: np.ndarray, after: np.ndarray, decimals: int, num_shifts: int) -> str:
    """Return how the interquartile mean changes, with the interval of a bootstrap over pairs of one seed.

    Of so many such intervals none misses, with 95 % confidence (Bonferroni).
    """
    draws = np.random.default_rng(0).integers(len(before), size=(NUM_RESAMPLES, len(before)))
    with np.errstate(invalid="ignore"):
        changes = stats.trim_mean(after[draws], TRIMMED, axis=1) - stats.trim_mean(
            before[draws], TRIMMED, axis=1
        )
        change = middle(after) - middle(before)
    if not np.isfinite(changes).all():
        return "in some trainings never"
    tail = 50.0 * (1.0 - CONFIDENCE) / num_shifts
    low, high = np.percentile(changes, (tail, 100.0 - tail))
    return f"{change:+.{decimals}f} ({low:+.{decimals}f} to {high:+.{decimals}f})"


def picture(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw each training's success and delta-v, arm by arm, with the paper's fuel."""
    names = list(dict.fromkeys(row["arm"] for row in rows))
    figure = Figure(figsize=(11, 0.55 * len(names) + 1.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for index, name in enumerate(names):
        group = [row for row in rows if row["arm"] == name]
        for ax, key in ((left, "success_percent"), (right, "delta_v_m_s")):
            values = column(group, key)
            ax.plot(values, np.full(len(values), index), "o", color="#4c78a8", alpha=0.45, markersize=5)
            low, high = interval(values)
            ax.plot([low, high], [index, index], color="#222222", linewidth=2)
            ax.plot(middle(values), index, "|", color="#222222", markersize=14, markeredgewidth=2.5)
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set_xlabel("success of test flights (%)")
    left.set_xlim(-2, 102)
    fuel = PAPER["delta_v_m_s"]
    right.axvline(fuel, color="#e45756", linestyle="--")
    above = {"xy": (fuel, 1), "xycoords": ("data", "axes fraction"), "xytext": (0, 4)}
    right.annotate("the paper", **above, textcoords="offset points", color="#e45756", ha="center")
    right.set_xscale("log")
    right.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    right.xaxis.set_major_formatter(ScalarFormatter())
    right.xaxis.set_minor_formatter(NullFormatter())
    right.set_xlabel("mean delta-v of test flights (m/s)")
    for ax in (left, right):
        ax.grid(axis="x", alpha=0.3)
        ax.spines[["top", "right"]].set_visible(False)
    return figure
