"""Sweeps: their runs are checked before any begins, recorded in a file, and resumed with any launcher."""

import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import Any, Final, cast

from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf, read_write

from pipeline.command_line import runs, stored_words
from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.command_line.choices import HYDRA, top_of
from pipeline.command_line.config import Job, check_stages, checked_job, errors_in_words
from pipeline.command_line.endings import FAULT, most_telling
from pipeline.command_line.hydra_parts import DEFAULT_SWEEPER, split_arguments
from pipeline.command_line.overrides import SUFFIXES, quoted, words_of
from pipeline.preflight import check_before
from pipeline.run import artifacts, configuration, lock, sweep, typed
from pipeline.run.sweep import DONE, Ending, SweptRun, state_of
from pipeline.settings.keys import value_at

#: the key that tells a resumed run its number in the sweep; no setting, and in no configuration that is kept
RESUMED: Final = "resume"
#: of a folder that is named by its run's differences
LONGEST_NAME: Final = 120


def new_job(node: DictConfig, folder: Path) -> Job:
    """Return a run that begins, after all checks that it may fail.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    job = checked_job(node, node.hydra, folder)
    for key in ("controller.path", "starts.path"):
        path = value_at(job.config, key)
        if node.hydra.job.chdir and path is not None and not Path(str(path)).is_absolute():
            raise ConfigError(f"{key} is {path}, and with hydra.job.chdir=true not found; make it absolute")
    check_stages(job)
    check_before(job.experiment)
    runs.check_vacant(job)
    return job


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

        Where a sweep goes on, see `resume_words`, the runs that are left need no more checks.

        Parameters
        ----------
        config : DictConfig
            What Hydra composed for all runs; its part ``hydra`` is completed.

        Raises
        ------
        ConfigError
            If a run cannot be started, or two would be the same; it names the run.
        """
        if config.hydra.sweeper._target_.rpartition(".")[2] != DEFAULT_SWEEPER:
            raise ConfigError(
                "a sweep is made by hydra/sweeper=basic, whose runs are checked before any begins; for a "
                "search over settings add the stage search, see hparams_search"
            )
        folder = literal(Path(config.hydra.sweep.dir).absolute())
        chosen, varied = _combinations(config)
        _fix(config, folder, varied)
        if any(word.startswith(f"+{RESUMED}=") for word in config.hydra.overrides.task):
            return cls(folder, [], unfinished(folder))
        sources = config.hydra.runtime.config_sources
        options = [f"--config-dir={source.path}" for source in sources if source.provider == "command-line"]
        options += [word for word in _hydra_words(config) if word.startswith("hydra.searchpath=")]
        made, met = cls(folder, [], []), list[dict[str, Any]]()
        if len(chosen) > 100:  # each takes a fifth of a second
            sys.stderr.write(f"{len(chosen)} runs are checked before the first begins\n")
        for number, words in enumerate(chosen):
            try:
                with errors_in_words():
                    node = GlobalHydra.instance().config_loader().load_sweep_config(config, words)
                    with read_write(node.hydra):
                        node.hydra.job.num, node.hydra.job.id = number, str(number)
                    HydraConfig.instance().set_config(node)
                    path = folder / (subdir := str(PurePath(str(node.hydra.sweep.subdir))))
                try:
                    sweep.check_folder(subdir)
                except ValueError as error:
                    raise ConfigError(
                        f"hydra.sweep.subdir is {subdir}; name a folder inside the sweep's ({error})"
                    ) from error
                made.jobs.append(new_job(node, path))
            except (ValueError, OSError) as error:
                chosen_here = ", ".join(word.lstrip("+") for word in words if word.split("=")[0] in varied)
                raise ConfigError(f"in the run with {chosen_here}: {error}" if varied else error) from error
            values, name = labels(node, varied), path.relative_to(folder).as_posix()
            differs = {key: str(value) for key, value in values.items()}
            if values in met:  # 600 and 600.0 are one
                same = ", ".join(f"{key}={value}" for key, value in differs.items())
                raise ConfigError(f"two runs of the sweep would have {same}; give each value once")
            if name in [run.folder for run in made.runs]:
                raise ConfigError(f"two runs would have the folder {name}; let hydra.sweep.subdir differ")
            met.append(values)
            made.runs.append(SweptRun(name, differs, (*options, *words), config=made.jobs[-1].config))
        HydraConfig.instance().set_config(config)
        return made

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
        seconds = (time.perf_counter() - self.started) * (len(self.runs) / self.num_ended - 1.0)
        word = f"FAILED: {ending.failure}" if ending.failure else "done"
        name, count = folder.relative_to(self.folder), f"[{self.num_ended}/{len(self.runs)}]"
        sys.stderr.write(f"{count} {name}: {word}; {seconds:.0f} s left\n")

    @property
    def cure(self) -> str:
        """The command that resumes the sweep."""
        return typed.resume(runs.shown_path(self.folder))

    def end(self) -> int:
        """Print the sweep's results and the command for its summary; return the exit code."""
        num_known, left = len(sweep.read(self.folder)), unfinished(self.folder)
        for run in left:
            word = f"failed: {run.folder}: {run.failure}" if run.failure else f"not done: {run.folder}"
            sys.stderr.write(f"{word}\n")
        sys.stderr.write(
            f"{num_known - len(left)} of {num_known} runs are done"
            + (f"; to try the others again: {self.cure}" if left else "")
            + f"\nto see what came out: {typed.summary(runs.shown_path(self.folder))}\n"
        )
        lost = {run.folder: FAULT for run in left}
        ended = {run.folder: sweep.read_ending(self.folder / run.folder) for run in self.runs}
        return most_telling(ending.code or lost.get(name, 0) for name, ending in ended.items())


def unfinished(folder: Path) -> list[SweptRun]:
    """Return the runs of a sweep that are not done."""
    return [run for run in sweep.read(folder) if state_of(folder, run) != DONE]


def _combinations(config: DictConfig) -> tuple[list[list[str]], list[str]]:
    """Return the overrides of each run, as Hydra's sweeper chooses them, and the keys with several values.

    Of a key that is given twice the last counts.
    """
    parameters = config.hydra.sweeper.get("params") or {}
    words = [*(f"{key}={value}" for key, value in parameters.items()), *config.hydra.overrides.task]
    overrides = OverridesParser.create(GlobalHydra.instance().config_loader()).parse_overrides(words)
    (batch,) = split_arguments(overrides, None)
    last = {override.get_key_element(): override for override in overrides}
    return batch, [key for key, override in last.items() if override.is_sweep_override()]


def _fix(config: DictConfig, folder: Path, varied: Sequence[str]) -> None:
    """Give all jobs of a sweep one folder, whatever their names, and each its own in it."""
    given = {word.partition("=")[0] for word in _hydra_words(config)}
    fixed = [f"hydra.sweep.dir={quoted(str(folder))}"]
    if "hydra.sweep.subdir" not in given:
        keys = ",".join(f'"{key}"' for key in varied)
        fixed.append(f"hydra.sweep.subdir={quoted(f'${{run_folder:{keys}}}')}")
    with read_write(config.hydra):
        config.hydra.overrides.hydra.extend(fixed)
        config.hydra.sweep.dir = str(folder)
        is_submitit = (config.hydra.launcher or {}).get("submitit_folder") is not None
        if is_submitit and "hydra.launcher.submitit_folder" not in given:
            # beside the sweep's folder: it makes links there, and a sweep has no links
            config.hydra.launcher.submitit_folder = f"{folder}.submitit/%j"


def _hydra_words(config: DictConfig) -> list[str]:
    """Return the overrides of Hydra's own keys, as they are written: references are resolved by each run."""
    return cast(list[str], OmegaConf.to_container(config.hydra.overrides.hydra, resolve=False))


def labels(node: DictConfig, varied: Sequence[str]) -> dict[str, Any]:
    """Return the composed values of the keys and groups that vary in a sweep.

    Parameters
    ----------
    node : DictConfig
        With Hydra's own part.
    varied : sequence of str
        The keys and groups of overrides with several values; a path stands for its group.
    """
    choices, values = node.hydra.runtime.choices, {}
    paths = {f"{group}.path": group for group in SUFFIXES}
    for word in varied:
        key = word.lstrip("+~").partition("@")[0]
        value = choices[key] if key in choices else OmegaConf.select(node, key)
        values[paths.get(key, key)] = OmegaConf.to_container(value) if OmegaConf.is_config(value) else value
    return values


def run_folder(*varied: str, _root_: DictConfig) -> str:
    """Return the name of a run's folder in its sweep by what it differs in, such as ``seed=1``."""
    number = _root_.hydra.job.get("num")
    joined = "+".join(f"{key}={value}" for key, value in labels(_root_, varied).items())
    name = re.sub(r"[^\w.+=-]+", "-", joined).strip("-") or str(number)
    return name if len(name) <= LONGEST_NAME else f"{number}-{name[:LONGEST_NAME]}"


def swept_folder(number: int, *, _root_: DictConfig) -> str:
    """Return the folder of a run by its number in its sweep; it is a plain name."""
    return sweep.read(Path(_root_.hydra.sweep.dir))[number].folder


# in every process that imports this module, so also where a launcher runs a job
OmegaConf.register_new_resolver("run_folder", run_folder, replace=True)
OmegaConf.register_new_resolver("swept_folder", swept_folder, replace=True)


def recorded_command(folder: Path, run: Path) -> tuple[str, ...]:
    """Return the arguments with which a run of a sweep would be started alone; nothing if none are known."""
    known = sweep.read(folder) if (folder / sweep.SWEEP).exists() else []
    return next((swept.command for swept in known if folder / swept.folder == run), ())


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
    kept = [override for override in overrides if override.key_or_group != EXPERIMENT]
    runs.given_again([override for override in kept if top_of(override.key_or_group) != HYDRA])
    left = unfinished(folder)
    for run in sweep.read(folder):
        lock.drop_left(folder / run.folder)
    for run in left:
        if not (folder / run.folder / artifacts.CONFIG).exists():
            configuration.write(folder / run.folder, run.config or stored_words.config_of(folder, run))
    if not left:
        sys.stderr.write(f"nothing is left to do: all {len(sweep.read(folder))} runs are finished\n")
        return []
    numbers = {run.folder: number for number, run in enumerate(sweep.read(folder))}
    return [
        f"+{RESUMED}=" + ",".join(str(numbers[run.folder]) for run in left),
        f"hydra.sweep.dir={quoted(str(literal(folder.absolute())))}",
        f"hydra.sweep.subdir={quoted(f'${{swept_folder:${{{RESUMED}}}}}')}",
        *words_of(kept),
    ]


def literal(folder: Path) -> Path:
    """Return a folder; raise ConfigError if Hydra would take a part of its name for an expression."""
    if "${" in str(folder):
        raise ConfigError(f"{folder} has ${{ in its name, which Hydra would replace; rename the folder")
    return folder
