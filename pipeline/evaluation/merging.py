"""Shards of one campaign, flown by separate commands, as the parts of one run.

A shard is a run with `monte_carlo.only_cases`, on any machine: it needs no lock or file of the others.
Merging puts the flights of all into the parts of a new run (`pipeline.evaluation.parts`), whose evaluation
then does the rest, so that its files are those of a campaign that was flown whole.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.evaluation import parts
from pipeline.evaluation.statistics import Column, Columns
from pipeline.run import artifacts, maker, manifests, tables
from pipeline.settings import schema
from pipeline.settings.keys import value_at, with_values
from pipeline.settings.sizes import BLOCK_ROWS

#: the setting that makes a run a shard
ONLY: Final = "monte_carlo.only_cases"
#: the stage that flies cases
EVALUATE: Final = "evaluate"


class MergeError(ValueError):
    """Why shards cannot be merged."""


@dataclass(frozen=True)
class Shard:
    """A run of some cases of a campaign.

    Parameters
    ----------
    folder : Path
    config : mapping
        As plain data.
    manifest : mapping
    """

    folder: Path
    config: Mapping[str, Any]
    manifest: Mapping[str, Any]

    @property
    def cases(self) -> range:
        """The numbers of its cases."""
        return range(*value_at(self.config, ONLY))

    @property
    def makers(self) -> list[Mapping[str, Any]]:
        """Who flew them."""
        return [self.manifest["makers"][index] for index in self.manifest["made_by"][EVALUATE]]

    def rows(self, name: str) -> int:
        """Return how many rows a table has of each case."""
        return int(value_at(self.config, "fleet.deputies")) if name == artifacts.DEPUTIES else 1

    def columns(self, name: str) -> tables.Columns:
        """Return the columns of a table of its cases."""
        return tables.Columns(self.folder, name)


def read_shard(folder: Path, config: Mapping[str, Any]) -> Shard:
    """Return a shard whose flights are as they were written.

    Parameters
    ----------
    folder : Path
    config : mapping
        Its checked configuration.

    Raises
    ------
    MergeError
        If the run is no shard, is not evaluated, or its flights were changed.
    """
    manifest = manifests.read(folder)
    if value_at(config, ONLY) is None:
        raise MergeError(
            f"{folder} is no shard, it was flown whole; fly the shards of a campaign with {ONLY}=[first,past]"
        )
    if EVALUATE not in manifest["finished_stages"] or EVALUATE not in manifest.get("made_by", {}):
        raise MergeError(f"{folder} is not evaluated to its end; finish it with resume={folder}")
    shard = Shard(folder, config, manifest)
    for name in (*_tables_of(config), artifacts.SUMMARY):
        path = artifacts.require(folder, name)
        if artifacts.file_hash(path) != manifest.get("sha256", {}).get(name):
            raise MergeError(f"{path} was changed since it was written; restore it, or fly the shard again")
    for name in _tables_of(config):
        if not np.array_equal(shard.columns(name)["case"], np.repeat(shard.cases, shard.rows(name))):
            raise MergeError(f"{folder / name} has other cases than its {ONLY}; fly the shard again")
    return shard


def _tables_of(config: Mapping[str, Any]) -> list[str]:
    """Return the tables of a shard's flights, also of a fleet's deputies, and without its dispersions."""
    return [
        artifacts.EPISODES,
        *([artifacts.DEPUTIES] if value_at(config, "fleet.deputies") > 1 else []),
        *([artifacts.NOMINAL_EPISODES] if config.get("dispersions") else []),
    ]


def whole_of(shards: Sequence[Shard]) -> dict[str, Any]:
    """Return the configuration of the campaign of which shards are all that there is.

    Raises
    ------
    MergeError
        If they are of several campaigns or programs, fly other controllers, leave cases out, or differ in
        cases that two of them have.
    """
    first, *others = shards
    present = maker.present_maker()
    for shard in shards:
        for made_by in shard.makers:
            if differences := maker.unfit(present, made_by):
                raise MergeError(
                    f"{shard.folder} was made by another program ({', '.join(differences)}), so that the "
                    "whole would mix two; fly it again with this one, or merge with that"
                )
    for shard in others:
        then, now = (schema.only_results(schema.present(each.config)) for each in (first, shard))
        here, there = (with_values(config, {ONLY: None}) for config in (then, now))
        words = str(first.folder), str(shard.folder)
        if differing := schema.differences(here, there, {"hydra"}, words):
            raise MergeError(f"the shards are of different campaigns, in {'; '.join(differing)}")
        if _flown_by(first) != _flown_by(shard):
            raise MergeError(
                f"{first.folder} and {shard.folder} flew different controllers; fly one of them again"
            )
    _check_overlaps(shards)
    whole = with_values(first.config, {ONLY: None})
    _check_covered(shards, int(value_at(whole, "monte_carlo.num_cases")))
    return whole


def _flown_by(shard: Shard) -> str:
    """Return the hash of the controller that a shard flew."""
    with artifacts.explained(f"{shard.folder / artifacts.SUMMARY} cannot be read", "fly the shard again"):
        return str(artifacts.read_json(shard.folder, artifacts.SUMMARY)["controller_sha256"])


def _check_covered(shards: Sequence[Shard], num_cases: int) -> None:
    """Raise MergeError if no shard has some of the cases."""
    past = 0
    for first, end in [*sorted((shard.cases.start, shard.cases.stop) for shard in shards), (num_cases, 0)]:
        if first > past:
            raise MergeError(
                f"no shard has the cases {past} to {first - 1}; fly them with the same settings and "
                f"{ONLY}=[{past},{first}], and merge again"
            )
        past = max(past, end)


def _check_overlaps(shards: Sequence[Shard]) -> None:
    """Raise MergeError if two shards have a case that they flew differently."""
    for first, second in combinations(shards, 2):
        start, stop = max(first.cases.start, second.cases.start), min(first.cases.stop, second.cases.stop)
        for name in _tables_of(first.config) if start < stop else ():
            blocks = [_blocks(shard, name, start, stop) for shard in (first, second)]
            for case, column in _differing(*blocks):
                raise MergeError(
                    f"{first.folder} and {second.folder} both have case {case}, and differ in its {column} "
                    f"in {name}; one of them is wrong: fly both again"
                )


def _differing(first: Iterator[Columns], second: Iterator[Columns]) -> Iterator[tuple[int, str]]:
    """Yield case and column of each first difference between the same cases of two tables."""
    for here, there in zip(first, second, strict=True):
        zeros = np.zeros(len(here["case"]))
        for column in dict.fromkeys((*here, *there)):
            first_of, second_of = here.get(column, zeros), there.get(column, zeros)
            are_missing = np.isnan(first_of) & np.isnan(second_of)
            is_other = (first_of != second_of) & ~are_missing
            if np.any(is_other):
                yield int(here["case"][np.argmax(is_other)]), column


def _blocks(shard: Shard, name: str, start: int, stop: int) -> Iterator[Columns]:
    """Yield cases of a shard's table in blocks whose bounds do not depend on the shard."""
    left: dict[str, Column] = {}
    length = BLOCK_ROWS * shard.rows(name)
    for block in shard.columns(name).blocks():
        is_asked = (block["case"] >= start) & (block["case"] < stop)
        part = {column: block[column][is_asked] for column in block}
        left = {column: np.concatenate((left[column], part[column])) for column in part} if left else part
        while len(left["case"]) >= length:
            yield {column: values[:length] for column, values in left.items()}
            left = {column: values[length:] for column, values in left.items()}
    if left and len(left["case"]):
        yield left


def write_parts(shards: Sequence[Shard], folder: Path) -> None:
    """Write the flights of shards as the parts of a run, each case once, with all who may have flown it.

    Parameters
    ----------
    shards : sequence of Shard
        See `whole_of`.
    folder : Path
        The run's.
    """
    past = 0
    for shard in sorted(shards, key=lambda shard: (shard.cases.start, -shard.cases.stop)):
        for name in _tables_of(shard.config) if shard.cases.stop > past else ():
            for columns in _blocks(shard, name, past, shard.cases.stop):
                first, last = int(columns["case"][0]), int(columns["case"][-1])
                path = parts.path_of(folder / parts.FOLDERS[name], first, last + 1)
                parts.write(path, columns, parts.certified(columns, shard.makers))
        past = max(past, shard.cases.stop)
