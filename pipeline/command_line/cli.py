"""The command ``python -m pipeline``: checks first, then the stages.

Exit codes: 0 success, 1 a fault of the program (with a traceback), 2 a user error (in sentences
on standard error), 130 interrupted from the keyboard.
"""

import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from pipeline.command_line import runs, sweeps
from pipeline.command_line.arguments import Asked, read_arguments
from pipeline.command_line.config import compose_experiment, compose_node, job_of, options
from pipeline.command_line.overrides import (
    EXPERIMENT,
    ConfigError,
    check_overrides,
    check_sweeps,
    first_line,
    parse,
    rewrite_paths,
    single_runs,
)
from pipeline.command_line.runs import MISTAKE, OK
from pipeline.run import artifacts, maker, reproducible
from pipeline.run.runner import Interrupted
from pipeline.run.sweep import SWEEP

INTERRUPTED = 130
#: other commands, by the modules with a function of that name; few runs need them
COMMANDS = {name: f"pipeline.command_line.{name}" for name in ("cluster", "summary", "verify")}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        The exit code.
    """
    words = sys.orig_argv[1:] if arguments is None else ["-m", "pipeline", *arguments]
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _dispatch(arguments)
    except reproducible.NotInForce:
        return reproducible.start_anew(words)
    except Interrupted as interrupt:
        sys.stderr.write(f"\n{interrupt}\n")
        return INTERRUPTED
    except KeyboardInterrupt:
        sys.stderr.write("\ninterrupted before anything was done; nothing to keep\n")
        return INTERRUPTED
    except (ValueError, OSError, MemoryError) as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        sys.stderr.write(runs.told(error))
        return MISTAKE


def _dispatch(arguments: Sequence[str]) -> int:
    """Print what is only printed, or run the rest."""
    if arguments and (module := COMMANDS.get(arguments[0])):
        run: Callable[[Sequence[str]], int] = getattr(import_module(module), arguments[0])
        return run(arguments[1:])
    asked = read_arguments(arguments)
    if asked.version:
        sys.stdout.write(f"{maker.DISTRIBUTION} {maker.product_version()}\n")
        return OK
    if asked.help or not (asked.overrides or asked.resume or asked.compare or asked.cfg):
        from pipeline.command_line.guide import help_text  # noqa: PLC0415 - it loads compiled code

        sys.stdout.write(help_text(asked.folders) + "\n")
        return OK if asked.help else MISTAKE
    if asked.compare is not None:
        from pipeline.command_line.summary import compare  # noqa: PLC0415 - as above

        return compare(*asked.compare)
    return _experiment(asked)


def _experiment(asked: Asked) -> int:
    """Check the arguments; then run the experiment, or print its configuration."""
    groups = options(asked.folders)
    overrides = parse(rewrite_paths(asked.overrides))
    check_overrides(overrides, groups)
    check_sweeps(overrides, asked.multirun)
    if asked.resume is not None:
        if (asked.resume / SWEEP).exists() and not overrides:
            return sweeps.resume(asked.resume)
        return runs.resume(asked.resume, overrides)
    folder = None if asked.multirun else _run_folder(overrides)
    if folder is not None:
        if (folder / artifacts.MANIFEST).exists():
            return runs.repeat(folder, overrides, asked)
        keys = {override.key_or_group for override in overrides}
        if "stages" in keys and EXPERIMENT not in keys:
            raise ConfigError(
                f"{folder} holds no run; give the folder of a run to repeat stages of it, or add "
                "+experiment=NAME to start one there"
            )
    words = next(single_runs(overrides, groups))
    if asked.cfg:
        sys.stdout.write(_printed(compose_node(words, asked.config_dir), asked))
        return OK
    if asked.multirun:
        return sweeps.start(*sweeps.composed(asked, overrides))
    own = ["--config-dir", str(asked.config_dir.resolve())] if asked.config_dir else []
    job = compose_experiment(words, asked.config_dir)
    runs.check_before(job.experiment)
    return runs.start(job, [*own, *words])


def _run_folder(overrides: Sequence[Override]) -> Path | None:
    """Return the requested folder, None without one."""
    given = [override.value() for override in overrides if override.key_or_group == "hydra.run.dir"]
    return Path(str(given[-1])) if given else None


def _printed(node: DictConfig, asked: Asked) -> str:
    """Return a configuration as YAML: the run's, Hydra's own, or both."""
    shown = {"job": job_of(node), "hydra": node.hydra}.get(asked.cfg or "all", node)
    try:
        return OmegaConf.to_yaml(shown, resolve=asked.resolve)
    except OmegaConfBaseException as error:
        raise ConfigError(first_line(error)) from error
