"""The manifest of a run: what its files come from.

It holds the hash of the run's configuration, software and hardware (`pipeline.run.maker`), the seed, the
finished stages, and the SHA-256 of each file. For programs that know nothing of this one, it also says which
file has which role (`ROLES`) and gives the scene of its flights (`docs/reference/run-folder.md`).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pipeline.run import artifacts, configuration, maker
from pipeline.run.artifacts import MANIFEST, ArtifactError
from pipeline.run.writing import write_json
from pipeline.settings.experiment import Experiment

#: 2 added the roles of files, the scene and the command; runs of version 1 are read and resumed
MANIFEST_VERSION: Final = 2
VERSIONS_READ: Final = (1, 2)

#: the files that other programs look for in a run's folder, by these names in the manifest
ROLES: Final[Mapping[str, str]] = {
    "configuration": artifacts.CONFIG,
    "champion": artifacts.CHAMPION,
    "training_history": artifacts.HISTORY,
    "evaluation_episodes": artifacts.EPISODES,
    "evaluation_trajectories": artifacts.TRAJECTORIES,
    "recordings": artifacts.RECORDINGS,
}

#: the shape of a maker, see `pipeline.run.maker.present_maker`
MAKER_SHAPE: Final[Mapping[Any, Any]] = {"versions": {str: str}, "processor": dict}
#: the shape of a manifest, see `fits`; those of earlier versions may lack all but `MANIFEST_NEEDS`
MANIFEST_SHAPE: Final[Mapping[Any, Any]] = {
    "config_hash": str,
    "finished_stages": [str],
    "sha256": {str: str},
    "makers": [MAKER_SHAPE],
    "made_by": {str: [int]},
    "command": [str],
    "files": {str: str},
    "tags": {str: str},
    "versions": {str: str},
}
MANIFEST_NEEDS: Final = ("config_hash", "finished_stages")


def write(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest of a run, with the hashes of the files that are there now.

    Parameters
    ----------
    folder : Path
        The run's.
    manifest : mapping
        All else, see `pipeline.run.runner.manifest_of`.
    """
    hashes = {name: artifacts.file_hash(folder / name) for name in artifacts.list_artifacts(folder)}
    write_json(folder / MANIFEST, {**manifest, "sha256": hashes})


def fits(value: Any, shape: Any) -> bool:
    """Return whether plain data has a shape: a type, ``[shape]``, ``{str: shape}``, or named keys."""
    if isinstance(shape, list):
        return isinstance(value, list) and all(fits(item, shape[0]) for item in value)
    if isinstance(shape, Mapping):
        return isinstance(value, Mapping) and all(
            fits(item, shape.get(key, shape.get(str, object))) for key, item in value.items()
        )
    return isinstance(value, shape)


def read(folder: Path) -> dict[str, Any]:
    """Read the manifest of a run.

    Raises
    ------
    ArtifactError
        If it is missing, cannot be read, is of another version or lacks a key that is read.
    """
    manifest = artifacts.read_json(folder, MANIFEST)
    version = manifest.get("manifest_version") if isinstance(manifest, dict) else None
    if version not in VERSIONS_READ:
        raise ArtifactError(
            f"{folder / MANIFEST} has manifest version {version}, this program reads "
            f"{' and '.join(map(str, VERSIONS_READ))}; use the program that made the run"
        )
    for name, shape in MANIFEST_SHAPE.items():
        if not (fits(manifest[name], shape) if name in manifest else name not in MANIFEST_NEEDS):
            raise ArtifactError(
                f"{folder / MANIFEST} is damaged, it has no proper {name}; restore it, or start a new run"
            )
    return dict(manifest)


def read_if_any(folder: Path) -> dict[str, Any]:
    """Read the manifest of a run; return an empty mapping if there is none."""
    return read(folder) if (folder / MANIFEST).exists() else {}


def provenance(experiment: Experiment, folder: Path) -> dict[str, str]:
    """Return the facts on the run that a controller's file carries: configuration, seed, program."""
    return {
        "experiment": experiment.name,
        "seed": str(experiment.seed),
        "config_hash": configuration.config_hash(configuration.read(folder)),
        "product_version": maker.product_version(),
        "git_revision": maker.git_revision() or "none",
    }
