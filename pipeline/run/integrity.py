"""Compares the files of a run with the hashes in its manifest, and with those of another run."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.run import artifacts


@dataclass(frozen=True)
class Integrity:
    """Comparison of a run's files with its manifest.

    Parameters
    ----------
    intact, changed, missing, added : tuple of str
        Paths in the run's folder; added files are not in the manifest.
    strangers : tuple of str
        Links, pipes and devices, with what they are.
    """

    intact: tuple[str, ...]
    changed: tuple[str, ...]
    missing: tuple[str, ...]
    added: tuple[str, ...]
    strangers: tuple[str, ...]

    @property
    def is_whole(self) -> bool:
        """Whether every file in the manifest is as it was written, and nothing leads out of the folder."""
        return not (self.changed or self.missing or self.strangers)


@dataclass(frozen=True)
class Beside:
    """Comparison of the files of two runs, by the hashes in their manifests.

    Parameters
    ----------
    equal, different, single : tuple of str
        Paths in the runs' folders; the last are in only one of them.
    """

    equal: tuple[str, ...]
    different: tuple[str, ...]
    single: tuple[str, ...]


def put_beside(folder: Path, other: Path) -> Beside:
    """Compare the files of two runs; their configurations do not count.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a folder contains no run, or its manifest cannot be read.
    """
    one, two = (dict(artifacts.read_manifest(place).get("sha256", {})) for place in (folder, other))
    names = sorted({*one, *two} - {artifacts.CONFIG})
    return Beside(
        equal=tuple(name for name in names if name in one and one[name] == two.get(name)),
        different=tuple(name for name in names if name in one and name in two and one[name] != two[name]),
        single=tuple(name for name in names if name not in one or name not in two),
    )


def check_files(folder: Path) -> Integrity:
    """Hash the files of a run again; the configuration is also compared by content.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder contains no run, or its manifest cannot be read.
    """
    manifest = artifacts.read_manifest(folder)
    told: dict[str, str] = manifest.get("sha256", {})
    there = set(artifacts.list_artifacts(folder))
    changed = {name for name in there & set(told) if artifacts.file_hash(folder / name) != told[name]}
    if artifacts.CONFIG in there and not _is_own_config(folder, manifest):
        changed.add(artifacts.CONFIG)
    return Integrity(
        intact=tuple(sorted((there & set(told)) - changed)),
        changed=tuple(sorted(changed)),
        missing=tuple(sorted(set(told) - there)),
        added=tuple(sorted(there - set(told))),
        strangers=tuple(artifacts.strangers(folder)),
    )


def _is_own_config(folder: Path, manifest: Mapping[str, Any]) -> bool:
    try:
        return artifacts.is_config_of(artifacts.stored_config(folder), manifest)
    except artifacts.ArtifactError:
        return False
