"""Trials of settings, proposed by Optuna and raced on common flights.

Optuna only proposes values and receives results, one trial after the other. Its journal, lines of JSON, is
written whole when a trial has ended, and is all that a search needs to resume: a trial that did not end
leaves nothing there, and is proposed and flown again. A trial flies block after block of the same flights as
the others; it ends when Wilcoxon's signed-rank test shows that it is worse than the best one on the blocks
that both have flown.
"""

import json
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.pruners import WilcoxonPruner
from optuna.samplers import TPESampler
from optuna.storages import JournalStorage
from optuna.storages.journal import BaseJournalBackend
from optuna.trial import FrozenTrial, Trial, TrialState

from pipeline.run import writing
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import HparamsSearch
from pipeline.settings.training import Dimension, dimensions
from plain_files.file_access import read_text
from plain_files.plain_text import parse_json

#: values to try -> mean costs of successive blocks of flights
Judge = Callable[[Mapping[str, Any]], Iterator[float]]

#: separates the proposals from the random numbers of flights with the same seed
SPAWN_KEY = 0x5EA
NAME = "search"
#: of a trial that failed: why
REFUSED = "refused"


@dataclass(frozen=True)
class TrialResult:
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
    why : str
        Why it failed; empty if it did not.
    """

    number: int
    values: Mapping[str, Any]
    blocks: tuple[float, ...]
    state: str
    why: str = ""

    @property
    def cost(self) -> float:
        """The mean of the blocks that it flew; NaN without any."""
        return float(np.mean(self.blocks)) if self.blocks else float("nan")


def trials(journal: Path, search: HparamsSearch, seed: int, judge: Judge) -> Iterator[TrialResult]:
    """Yield trials of settings as they end, those of a journal first.

    A trial is written to the journal when the next one is requested, so a process that is killed while it
    uses a trial repeats it.

    Parameters
    ----------
    journal : Path
        Made if missing; the search begins anew, and says so, if it is damaged.
    search : HparamsSearch
    seed : int
    judge : callable
        Takes a trial's values; what it yields must depend on these alone.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        study, kept = _resumed(journal, search)
        space = _space(search)
        for number in range(search.trials):
            if number >= len(study.get_trials(deepcopy=False)):
                # each trial draws from its own seed, so that a resumed search proposes the same
                words = np.random.SeedSequence(seed, spawn_key=(SPAWN_KEY, number)).generate_state(1)
                study.sampler = TPESampler(seed=int(words[0]), constant_liar=False)
                _race(study, study.ask(space), judge)
            yield _result_of(study.get_trials(deepcopy=False)[number])
            kept.write()


class _Journal(BaseJournalBackend):
    """Optuna's journal in a file of one process, which its run's folder keeps others out of.

    Optuna's own appends a line for each step, so that a killed process leaves half a trial or half a line,
    and locks by a link that such a process leaves as well.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._logs: list[dict[str, Any]] = [parse_json(line) for line in text.splitlines()]

    def read_logs(self, log_number_from: int) -> list[dict[str, Any]]:
        """Return the steps from a number on."""
        return self._logs[log_number_from:]

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Add steps, in memory."""
        self._logs += json.loads(json.dumps(logs))

    def write(self) -> None:
        """Write all steps."""
        text = "".join(json.dumps(log, separators=(",", ":")) + "\n" for log in self._logs)
        writing.write_atomically(self._path, text)


def _resumed(path: Path, search: HparamsSearch) -> tuple[optuna.Study, _Journal]:
    """Return a study with the trials of a journal; a new one if that is missing or damaged."""
    try:
        return _opened(path, read_text(path), search)
    except FileNotFoundError:
        pass
    except Exception as error:  # noqa: BLE001 - whatever Optuna raises of what it did not write
        sys.stderr.write(
            f"note: {path} cannot be gone on with ({_reason(error)}); the search begins anew, with the same "
            "trials\n"
        )
    return _opened(path, "", search)


def _reason(error: Exception) -> str:
    """Return what is wrong with a journal, in Optuna's words only by their kind."""
    return str(error) if str(error).startswith("it ") else f"damaged: {type(error).__name__}"


def _opened(path: Path, text: str, search: HparamsSearch) -> tuple[optuna.Study, _Journal]:
    """Return the study and the journal that a file's text holds; raise ValueError for a broken one."""
    journal = _Journal(path, text)
    pruner = WilcoxonPruner(p_threshold=search.prune_below)
    study = optuna.create_study(
        storage=JournalStorage(journal), study_name=NAME, pruner=pruner, load_if_exists=True
    )
    done, space = study.get_trials(deepcopy=False), _space(search)
    if not all(trial.state.is_finished() for trial in done):
        raise ValueError("it has a trial that did not end")
    if any(trial.distributions != space for trial in done):
        raise ValueError("it is of another search space")
    return study, journal


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
        trial.set_user_attr(REFUSED, str(error))
        study.tell(trial, state=TrialState.FAIL)
        return
    study.tell(trial, float(np.mean(costs)))


def _result_of(trial: FrozenTrial) -> TrialResult:
    blocks = tuple(cost for _, cost in sorted(trial.intermediate_values.items()))
    refused = str(trial.user_attrs.get(REFUSED, ""))
    return TrialResult(trial.number, trial.params, blocks, trial.state.name.lower(), refused)


def _space(search: HparamsSearch) -> dict[str, BaseDistribution]:
    """Return Optuna's distribution of each key of the space."""
    return {dimension.key: _distribution(dimension) for dimension in dimensions(search.space)}


def _distribution(dimension: Dimension) -> BaseDistribution:
    """Return Optuna's distribution of a dimension of the search."""
    if dimension.choices:
        return CategoricalDistribution(dimension.choices)
    if isinstance(dimension.low, int) and isinstance(dimension.high, int):
        return IntDistribution(dimension.low, dimension.high, log=dimension.is_log)
    return FloatDistribution(dimension.low, dimension.high, log=dimension.is_log)
