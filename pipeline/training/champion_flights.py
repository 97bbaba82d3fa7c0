"""Flights of a training's champions, generation by generation, to watch it learn."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.cases.cases import cases_of
from pipeline.flight.cases.starts import given_start
from pipeline.flight.control.controller import law_of
from pipeline.flight.fly.population import fly_population, lanes_for
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Experiment
from pipeline.training.evolution.state import Generation
from pipeline.training.genome import Genome


class ChampionFlights:
    """The flight of each champion of a training, all from the start in the configuration.

    Parameters
    ----------
    experiment : Experiment
    genome : Genome
        Meaning of their genes.
    """

    def __init__(self, experiment: Experiment, genome: Genome):
        mission = experiment.mission
        self._world, self._law = pack_world(mission), law_of(genome.template, mission)
        self._genome = genome
        self._start = cases_of(mission, [given_start(mission.deputy, experiment.sun, experiment.seed)])
        self._num_seen = 0
        self._last: Floats | None = None
        self._moments: list[tuple[int, int]] = []
        self._tracks: list[NDArray[np.float32]] = []

    def add(self, history: Sequence[Generation]) -> bool:
        """Fly the champions that are new since the last call; return whether there was one."""
        num_flown = len(self._tracks)
        for generation in history[self._num_seen :]:
            if self._last is None or not np.array_equal(generation.champion, self._last):
                self._last = generation.champion
                self._moments.append((generation.round, generation.generation))
                self._tracks.append(self._fly(generation.champion))
        self._num_seen = len(history)
        return len(self._tracks) > num_flown

    def _fly(self, genome: Floats) -> NDArray[np.float32]:
        tracks = np.empty((1, self._world.num_controls + 1, 3), dtype=np.float32)
        numbers = self._genome.pack(genome[np.newaxis])
        fly_population(self._world, self._law, numbers, self._start, 1, tracks, lanes=lanes_for(1))
        track: NDArray[np.float32] = tracks[0]
        return track

    def columns(self) -> dict[str, NDArray[np.generic]]:
        """Return a row for each sample of each champion, with the generation that found it."""
        num_samples = self._world.num_controls + 1
        moments = np.repeat(np.array(self._moments, dtype=np.int32), num_samples, axis=0)
        positions = np.concatenate(self._tracks)
        return {
            "round": moments[:, 0],
            "generation": moments[:, 1],
            "sample": np.tile(np.arange(num_samples, dtype=np.int32), len(self._tracks)),
            **{f"position_{axis}_m": positions[:, i] for i, axis in enumerate("xyz")},
        }
