"""The files of a run's folder: their names, atomic writing, and the manifest.

The manifest says what a run's files come from: the hash of its configuration, software and hardware
(`pipeline.run.maker`), the seed, the finished stages, and the SHA-256 of each file. For programs that
know nothing of this one, it also says which file has which role (`ROLES`) and gives the scene of its flights
(`docs/reference/run-folder.md`).
"""

import hashlib
import json
import math
import os
import secrets
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any, BinaryIO, Final

import yaml

from fis_tools.plain_text import plain
from pipeline.settings.experiment import STAGES
from pipeline.settings.schema import only_results

CONFIG: Final = "config.yaml"
MANIFEST: Final = "manifest.json"
LOG: Final = "pipeline.log"
SCENARIOS: Final = "scenarios.csv"
SEARCH_JOURNAL: Final = "search/journal.log"
SEARCH_TRIALS: Final = "search/trials.csv"
SEARCH_BEST: Final = "search/best.json"
LOGBOOK: Final = "train/logbook.csv"
HISTORY: Final = "train/history.parquet"
VALIDATION: Final = "train/validation.csv"
CHECKPOINT: Final = "train/checkpoint.npz"
TENSORBOARD: Final = "train/tensorboard"
CHAMPION: Final = "champion.json"
CONTROLLER: Final = "controller.json"
EPISODES: Final = "evaluate/episodes.parquet"
TRAJECTORIES: Final = "evaluate/trajectories.parquet"
SUMMARY: Final = "evaluate/summary.json"
EPISODE_PARTS: Final = "evaluate/.parts"
BESIDE_OPTIMUM: Final = "evaluate/optimum.parquet"
OPTIMUM_CASES: Final = "optimum/cases.parquet"
OPTIMUM_PLANS: Final = "optimum/plans"
OPTIMUM_FORCES: Final = "optimum/forces.csv"
OPTIMUM_SUMMARY: Final = "optimum/summary.json"
COMPARISON_TABLE: Final = "compare/table.csv"
COMPARISON_EPISODES: Final = "compare/episodes.parquet"
COMPARISON: Final = "compare/summary.json"
THEOREM: Final = "prove/theorem.json"
TUBE: Final = "prove/tube.parquet"
PROVED_CONTROLLER: Final = "prove/controller.json"
ASSURANCE: Final = "assure"
REQUIREMENTS: Final = "assure/requirements.yaml"
ASSURED_CASES: Final = "assure/cases.parquet"
SEARCHED: Final = "assure/search.parquet"
WORST_FLIGHTS: Final = "assure/flights"
PROOF_BOXES: Final = "assure/boxes.parquet"
DOMAIN: Final = "assure/domain.json"
EVIDENCE: Final = "assure/evidence.json"
EVIDENCE_PAGE: Final = "assure/evidence.html"
RECORDINGS: Final = "episodes"
FIGURES: Final = "figures"
REPORT: Final = "report.html"
REVIEW: Final = "review.html"

#: suffix of the hidden name of a file while it is written
UNFINISHED: Final = ".unfinished"

#: limits of a configuration that is read: bytes, and nesting levels of groups and lists
MOST_CONFIG_BYTES: Final = 2 * 1024 * 1024
MOST_DEEP: Final = 64

#: the stages of files that are in no folder of their stage's name
ELSEWHERE: Final[Mapping[str, str]] = {
    SCENARIOS: "scenario",
    CHAMPION: "train",
    RECORDINGS: "record",
    **dict.fromkeys((FIGURES, REPORT, REVIEW), "report"),
}

#: 2 added the roles of files, the scene and the command; runs of version 1 are read and resumed
MANIFEST_VERSION: Final = 2
VERSIONS_READ: Final = (1, 2)
#: the files that other programs look for in a run's folder, by these names in the manifest
ROLES: Final[Mapping[str, str]] = {
    "configuration": CONFIG,
    "champion": CHAMPION,
    "training_history": HISTORY,
    "evaluation_episodes": EPISODES,
    "evaluation_trajectories": TRAJECTORIES,
    "recordings": RECORDINGS,
}
#: the shape of a manifest, see `fits`; those of earlier versions may lack all but `MANIFEST_NEEDS`
MANIFEST_SHAPE: Final[Mapping[Any, Any]] = {
    "config_hash": str,
    "finished_stages": [str],
    "sha256": {str: str},
    "makers": [{"versions": {str: str}, "processor": dict}],
    "made_by": {str: [int]},
    "command": [str],
    "files": {str: str},
    "versions": {str: str},
}
MANIFEST_NEEDS: Final = ("config_hash", "finished_stages")


class ArtifactError(ValueError):
    """A file of a run that is missing or cannot be read."""


class WriteError(OSError):
    """A file of a run that could not be written; the one it was to replace is unchanged."""


def write_atomically(path: Path, content: bytes | str) -> None:
    """Write a file atomically: at every moment either the old or the new content is there, never a part.

    Parameters
    ----------
    path : Path
        Its folder is made if missing.
    content : bytes or str
        Text is written as UTF-8 with its line ends unchanged.

    Raises
    ------
    WriteError
        If the disk is full, or the folder may not be written to.
    """
    with beside(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def beside(path: Path) -> Iterator[BinaryIO]:
    """Yield a file beside a path that takes its place once it is whole and safely on disk.

    Raises
    ------
    WriteError
        As `write_atomically`.
    """
    name = path.with_name(f".{path.name}.{secrets.token_hex(4)}{UNFINISHED}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with name.open("xb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        name.replace(path)
    except OSError as error:
        raise WriteError(
            f"{path} cannot be written: {error.strerror or error}; make room, or choose a folder that may be "
            "written to"
        ) from error
    finally:
        name.unlink(missing_ok=True)


def strangers(folder: Path) -> Iterator[str]:
    """Yield the paths of what no run makes in its folder, links, pipes and devices, with what they are."""
    for place, folders, files in os.walk(folder):
        for name in sorted([*folders, *files]):
            path = Path(place, name)
            try:
                mode = path.lstat().st_mode
            except FileNotFoundError:  # a run inside this folder is at work
                continue
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                what = f"a link to {os.readlink(path)}" if stat.S_ISLNK(mode) else "a pipe, socket or device"
                yield f"{path.relative_to(folder).as_posix()} is {what}"


def check_no_strangers(folder: Path) -> None:
    """Raise ArtifactError unless a folder holds files and folders alone, so that nothing leads out of it."""
    if found := next(strangers(folder), None):
        raise ArtifactError(
            f"{folder}: {found}; a run's folder holds files and folders alone, so that nothing outside it is "
            "read or written: remove it, or put a copy in its place"
        )


def drop_unfinished(folder: Path) -> None:
    """Remove the files that a process was writing when it was killed; no other process may be at work there.

    Those of runs inside it, where others may be at work, stay: each run removes its own.
    """
    for path in folder.rglob(f".*{UNFINISHED}"):
        inner = [parent for parent in path.parents if folder in parent.parents]
        if not any((parent / CONFIG).exists() for parent in inner):
            path.unlink(missing_ok=True)


def write_json(path: Path, content: Any) -> None:
    """Write plain data as JSON.

    Raises
    ------
    ArtifactError
        If a number is not finite, which JSON cannot hold.
    WriteError
        See `write_atomically`.
    """
    try:
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        key = next(_not_finite(content), "a number")
        raise ArtifactError(
            f"{path} is not written, for {key} is not finite; settings or files that were read make no sense"
        ) from error
    write_atomically(path, text + "\n")


def _not_finite(content: Any, key: str = "") -> Iterator[str]:
    """Yield the keys of the numbers that JSON cannot hold."""
    if isinstance(content, float) and not math.isfinite(content):
        yield key
    elif isinstance(content, Mapping):
        for name, value in content.items():
            yield from _not_finite(value, f"{key}.{name}".lstrip("."))
    elif isinstance(content, list | tuple):
        for index, value in enumerate(content):
            yield from _not_finite(value, f"{key}[{index}]")


def stage_of(name: str) -> str | None:
    """Return the stage that writes a file of a run, if one does: its folder bears the stage's name."""
    first = PurePath(name).parts[0]
    return ELSEWHERE.get(first, first if first in STAGES else None)


def require(folder: Path, name: str) -> Path:
    """Return the path of a file of a run.

    Raises
    ------
    ArtifactError
        If it does not exist, or a link leads to it.
    """
    path = folder / name
    if any((folder / part).is_symlink() for part in (PurePath(name), *PurePath(name).parents)):
        raise ArtifactError(f"{path} is reached by a link, which is not followed; put a copy in its place")
    if not path.exists():
        writer = stage_of(name)
        cure = f"the stage {writer} writes it, run that first" if writer else "choose the folder of a run"
        raise ArtifactError(f"{folder} has no {name}; {cure}")
    return path


def read_json(folder: Path, name: str) -> Any:
    """Read a JSON file of a run.

    Raises
    ------
    ArtifactError
        If it is missing, cut short or not JSON.
    """
    path = require(folder, name)
    try:
        return plain(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        raise ArtifactError(f"{path} cannot be read ({error}); repeat the stage that writes it") from error


def config_hash(config: Mapping[str, Any]) -> str:
    """Hash what the results of a resolved configuration depend on.

    Parameters
    ----------
    config : mapping
        Plain data. Settings that no result depends on do not count, nor does its part ``hydra``, which only
        sets output folders.

    Returns
    -------
    str
        SHA-256 of ``json.dumps(config, sort_keys=True)``, 64 hexadecimal digits.
    """
    return _hash_of(only_results(config))


def _hash_of(config: Mapping[str, Any]) -> str:
    counted = {key: value for key, value in config.items() if key != "hydra"}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()


def is_config_of(config: Mapping[str, Any], manifest: Mapping[str, Any]) -> bool:
    """Return whether a manifest is of a run with a configuration; earlier versions hashed every key."""
    return manifest["config_hash"] in (config_hash(config), _hash_of(config))


def config_text(config: Mapping[str, Any]) -> str:
    """Write a resolved configuration as YAML that reads back to the same data."""
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # the first is ten times as fast
    text: str = yaml.dump(
        dict(config), Dumper=dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )
    return text


def _check_events(content: bytes, loader: Any) -> None:
    """Raise ValueError for aliases, by which a page of text grows to gigabytes, and excessive nesting."""
    depth = 0
    for event in yaml.parse(content, loader):
        if isinstance(event, yaml.AliasEvent):
            raise ValueError("it has an alias (*), and none is written")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_DEEP:
            raise ValueError(f"it is nested more than {MOST_DEEP} deep")


def parse_config(content: bytes) -> Any:
    """Turn the output of `config_text`, or anything else, into plain data.

    Raises
    ------
    ValueError
        If it is larger, deeper or of another kind than `config_text` writes.
    """
    if len(content) > MOST_CONFIG_BYTES:
        raise ValueError(f"it has {len(content)} bytes, and at most {MOST_CONFIG_BYTES} are read")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the first is ten times as fast
    try:
        _check_events(content, loader)
        found = plain(yaml.load(content, loader))  # noqa: S506 - a safe one
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    _check_keys(found)
    return found


def _check_keys(value: Any) -> None:
    """Raise ValueError for a key that is no text: JSON, and with it the hash, knows no other."""
    for key in value if isinstance(value, dict) else ():
        if not isinstance(key, str):
            raise ValueError(f"the key {key!r} is no text; write it in quotes")
    for one in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _check_keys(one)


def write_config(folder: Path, config: Mapping[str, Any]) -> None:
    """Write a resolved configuration into a run's folder, see `config_text`."""
    write_atomically(folder / CONFIG, config_text(config))


def read_config(folder: Path) -> dict[str, Any]:
    """Read the configuration of a run as it is stored.

    Raises
    ------
    ArtifactError
        If the folder contains no run, or its configuration cannot be read.
    """
    if not folder.is_dir():
        raise ArtifactError(f"{folder} is no folder; give the folder of a run, outputs/NAME/TIME")
    path = require(folder, CONFIG)
    try:
        config = parse_config(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path} cannot be read ({error})") from error
    if not isinstance(config, dict):
        raise ArtifactError(f"{path} holds no configuration; it must be a mapping of keys to values")
    return config


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file, 64 hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def list_artifacts(folder: Path) -> list[str]:
    """Return the finished files of a run, by their paths in its folder, sorted.

    The manifest, logs, checkpoints, files still being written and hidden ones do not count.
    """
    names = []
    for path in sorted(folder.rglob("*")):
        place = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in place.parts)
        is_log = path.suffix in (".log", ".partial") or place.is_relative_to(TENSORBOARD)
        if path.is_file() and not path.is_symlink() and not is_hidden and not is_log:
            names.append(place.as_posix())
    return [name for name in names if name not in (MANIFEST, CHECKPOINT)]


def holds_run(folder: Path) -> bool:
    """Return whether a folder contains a run, even one that was killed before it had a manifest."""
    return (folder / MANIFEST).exists() or list_artifacts(folder) == [CONFIG]


def write_manifest(
    folder: Path,
    config: Mapping[str, Any],
    finished: Sequence[str],
    *,
    command: Sequence[str] = (),
    scene: Mapping[str, float] | None = None,
    makers: Sequence[Mapping[str, Any]] = (),
    made_by: Mapping[str, Sequence[int]] | None = None,
    controller_edited: str | None = None,
) -> None:
    """Write the manifest of a run.

    Parameters
    ----------
    folder : Path
        The run's.
    config : mapping
        Resolved, plain data.
    finished : sequence of str
        The finished stages.
    command : sequence of str
        The arguments with which the run was started, after ``python -m pipeline``.
    scene : mapping of str to float, optional
        Parameters for plotting its flights: ``sample_period_s``, ``min_distance_m`` and ``max_distance_m``
        (limits), ``threshold_percent`` (of a success), ``chief_radius_m``.
    makers : sequence of mapping
        All that have worked on the run, see `pipeline.run.maker`; the last is the present one.
    made_by : mapping of str to sequence of int, optional
        For each stage that was begun, the indices of its makers.
    controller_edited : str, optional
        How the configured controller differs from what its provenance tells of.
    """
    manifest: dict[str, Any] = {
        "manifest_version": MANIFEST_VERSION,
        "name": config["name"],
        "config_hash": config_hash(config),
        "seed": config["seed"],
        "command": list(command),
        "finished_stages": list(finished),
        "files": dict(ROLES),
        "scene": dict(scene or {}),
        "versions": makers[-1]["versions"] if makers else {},
        "makers": [dict(maker) for maker in makers],
        "made_by": {stage: list(indices) for stage, indices in (made_by or {}).items()},
    }
    if controller_edited is not None:
        manifest["controller_edited"] = controller_edited
    if makers and (revision := makers[-1]["git_revision"]):
        manifest["git_revision"] = revision
    manifest["sha256"] = {name: file_hash(folder / name) for name in list_artifacts(folder)}
    write_json(folder / MANIFEST, manifest)


def fits(value: Any, shape: Any) -> bool:
    """Return whether plain data is of a shape: a type, ``[shape]``, ``{str: shape}``, or named keys."""
    if isinstance(shape, list):
        return isinstance(value, list) and all(fits(one, shape[0]) for one in value)
    if isinstance(shape, Mapping):
        return isinstance(value, Mapping) and all(
            fits(one, shape.get(key, shape.get(str, object))) for key, one in value.items()
        )
    return isinstance(value, shape)


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a run.

    Raises
    ------
    ArtifactError
        If it is missing, cannot be read, is of another version or lacks a key that is read.
    """
    manifest = read_json(folder, MANIFEST)
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
