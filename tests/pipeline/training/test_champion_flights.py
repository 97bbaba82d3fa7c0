"""The champions' flights, of genomes that change when they are told to."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.controllers import source
from pipeline.training.evolution.state import Generation
from pipeline.training.genome import genome_of
from pipeline.training.progress import ChampionFlights
from tests.pipeline.stages.cases import prepared


def generation(round_index: int, number: int, champion: np.ndarray) -> Generation:
    return Generation(
        round=round_index,
        generation=number,
        evaluations=6,
        best=1.0,
        mean=2.0,
        std=0.5,
        step_size=1.0,
        parts={},
        champion=champion,
    )


@pytest.fixture
def flights(tmp_path: Path) -> ChampionFlights:
    experiment = prepared(tmp_path).experiment
    template = source.load(experiment.controller, experiment.mission)
    return ChampionFlights(experiment, genome_of(template, experiment.optimizer.encoding))


def history() -> list[Generation]:
    first, second = np.random.default_rng(3).random((2, 150))
    moments = [(0, 0, first), (0, 1, first), (0, 2, second), (1, 0, second), (1, 1, first)]
    return [generation(*moment) for moment in moments]


def test_only_new_champions_are_flown(flights: ChampionFlights) -> None:
    grown = history()
    assert [flights.add(grown[:count]) for count in range(1, 6)] == [True, False, True, False, True]
    columns = flights.columns()
    begun = columns["sample"] == 0
    assert columns["round"][begun].tolist() == [0, 0, 1]
    assert columns["generation"][begun].tolist() == [0, 2, 1]
    tracks = np.column_stack([columns[f"position_{axis}_m"] for axis in "xyz"]).reshape(3, -1, 3)
    assert np.array_equal(tracks[0], tracks[2])
    assert np.array_equal(tracks[0, 0], tracks[1, 0])
    assert np.abs(tracks[0, -1] - tracks[1, -1]).max() > 0.01


def test_a_history_at_once_gives_what_one_gives_that_grows(tmp_path: Path, flights: ChampionFlights) -> None:
    """A training that goes on knows all champions of earlier runs at once."""
    grown = history()
    for count in range(1, 6):
        flights.add(grown[:count])
    experiment = prepared(tmp_path).experiment
    template = source.load(experiment.controller, experiment.mission)
    resumed = ChampionFlights(experiment, genome_of(template, experiment.optimizer.encoding))
    assert resumed.add(grown)
    for name, column in flights.columns().items():
        np.testing.assert_array_equal(column, resumed.columns()[name])
