"""Starts runs, resumes them, and repeats stages on the files of an earlier run."""

import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fis_tools.streams import print_result
from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.run import artifacts, configuration, maker, manifests
from pipeline.run.engine import check_engine
from pipeline.run.extras import require_packages
from pipeline.run.lock import held
from pipeline.run.runner import Unimproved, run_stages
from pipeline.settings import schema
from pipeline.settings.experiment import Experiment
from pipeline.settings.keys import in_todays_words, with_values

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override

    from pipeline.command_line.config import Job

#: exit codes; the last one is of a run that was asked for a proof and found none
OK, FAULT, MISTAKE, UNPROVED, UNIMPROVED = 0, 1, 2, 3, 4

#: groups that may be changed when a stage is repeated on an earlier run's files: those no other stage reads
OWN_GROUPS = {"record": ("telemetry", "case"), "assure": ("assurance",), "report": ("report",)}


def error_sentence(error: Exception) -> str:
    """Return the message of an error; one for lack of memory has none of its own."""
    if not isinstance(error, MemoryError):
        return str(error)
    return (
        "there is not enough memory for this; lower monte_carlo.num_cases, optimizer.population_size or "
        "duration_s, or lengthen control_period_s"
    )


def error_text(error: Exception) -> str:
    """Return the message of a user error, with its notes."""
    return "\n".join([f"error: {error_sentence(error)}", *getattr(error, "__notes__", ())]) + "\n"


def run_new(job: "Job", command: Sequence[str]) -> int:
    """Run an experiment, with the run's folder locked by the caller; return the exit code.

    Parameters
    ----------
    job : Job
    command : sequence of str
        The arguments that start it.
    """
    check_vacant(job)
    return _run(job.config, job.experiment, job.folder, command=command)


def run_or_resume(job: "Job", command: Sequence[str]) -> int:
    """Run an experiment, or resume it if it was begun in the folder; return the exit code.

    A job of a cluster that was stopped is begun again by the same command.
    """
    if (job.folder / artifacts.MANIFEST).exists():
        check_vacant(job)
        return resume(job.folder, ())
    with held(job.folder):
        return run_new(job, command)


def check_vacant(job: "Job") -> None:
    """Raise ConfigError if the folder holds another run; the same run may be repeated."""
    if not (job.folder / artifacts.MANIFEST).exists():
        if (job.folder / artifacts.CONFIG).exists():
            _experiment_of(job.folder, _stored(job.folder))
        return
    if not configuration.is_of(job.config, manifests.read(job.folder)):
        path = shown_path(job.folder)
        raise ConfigError(
            f"{path} holds another run; choose another hydra.run.dir (for sweeps hydra.sweep.dir), or go on "
            f"with it by resume={path}"
        )
    _require_kept(job.experiment, job.folder)


def _require_kept(experiment: Experiment, folder: Path) -> None:
    """Raise ControllerError if a command names a controller whose file has changed since the run began."""
    from pipeline.controllers.source import require_kept  # noqa: PLC0415 - compiled code

    require_kept(experiment, folder)


def shown_path(folder: Path) -> Path:
    """Return a folder relative to the working directory if it lies below it."""
    return Path(os.path.relpath(folder)) if Path.cwd() in folder.parents else folder


def _run(
    config: dict[str, Any],
    experiment: Experiment,
    folder: Path,
    stages: Sequence[str] | None = None,
    command: Sequence[str] | None = None,
) -> int:
    """Run stages in a folder, and print where the files are and which proofs are missing."""
    path = shown_path(folder)
    sys.stderr.write(f"run folder: {path}\n")
    try:
        missing = run_stages(experiment, config, path, stages, command)
    except (ValueError, OSError, MemoryError) as error:
        error.add_note(f"(what the program was doing: {path / artifacts.LOG})")
        raise
    print_result(f"{path}\n")
    sys.stderr.writelines(f"{sentence}\n" for sentence in missing)
    if not missing:
        return OK
    return UNIMPROVED if all(isinstance(words, Unimproved) for words in missing) else UNPROVED


def resume(folder: Path, overrides: Sequence["Override"], command: Sequence[str] | None = None) -> int:
    """Resume a run with its own configuration; return the exit code.

    Parameters
    ----------
    folder : Path
    overrides : sequence of Override
        Those on the command line: of settings that no result depends on.
    command : sequence of str, optional
        The arguments with which it is started, for a run of a sweep that was not begun.
    """
    configuration.read(folder)
    with held(folder):
        stored = _stored(folder)
        given = _given_again(overrides, _experiment_of(folder, stored).name)
        config = with_values(stored, given)
        experiment = _experiment_of(folder, config)
        manifest = manifests.read_if_any(folder)
        finished = manifest.get("finished_stages", [])
        left = [stage for stage in experiment.stages if stage not in finished]
        if not left:
            sys.stderr.write(f"nothing is left to do: {', '.join(finished)} are finished\n")
            sys.stdout.write(f"{folder}\n")
            return OK
        check_before(replace(experiment, stages=tuple(left)))
        command = None if manifest else command
        return _run(config, replace(experiment, resume=True), folder, left, command)


def _given_again(overrides: Sequence["Override"], name: str) -> dict[str, Any]:
    """Return the settings that override those of a resumed run, by dotted key."""
    given = {}
    for override in overrides:
        if override.key_or_group in schema.free_keys():
            given[override.key_or_group] = override.value()
        elif override.key_or_group != EXPERIMENT or override.value() != name:
            raise ConfigError(
                f"resume goes on with the run's own configuration; drop {override.input_line}, or start "
                f"a new run. No result depends on {', '.join(schema.free_keys())}: these may be given"
            )
    return given


def repeat(folder: Path, overrides: Sequence["Override"], config_dir: Path | None) -> int:
    """Repeat stages on the files of an earlier run, with its configuration; return the exit code."""
    configuration.read(folder)
    with held(folder):
        config = _stored(folder)
        experiment = _experiment_of(folder, config)
        stages = next((override.value() for override in overrides if override.key_or_group == "stages"), None)
        if not isinstance(stages, list):
            raise ConfigError(
                f"{folder} holds a run already; go on with resume={folder}, repeat a stage of it with "
                "stages=[report], or choose another folder"
            )
        asked_for = [str(stage) for stage in stages]
        own_groups = {group for stage in asked_for for group in OWN_GROUPS.get(stage, ())}
        given = [
            o for o in overrides if o.key_or_group != "stages" and not o.key_or_group.startswith("hydra.")
        ]
        keys = [override.key_or_group for override in given]
        if is_composed := any("." not in key and key not in schema.schema() for key in keys):
            from pipeline.command_line.config import compose_experiment  # noqa: PLC0415 - Hydra, which few runs need

            new = compose_experiment([o.input_line or "" for o in overrides], config_dir).config
        else:
            new = with_values(config, {override.key_or_group: override.value() for override in given})
            for key, mark in schema.idle(new).items():
                if key in keys:
                    raise ConfigError(mark.refusal(key, new))
        then, now = (schema.only_results(schema.present(compared)) for compared in (config, new))
        if changed := schema.differences(then, now, {*own_groups, "stages"}):
            raise ConfigError(
                f"{folder} was made with another {', '.join(changed)}; drop what changes that, or start "
                "a new run"
            )
        config = {**new, "stages": config["stages"]}
        experiment = schema.experiment_from(config)
        check_before(replace(experiment, stages=tuple(asked_for)))
        if is_composed:
            _require_kept(experiment, folder)
        return _run(config, experiment, folder, asked_for)


def _stored(folder: Path) -> dict[str, Any]:
    """Return a run's configuration as it is stored; raise an error if it was edited since."""
    config = configuration.read(folder)
    if not artifacts.holds_run(folder):
        raise artifacts.ArtifactError(
            f"{folder} is no run's folder, it has no {artifacts.MANIFEST}; give the folder of a run, "
            "outputs/NAME/TIME"
        )
    manifest = manifests.read_if_any(folder)
    if manifest and not configuration.is_of(config, manifest):
        raise artifacts.ArtifactError(
            f"{folder / artifacts.CONFIG} is not what the run was made with (its hash is not the "
            "manifest's); restore it, or start a new run"
        )
    return in_todays_words(config)


def _experiment_of(folder: Path, config: dict[str, Any]) -> Experiment:
    """Return the experiment of a run's configuration, possibly from another version."""
    try:
        return schema.experiment_from(config)
    except ValueError as error:
        raise artifacts.ArtifactError(
            f"{folder / artifacts.CONFIG} is no configuration of this program's ({error}); use the program "
            "that made the run, or start a new run"
        ) from error


def check_before(experiment: Experiment) -> None:
    """Check whatever stages would refuse later, before any folder is made."""
    check_engine(experiment.engine)
    require_packages(experiment)
    # NumPy, needed once the settings are right
    from pipeline.flight.cases.dispersions import missions_at_ends  # noqa: PLC0415
    from pipeline.flight.world.chief import check_perigee, num_chief_steps  # noqa: PLC0415

    if experiment.reproducible:
        maker.require_reproducible()
    for mission in (experiment.mission, *missions_at_ends(experiment.mission)):
        num_chief_steps(mission)
        check_perigee(mission)
    if experiment.mission.chief.shape == "mesh":
        from pipeline.flight.world.surface import surface_of  # noqa: PLC0415 - the same

        surface_of(experiment.mission)
    guidance = experiment.mission.guidance
    if "train" in experiment.stages and (guidance.kind, guidance.engine) == ("clusters", "sklearn"):
        raise ConfigError(
            "guidance.engine is sklearn, which flies one flight at a time; "
            "train with guidance.engine=compiled"
        )
    if "assure" in experiment.stages:
        from pipeline.evaluation.assurance.requirements import check_formulas, load_requirements  # noqa: PLC0415

        requirements = load_requirements(experiment.assurance.requirements)
        check_formulas(requirements, experiment.mission)
    if "optimum" in experiment.stages:
        from pipeline.optimum.problem import check_light  # noqa: PLC0415 - compiled code, like the controller's
        from pipeline.optimum.solved import check_points  # noqa: PLC0415 - the same

        check_light(experiment.mission)
        check_points(experiment.mission, experiment.optimum.points)
    if "evaluate" in experiment.stages:
        from pipeline.optimum.solved import IncomparableError, solved_for  # noqa: PLC0415 - the same

        with suppress(IncomparableError):
            solved_for(experiment)
    from pipeline.controllers.source import load, named  # noqa: PLC0415 - compiled code, needed once the rest is right
    from pipeline.flight.control.controller import about_points  # noqa: PLC0415 - the same
    from pipeline.flight.control.law import law_of  # noqa: PLC0415 - the same

    controllers = [load(experiment.controller, experiment.mission)]
    if "assure" in experiment.stages:
        from pipeline.evaluation.assurance.proofs import check_questions  # noqa: PLC0415 - the same

        check_questions(requirements, controllers[0])
    if "train" in experiment.stages:
        from pipeline.training.genome import genome_of  # noqa: PLC0415 - the same

        genome_of(controllers[0], experiment.optimizer.encoding)
    elif "search" not in experiment.stages:
        law_of(controllers[0], experiment.mission)
    names = experiment.compare.controllers if "compare" in experiment.stages else ()
    controllers += [named(name, experiment.mission) for name in names]
    for controller in controllers if experiment.mission.problem.kind == "reach" else ():
        if sensed := about_points(controller):
            sys.stderr.write(
                f"note: {controller.name} senses {', '.join(sensed)}, which are about points to inspect, and "
                "there are none where problem.kind is reach\n"
            )


def most_telling(codes: Iterable[int]) -> int:
    """Return the exit code for several runs: a failure's, else that of one without proof or gain, else 0."""
    codes = list(codes)
    return max((code for code in codes if code not in (UNPROVED, UNIMPROVED)), default=OK) or max(
        codes, default=OK
    )
