"""Experiments from the command line: checked, then run, resumed, repeated, printed, or flown beside edits."""

import argparse
import os
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import Override

from fis_tools.errors import MissingExtra
from pipeline.command_line import runs
from pipeline.command_line.arguments import EXPERIMENT, Asked, ConfigError, read_arguments
from pipeline.command_line.config import Job, check_stages, compose_experiment, compose_jobs, options
from pipeline.command_line.overrides import Groups, differences_of, folder_names, read_overrides, single_runs
from pipeline.run import artifacts, configuration, sweep
from pipeline.run.lock import held
from pipeline.run.runner import Interrupted
from pipeline.run.sweep import DONE, SWEEP, SweptRun, state_of
from pipeline.settings.schema import commented


def plan(asked: Asked) -> Callable[[], int]:
    """Check and compose the arguments; return a function that carries them out and returns the exit code.

    Raises
    ------
    ValueError, OSError
    """
    groups = options(asked.folders)
    overrides = read_overrides(asked.overrides, groups, is_multirun=asked.multirun)
    if asked.resume is not None:
        if (asked.resume / SWEEP).exists():
            return partial(resume_sweep, asked.resume, overrides)
        return partial(runs.resume, asked.resume, overrides)
    folder = None if asked.multirun else _run_folder(overrides)
    if folder is not None:
        if (folder / artifacts.MANIFEST).exists():
            return partial(runs.repeat, folder, overrides, asked.config_dir)
        keys = {override.key_or_group for override in overrides}
        if "stages" in keys and EXPERIMENT not in keys:
            raise ConfigError(
                f"{folder} holds no run; give the folder of a run to repeat stages of it, or add "
                "+experiment=NAME to start one there"
            )
    if asked.multirun and not asked.cfg:
        return _sweep(asked, overrides, groups)
    words = next(single_runs(overrides, groups))
    job = compose_experiment(words, asked.config_dir)
    check_stages(job.config, words)
    if asked.cfg:
        return partial(_print, job.config)
    runs.check_before(job.experiment)
    return partial(runs.start, job, [*_config_dir_of(asked), *words])


def _config_dir_of(asked: Asked) -> list[str]:
    """Return the option of a folder of configurations as it is kept with a run: wherever that is resumed."""
    return ["--config-dir", str(asked.config_dir.resolve())] if asked.config_dir else []


def _run_folder(overrides: Sequence[Override]) -> Path | None:
    """Return the requested folder, None without one."""
    given = [override.value() for override in overrides if override.key_or_group == "hydra.run.dir"]
    return Path(str(given[-1])) if given else None


def _print(config: Mapping[str, Any]) -> int:
    """Print a run's configuration as YAML, with the meanings of its keys."""
    sys.stdout.write(commented(config))
    return runs.OK


def _sweep(asked: Asked, overrides: Sequence[Override], groups: Groups) -> Callable[[], int]:
    """Compose every combination of values, each in a folder named after them, and check them.

    Return a function that runs them all, in a new or an extended sweep, and returns the exit code.
    """
    words = list(single_runs(overrides, groups))
    differing = differences_of(overrides, groups)
    jobs = compose_jobs(words, asked.config_dir, names=folder_names(differing))
    folder, own = jobs[0].sweep_folder, _config_dir_of(asked)
    swept = [
        SweptRun(job.folder.relative_to(folder).as_posix(), differs, (*own, *chosen))
        for job, differs, chosen in zip(jobs, differing, words, strict=True)
    ]
    for job, chosen in zip(jobs, words, strict=True):
        check_stages(job.config, chosen)
        runs.check_before(job.experiment)
    return partial(_start_sweep, jobs, swept, folder)


def _start_sweep(jobs: Sequence[Job], swept: Sequence[SweptRun], folder: Path) -> int:
    with held(folder):
        # a sweep may be extended
        earlier = sweep.read(folder) if (folder / SWEEP).exists() else []
        known = list({run.folder: run for run in (*earlier, *swept)}.values())
        for job in jobs:
            # so that it can be resumed; what is there is kept
            if not (job.folder / artifacts.CONFIG).exists():
                configuration.write(job.folder, job.config)
        # last: what is in its file can be resumed
        sweep.write(folder, known)
        begun = [(run, partial(runs.start, job, run.command)) for job, run in zip(jobs, swept, strict=True)]
        return _run_all(folder, known, begun)


def resume_sweep(folder: Path, overrides: Sequence[Override]) -> int:
    """Resume the unfinished runs of a sweep, each as `runs.resume`; return the exit code."""
    with held(folder):
        known = sweep.read(folder)
        left = [run for run in known if state_of(folder, run) != DONE]
        if not left:
            sys.stderr.write(f"nothing is left to do: all {len(known)} runs are finished\n")
            return runs.OK
        begun = [(run, partial(runs.resume, folder / run.folder, overrides, run.command)) for run in left]
        return _run_all(folder, known, begun)


def _run_all(folder: Path, known: list[SweptRun], begun: Sequence[tuple[SweptRun, Callable[[], int]]]) -> int:
    """Run all given runs, with a line each; at the end list those that failed."""
    started, codes = time.perf_counter(), [runs.OK]
    for number, (run, begin) in enumerate(begun, 1):
        try:
            code, failure = _attempt(begin)
        except Interrupted as interrupt:
            left = len(begun) - number + 1
            raise Interrupted(
                f"{interrupt}\n{left} runs of the sweep are left. To go on with all: "
                f"python -m pipeline resume={folder}"
            ) from interrupt
        codes.append(code)
        known = [replace(one, failure=failure) if one.folder == run.folder else one for one in known]
        sweep.write(folder, known)
        per_run = (time.perf_counter() - started) / number
        word = f"FAILED: {failure}" if failure else "done"
        sys.stderr.write(
            f"[{number}/{len(begun)}] {run.folder}: {word}; {per_run * (len(begun) - number):.0f} s left\n"
        )
    _tell(folder, known)
    # a run that failed says more than one that proved nothing
    return max((code for code in codes if code != runs.UNPROVED), default=runs.OK) or max(codes)


def _attempt(begin: Callable[[], int]) -> tuple[int, str]:
    """Run one; return its exit code and why it failed, or nothing."""
    if os.environ.get("HYDRA_FULL_ERROR") == "1":
        return begin(), ""
    try:
        return begin(), ""
    except (ValueError, OSError, MemoryError) as error:
        sys.stderr.write(runs.in_words(error))
        return runs.MISTAKE, runs.sentence(error)
    except Exception as error:  # noqa: BLE001 - the failure of one run must not lose the others
        traceback.print_exc()
        return runs.FAULT, f"a fault of the program: {type(error).__name__}: {error}"


def _tell(folder: Path, known: Sequence[SweptRun]) -> None:
    """Print the results of a sweep, and how to see its summary."""
    failed = [run for run in known if run.failure]
    for run in failed:
        sys.stderr.write(f"failed: {run.folder}: {run.failure}\n")
    sys.stderr.write(
        f"{len(known) - len(failed)} of {len(known)} runs are done"
        + (f"; to try the others again: python -m pipeline resume={folder}" if failed else "")
        + f"\nto see what came out: python -m pipeline summary {folder}\n"
    )


def edit(arguments: Sequence[str]) -> int:
    """Open a page on which rules and terms change, and each touch flies 1,000 paired cases anew.

    Usage: python -m pipeline edit [key=value ...] [--port PORT] [--no-browser]

    Keys are those of +experiment=evaluate, such as controller=champion_27, world=leo or sun=random. Ctrl-C
    ends it. Nothing is written but the copy that you save.

    Returns
    -------
    int
        The exit code.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = argparse.ArgumentParser(prog="python -m pipeline edit", allow_abbrev=False, add_help=False)
    parser.add_argument("--port", type=int, default=0, choices=range(1 << 16), metavar="PORT")
    parser.add_argument("--no-browser", action="store_true")
    chosen, words = parser.parse_known_args(list(arguments))
    asked = read_arguments(words)
    overrides = read_overrides(asked.overrides, options(asked.folders), is_multirun=asked.multirun)
    words = [one.input_line or "" for one in overrides]
    if EXPERIMENT not in {one.key_or_group for one in overrides}:
        words.insert(0, f"+{EXPERIMENT}=evaluate")
    experiment = compose_experiment(words, asked.config_dir).experiment
    runs.check_before(experiment)

    from pipeline.controllers.source import load  # noqa: PLC0415 - compiled code, needed once the rest is right

    try:
        from fis_tools.edit.server import serve  # noqa: PLC0415 - the other commands do without a server
    except MissingExtra as error:
        raise ConfigError(str(error)) from error
    from fis_tools.edit.page import Editor  # noqa: PLC0415
    from pipeline.edit import panels  # noqa: PLC0415 - compiled code
    from pipeline.evaluation.assurance.requirements import load_requirements  # noqa: PLC0415 - compiled code
    from pipeline.flight.state.signals import CONSTANTS  # noqa: PLC0415

    controller = load(experiment.controller, experiment.mission).fuzzy
    if controller is None:
        raise ConfigError("this controller has no rules to edit; choose one that has, such as champion_27")
    requirements = load_requirements(experiment.assurance.requirements)
    path = Path(str(experiment.controller.get("path", f"{controller.name}.yaml")))
    meanings = {name: kind.description for name, kind in CONSTANTS.items()}

    def page() -> None:
        Editor(path, controller, panels(controller, experiment, requirements), meanings)

    serve(page, controller.name, chosen.port, not chosen.no_browser)
    return runs.OK
