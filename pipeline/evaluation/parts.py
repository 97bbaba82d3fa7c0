"""Parts of a campaign: tables of consecutive cases, each of which certifies itself.

Flights of fleets fill two tables, one with a row for each deputy; a part is there if both certify it.

In its file stand, beside the rows, who made them, their hash, and statistics from which shares, means and
deviations of the whole follow. A part that tells other than it holds is not used.
"""

import hashlib
import json
import math
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.evaluation.monte_carlo import deputy_columns, episode_columns, fly_followed, summarised
from pipeline.evaluation.sequential import LOOK_CASES, Stop
from pipeline.evaluation.statistics import Column, Columns
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleets import FleetOutcomes
from pipeline.run import artifacts, maker, manifests, tables
from pipeline.run.engine import TaskPool
from pipeline.run.progress import Progress
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment
from plain_files.plain_text import parse_json

#: the notes in a part's file, as JSON: a list of makers, the hash of its rows, their statistics
MAKERS, ROWS, STATISTICS = "makers", "rows_sha256", "statistics"
#: where the parts of a table are until it is written
FOLDERS: Final = {
    artifacts.EPISODES: f"{artifacts.EPISODE_PARTS}/cases",
    artifacts.DEPUTIES: f"{artifacts.EPISODE_PARTS}/deputies",
    artifacts.NOMINAL_EPISODES: f"{artifacts.EPISODE_PARTS}/nominal",
}
#: the name of a part's file: its first case, and the one after its last
NAME: Final = re.compile(r"(\d{9,})-(\d{9,})\.parquet")
CURE: Final = "remove it and go on with resume=, which flies its cases again"


@dataclass(frozen=True)
class CasePart:
    """A file with the cases from a first one up to another, which it does not hold.

    Parameters
    ----------
    path : Path
    first, past : int
    rows : int
        Of each case, one after the other: as many as there are deputies in a table of theirs.
    """

    path: Path
    first: int
    past: int
    rows: int = 1

    @property
    def columns(self) -> Columns:
        """Read its rows."""
        return tables.read_parquet(self.path.parent, self.path.name)

    def check(self, columns: Columns, notes: Mapping[str, str]) -> list[dict[str, Any]]:
        """Return who made the part's rows.

        Raises
        ------
        pipeline.run.artifacts.ArtifactError
            If they are not the rows that its notes certify.
        """
        with artifacts.explained(f"{self.path} certifies nothing", CURE, RecursionError):
            claims = {name: parse_json(notes[name]) for name in (MAKERS, ROWS, STATISTICS)}
            makers: list[dict[str, Any]] = claims[MAKERS]
            if not manifests.fits(makers, [manifests.MAKER_SHAPE]) or not makers:
                raise ValueError("it names no maker")
            if any(not made_by.keys() >= manifests.MAKER_SHAPE.keys() for made_by in makers):
                raise ValueError("it names a maker without program or processor")
            if not np.array_equal(columns["case"], np.arange(self.first, self.past).repeat(self.rows)):
                raise ValueError("its cases are not those of its name")
            if claims[ROWS] != rows_hash(columns):
                raise ValueError("its rows are not those whose hash it tells")
            if claims[STATISTICS] != sufficient(columns):
                raise ValueError("its rows have other statistics than it tells")
        return makers


def path_of(folder: Path, first: int, past: int) -> Path:
    """Return the path of the part with the cases from `first` up to `past`."""
    return folder / f"{first:09d}-{past:09d}.parquet"


def write(path: Path, columns: Columns, certificate: Mapping[str, str]) -> None:
    """Write a part with its certificate, see `certified`."""
    tables.write_parquet(path, columns, certificate)


def certified(columns: Columns, makers: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return the notes with which a part certifies itself.

    Parameters
    ----------
    columns : mapping of (n,) arrays
    makers : sequence of mapping
        Of the rows, see `pipeline.run.maker.present_maker`.
    """
    return {
        MAKERS: json.dumps(makers),
        ROWS: json.dumps(rows_hash(columns)),
        STATISTICS: json.dumps(sufficient(columns)),
    }


def rows_hash(columns: Columns) -> str:
    """Return the SHA-256 of the names, types and values of columns, 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for name in columns:
        column = np.ascontiguousarray(columns[name])
        digest.update(f"{name} {column.dtype.str} {len(column)}\n".encode())
        digest.update(column.tobytes())
    return digest.hexdigest()


def sufficient(columns: Columns) -> dict[str, Any]:
    """Return statistics of flights that add up over parts, and from which means and shares follow.

    Returns
    -------
    dict
        ``count``; ``true``, by share the number of flights; ``sums``, by quantity the sum of its values and
        of their squares, both rounded once (Shewchuk, Discrete & Computational Geometry 18, 1997), so that
        every machine adds alike. Of a table of deputies, which is not summarised, the number of rows alone.
    """
    names, shares = summarised(columns) if "deputy" not in columns else ([], {})
    values = {name: np.asarray(columns[name], dtype=np.float64) for name in names}
    return {
        "count": len(columns["case"]),
        "true": {name: int(np.count_nonzero(share)) for name, share in shares.items()},
        "sums": {name: [math.fsum(of), math.fsum(of * of)] for name, of in values.items()},
    }


def kept(folder: Path, cases: range, rows: int = 1) -> Iterator[CasePart]:
    """Yield the parts in a folder that certify themselves, in the order of cases, none of them twice.

    Their makers are named in the manifest. Of others it is told that their cases are flown again.
    """
    past = cases.start
    for path in sorted(folder.glob("*.parquet"), key=_bounds):
        first, end = _bounds(path)
        if not past <= first < end <= cases.stop:
            continue
        part = CasePart(path, first, end, rows)
        try:
            makers = part.check(part.columns, tables.notes_of(path))
        except artifacts.ArtifactError as error:
            sys.stderr.write(
                f"  note: {path.name} is not used, its cases are flown again: {error.__cause__ or error}\n"
            )
            continue
        for made_by in makers:
            maker.collect(made_by)
        past = end
        yield part


def _bounds(path: Path) -> tuple[int, int]:
    """Return the cases in a part's name; none if it is not one."""
    named = NAME.fullmatch(path.name)
    return (int(named[1]), int(named[2])) if named else (-1, -1)


def missing(there: Sequence[CasePart], cases: range, length: int) -> list[tuple[int, int]]:
    """Return the bounds of the parts to fly, of at most a length, where none is."""
    ends = [cases.start, *(end for part in there for end in (part.first, part.past)), cases.stop]
    gaps = zip(ends[::2], ends[1::2], strict=True)
    return [
        (first, min(first + length, past)) for begin, past in gaps for first in range(begin, past, length)
    ]


def join(path: Path, whole: Sequence[CasePart], num_cases: int | None = None) -> None:
    """Join parts of a table, or their first cases, in the order of cases, as if written at once to the byte.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a part is not what it certifies.
    """
    by_path = {part.path: part for part in whole}

    def check(path: Path, columns: Columns, notes: Mapping[str, str]) -> None:
        by_path[path].check(columns, notes)

    tables.join_parquet(path, list(by_path), check, num_cases and num_cases * whole[0].rows)


def fly(
    experiment: Experiment,
    controller: Controller,
    cases: range,
    written: Mapping[Path, Path],
    pool: TaskPool,
    stop: Stop | None = None,
) -> None:
    """Fly cases, each part into a file, and join them; a resumed run flies only what is missing.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
    cases : range
    written : mapping of Path to Path
        For each table that the flights fill, the folder of its parts and its path: episodes first.
    pool : TaskPool
    stop : Stop, optional
    """
    if not experiment.resume:
        for folder in written:
            shutil.rmtree(folder, ignore_errors=True)
    rows = dict(zip(written, (1, experiment.mission.fleet.deputies), strict=False))
    there = _kept_in_all(rows, cases)
    taken = (stop.take(part.first, part.columns) for part, *_ in there) if stop else ()
    end = next(filter(None, taken), None)
    # a resumed run may be cut into other parts
    length = min(experiment.engine.part_cases, LOOK_CASES) if stop else experiment.engine.part_cases
    left = [] if end else missing([part for part, *_ in there], cases, length)
    threads = pool.threads(experiment.monte_carlo.workers)
    tasks = [(experiment, controller, bounds, threads) for bounds in left]
    with (
        Progress("part:", len(there) + len(left), len(there)) as progress,
        closing(pool.run(fly_and_certify, tasks)) as results,
    ):
        for index, flown in results:
            made = _parts_of(rows, *left[index])
            for part, (columns, certificate) in zip(made, flown, strict=True):
                write(part.path, columns, certificate)
            there.append(made)
            progress.show(len(there))
            if stop and (end := stop.take(made[0].first, flown[0][0])):
                break
    there.sort(key=lambda made: made[0].first)
    for path, whole in zip(written.values(), zip(*there, strict=True), strict=True):
        join(path, [part for part in whole if end is None or part.first < end], end)


def _parts_of(rows: Mapping[Path, int], first: int, past: int) -> list[CasePart]:
    """Return some cases' part of each table, by the folder of its parts and its rows of a case."""
    return [CasePart(path_of(folder, first, past), first, past, of_each) for folder, of_each in rows.items()]


def _kept_in_all(rows: Mapping[Path, int], cases: range) -> list[list[CasePart]]:
    """Return the parts that all tables have, see `kept`."""
    by_table = [{(part.first, part.past) for part in kept(folder, cases, rows[folder])} for folder in rows]
    return [_parts_of(rows, *bounds) for bounds in sorted(set.intersection(*by_table))]


def fly_and_certify(*task: Any) -> list[tuple[dict[str, Column], dict[str, str]]]:
    """Return the tables that `fly_part` does, each with its certificate, see `certified`."""
    makers = [maker.present_maker()]
    return [(columns, certified(columns, makers)) for columns in fly_part(*task)]


def fly_part(
    experiment: Experiment, controller: Controller, bounds: tuple[int, int], workers: int | None
) -> list[dict[str, Column]]:
    """Fly the cases from the first bound up to the second; return the columns of each table."""
    scenarios = evaluation_scenarios(experiment, range(*bounds))
    outcomes, after = fly_followed(experiment.mission, controller, scenarios, workers)
    filled = [episode_columns(experiment.mission, scenarios, outcomes, after)]
    if isinstance(outcomes, FleetOutcomes):
        filled.append(deputy_columns(scenarios, outcomes, after))
    return [columns | {"case": columns["case"] + bounds[0]} for columns in filled]
