"""The flights of an evaluated run as they are compared with others: of fleets with all deputies' starts."""

from pathlib import Path

import numpy as np

from pipeline.evaluation.paired_runs import OWN_START, of_deputy
from pipeline.evaluation.statistics import Columns
from pipeline.run import artifacts, tables

#: columns of `evaluate/episodes.parquet` that fleets alone have
OF_FLEETS = "nearest_pair_m"


def read_flights(folder: Path) -> Columns:
    """Read the flights of a run, a row a case; a fleet's with the starts of its deputies beside.

    A large table of one deputy's flights is read on request.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a table is missing, cannot be read, or is not of the same cases as the other.
    """
    flights = tables.read_or_open(folder, artifacts.EPISODES)
    if OF_FLEETS not in flights:
        return flights
    deputies, cases = tables.read_parquet(folder, artifacts.DEPUTIES), flights["case"]
    number = int(np.max(deputies["deputy"], initial=1))
    if not np.array_equal(deputies["case"], np.repeat(cases, number)):
        raise artifacts.ArtifactError(
            f"{folder / artifacts.DEPUTIES} is not of the cases of {artifacts.EPISODES}; repeat the stage "
            "evaluate"
        )
    starts = {
        of_deputy(name, deputy): deputies[name][deputy - 1 :: number]
        for deputy in range(1, number + 1)
        for name in OWN_START
        if name in deputies
    }
    return {**flights, **starts}
