"""The names of the files of a run's folder, and access to them."""

import hashlib
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path, PurePath
from typing import Any, Final

from pipeline.settings import plugged
from pipeline.settings.stages import STAGES
from plain_files.file_access import open_regular, read_text
from plain_files.plain_text import parse_json

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
TRAINED: Final = "train/summary.json"
FRONT: Final = "train/front.csv"
FRONT_CONTROLLERS: Final = "train/front"
CHECKPOINT: Final = "train/checkpoint.npz"
TENSORBOARD: Final = "train/tensorboard"
FIT_CANDIDATES: Final = "fit/candidates.csv"
FIT_CONTROLLER: Final = "fit/controller.yaml"
FIT_CHECKPOINT: Final = "fit/checkpoint.npz"
FIT: Final = "fit/summary.json"
FIT_PAGE: Final = "fit/fit.html"
CHAMPION: Final = "champion.json"
CONTROLLER: Final = "controller.json"
EPISODES: Final = "evaluate/episodes.parquet"
DEPUTIES: Final = "evaluate/deputies.parquet"
TRAJECTORIES: Final = "evaluate/trajectories.parquet"
SUMMARY: Final = "evaluate/summary.json"
EPISODE_PARTS: Final = "evaluate/.parts"
NOMINAL_EPISODES: Final = "evaluate/nominal.parquet"
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
LEDGER: Final = "assure/ledger.jsonl"
EVIDENCE_PAGE: Final = "assure/evidence.html"
BOARD_PAGE: Final = "assure/board.html"
RECORDINGS: Final = "episodes"
FIGURES: Final = "figures"
REPORT: Final = "report.html"
REVIEW: Final = "review.html"


#: the stages of files that are in no folder of their stage's name
ELSEWHERE: Final[Mapping[str, str]] = {
    SCENARIOS: "scenario",
    CHAMPION: "train",
    RECORDINGS: "record",
    **dict.fromkeys((FIGURES, REPORT, REVIEW), "report"),
}


#: of runs that a message names
MOST_NAMED: Final = 3
#: of a run in the folder of all runs, outputs/NAME-sweep/TIME/RUN
SWEEP_DEPTH: Final = 4
#: entries of a folder among which runs are looked for
MOST_LISTED: Final = 1000


class ArtifactError(ValueError):
    """A file of a run that is missing or cannot be read."""


@contextmanager
def explained(what: str, cure: str, *also: type[Exception]) -> Iterator[None]:
    """Turn errors while reading into an ArtifactError that says what is wrong and how to repair it."""
    expected: tuple[type[Exception], ...] = (OSError, ValueError, KeyError, TypeError, *also)
    try:
        yield
    except expected as error:
        raise ArtifactError(f"{what} ({type(error).__name__}: {error}); {cure}") from error


def strangers(folder: Path) -> Iterator[str]:
    """Yield the links, pipes and devices in a folder, which no run makes, in words."""
    for parent, folders, files in os.walk(folder):
        for name in sorted([*folders, *files]):
            path = Path(parent, name)
            try:
                mode = path.lstat().st_mode
            except FileNotFoundError:  # a run inside this folder is at work
                continue
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                kind = f"a link to {os.readlink(path)}" if stat.S_ISLNK(mode) else "a pipe, socket or device"
                yield f"{path.relative_to(folder).as_posix()} is {kind}"


def check_no_strangers(folder: Path) -> None:
    """Raise ArtifactError unless a folder contains only files and folders: no link leads out of it."""
    if stranger := next(strangers(folder), None):
        raise ArtifactError(
            f"{folder}: {stranger}; a run's folder holds files and folders alone, so that nothing outside it "
            "is read or written: remove it, or put a copy in its place"
        )


def stage_of(name: str) -> str | None:
    """Return the stage that writes a file of a run, by the file's folder; None if no stage does."""
    first = PurePath(name).parts[0]
    return ELSEWHERE.get(first, first if first in (*STAGES, *plugged.names(plugged.STAGES)) else None)


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
        cure = f"the stage {writer} writes it, run that first" if writer else choose_run(folder)
        raise ArtifactError(f"{folder} has no {name}; {cure}")
    return path


def read_json(folder: Path, name: str, cure: str = "repeat the stage that writes it") -> Any:
    """Read a JSON file of a run, or another of which it is said how to repair it.

    Raises
    ------
    ArtifactError
        If it is missing, cut short or not JSON.
    """
    path = require(folder, name)
    with explained(f"{path} cannot be read", cure, RecursionError):
        return parse_json(read_text(path))


def text_of(folder: Path, name: str) -> str:
    """Return a text file of a run, empty where there is none; raise ArtifactError if it cannot be read."""
    if not (folder / name).exists():
        return ""
    path = require(folder, name)
    with explained(f"{path} cannot be read", "restore it, or repeat the stage that writes it"):
        return read_text(path)


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file, 64 hexadecimal digits."""
    with open_regular(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def list_artifacts(folder: Path) -> list[str]:
    """Return the finished files of a run, by their paths in its folder, sorted.

    The manifest, logs, checkpoints, files still being written and hidden ones do not count.
    """
    names = []
    for path in sorted(folder.rglob("*")):
        relative = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in relative.parts)
        is_log = path.suffix in (".log", ".partial") or relative.is_relative_to(TENSORBOARD)
        if path.is_file() and not path.is_symlink() and not is_hidden and not is_log:
            names.append(relative.as_posix())
    return [name for name in names if name not in (MANIFEST, CHECKPOINT, FIT_CHECKPOINT)]


def choose_run(folder: Path) -> str:
    """Return the advice to choose the folder of a run; it names some that are in a folder, which is none."""
    return f"choose the folder of a run{_such_as(_runs_below(folder))}"


def choose_others(folder: Path) -> str:
    """Return the advice to choose several runs where one is given; it names some in its folder, or beside."""
    if not holds_run(folder):
        return f"choose the folders of runs{_such_as(_runs_below(folder))}"
    return f"choose others too{_such_as(path for path in _runs_below(folder.parent) if path != folder)}"


def _such_as(runs: Iterator[Path]) -> str:
    """Return the first of some runs in words; nothing if there are none."""
    first = [str(run) for run in islice(runs, MOST_NAMED)]
    return f", such as {', '.join(first)}" if first else ""


def _runs_below(folder: Path) -> Iterator[Path]:
    """Yield the folders of runs in one, as deep in it as those of all sweeps are."""
    level = [folder]
    for _ in range(SWEEP_DEPTH):
        below = sorted(path for parent in level[:MOST_LISTED] for path in _folders_in(parent))
        yield from (path for path in below if _has_file(path, MANIFEST) and _has_file(path, CONFIG))
        level = [path for path in below if not _has_file(path, CONFIG)]


def _folders_in(folder: Path) -> list[Path]:
    """Return the folders in one, which may hold anything: none where it cannot be read."""
    with suppress(OSError), os.scandir(folder) as entries:
        return [Path(each) for each in islice(entries, MOST_LISTED) if each.is_dir(follow_symlinks=False)]
    return []


def _has_file(folder: Path, name: str) -> bool:
    """Return whether a folder that can be read has a file of a name."""
    with suppress(OSError):
        return (folder / name).is_file()
    return False


def holds_run(folder: Path) -> bool:
    """Return whether a folder contains a run, even one that was killed before it had a manifest."""
    return (folder / MANIFEST).exists() or list_artifacts(folder) == [CONFIG]
