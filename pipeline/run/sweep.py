"""The file of a sweep: its runs, their differences and their checked configurations.

What became of a run is in its own folder, wherever it ran: its manifest, and how it ended unless well.
"""

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Final, NamedTuple

from pipeline.run import artifacts, configuration, manifests, typed, writing
from pipeline.settings import keys, schema

SWEEP: Final = "sweep.json"
#: 2 added configurations
SWEEP_VERSION: Final = 2
VERSIONS_READ: Final = (1, 2)
#: of a run that did not end well, in its folder; the point keeps it out of the manifest
ENDING: Final = ".ending.json"
#: see `pipeline.run.manifests.fits`
RUN_SHAPE: Final = {
    **{"folder": str, "differs": dict, "command": [str], "failure": str},
    **{"config": {str: object}, "without": [str]},
}
#: a name, or several, of folders inside a sweep's: nothing in it means anything to a shell, a page or Hydra
PLAIN_FOLDER: Final = re.compile(r"(?!.*\.\.)[\w+=(\[][\w.+=,@()\[\] -]*(/[\w+=(\[][\w.+=,@()\[\] -]*)*")
#: of a folder, bytes, on the usual file systems
LONGEST_NAME: Final = 255

DONE, FAILED, UNFINISHED = "done", "failed", "unfinished"


@dataclass(frozen=True)
class SweptRun:
    """A run of a sweep.

    Parameters
    ----------
    folder : str
        In the sweep's folder.
    differs : mapping of str to str
        Key to value in this run, for the keys that vary in the sweep.
    command : tuple of str
        The arguments with which it would be started alone, to be read by people: nothing composes them.
    failure : str
        Why it failed; empty if it did not. Earlier versions kept it in the sweep's file.
    config : mapping
        Its checked configuration; empty where it is not known: earlier versions kept none.
    """

    folder: str
    differs: Mapping[str, str]
    command: tuple[str, ...]
    failure: str = ""
    config: Mapping[str, Any] = field(default_factory=dict)


class Ending(NamedTuple):
    """How a run ended: its exit code, and why it failed, or nothing if it did not."""

    code: int = 0
    failure: str = ""


def write_ending(folder: Path, ending: Ending) -> None:
    """Write how a run ended into its folder; nothing if it succeeded."""
    if ending.code:
        writing.write_json(folder / ENDING, ending._asdict())
    else:
        (folder / ENDING).unlink(missing_ok=True)


def read_ending(folder: Path) -> Ending:
    """Read how a run ended; a damaged file counts as none."""
    try:
        content = artifacts.read_json(folder, ENDING)
        return Ending(int(content["code"]), str(content["failure"]))
    except (artifacts.ArtifactError, KeyError, TypeError, ValueError):
        return Ending()


def write(folder: Path, runs: Sequence[SweptRun]) -> None:
    """Write the file of a sweep: a configuration, and in what those of the runs differ from it."""
    shared = next((run.config for run in runs if run.config), {})
    entries = []
    for run in runs:
        entry = {**asdict(run), "config": {}, "without": []}
        if run.config:
            entry["config"] = {
                key: value for key, value in run.config.items() if key not in shared or shared[key] != value
            }
            entry["without"] = [key for key in shared if key not in run.config]
        else:
            del entry["config"], entry["without"]
        entries.append(entry)
    writing.write_json(folder / SWEEP, {"sweep_version": SWEEP_VERSION, "config": shared, "runs": entries})


def gather_runs(folder: Path) -> list[SweptRun]:
    """Return the runs of a sweep, or all runs in a folder that is none, such as those of a job array.

    Of a run whose files cannot be read nothing is known but its folder.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder contains no run, or the sweep's file is damaged.
    """
    if (folder / SWEEP).exists():
        return read(folder)
    paths = _run_folders(folder)
    if not paths:
        if artifacts.holds_run(folder):
            raise artifacts.ArtifactError(f"{folder} is one run; give the folder that holds it")
        what = "holds no runs" if folder.is_dir() else "is no folder"
        raise artifacts.ArtifactError(f"{folder} {what}; give the folder of a sweep, or one with runs in it")
    gathered = [_gathered(path) for path in paths]
    keys = dict.fromkeys(key for run in gathered for key in run.differs)
    varied = [key for key in keys if len({run.differs.get(key) for run in gathered if run.differs}) > 1]
    return [
        replace(
            run,
            folder=path.relative_to(folder).as_posix(),
            differs={key: run.differs[key] for key in varied if key in run.differs},
        )
        for path, run in zip(paths, gathered, strict=True)
    ]


def _gathered(path: Path) -> SweptRun:
    """Return a run by the files in its folder, with all its settings as what it differs in."""
    try:
        labels = _labels(schema.present(configuration.read(path)))
        command = tuple(manifests.read_if_any(path).get("command", ()))
    except artifacts.ArtifactError:
        return SweptRun("", {}, ())
    return SweptRun("", labels, command, read_ending(path).failure)


def _run_folders(folder: Path) -> list[Path]:
    """Return the folders below one that contain a run, sorted; links are not followed."""
    folders = [Path(parent) for parent, _, files in os.walk(folder) if artifacts.CONFIG in files]
    return sorted(path for path in folders if artifacts.holds_run(path) and path != folder)


def _labels(config: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings that may distinguish a run in a sweep: those that results depend on."""
    counted = schema.only_results(config)
    controller = counted.pop(keys.FREE, {})
    counted.pop("name", None)
    controller_name = next(
        (str(controller[key]) for key in ("path", "name", "kind") if key in controller), ""
    )
    return {keys.FREE: controller_name} | {key: str(value) for key, value in keys.leaves(counted, ())}


def read(folder: Path) -> list[SweptRun]:
    """Read the runs of a sweep.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder contains no sweep, or its file is damaged.
    """
    cure = (
        f"restore it, or delete it: {typed.summary(folder)} does without, and the command that began the "
        f"sweep goes on with its runs where {shlex.quote(f'hydra.sweep.dir={folder}')} is added"
    )
    content = artifacts.read_json(folder, SWEEP, cure)
    with artifacts.explained(f"{folder / SWEEP} is no file of a sweep", cure):
        if (version := content["sweep_version"]) not in VERSIONS_READ:
            raise ValueError(f"its version is {version}, {' and '.join(map(str, VERSIONS_READ))} are read")
        shared = content.get("config", {})
        if not isinstance(shared, dict):
            raise ValueError("its config is no mapping")
        runs = [_run_of(entry, shared) for entry in content["runs"]]
    return [replace(run, failure=read_ending(folder / run.folder).failure or run.failure) for run in runs]


def _run_of(entry: Mapping[str, Any], shared: Mapping[str, Any]) -> SweptRun:
    """Return a run, after checking that its folder is inside the sweep's."""
    if not manifests.fits(entry, RUN_SHAPE):
        raise ValueError(f"{str(entry)[:80]} is no run")
    check_folder(folder := str(entry["folder"]))
    differs = {key: str(value) for key, value in entry["differs"].items()}
    config: dict[str, Any] = {}
    if "config" in entry:
        differing, missing = entry["config"], set(entry["without"])
        # in the order in which they were written
        kept = {key: value for key, value in shared.items() if key not in missing}
        config = {key: differing.get(key, value) for key, value in kept.items()} | differing
    return SweptRun(folder, differs, tuple(entry["command"]), entry["failure"], config)


def check_folder(folder: str) -> None:
    """Raise ValueError unless a run's folder is a plain name inside the sweep's."""
    path = PurePosixPath(folder)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError(f"{folder} lies outside")
    if max(len(part.encode()) for part in (".", *path.parts)) > LONGEST_NAME:
        raise ValueError(f"{folder[:80]}... is longer than the name of a folder can be")
    if not PLAIN_FOLDER.fullmatch(folder):
        raise ValueError(f"{folder!r} is no plain name of a folder: letters, digits and . + = , @ ( ) [ ] -")


def state_of(folder: Path, run: SweptRun) -> str:
    """Return whether a run is `DONE`, `FAILED` or `UNFINISHED`, by the files in its folder."""
    path = folder / run.folder
    manifest = manifests.read_if_any(path)
    if manifest and set(configuration.read(path).get("stages", [])) <= set(manifest["finished_stages"]):
        return DONE
    return FAILED if run.failure else UNFINISHED
