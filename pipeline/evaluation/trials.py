"""Trials of settings, proposed by Optuna and raced on common flights.

Optuna only proposes values and receives results, one trial after the other. Its journal,
lines of JSON, is all that a search needs to resume. A trial flies block after block of the same flights as
the others; it ends when Wilcoxon's signed-rank test shows that it is worse than the best one on the blocks
that both have flown.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.pruners import WilcoxonPruner
from optuna.samplers import TPESampler
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, Trial, TrialState

from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Search
from pipeline.settings.space import Dimension, dimensions

#: values to try -> mean costs of successive blocks of flights
Judge = Callable[[Mapping[str, Any]], Iterator[float]]

#: separates the proposals from other random numbers with the same seed
SPAWN_KEY = 0x5EA
NAME = "search"


@dataclass(frozen=True)
class Tried:
    """A finished trial.

    Parameters
    ----------
    number : int
        From 0.
    values : mapping
        Of the keys of the space.
    blocks : tuple of float
        Mean cost of each block of flights.
    state : str
        ``complete``, ``pruned`` in the race, or ``fail`` if settings do not fit together.
    """

    number: int
    values: Mapping[str, Any]
    blocks: tuple[float, ...]
    state: str

    @property
    def cost(self) -> float:
        """The mean of the blocks that it flew; NaN without any."""
        return float(np.mean(self.blocks)) if self.blocks else float("nan")


def trials(journal: Path, search: Search, seed: int, judge: Judge) -> Iterator[Tried]:
    """Try settings, those of a journal first, and yield each trial when it ends.

    Parameters
    ----------
    journal : Path
        Made if missing; an interrupted trial in it is resumed.
    search : Search
    seed : int
    judge : callable
        Takes a trial's values; what it yields must depend on these alone.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    journal.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        # of a resumed trial: its first blocks are flown again, with the same results
        warnings.filterwarnings("ignore", "The reported value is ignored")
        study = optuna.create_study(
            storage=JournalStorage(JournalFileBackend(str(journal))),
            study_name=NAME,
            pruner=WilcoxonPruner(p_threshold=search.prune_below),
            load_if_exists=True,
        )
        space = {one.key: _distribution(one) for one in dimensions(search.space)}
        for number in range(search.trials):
            known = study.get_trials(deepcopy=False)
            if number >= len(known) or not known[number].state.is_finished():
                # each trial draws from its own seed, so that a resumed search proposes the same
                words = np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, number)).generate_state(1)
                study.sampler = TPESampler(seed=int(words[0]), constant_liar=False)
                _race(study, _begun(study, known[number:], space), judge)
            yield _told(study.get_trials(deepcopy=False)[number])


def _begun(
    study: optuna.Study, interrupted: Sequence[FrozenTrial], space: dict[str, BaseDistribution]
) -> Trial:
    return Trial(study, interrupted[0]._trial_id) if interrupted else study.ask(space)


def _race(study: optuna.Study, trial: Trial, judge: Judge) -> None:
    """Fly a trial until it ends or falls behind, and report it to the study."""
    costs: list[float] = []
    try:
        for block, cost in enumerate(judge(trial.params)):
            costs.append(cost)
            trial.report(cost, block)
            if trial.should_prune():
                study.tell(trial, state=TrialState.PRUNED)
                return
    except SettingError as error:
        trial.set_user_attr("refused", str(error))
        study.tell(trial, state=TrialState.FAIL)
        return
    study.tell(trial, float(np.mean(costs)))


def _told(trial: FrozenTrial) -> Tried:
    blocks = tuple(cost for _, cost in sorted(trial.intermediate_values.items()))
    return Tried(trial.number, trial.params, blocks, trial.state.name.lower())


def _distribution(one: Dimension) -> BaseDistribution:
    if one.choices:
        return CategoricalDistribution(one.choices)
    if isinstance(one.low, int) and isinstance(one.high, int):
        return IntDistribution(one.low, one.high, log=one.is_log)
    return FloatDistribution(one.low, one.high, log=one.is_log)
