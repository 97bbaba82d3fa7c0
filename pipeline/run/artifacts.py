"""The files of a run's folder: their names, how they are written whole or not at all, and the manifest.

The manifest says what a run's files come from: the hash of its configuration, the versions of everything
that took part, the seed, the revision of the sources where they lie in a git repository, the finished stages,
and the SHA-256 of each file. It also says, for programs that know nothing of this one, which file has which
role (`ROLES`) and what the scene of its flights is (`docs/reference/run-folder.md`).
"""

import hashlib
import json
import os
import platform
import subprocess
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import yaml

CONFIG: Final = "config.yaml"
MANIFEST: Final = "manifest.json"
LOG: Final = "pipeline.log"
SCENARIOS: Final = "scenarios.csv"
LOGBOOK: Final = "train/logbook.csv"
HISTORY: Final = "train/history.parquet"
VALIDATION: Final = "train/validation.csv"
FRONT: Final = "train/front.csv"
FRONT_GENOMES: Final = "train/front.parquet"
FRONT_CONTROLLERS: Final = "train/front"
CHAMPION_TRAJECTORIES: Final = "train/trajectories.parquet"
CHECKPOINT: Final = "train/checkpoint.npz"
CHAMPION: Final = "champion.json"
CONTROLLER: Final = "controller.json"
EPISODES: Final = "evaluate/episodes.parquet"
TRAJECTORIES: Final = "evaluate/trajectories.parquet"
SUMMARY: Final = "evaluate/summary.json"
BESIDE_OPTIMUM: Final = "evaluate/optimum.parquet"
OPTIMUM_CASES: Final = "optimum/cases.parquet"
OPTIMUM_PLANS: Final = "optimum/plans"
OPTIMUM_FORCES: Final = "optimum/forces.csv"
OPTIMUM_SUMMARY: Final = "optimum/summary.json"
COMPARISON_TABLE: Final = "compare/table.csv"
COMPARISON_EPISODES: Final = "compare/episodes.parquet"
COMPARISON: Final = "compare/summary.json"
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

#: which stage writes what another may miss
WRITTEN_BY: Final[Mapping[str, str]] = {
    SCENARIOS: "scenario",
    LOGBOOK: "train",
    HISTORY: "train",
    CHAMPION_TRAJECTORIES: "train",
    CHECKPOINT: "train",
    CHAMPION: "train",
    EPISODES: "evaluate",
    TRAJECTORIES: "evaluate",
    SUMMARY: "evaluate",
    BESIDE_OPTIMUM: "evaluate",
    OPTIMUM_CASES: "optimum",
    OPTIMUM_PLANS: "optimum",
    OPTIMUM_FORCES: "optimum",
    OPTIMUM_SUMMARY: "optimum",
    COMPARISON_TABLE: "compare",
    COMPARISON_EPISODES: "compare",
    COMPARISON: "compare",
    REQUIREMENTS: "assure",
    ASSURED_CASES: "assure",
    SEARCHED: "assure",
    WORST_FLIGHTS: "assure",
    PROOF_BOXES: "assure",
    DOMAIN: "assure",
    EVIDENCE: "assure",
    EVIDENCE_PAGE: "assure",
    RECORDINGS: "record",
    FIGURES: "report",
    REPORT: "report",
    REVIEW: "report",
}

DISTRIBUTION: Final = "fuzzy-spacecraft-inspection"
SOURCES: Final = Path(__file__).resolve().parents[2]
#: 2 added the roles of files, the scene and the command; runs of version 1 are read and gone on with
MANIFEST_VERSION: Final = 2
VERSIONS_READ: Final = (1, 2)
#: what other programs look for in a run's folder; they find it by these names in the manifest
ROLES: Final[Mapping[str, str]] = {
    "configuration": CONFIG,
    "champion": CHAMPION,
    "training_history": HISTORY,
    "training_trajectories": CHAMPION_TRAJECTORIES,
    "evaluation_episodes": EPISODES,
    "evaluation_trajectories": TRAJECTORIES,
    "recordings": RECORDINGS,
}
#: what is read of a manifest again
MANIFEST_KEYS: Final[Mapping[str, type]] = {"config_hash": str, "finished_stages": list}
#: packages whose version may change a result or a file
LIBRARIES: Final = (
    "numpy",
    "scipy",
    "numba",
    "scikit-fuzzy",
    "scikit-learn",
    "deap",
    "hydra-core",
    "mcap",
    "protobuf",
    "pyarrow",
    "matplotlib",
    "rerun-sdk",
)


class ArtifactError(ValueError):
    """A file of a run that is missing or cannot be read."""


class WriteError(OSError):
    """A file of a run that the disk refuses; the one it was to replace still stands."""


def write_atomically(path: Path, content: bytes | str) -> None:
    """Write a file so that at every moment either the old or the new content stands, never a part.

    Parameters
    ----------
    path : Path
        Its folder is made where it is missing.
    content : bytes or str
        Text is written as UTF-8 with its line ends unchanged.

    Raises
    ------
    WriteError
        If the disk is full, or the folder may not be written to.
    """
    try:
        _write_beside(path, content)
    except OSError as error:
        raise WriteError(
            f"{path} cannot be written: {error.strerror or error}; make room, or choose a folder that may be "
            "written to"
        ) from error


def _write_beside(path: Path, content: bytes | str) -> None:
    """Write a file under another name and, once it is safely on disk, give it its own."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_json(path: Path, content: Any) -> None:
    """Write plain data as JSON; numbers that are not finite are refused, for JSON has none."""
    write_atomically(path, json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def require(folder: Path, name: str) -> Path:
    """Return the path of a file of a run.

    Raises
    ------
    ArtifactError
        If it is not there.
    """
    path = folder / name
    if not path.exists():
        writer = WRITTEN_BY.get(name)
        cure = f"the stage {writer} writes it, run that first" if writer else "choose the folder of a run"
        raise ArtifactError(f"{folder} has no {name}; {cure}")
    return path


def read_json(folder: Path, name: str) -> Any:
    """Read a JSON file of a run.

    Raises
    ------
    ArtifactError
        If it is missing, cut short or no JSON.
    """
    path = require(folder, name)
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path} cannot be read ({error}); repeat the stage that writes it") from error


def config_hash(config: Mapping[str, Any]) -> str:
    """Hash a resolved configuration.

    Parameters
    ----------
    config : mapping
        Plain data; its part ``hydra``, which only says where files go, does not count.

    Returns
    -------
    str
        SHA-256 of ``json.dumps(config, sort_keys=True)``, 64 hexadecimal digits.
    """
    counted = {key: value for key, value in config.items() if key != "hydra"}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()


def config_text(config: Mapping[str, Any]) -> str:
    """Write a resolved configuration as YAML that reads back to the same data."""
    return yaml.safe_dump(
        dict(config), sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def write_config(folder: Path, config: Mapping[str, Any]) -> None:
    """Keep a resolved configuration in a run's folder, see `config_text`."""
    write_atomically(folder / CONFIG, config_text(config))


def read_config(folder: Path) -> dict[str, Any]:
    """Read the configuration of a run.

    Raises
    ------
    ArtifactError
        If the folder holds no run, or its configuration cannot be read.
    """
    if not folder.is_dir():
        raise ArtifactError(f"{folder} is no folder; give the folder of a run, outputs/NAME/TIME")
    path = require(folder, CONFIG)
    try:
        config = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ArtifactError(f"{path} cannot be read ({error})") from error
    if not isinstance(config, dict):
        raise ArtifactError(f"{path} holds no configuration; it must be a mapping of keys to values")
    return config


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file, 64 hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def list_artifacts(folder: Path) -> list[str]:
    """Name the finished files of a run, by their paths in its folder, in order.

    The manifest, logs, checkpoints, files still being written and hidden ones do not count.
    """
    names = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        is_hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.is_file() and not is_hidden and path.suffix not in (".log", ".partial"):
            names.append(name)
    return [name for name in names if name not in (MANIFEST, CHECKPOINT)]


def write_manifest(
    folder: Path,
    config: Mapping[str, Any],
    finished: Sequence[str],
    *,
    command: Sequence[str] = (),
    scene: Mapping[str, float] | None = None,
) -> None:
    """Write down what the files of a run come from.

    Parameters
    ----------
    folder : Path
        Of the run.
    config : mapping
        Resolved, plain data.
    finished : sequence of str
        The finished stages.
    command : sequence of str
        The words with which the run was started, after ``python -m pipeline``.
    scene : mapping of str to float, optional
        What a picture of its flights needs: ``sample_period_s``, ``min_distance_m`` and ``max_distance_m``
        (limits), ``threshold_percent`` (of a success), ``chief_radius_m``.
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
        "versions": versions(),
    }
    if revision := git_revision():
        manifest["git_revision"] = revision
    manifest["sha256"] = {name: file_hash(folder / name) for name in list_artifacts(folder)}
    write_json(folder / MANIFEST, manifest)


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a run.

    Raises
    ------
    ArtifactError
        If it is missing, cannot be read, is of another version or lacks what is read of it.
    """
    manifest = read_json(folder, MANIFEST)
    version = manifest.get("manifest_version") if isinstance(manifest, dict) else None
    if version not in VERSIONS_READ:
        raise ArtifactError(
            f"{folder / MANIFEST} has manifest version {version}, this program reads "
            f"{' and '.join(map(str, VERSIONS_READ))}; use the program that made the run"
        )
    for name, kind in MANIFEST_KEYS.items():
        if not isinstance(manifest.get(name), kind):
            raise ArtifactError(
                f"{folder / MANIFEST} is damaged, it has no proper {name}; restore it, or start a new run"
            )
    return dict(manifest)


def product_version() -> str:
    """Return the version of this product: of the source tree it runs from, else of what is installed.

    It is ``unknown`` where the packages were copied without being installed.
    """
    project = SOURCES / "pyproject.toml"
    if project.is_file():
        table = tomllib.loads(project.read_text(encoding="utf-8")).get("project", {})
        if table.get("name") == DISTRIBUTION:
            return str(table["version"])
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"


def versions() -> dict[str, str]:
    """Name the versions of this product, Python, the libraries that matter, and the platform."""
    found = {
        "product": product_version(),
        "python": platform.python_version(),
        "platform": platform.platform(),
    }
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            found[library] = "absent"
    return found


def git_revision() -> str | None:
    """Return the revision of the sources, with ``+changes`` where files differ from it; None without git."""
    if not (SOURCES / ".git").exists():
        return None
    try:
        revision = _git("rev-parse", "HEAD")
        return revision + ("+changes" if _git("status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(SOURCES), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=20).stdout.strip()  # noqa: S603
