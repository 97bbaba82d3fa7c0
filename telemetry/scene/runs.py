"""The trajectories of an evaluation in a run's folder."""

import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, fields
from enum import IntEnum
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plain_files.file_access import open_regular, read_text
from plain_files.plain_text import parse_json
from telemetry.array_types import Floats, Integers
from telemetry.file import RecordingError, explained

Columns = Mapping[str, NDArray[Any]]

MANIFEST: Final = "manifest.json"
#: where a run whose manifest does not name its files, of version 1, has those of each role
FILES: Final[Mapping[str, str]] = {
    "configuration": "config.yaml",
    "evaluation_episodes": "evaluate/episodes.parquet",
    "evaluation_trajectories": "evaluate/trajectories.parquet",
}

#: of the configuration of a run
MOST_CONFIG_BYTES: Final = 2 * 1024 * 1024
#: what a table may unpack to
MOST_BYTES: Final = 512 * 1024 * 1024
#: columns of whole numbers
_KEYS: Final = ("case", "sample")
_POSITION: Final = ("position_x_m", "position_y_m", "position_z_m")
_JUDGED: Final = ("delta_v_m_s", "inspected_count", "inspection_rate_percent", "success", "violated")


class CaseOutcome(IntEnum):
    """The outcome of a case; if several apply, the highest counts."""

    SUCCESS = 0
    SHORT = 1
    OUTSIDE = 2


@dataclass(frozen=True)
class Surroundings:
    """A run's surroundings, from its configuration; unknown values are None.

    Parameters
    ----------
    sample_period_s : float
        Between samples of a trajectory.
    min_distance_m, max_distance_m : float
        Limits of a deputy's distance.
    threshold_percent : float
        Inspection rate from which a flight is a success; None for flights that inspect nothing, too.
    chief_radius_m : float
        Of the sphere of inspection points.
    """

    sample_period_s: float | None = None
    min_distance_m: float | None = None
    max_distance_m: float | None = None
    threshold_percent: float | None = None
    chief_radius_m: float | None = None


@dataclass(frozen=True)
class EvaluatedCases:
    """The trajectories of many cases, and their outcomes.

    Parameters
    ----------
    name : str
        Of the run.
    case : (n,)
        Numbers of the cases, ascending.
    position_m : (n, K+1, 3) float32
        Hill axes.
    episodes : mapping of str to (n,) arrays
        `delta_v_m_s`, `inspected_count`, `inspection_rate_percent`, `success`, `violated`; empty if only
        the trajectories are known.
    surroundings : Surroundings
    """

    name: str
    case: Integers
    position_m: NDArray[np.float32]
    episodes: Columns
    surroundings: Surroundings

    @property
    def outcome(self) -> Integers | None:
        """The `CaseOutcome` of each case; None if unknown."""
        if not self.episodes:
            return None
        ended = np.where(self.episodes["success"], CaseOutcome.SUCCESS, CaseOutcome.SHORT)
        return np.where(self.episodes["violated"], CaseOutcome.OUTSIDE, ended).astype(np.int64)

    @property
    def distance_m(self) -> Floats:
        """Distance to the chief, shape (n, K+1)."""
        return np.linalg.norm(self.position_m.astype(np.float64), axis=2)

    @property
    def time_s(self) -> Floats:
        """Time of each sample, shape (K+1,); the index of the sample if the period is unknown."""
        samples = np.arange(self.position_m.shape[1], dtype=np.float64)
        return samples * (self.surroundings.sample_period_s or 1.0)


def file_of(folder: Path, role: str) -> Path:
    """Return the path of a run's file of a role, by its manifest; see `FILES`."""
    files = _manifest(folder).get("files")
    name = files.get(role) if isinstance(files, dict) else None
    path = folder / (name if isinstance(name, str) else FILES[role])
    if not path.resolve().is_relative_to(folder.resolve()):
        raise RecordingError(
            f"{folder / MANIFEST} names {name!r} as {role}, which lies outside the folder; restore it"
        )
    return path


def _manifest(folder: Path) -> dict[str, Any]:
    """Return the content of a run's manifest, empty where there is none."""
    path = folder / MANIFEST
    if not path.exists():
        return {}
    with explained(f"{path} cannot be read", "restore it", ValueError, RecursionError):
        manifest = parse_json(read_text(path))
    return manifest if isinstance(manifest, dict) else {}


def read_evaluation(path: Path) -> EvaluatedCases:
    """Read the trajectories of an evaluation, and the outcomes of its cases if they are stored with them.

    Parameters
    ----------
    path : Path
        A run's folder, or its ``evaluate/trajectories.parquet``.

    Raises
    ------
    RecordingError
        If there are none, or a table is damaged or holds something else.
    """
    if path.is_file() and path.suffix != ".parquet":
        raise RecordingError(
            f"{path} is neither a run's folder nor its {FILES['evaluation_trajectories']}; to look at a "
            f"flight: python -m telemetry replay {shlex.quote(str(path))}"
        )
    table = path if path.suffix == ".parquet" else file_of(path, "evaluation_trajectories")
    root = table.parent.parent
    outcomes = table.with_name(file_of(root, "evaluation_episodes").name)
    if not table.exists():
        why = (
            "; give the folder of a run that has been evaluated, as "
            "`python -m pipeline +experiment=evaluate` makes one"
        )
        if outcomes.exists():
            why = (
                ": campaigns of more cases than engine.part_cases keep no trajectories; evaluate again with "
                "fewer (monte_carlo.num_cases), or with a greater engine.part_cases"
            )
        raise RecordingError(f"{table} does not exist{why}")
    cases, tracks = _tracks(table)
    return EvaluatedCases(
        name=root.resolve().name,
        case=cases,
        position_m=tracks,
        episodes=_episodes(outcomes, cases),
        surroundings=_surroundings(root),
    )


def _read(path: Path, required: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Read the columns of numbers of a Parquet file, in bounded memory."""
    import pyarrow as pa  # noqa: PLC0415 - takes a tenth of a second; replays of flights do without it
    import pyarrow.parquet as pq  # noqa: PLC0415

    cure = "repeat the stage of the run that writes it"
    with explained(f"{path} cannot be read", cure, ValueError, pa.ArrowException), ExitStack() as stack:
        stream = stack.enter_context(open_regular(path))
        file = pq.ParquetFile(stream)
        schema, claimed = file.schema_arrow, file.metadata
        are_numbers = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean)
        wanted = [field.name for field in schema if any(is_so(field.type) for is_so in are_numbers)]
        unpacked = sum(claimed.row_group(index).total_byte_size for index in range(claimed.num_row_groups))
        # equal numbers in a row are packed as one
        unpacked = max(unpacked, 8 * claimed.num_rows * (len(wanted) + 1))
        if unpacked > MOST_BYTES:
            raise RecordingError(f"{path} unpacks to {unpacked} bytes; at most {MOST_BYTES} are read")
        table = file.read(columns=wanted, use_threads=False)
    if missing := [name for name in required if wanted.count(name) != 1 or table[name].null_count]:
        raise RecordingError(
            f"{path} has no column {', '.join(missing)} of numbers without gaps; give a table that the "
            "pipeline has written"
        )
    for name in required:
        if name in _KEYS and not pa.types.is_integer(schema.field(name).type):
            raise RecordingError(f"{path} has no whole numbers in its column {name}; give another table")
    return {name: table[name].to_numpy() for name in wanted}


def _tracks(path: Path) -> tuple[Integers, NDArray[np.float32]]:
    """Return the cases of the tracks, (n,), and the tracks, (n, K+1, 3)."""
    columns = _read(path, ("case", "sample", *_POSITION))
    sample = columns["sample"].astype(np.int64)  # a number that overflows is no sample
    num_samples = min(int(sample.max(initial=-1)) + 1, len(sample) + 1)
    num_tracks = len(sample) // max(num_samples, 1)
    regular = np.tile(np.arange(num_samples), num_tracks)
    if not num_tracks or len(regular) != len(sample) or not np.array_equal(regular, sample):
        raise RecordingError(
            f"{path} does not hold whole trajectories, sample by sample; repeat the stage that writes it"
        )
    positions = np.column_stack([columns[name] for name in _POSITION]).astype(np.float32)
    return columns["case"][::num_samples].astype(np.int64), positions.reshape(num_tracks, num_samples, 3)


def _episodes(path: Path, cases: Integers) -> Columns:
    """Return the outcomes of the cases, if they are stored; raise RecordingError for other cases."""
    if not path.exists():
        return {}
    episodes = _read(path, ("case", *_JUDGED))
    if not np.array_equal(episodes["case"], cases):
        raise RecordingError(
            f"{path} holds other cases than the trajectories next to it; repeat the stage evaluate"
        )
    return {name: episodes[name] for name in _JUDGED}


def _surroundings(folder: Path) -> Surroundings:
    """Return the limits and periods of a run from its manifest, or of version 1 its configuration."""
    scene = _manifest(folder).get("scene")
    if isinstance(scene, dict):
        stated = {field.name: scene.get(field.name) for field in fields(Surroundings)}
        return Surroundings(
            **{name: float(value) for name, value in stated.items() if isinstance(value, int | float)}
        )
    # a run of version 1
    path = file_of(folder, "configuration")
    if not path.exists():
        return Surroundings()
    from plain_files import plain_yaml  # noqa: PLC0415 - only runs have a configuration

    with explained(f"{path} cannot be read", "restore it, or remove it", ValueError):
        config = plain_yaml.parse(read_text(path, MOST_CONFIG_BYTES), MOST_CONFIG_BYTES)

    def number(*keys: str) -> float | None:
        value = config
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return float(value) if isinstance(value, int | float) else None

    return Surroundings(
        sample_period_s=number("control_period_s"),
        min_distance_m=number("deputy", "min_distance_m"),
        max_distance_m=number("deputy", "max_distance_m"),
        threshold_percent=number("inspection_threshold_percent"),
        chief_radius_m=number("chief", "inspection_radius_m"),
    )
