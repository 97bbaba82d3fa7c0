"""Starts runs, resumes them, and repeats stages on the files of an earlier run."""

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import Override

from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.command_line.choices import top_of
from pipeline.command_line.config import Job, compose_experiment
from pipeline.command_line.endings import MISSED, MISTAKES, OK, UNIMPROVED, UNPROVED
from pipeline.command_line.overrides import words_of
from pipeline.preflight import check_before
from pipeline.run import artifacts, configuration, manifests, typed
from pipeline.run.lock import held
from pipeline.run.runner import Missed, Unimproved, run_stages
from pipeline.settings import schema
from pipeline.settings.keys import TAGS, in_todays_words, with_values
from plain_files.streams import print_result

#: those of stages that end with a sentence of their own; any other sentence is of a proof
CODES = {Unimproved: UNIMPROVED, Missed: MISSED}
#: the key that names a logger
LOGGER = "logger.kind"
#: groups that may be changed when a stage is repeated on an earlier run's files: those no other stage reads
OWN_GROUPS = {"record": ("telemetry", "case"), "assure": ("assurance",), "report": ("report",)}


def run_new(job: Job, command: Sequence[str]) -> int:
    """Run an experiment in its folder, which the caller has locked; return the exit code.

    Parameters
    ----------
    job : Job
    command : sequence of str
        The arguments that start it.
    """
    check_vacant(job)
    return run(job, command=command)


def run_or_resume(job: Job, command: Sequence[str]) -> int:
    """Run an experiment, or resume it if it was begun in the folder; return the exit code.

    A job of a cluster that was stopped is begun again by the same command.
    """
    if (job.folder / artifacts.MANIFEST).exists():
        check_vacant(job)
        logger = job.experiment.logger
        return resume(job.folder, (), logger=logger.kind if logger.is_own else "")
    with held(job.folder):
        return run_new(job, command)


def check_vacant(job: Job) -> None:
    """Raise ConfigError if its folder holds another run; the same run may be repeated.

    Raises
    ------
    ConfigError, pipeline.controllers.source.ControllerError
        Also if a command names a controller whose file has changed since the run began.
    """
    if not (job.folder / artifacts.MANIFEST).exists():
        if (job.folder / artifacts.CONFIG).exists():
            stored(job.folder)
        return
    if not configuration.is_of(job.config, manifests.read(job.folder)):
        path = shown_path(job.folder)
        raise ConfigError(
            f"{path} holds another run; choose another hydra.run.dir or hydra.sweep.dir, or go on with "
            f"it: {typed.resume(path)}"
        )
    from pipeline.controllers.source import require_kept  # noqa: PLC0415 - compiled code

    require_kept(job.experiment, job.folder)


def shown_path(folder: Path) -> Path:
    """Return a folder relative to the working directory if it lies below it."""
    return Path(os.path.relpath(folder)) if Path.cwd() in folder.parents else folder


def run(job: Job, stages: Sequence[str] | None = None, command: Sequence[str] | None = None) -> int:
    """Run stages in a folder that was checked; print where the files are and what is missing.

    Parameters
    ----------
    job : Job
    stages : sequence of str, optional
        By default all of the experiment's.
    command : sequence of str, optional
        The arguments with which a new run is started.

    Returns
    -------
    int
        The exit code.
    """
    path = shown_path(job.folder)
    sys.stderr.write(f"run folder: {path}\n")
    try:
        missing = run_stages(job.experiment, job.config, path, stages, command)
    except MISTAKES as error:
        error.add_note(f"(what the program was doing: {path / artifacts.LOG})")
        raise
    print_result(f"{path}\n")
    sys.stderr.writelines(f"{sentence}\n" for sentence in missing)
    return min((CODES.get(type(words), UNPROVED) for words in missing), default=OK)


def resume(
    folder: Path, overrides: Sequence[Override], command: Sequence[str] | None = None, logger: str = ""
) -> int:
    """Resume a run with its own configuration; return the exit code.

    Parameters
    ----------
    folder : Path
    overrides : sequence of Override
        Those on the command line: of settings that no result depends on.
    command : sequence of str, optional
        The arguments with which it is started, for a run of a sweep that was not begun.
    logger : str
        A logger of one's own that is given now; that of a stored configuration is not called.
    """
    configuration.read(folder)
    with held(folder):
        job = stored(folder)
        given = given_again(overrides, job.experiment.name)
        config = with_values(job.config, given | ({LOGGER: logger} if logger else {}))
        experiment = schema.experiment_from(config)
        manifest = manifests.read_if_any(folder)
        finished = manifest.get("finished_stages", [])
        left = tuple(stage for stage in experiment.stages if stage not in finished)
        if not left:
            sys.stderr.write(f"nothing is left to do: {', '.join(finished)} are finished\n")
            sys.stdout.write(f"{folder}\n")
            return OK
        check_before(replace(experiment, stages=left))
        job = Job(config, replace(experiment, resume=True), folder)
        return run(job, left, None if manifest else command)


def given_again(overrides: Iterable[Override], name: str = "") -> dict[str, Any]:
    """Return the settings that override those of resumed runs, by dotted key.

    Parameters
    ----------
    overrides : iterable of Override
    name : str
        Of the run's experiment, which may be given too.

    Raises
    ------
    ConfigError
        If a result depends on one.
    """
    free, given = schema.free_keys(), {}
    for override in overrides:
        if override.key_or_group in free or top_of(override.key_or_group) in free:
            given[override.key_or_group] = override.value()
        elif override.key_or_group != EXPERIMENT or override.value() != name:
            raise ConfigError(
                f"resume goes on with the configuration that is stored; drop {override.input_line}, or start "
                f"anew. No result depends on {', '.join(free)}: these may be given"
            )
    return given


def repeat(folder: Path, overrides: Mapping[str, Override], config_dir: Path | None) -> int:
    """Repeat stages on the files of an earlier run, with its configuration; return the exit code.

    Parameters
    ----------
    folder : Path
    overrides : mapping of str to Override
        By key: the stages, and what they alone read.
    config_dir : Path, optional
        A user's own folder of configurations.
    """
    with held(folder):
        config = stored(folder).config
        given = {key: each.value() for key, each in overrides.items() if not key.startswith("hydra.")}
        stages = given.pop("stages", None)
        if not isinstance(stages, list):
            raise ConfigError(
                f"{folder} holds a run already; go on with it, {typed.resume(folder)}, repeat a stage, "
                f"{typed.repeat(folder, 'report')}, or choose another folder"
            )
        stages = [str(stage) for stage in stages]
        if is_composed := any("." not in key and key not in schema.schema() for key in given):
            new = compose_experiment(words_of(overrides.values()), config_dir).config
        else:
            new = with_values(config, given)
            for key, mark in schema.idle(new).items():
                if key in given:
                    raise ConfigError(mark.refusal(key, new))
        own_groups = {group for stage in stages for group in OWN_GROUPS.get(stage, ())}
        then, now = (schema.only_results(schema.present(compared)) for compared in (config, new))
        if changed := schema.differences(then, now, {*own_groups, "stages"}):
            raise ConfigError(
                f"{folder} was made with another {', '.join(changed)}; drop what changes that, or start anew"
            )
        noted = {**config.get(TAGS, {}), **new.get(TAGS, {})}
        config = {**new, "stages": config["stages"], TAGS: noted}
        experiment = schema.experiment_from(config)
        check_before(replace(experiment, stages=tuple(stages)))
        if is_composed:
            from pipeline.controllers.source import require_kept  # noqa: PLC0415 - compiled code

            require_kept(experiment, folder)
        return run(Job(config, experiment, folder), stages)


def stored(folder: Path) -> Job:
    """Return a run as it is stored, but for a logger of one's own, which only a command calls.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If it was edited since, or is not of this program.
    """
    config = configuration.read(folder)
    if not artifacts.holds_run(folder):
        raise artifacts.ArtifactError(
            f"{folder} is no run's folder, it has no {artifacts.MANIFEST}; {artifacts.choose_run(folder)}"
        )
    manifest = manifests.read_if_any(folder)
    if manifest and not configuration.is_of(config, manifest):
        raise artifacts.ArtifactError(
            f"{folder / artifacts.CONFIG} is not what the run was made with (its hash is not the "
            "manifest's); restore it, or start a new run"
        )
    try:
        config = in_todays_words(config)
        if schema.experiment_from(config).logger.is_own:
            config = with_values(config, {LOGGER: "none"})
        return Job(config, schema.experiment_from(config), folder)
    except ValueError as error:
        raise artifacts.ArtifactError(
            f"{folder / artifacts.CONFIG} is no configuration of this program's ({error}); use the program "
            "that made the run, or start a new run"
        ) from error
