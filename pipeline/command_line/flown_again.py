"""Commands on the folder of a run, which need nothing else: ``fly``, ``again`` and ``repeat``."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from pipeline.command_line import runs
from pipeline.command_line.arguments import CommandParser, ConfigError
from pipeline.command_line.config import Job, compose_experiment
from pipeline.command_line.overrides import read_overrides, words_of
from pipeline.preflight import check_before
from pipeline.run import artifacts
from pipeline.run.lock import held
from pipeline.settings import schema
from pipeline.settings.keys import with_values
from pipeline.settings.places import conf_folder
from pipeline.settings.stages import STAGES, check_stage_names

#: what a flight alone changes in the configuration of its run
FLOWN: Final[Mapping[str, Any]] = {
    "stages": ["record"],
    "telemetry.record_training": False,
    "telemetry.record_ranked": False,
    "telemetry.record_start": True,
}
GIVEN: Final = ("case", "controller")


def fly(given: Sequence[str]) -> int:
    """Fly a case of a run again, in the world of the run, and record it in a new folder.

    Usage: python -m pipeline fly RUN_FOLDER [case=N] [controller=NAME_OR_FILE]

    World, limits, errors and the draw of the cases are those of the run's checked configuration; its
    controller is the one that the run made or flew, unless another is given. Without case=N it is case 0 of a
    run that draws cases, else the start that is configured.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser("python -m pipeline fly")
    if not given:
        parser.error("fly takes the folder of a run")
    folder, words = Path(given[0]).expanduser(), list(given[1:])
    overrides = read_overrides(words, [conf_folder()], "give one")
    for override in overrides:
        if (override.key_or_group or "").partition(".")[0] not in GIVEN:
            raise ConfigError(
                f"fly takes case=N and controller=NAME, and no {override.input_line}: all else is the run's"
            )
    stored = runs.stored(folder)
    changes: dict[str, Any] = {**FLOWN, "case": None, **made_by(folder, stored.config)}
    if "scenario" in stored.experiment.stages:
        changes["case"] = 0
    config = with_values(stored.config, changes)
    if chosen := [override for override in overrides if override.key_or_group != "case"]:
        config["controller"] = compose_experiment(["+experiment=fly", *words_of(chosen)]).config["controller"]
    cases = [override.value() for override in overrides if override.key_or_group == "case"]
    config = schema.present(with_values(config, {"case": cases[-1]} if cases else {}))
    job = Job(config, schema.experiment_from(config), _new_folder(f"{config['name']}-fly"))
    check_before(job.experiment)
    with held(job.folder):
        return runs.run_new(job, ["fly", str(folder), *words])


def again(given: Sequence[str]) -> int:
    """Make the same run again, from its checked configuration, in a new folder.

    Usage: python -m pipeline again RUN_FOLDER

    A controller from a file must be as it was. Where everything that a result depends on is the same, so is
    each file: `python -m pipeline verify RUN_FOLDER OTHER_RUN_FOLDER` compares them.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser("python -m pipeline again")
    if len(given) != 1:
        parser.error("again takes the folder of a run, and nothing else")
    folder = Path(given[0]).expanduser()
    stored = runs.stored(folder)
    check_before(stored.experiment)
    from pipeline.controllers.source import require_kept  # noqa: PLC0415 - compiled code

    require_kept(stored.experiment, folder)
    job = Job(stored.config, stored.experiment, _new_folder(stored.experiment.name))
    with held(job.folder):
        return runs.run_new(job, ["again", str(folder)])


def repeat(given: Sequence[str]) -> int:
    """Repeat stages of a run on its files, with its configuration.

    Usage: python -m pipeline repeat RUN_FOLDER STAGE [STAGE ...]

    With other settings of what a stage alone reads: python -m pipeline stages=[STAGE]
    hydra.run.dir=RUN_FOLDER key=value.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser("python -m pipeline repeat")
    if len(given) < 2:
        parser.error(f"repeat takes the folder of a run, and stages: {', '.join(STAGES)}")
    folder, *stages = given
    check_stage_names(stages)
    words = [f"stages=[{','.join(stages)}]"]
    (override,) = read_overrides(words, [conf_folder()], "give one")
    return runs.repeat(Path(folder).expanduser(), {"stages": override}, None)


def _new_folder(name: str) -> Path:
    """Return where a run of a name goes that is made now."""
    now = datetime.now(UTC).astimezone().strftime("%Y%m%d-%H%M%S-%f")
    return Path("outputs", name, now)


def made_by(folder: Path, config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that a run came to itself: its controller, and the safety layer of a fit."""
    names = (artifacts.CHAMPION, artifacts.CONTROLLER)
    kept = next((folder / name for name in names if (folder / name).exists()), None)
    made: dict[str, Any] = {} if kept is None else {"controller": {"path": str(kept.resolve())}}
    if "fit" in config.get("stages", ()) and (folder / artifacts.FIT).exists():
        made["safety.kind"] = artifacts.read_json(folder, artifacts.FIT).get("safety") or "none"
    return made
