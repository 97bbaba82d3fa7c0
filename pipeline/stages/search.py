"""Try settings of the experiment and keep the best: trials, the command for the best, its champion."""

import sys
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.evaluation.selection import select
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.goals.flights import fly_all
from pipeline.run import artifacts, configuration, tables, writing
from pipeline.run.extras import require_package
from pipeline.run.progress import Progress
from pipeline.scenarios import validation_scenarios
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import with_values
from pipeline.settings.schema import experiment_from
from pipeline.training.fitness import costs
from pipeline.training.genome import genome_of
from pipeline.training.judging import evolved


def run(experiment: Experiment, folder: Path) -> None:
    """Run the requested trials, each at the experiment's own prices, and write the results."""
    require_package("optuna", "the stage search")
    from pipeline.evaluation.trials import trials  # noqa: PLC0415 - an extra

    search, journal = experiment.hparams_search, folder / artifacts.SEARCH_JOURNAL
    if not experiment.resume:
        journal.unlink(missing_ok=True)
    config = configuration.read(folder)
    made: dict[str, Controller] = {}
    rows: list[tuple[Any, ...]] = []
    best = None
    with Progress("trial", search.trials) as progress:
        for trial in trials(journal, search, experiment.seed, partial(_judge, experiment, config, made)):
            if trial.state == "complete" and (best is None or trial.cost < best.cost):
                best = trial
                _keep(experiment, folder, made)
            cells = trial.number, trial.state, trial.cost, len(trial.blocks)
            rows.append((*cells, *trial.values.values(), trial.why))
            header = ["trial", "state", "cost_m_s", "blocks", *trial.values, "why"]
            tables.write_csv(folder / artifacts.SEARCH_TRIALS, header, rows)
            so_far = "none complete" if best is None else f"best {best.cost:.4f} m/s, trial {best.number}"
            ended = f"fail: {trial.why}" if trial.why else f"{trial.state} {trial.cost:.4f} m/s"
            progress.show(trial.number + 1, f"{ended}; {so_far}")
    if best is None:
        raise SettingError(
            "no trial of the search could be flown to its end; choose an hparams_search.space that fits"
        )
    words = [f"{key}={value}" for key, value in best.values.items()]
    writing.write_json(
        folder / artifacts.SEARCH_BEST,
        {"trial": best.number, "cost_m_s": best.cost, "values": dict(best.values), "words": words},
    )
    sys.stderr.write(f"  the best: {' '.join(words)}\n")


def _judge(
    experiment: Experiment, config: Mapping[str, Any], made: dict[str, Controller], values: Mapping[str, Any]
) -> Iterator[float]:
    """Fly a trial's controller, trained if requested, block by block; yield mean costs, m/s."""
    search = experiment.hparams_search
    tried = experiment_from(with_values(config, values))
    controller = _trained(tried) if search.trains else source.load(tried.controller, tried.mission)
    made["last"] = controller
    scenarios = validation_scenarios(experiment, search.num_cases)
    for first in range(0, len(scenarios), search.block_cases):
        block = scenarios[first : first + search.block_cases]
        outcomes = fly_all(tried.mission, controller, block, experiment.monte_carlo.workers)
        yield float(costs(outcomes, experiment.optimizer.penalty, experiment.mission).mean())


def _trained(experiment: Experiment) -> Controller:
    """Train from the configured controller, keeping only the champion."""
    given = source.load(experiment.controller, experiment.mission)
    genome = genome_of(given, experiment.optimizer.encoding)
    result = evolved(experiment, genome)
    if result.interrupted:
        raise KeyboardInterrupt
    return from_fuzzy(select(experiment, genome, result.history, given.fuzzy).controller)


def _keep(experiment: Experiment, folder: Path, made: Mapping[str, Controller]) -> None:
    """Write the controller that was trained last; one of an earlier process is already written."""
    if experiment.hparams_search.trains and "last" in made and made["last"].fuzzy is not None:
        writing.write_atomically(folder / artifacts.CHAMPION, serialize.dump_json(made["last"].fuzzy) + "\n")
