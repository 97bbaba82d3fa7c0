"""The command ``python -m pipeline``: checks first, then Hydra, then the stages.

Exit codes: 0 done, 1 a fault of the program (with a traceback), 2 a mistake in what was asked (in sentences
on standard error), 130 stopped from the keyboard.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf

from pipeline.command_line.config import (
    CONFIG_NAME,
    EXPERIMENT,
    VERSION_BASE,
    ConfigError,
    check_overrides,
    compose_experiment,
    differences,
    options,
    parse,
    rewrite_controller_paths,
    single_runs,
)
from pipeline.run import artifacts
from pipeline.run.runner import Interrupted, finished_stages, run_stages
from pipeline.settings.experiment import Experiment
from pipeline.settings.nearest import did_you_mean
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import experiment_from

OK, MISTAKE, INTERRUPTED = 0, 2, 130

#: groups that a stage, repeated on an earlier run's files, may be given anew: those no other stage reads
OWN_GROUPS = {"record": ("telemetry",), "report": ("report",)}


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
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _dispatch(arguments)
    except Interrupted as interrupt:
        sys.stderr.write(f"\n{interrupt}\n")
        return INTERRUPTED
    except KeyboardInterrupt:
        sys.stderr.write("\ninterrupted before anything was done; nothing to keep\n")
        return INTERRUPTED
    except (ValueError, OSError, MemoryError) as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        sys.stderr.write(f"error: {_sentence(error)}\n")
        return MISTAKE


def _sentence(error: Exception) -> str:
    """Say what went wrong; an exhausted memory says little by itself."""
    if not isinstance(error, MemoryError):
        return str(error)
    return (
        "there is not enough memory for this; lower monte_carlo.num_cases, optimizer.population_size or "
        "duration_s, or lengthen control_period_s"
    )


def _dispatch(arguments: list[str]) -> int:
    """Tell commands from experiments."""
    words = [word for word in arguments if not word.startswith("-")]
    first = arguments[0] if arguments else ""
    if first and first[0] not in "+-~" and "=" not in first:
        raise ConfigError(
            f"there is no subcommand {first} (there are none); an experiment is started with "
            "+experiment=NAME and settings with key=value, see python -m pipeline --help"
        )
    if "--version" in arguments:
        sys.stdout.write(f"{artifacts.DISTRIBUTION} {artifacts.product_version()}\n")
        return OK
    if "--hydra-help" in arguments or any(word.startswith("--shell") for word in arguments):
        _through_hydra(arguments, lambda _config: None)
        return OK
    asked, overrides = _read_options(arguments)
    if asked.help or not words:
        from pipeline.command_line.guide import help_text  # noqa: PLC0415 - it loads compiled code

        sys.stdout.write(help_text(_folders(asked)) + "\n")
        return OK if asked.help else MISTAKE
    return _experiment(arguments, asked, overrides)


def _read_options(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """Read Hydra's options; what is left are the overrides."""
    parser = get_args_parser()
    parser.exit_on_error = False

    def refuse(message: str) -> None:
        raise ConfigError(f"{message}; see python -m pipeline --help")

    parser.error = refuse  # type: ignore[assignment,method-assign]
    try:
        asked, unknown = parser.parse_known_args(list(arguments))
    except argparse.ArgumentError as error:
        raise ConfigError(f"{error}; see python -m pipeline --help") from error
    for word in unknown:
        if word.startswith("-"):
            known = [text for action in parser._actions for text in action.option_strings]
            raise ConfigError(f"there is no option {word}{did_you_mean(word, known)}")
    for name in ("config_path", "config_name"):
        if getattr(asked, name) is not None:
            raise ConfigError(
                f"--{name.replace('_', '-')} would replace our configuration; add to it with --config-dir"
            )
    if asked.experimental_rerun is not None:
        raise ConfigError("--experimental-rerun would load a pickle; go on with resume=RUN_FOLDER instead")
    if asked.config_dir is not None and not Path(asked.config_dir).is_dir():
        raise ConfigError(
            f"--config-dir {asked.config_dir} is no folder; give one with experiments of your own"
        )
    # argparse takes overrides that stand apart from one another for unknown
    return asked, [*asked.overrides, *unknown]


def _folders(asked: argparse.Namespace) -> list[Path]:
    own = _own_folder(asked)
    return [conf_folder(), *([own] if own else [])]


def _own_folder(asked: argparse.Namespace) -> Path | None:
    return Path(asked.config_dir) if asked.config_dir else None


def _experiment(arguments: Sequence[str], asked: argparse.Namespace, written: Sequence[str]) -> int:
    """Check what was asked; then let Hydra make the folder and run the stages in it."""
    overrides = rewrite_controller_paths(text for text in written if not text.startswith("resume="))
    parsed = parse(overrides)
    check_overrides(parsed, options(_folders(asked)))
    _check_sweeps(parsed, asked)
    resumed = [text.partition("=")[2] for text in written if text.startswith("resume=")]
    if resumed:
        return _resume(Path(resumed[-1]).expanduser(), parsed)
    folder = None if asked.multirun else _run_folder(parsed)
    if folder is not None and any(
        (folder / name).exists() for name in (artifacts.CONFIG, artifacts.MANIFEST)
    ):
        return _repeat(folder, parsed, asked)
    keys = {override.key_or_group for override in parsed}
    if folder is not None and "stages" in keys and EXPERIMENT not in keys:
        raise ConfigError(
            f"{folder} holds no run; give the folder of a run to repeat stages of it, or add "
            "+experiment=NAME to start one there"
        )
    if not (asked.cfg or asked.info):
        for single in single_runs(parsed):
            _check_before(compose_experiment(single, _own_folder(asked)).experiment)
    options_alone = [word for word in arguments if word not in set(written)]
    outcomes: list[int] = []
    _through_hydra([*options_alone, *overrides], lambda config: outcomes.append(_job(config)))
    return max(outcomes, default=OK)


def _run_folder(overrides: Sequence[Override]) -> Path | None:
    """Return the folder that is asked for, None without one."""
    given = [override.value() for override in overrides if override.key_or_group == "hydra.run.dir"]
    return Path(str(given[-1])) if given else None


def _job(config: DictConfig) -> int:
    """Run one job in the folder that Hydra has made for it."""
    plain = OmegaConf.to_container(config, resolve=True)
    assert isinstance(plain, dict)  # noqa: S101 - the composed configuration is a mapping
    folder = Path(HydraConfig.get().runtime.output_dir)
    own = {str(key): value for key, value in plain.items()}
    try:
        _check_vacant(folder, own)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return MISTAKE
    return _run(own, folder)


def _check_vacant(folder: Path, config: dict[str, Any]) -> None:
    """Refuse a folder whose files another run has made; the same run may be made again."""
    if not (folder / artifacts.MANIFEST).exists():
        return
    if artifacts.read_manifest(folder)["config_hash"] != artifacts.config_hash(config):
        shown = _shown(folder)
        raise ConfigError(
            f"{shown} holds another run; choose another hydra.run.dir (for sweeps hydra.sweep.dir), or go on "
            f"with it by resume={shown}"
        )


def _shown(folder: Path) -> Path:
    """Return a folder as it is told to people: from where they are, if it lies there."""
    return Path(os.path.relpath(folder)) if folder.is_relative_to(Path.cwd()) else folder


def _run(
    config: dict[str, Any], folder: Path, stages: Sequence[str] | None = None, *, resume: bool = False
) -> int:
    """Run stages in a folder and say where the files are."""
    shown = _shown(folder)
    sys.stderr.write(f"run folder: {shown}\n")
    try:
        run_stages(experiment_from(config, resume=resume), config, shown, stages)
    except (ValueError, OSError, MemoryError) as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        sys.stderr.write(
            f"error: {_sentence(error)}\n(what the program was doing: {shown / artifacts.LOG})\n"
        )
        return MISTAKE
    sys.stdout.write(f"{shown}\n")
    return OK


def _check_sweeps(overrides: Sequence[Override], asked: argparse.Namespace) -> None:
    """Refuse several values where one run is asked for."""
    for override in overrides:
        if override.is_sweep_override() and not asked.multirun:
            text = override.input_line
            raise ConfigError(
                f"{text} gives several values; add -m for a run of each, or write a list as key=[a,b] and a "
                "text with a comma in quotes of its own"
            )


def _check_before(experiment: Experiment) -> None:
    """Refuse what a stage would refuse, before anything is made."""
    guidance = experiment.mission.guidance
    if "train" in experiment.stages and (guidance.kind, guidance.engine) == ("clusters", "sklearn"):
        raise ConfigError(
            "guidance.engine is sklearn, which flies one flight at a time; "
            "train with guidance.engine=compiled"
        )
    if "optimum" in experiment.stages:
        from pipeline.optimum.account import check_points  # noqa: PLC0415 - compiled code, like the controller's

        check_points(experiment.mission, experiment.optimum.points)
    if "evaluate" in experiment.stages:
        from pipeline.optimum.solved import IncomparableError, solved_for  # noqa: PLC0415 - the same

        with suppress(IncomparableError):
            solved_for(experiment)
    _check_controller(experiment)
    if "compare" in experiment.stages:
        _check_compared(experiment)


def _check_compared(experiment: Experiment) -> None:
    """Read the controllers that are compared."""
    from pipeline.controllers.source import named  # noqa: PLC0415 - compiled code, as above

    for name in experiment.compare.controllers:
        named(name, experiment.mission)


def _check_controller(experiment: Experiment) -> None:
    """Read the controller once before anything is made, for its mistakes to be told now."""
    from pipeline.controllers.source import load  # noqa: PLC0415 - compiled code, needed once the rest is right

    load(experiment.controller, experiment.mission)


def _resume(folder: Path, overrides: Sequence[Override]) -> int:
    """Go on where a run stopped, with its own configuration."""
    config = _config_of(folder)
    experiment = _experiment_of(folder, config)
    for override in overrides:
        if override.key_or_group != EXPERIMENT or override.value() != config.get("name"):
            raise ConfigError(
                f"resume goes on with the run's own configuration; drop {override.input_line}, or start "
                "a new run"
            )
    finished = finished_stages(folder)
    left = [stage for stage in experiment.stages if stage not in finished]
    if not left:
        sys.stderr.write(f"nothing is left to do: {', '.join(finished)} are finished\n")
        sys.stdout.write(f"{folder}\n")
        return OK
    _check_before(replace(experiment, stages=tuple(left)))
    return _run(config, folder, left, resume=True)


def _repeat(folder: Path, overrides: Sequence[Override], asked: argparse.Namespace) -> int:
    """Repeat stages on the files of an earlier run, with its configuration."""
    config = _config_of(folder)
    _experiment_of(folder, config)
    stages = next((override.value() for override in overrides if override.key_or_group == "stages"), None)
    if not isinstance(stages, list):
        raise ConfigError(
            f"{folder} holds a run already; go on with resume={folder}, repeat a stage of it with "
            "stages=[report], or choose another folder"
        )
    asked_for = [str(stage) for stage in stages]
    if any(not o.key_or_group.startswith("hydra.") and o.key_or_group != "stages" for o in overrides):
        new = compose_experiment([o.input_line or "" for o in overrides], _own_folder(asked)).config
        own = {group for stage in asked_for for group in OWN_GROUPS.get(stage, ())}
        if changed := differences(config, new, {*own, "stages"}):
            raise ConfigError(
                f"{folder} was made with another {', '.join(changed)}; drop what changes that, or start a "
                "new run"
            )
        config = {**new, "stages": config["stages"]}
    experiment = replace(experiment_from(config), stages=tuple(asked_for))
    _check_before(experiment)
    return _run(config, folder, asked_for)


def _config_of(folder: Path) -> dict[str, Any]:
    """Read a run's configuration and refuse one that was edited since."""
    config = artifacts.read_config(folder)
    if not (folder / artifacts.MANIFEST).exists():
        raise artifacts.ArtifactError(
            f"{folder} is no run's folder, it has no {artifacts.MANIFEST}; give the folder of a run, "
            "outputs/NAME/TIME"
        )
    if artifacts.config_hash(config) != artifacts.read_manifest(folder)["config_hash"]:
        raise artifacts.ArtifactError(
            f"{folder / artifacts.CONFIG} is not what the run was made with (its hash is not the "
            "manifest's); restore it, or start a new run"
        )
    return config


def _experiment_of(folder: Path, config: dict[str, Any]) -> Experiment:
    """Build the experiment of a run's configuration, which this program may not have made."""
    try:
        return experiment_from(config)
    except ValueError as error:
        raise artifacts.ArtifactError(
            f"{folder / artifacts.CONFIG} is no configuration of this program's ({error}); use the program "
            "that made the run, or start a new run"
        ) from error


def _through_hydra(arguments: Sequence[str], job: Callable[[DictConfig], None]) -> None:
    """Let Hydra read a command line, make the folders and call a job for each run."""
    main_of_hydra = hydra.main(str(conf_folder()), CONFIG_NAME, version_base=VERSION_BASE)(job)
    kept = sys.argv
    sys.argv = [kept[0], *arguments]
    try:
        main_of_hydra()
    finally:
        sys.argv = kept
