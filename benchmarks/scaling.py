"""A campaign: how its memory grows with the flights, and what it costs.

``python -m benchmarks scaling`` measures the memory, ``python -m benchmarks scaling --prices`` the processor
time of a flight of each champion in its world, and what millions of them take. ``--engine`` measures the
processor time of parts of a second, flown in turn by this process and on workers of Dask.
"""

import argparse
import math
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.timing import fuel_by_rules, line
from pipeline.command_line.config import compose_experiment
from pipeline.constants import DAY_S
from pipeline.controllers.source import load
from pipeline.evaluation.parts import fly_part
from pipeline.flight.goals.flights import fly_all
from pipeline.run.engine import HERE, open_pool
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Engine
from pipeline.settings.places import conf_folder
from pipeline.settings.sizes import MOST_CASES
from tests.hostile.kills import command, workers_of


def memory_of(cases: int, part_cases: int, folder: Path) -> float:
    """Fly a campaign of `cases` flights; return the peak memory of its process, MB."""
    words = [
        "+experiment=evaluate", "controller=coast", "stages=[evaluate]", "duration_s=60",
        f"monte_carlo.num_cases={cases}", f"engine.part_cases={part_cases}", "optimum.reference=null",
        f"hydra.run.dir={folder}",
    ]  # fmt: skip
    process = subprocess.Popen(command(words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # noqa: S603
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"the campaign of {cases} flights ended with {status}")
    return used.ru_maxrss / 1024.0


#: flights of `ENGINE_CONTROLLER` that take a part of a second
SECOND_CASES, ENGINE_CONTROLLER = 8000, "paper_champion"
#: parts that are flown in turn with each engine, and how often
NUM_PARTS, REPEATS = 8, 4


def print_engines() -> None:
    """Print the processor time of a part with each engine: of this process and of Dask's workers."""
    words = ["+experiment=evaluate", f"controller={ENGINE_CONTROLLER}"]
    words.append(f"monte_carlo.num_cases={SECOND_CASES * NUM_PARTS}")
    experiment = compose_experiment(words).experiment
    controller = load(experiment.controller, experiment.mission)
    bounds = [(SECOND_CASES * part, SECOND_CASES * (part + 1)) for part in range(NUM_PARTS)]
    tasks = [(experiment, controller, pair, 1) for pair in bounds]
    spent: dict[str, list[float]] = {"local": [], "dask": []}
    with open_pool(Engine(kind="dask"), 2) as dask:
        for pool in (HERE, dask):
            pool.map(fly_part, tasks[:4])  # compiles if necessary
        for _ in range(REPEATS):
            for kind, pool in (("local", HERE), ("dask", dask)):
                before = _processor_time()
                pool.map(fly_part, tasks)
                spent[kind].append((_processor_time() - before) / NUM_PARTS)
    for kind, seconds in spent.items():
        line(f"{kind}: processor time of a part, s", " ".join(f"{each:.3f}" for each in seconds))
    more = [dask / local - 1.0 for local, dask in zip(spent["local"], spent["dask"], strict=True)]
    line("Dask: more processor time, median, %", f"{100.0 * statistics.median(more):.1f}")


def _processor_time() -> float:
    """Return the processor time of this process and of Dask's workers so far, s."""
    ticks = [
        sum(map(int, Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[11:13]))
        for worker in workers_of(os.getpid())
    ]
    return time.process_time() + sum(ticks) / os.sysconf("SC_CLK_TCK")


#: worlds and Suns that champions were trained for, by parts of their names: the first that fits counts
WORLDS = {
    "leo": ("world=leo",),
    "afrl_weighted": ("world=afrl_weighted",),
    "afrl_six_dof": ("world=afrl_six_dof",),
    "afrl": ("world=afrl",),
    "rso": ("world=rso",),
    "docking": ("problem=docking",),
    "fixed_sun": (),
}
#: processor time over which flights are measured, s
MEASURED_S = 5.0
#: flights that fill the vectors in which they fly side by side
FEWEST = 64


def words_of(controller: str) -> tuple[str, ...]:
    """Return the words that choose a champion and its world."""
    world = next((words for name, words in WORLDS.items() if name in controller), ("sun=random",))
    return (f"controller={controller}", *world)


def price_of(controller: str) -> tuple[float, str]:
    """Return the processor time of a flight in one thread, s, over flights that take some seconds.

    And the share of fuel that rules fire in them, in words.
    """
    experiment = compose_experiment(["+experiment=evaluate", *words_of(controller)]).experiment
    loaded, first, num_cases = load(experiment.controller, experiment.mission), 0, FEWEST
    fly_all(experiment.mission, loaded, evaluation_scenarios(experiment, [0]), 1)  # compiles if necessary
    while True:
        scenarios = evaluation_scenarios(experiment, range(first, first + num_cases))
        started = time.process_time()
        flown = fly_all(experiment.mission, loaded, scenarios, 1)
        spent = time.process_time() - started
        if spent >= MEASURED_S:
            return spent / num_cases, fuel_by_rules(flown)
        first, num_cases = first + num_cases, 4 * num_cases


def print_prices() -> None:
    """Print a row for each champion that ships: its flight, a million of them, and the largest campaign."""
    names = sorted(path.stem for path in (conf_folder() / "controller").glob("*champion*.yaml"))
    most = f"10^{math.log10(MOST_CASES):g}"
    hours = f"10^6 flights: core hours | {most} flights: core hours"
    print(f"| controller | ms a flight | {hours} | cores for {most} in a day |")
    print("|---|---|---|---|---|")
    for name in names:
        seconds, share = price_of(name)
        million, whole = 1e6 * seconds / 3600.0, MOST_CASES * seconds / 3600.0
        cores = math.ceil(MOST_CASES * seconds / DAY_S)
        price = f"{1e3 * seconds:.3g} | {million:,.2f} | {whole:,.1f} | {cores:,}"
        print(f"| `{name}`{share} | {price} |", flush=True)


def main(arguments: Sequence[str]) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks scaling", description=__doc__)
    parser.add_argument("--cases", type=int, nargs="*", default=[100_000, 200_000, 400_000])
    parser.add_argument("--prices", action="store_true", help="print what flights cost instead")
    parser.add_argument("--engine", action="store_true", help="print what Dask costs instead")
    options = parser.parse_args(arguments)
    if options.prices:
        print_prices()
        return 0
    if options.engine:
        print_engines()
        return 0
    with tempfile.TemporaryDirectory() as name:
        held = [memory_of(cases, 10_000, Path(name) / str(cases)) for cases in options.cases]
    for cases, megabytes in zip(options.cases, held, strict=True):
        line(f"{cases:,} flights, MB at most", f"{megabytes:.0f}")
    growth = (held[-1] - held[0]) / (options.cases[-1] - options.cases[0])
    line("bytes more a flight", f"{1048576 * growth:.0f}")
    line("10,000,000 flights, extrapolated, MB", f"{held[0] + growth * (1e7 - options.cases[0]):.0f}")
    return 0
