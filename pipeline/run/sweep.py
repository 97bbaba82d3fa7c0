"""The file of a sweep: its runs, and their differences.

What became of a run is in its own folder, wherever it ran: its manifest, and how it ended unless well.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Final, NamedTuple

from pipeline.run import artifacts, configuration, manifests, writing
from pipeline.settings import keys, schema

SWEEP: Final = "sweep.json"
SWEEP_VERSION: Final = 1
#: of a run that did not end well, in its folder; the point keeps it out of the manifest
ENDING: Final = ".ending.json"
#: see `pipeline.run.manifests.fits`
RUN_SHAPE: Final = {"folder": str, "differs": dict, "command": [str], "failure": str}
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
        The arguments with which it would be started alone.
    failure : str
        Why it failed; empty if it did not. Earlier versions kept it in the sweep's file.
    """

    folder: str
    differs: Mapping[str, str]
    command: tuple[str, ...]
    failure: str = ""


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
    """Write the file of a sweep."""
    writing.write_json(
        folder / SWEEP, {"sweep_version": SWEEP_VERSION, "runs": [asdict(run) for run in runs]}
    )


def gather_runs(folder: Path) -> list[SweptRun]:
    """Return the runs of a sweep, or all runs in a folder that is none, such as those of a job array.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder contains no run, or a file in it is damaged.
    """
    if (folder / SWEEP).exists():
        return read(folder)
    paths = _run_folders(folder)
    if not paths:
        if artifacts.holds_run(folder):
            raise artifacts.ArtifactError(f"{folder} is one run; give the folder that holds it")
        what = "holds no runs" if folder.is_dir() else "is no folder"
        raise artifacts.ArtifactError(f"{folder} {what}; give the folder of a sweep, or one with runs in it")
    configs = [schema.present(configuration.read(path)) for path in paths]
    labels = [_labels(config) for config in configs]
    keys = dict.fromkeys(key for values in labels for key in values)
    varied = [key for key in keys if len({values.get(key) for values in labels}) > 1]
    return [
        SweptRun(
            path.relative_to(folder).as_posix(),
            {key: values[key] for key in varied if key in values},
            tuple(manifests.read_if_any(path).get("command", ())),
            read_ending(path).failure,
        )
        for path, values in zip(paths, labels, strict=True)
    ]


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
    content = artifacts.read_json(folder, SWEEP)
    with artifacts.explained(f"{folder / SWEEP} is no file of a sweep", "restore it"):
        if content["sweep_version"] != SWEEP_VERSION:
            raise ValueError(f"its version is {content['sweep_version']}, {SWEEP_VERSION} is read")
        runs = [_run_of(entry) for entry in content["runs"]]
    return [replace(run, failure=read_ending(folder / run.folder).failure or run.failure) for run in runs]


def _run_of(entry: Mapping[str, Any]) -> SweptRun:
    """Return a run, after checking that its folder is inside the sweep's."""
    if not manifests.fits(entry, RUN_SHAPE):
        raise ValueError(f"{str(entry)[:80]} is no run")
    folder = str(entry["folder"])
    path = PurePosixPath(folder)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError(f"{folder} lies outside")
    if max(len(part.encode()) for part in (".", *path.parts)) > LONGEST_NAME:
        raise ValueError(f"{folder[:80]}... is longer than the name of a folder can be")
    differs = {key: str(value) for key, value in entry["differs"].items()}
    return SweptRun(folder, differs, tuple(entry["command"]), entry["failure"])


def state_of(folder: Path, run: SweptRun) -> str:
    """Return whether a run is `DONE`, `FAILED` or `UNFINISHED`, by the files in its folder."""
    path = folder / run.folder
    manifest = manifests.read_if_any(path)
    if manifest and set(configuration.read(path).get("stages", [])) <= set(manifest["finished_stages"]):
        return DONE
    return FAILED if run.failure else UNFINISHED
