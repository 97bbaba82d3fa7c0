"""Sweeps: their runs are checked before any begins, recorded in a file, and resumed with any launcher."""

import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf, read_write

from pipeline.command_line import runs
from pipeline.command_line.arguments import EXPERIMENT, ConfigError, parse_arguments
from pipeline.command_line.config import (
    Job,
    check_stages,
    check_working_directory,
    checked_job,
    compose_experiment,
    folders_of,
    without_hydra,
)
from pipeline.command_line.hydra_errors import errors_in_words
from pipeline.command_line.labels import check_different, labels
from pipeline.command_line.overrides import HYDRA, quoted
from pipeline.run import artifacts, configuration, sweep
from pipeline.run.sweep import DONE, Ending, SweptRun, state_of
from pipeline.settings import schema
from pipeline.settings.places import conf_folder

#: the key that tells a resumed run its folder; no setting, and in no configuration that is kept
RESUMED: Final = "resume"
#: endings of a sweep's folder beside which submitit keeps its files: it links there, and a sweep has no links
SUBMITIT: Final = ".submitit"


@dataclass
class Sweep:
    """The runs of a command, in the folder of a sweep.

    Parameters
    ----------
    folder : Path
        The sweep's, absolute.
    jobs : list of Job
        The runs that begin; none where a sweep goes on.
    runs : list of SweptRun
        The same as they are recorded; where a sweep goes on, those that are left.
    """

    folder: Path
    jobs: list[Job]
    runs: list[SweptRun]
    started: float = field(default_factory=time.perf_counter)
    num_ended: int = 0

    @classmethod
    def checked(cls, config: DictConfig) -> "Sweep":
        """Compose and check every run of a sweep, and fix its folders for all jobs.

        Parameters
        ----------
        config : DictConfig
            What Hydra composed for all runs; its part ``hydra`` is completed.

        Raises
        ------
        ConfigError
            If a run cannot be started, or two would be the same; it names the run.
        """
        if config.hydra.sweeper._target_.rpartition(".")[2] != BasicSweeper.__name__:
            raise ConfigError(
                "a sweep is made by hydra/sweeper=basic, whose runs are checked before any begins; for a "
                "search over settings add the stage search, see hparams_search"
            )
        folder = Path(config.hydra.sweep.dir).absolute()
        chosen, varied = _combinations(config)
        _fix(config, folder, varied)
        folders = folders_of(config.hydra)
        options = [f"--config-dir={path}" for path in folders if _is_config_dir(config, path)]
        options += [word for word in _hydra_words(config) if word.startswith("hydra.searchpath=")]
        jobs, swept = [], []
        for number, words in enumerate(chosen):
            try:
                with errors_in_words([conf_folder(), *folders]):
                    node = GlobalHydra.instance().config_loader().load_sweep_config(config, words)
                    with read_write(node.hydra):
                        node.hydra.job.num, node.hydra.job.id = number, str(number)
                    HydraConfig.instance().set_config(node)
                    path = folder / str(node.hydra.sweep.subdir)
                job = checked_job(without_hydra(node), words, path, folders)
                check_working_directory(node.hydra, job)
                check_stages(job.config, words)
                runs.check_before(job.experiment)
                runs.check_vacant(job)
            except (ValueError, OSError) as error:
                chosen_here = ", ".join(word.lstrip("+") for word in words if word.split("=")[0] in varied)
                raise ConfigError(
                    f"in the run with {chosen_here}: {error}" if varied else str(error)
                ) from error
            jobs.append(job)
            name = path.relative_to(folder).as_posix()
            swept.append(SweptRun(name, labels(node, varied), (*options, *words)))
        HydraConfig.instance().set_config(config)
        check_different(swept)
        return cls(folder, jobs, swept)

    @classmethod
    def resumed(cls, config: DictConfig) -> "Sweep":
        """Return the runs of a sweep that are left, see `resume_words`."""
        folder = Path(config.hydra.sweep.dir).absolute()
        _fix(config, folder, None)
        return cls(folder, [], [run for run in sweep.read(folder) if state_of(folder, run) != DONE])

    def write(self) -> None:
        """Write the file of the sweep, new or extended, and the configurations of new runs."""
        known = sweep.read(self.folder) if (self.folder / sweep.SWEEP).exists() else []
        for job in self.jobs:
            # so that it can be resumed; what is there is kept
            if not (job.folder / artifacts.CONFIG).exists():
                configuration.write(job.folder, job.config)
        for run in self.runs:
            sweep.write_ending(self.folder / run.folder, Ending())
        # last: what is in its file can be resumed; why a run failed is in its own folder
        merged = {run.folder: replace(run, failure="") for run in (*known, *self.runs)}
        sweep.write(self.folder, list(merged.values()))

    def report(self, folder: Path, ending: Ending) -> None:
        """Print the result of a run that has ended, and the time left."""
        self.num_ended += 1
        left = len(self.runs) - self.num_ended
        seconds = (time.perf_counter() - self.started) / self.num_ended * left
        word = f"FAILED: {ending.failure}" if ending.failure else "done"
        name, count = folder.relative_to(self.folder), f"[{self.num_ended}/{len(self.runs)}]"
        sys.stderr.write(f"{count} {name}: {word}; {seconds:.0f} s left\n")

    @property
    def left(self) -> list[SweptRun]:
        """The runs of this command that are not done."""
        names = {run.folder for run in self.runs}
        known = [run for run in sweep.read(self.folder) if run.folder in names]
        return [run for run in known if state_of(self.folder, run) != DONE]

    @property
    def cure(self) -> str:
        """The command that resumes the sweep."""
        return f"python -m pipeline resume={runs.shown_path(self.folder)}"

    def end(self) -> int:
        """Print the sweep's results and the command for its summary; return the exit code."""
        known = sweep.read(self.folder)
        left = [run for run in known if state_of(self.folder, run) != DONE]
        for run in left:
            word = f"failed: {run.folder}: {run.failure}" if run.failure else f"not done: {run.folder}"
            sys.stderr.write(f"{word}\n")
        sys.stderr.write(
            f"{len(known) - len(left)} of {len(known)} runs are done"
            + (f"; to try the others again: {self.cure}" if left else "")
            + f"\nto see what came out: python -m pipeline summary {runs.shown_path(self.folder)}\n"
        )
        lost = {run.folder for run in left}
        codes = [sweep.read_ending(self.folder / run.folder).code for run in self.runs]
        pairs = zip(self.runs, codes, strict=True)
        return runs.most_telling(
            code or (runs.FAULT if run.folder in lost else runs.OK) for run, code in pairs
        )


def _combinations(config: DictConfig) -> tuple[list[list[str]], list[str]]:
    """Return the overrides of each run, as Hydra's sweeper chooses them, and the keys with several values.

    Of a key that is given twice the last counts.
    """
    parameters = config.hydra.sweeper.get("params") or {}
    words = [*(f"{key}={value}" for key, value in parameters.items()), *config.hydra.overrides.task]
    loader = GlobalHydra.instance().config_loader()
    overrides = OverridesParser.create(config_loader=loader).parse_overrides(words)
    (batch,) = BasicSweeper.split_arguments(overrides, None)
    last = {override.get_key_element(): override for override in overrides}
    return batch, [key for key, override in last.items() if override.is_sweep_override()]


def _fix(config: DictConfig, folder: Path, varied: Sequence[str] | None) -> None:
    """Give all jobs of a sweep one folder, whatever their names, and each its own in it."""
    words = _hydra_words(config)
    fixed = [f"hydra.sweep.dir={quoted(str(folder))}"]
    if varied is not None and not any(word.startswith("hydra.sweep.subdir=") for word in words):
        keys = ",".join(f'"{key}"' for key in varied)
        fixed.append(f"hydra.sweep.subdir={quoted(f'${{run_folder:{keys}}}')}")
    with read_write(config.hydra):
        config.hydra.overrides.hydra.extend(fixed)
        config.hydra.sweep.dir = str(folder)
        is_submitit = (config.hydra.launcher or {}).get("submitit_folder") is not None
        if is_submitit and not any(word.startswith("hydra.launcher.submitit_folder=") for word in words):
            config.hydra.launcher.submitit_folder = f"{folder}{SUBMITIT}/%j"


def _hydra_words(config: DictConfig) -> list[str]:
    """Return the overrides of Hydra's own keys, as they are written: references are resolved by each run."""
    words: Any = OmegaConf.to_container(config.hydra.overrides.hydra, resolve=False)
    return list(words)


def _is_config_dir(config: DictConfig, path: Path) -> bool:
    """Return whether a folder was given by ``--config-dir``."""
    sources = config.hydra.runtime.config_sources
    return any(source.provider == "command-line" and Path(source.path) == path for source in sources)


def recorded_command(folder: Path, run: Path) -> tuple[str, ...]:
    """Return the arguments with which a run of a sweep would be started alone; nothing if none are known."""
    if not (folder / sweep.SWEEP).exists():
        return ()
    commands = {folder / swept.folder: swept.command for swept in sweep.read(folder)}
    return commands.get(run, ())


def resume_words(folder: Path, overrides: Sequence[Override]) -> list[str]:
    """Return Hydra's arguments for resuming the unfinished runs of a sweep; none if all are done.

    Parameters
    ----------
    folder : Path
    overrides : sequence of Override
        Of settings that no result depends on, and of Hydra's own: a sweep may go on with another launcher.

    Raises
    ------
    ConfigError
        If an override changes results, or a run was deleted and its command is not known.
    """
    for override in overrides:
        key = re.split("[./]", override.key_or_group, maxsplit=1)[0]
        if key not in (HYDRA, EXPERIMENT) and override.key_or_group not in schema.free_keys():
            raise ConfigError(
                f"resume goes on with the runs' own configurations; drop {override.input_line}, or start a "
                f"new sweep. No result depends on {', '.join(schema.free_keys())}: these may be given"
            )
    known = sweep.read(folder)
    left = [run for run in known if state_of(folder, run) != DONE]
    for run in left:
        path = folder / run.folder
        if not (path / artifacts.CONFIG).exists():
            configuration.write(path, _composed_again(run).config)
    if not left:
        sys.stderr.write(f"nothing is left to do: all {len(known)} runs are finished\n")
        return []
    words = [override.input_line or "" for override in overrides if override.key_or_group != EXPERIMENT]
    return [
        f"+{RESUMED}=" + ",".join(quoted(run.folder) for run in left),
        f"hydra.sweep.dir={quoted(str(folder.absolute()))}",
        f"hydra.sweep.subdir=${{{RESUMED}}}",
        *words,
    ]


def _composed_again(run: SweptRun) -> Job:
    """Compose a run whose folder was deleted, from its recorded command."""
    if not run.command:
        raise ConfigError(
            f"{run.folder} was deleted, and how it was started is not known; take it out of {sweep.SWEEP}"
        )
    if any("${" in word for word in run.command):
        raise ConfigError(
            f"{run.folder} was deleted, and its command refers to other values; start it by hand"
        )
    command = parse_arguments(run.command)
    return compose_experiment(command.overrides, command.config_dir)
