"""The gain of each round of a training: ``python -m benchmarks rounds RUN_FOLDER`` flies its champions.

With ``--generations 25 50`` it flies those of these generations of the first round.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.controllers import source
from pipeline.evaluation.monte_carlo import SUCCESS, fly_cases, summarise
from pipeline.flight.control.controller import from_fuzzy
from pipeline.run import artifacts, configuration, tables
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Sun
from pipeline.settings.schema import experiment_from
from pipeline.training.genome import genome_of


def main(arguments: Sequence[str]) -> None:
    """Print a Markdown table with one row per round and Sun."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks rounds", description=__doc__)
    parser.add_argument("folder", type=Path, help="of a run with the stage train")
    parser.add_argument(
        "--seed", type=int, default=777, help="of the starts; choose one that no training used"
    )
    parser.add_argument("--generations", type=int, nargs="+", help="of the first round, not all rounds")
    options = parser.parse_args(arguments)
    experiment = experiment_from(configuration.read(options.folder))
    history = tables.read_parquet(options.folder, artifacts.HISTORY)
    template = source.load(experiment.controller, experiment.mission)
    tuned = genome_of(template, experiment.optimizer.encoding)
    what = "generation" if options.generations else "round"
    print(f"| {what} | Sun | delta-v (m/s) | inspection rate (%) | success rate | outside |")
    print("|---|---|---|---|---|---|")
    if options.generations:
        rows = {each: np.flatnonzero(history["generation"] == each)[0] for each in options.generations}
    else:
        rounds = np.unique(history["round"])
        rows = {each + 1: np.flatnonzero(history["round"] == each)[-1] for each in rounds}
    for number, row in rows.items():
        controller = from_fuzzy(tuned.decode(np.asarray(history["genome"][row])))
        for mode in ("fixed", "random"):
            sun = Sun(mode=mode, angle_deg=experiment.sun.angle_deg)
            scenarios = evaluation_scenarios(replace(experiment, sun=sun, seed=options.seed))
            summary = summarise(fly_cases(experiment.mission, controller, scenarios)[0], 95.0)
            means = [summary[name] for name in ("delta_v_m_s", "inspection_rate_percent")]
            shares = [100.0 * summary[name]["fraction"] for name in (SUCCESS, "violated")]
            print(
                f"| {number} | {mode} | {means[0]['mean']:.3f} | {means[1]['mean']:.2f} "
                f"| {shares[0]:.1f} % | {shares[1]:.1f} % |"
            )


if __name__ == "__main__":
    main(sys.argv[1:])
