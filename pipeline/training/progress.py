"""The progress of a training, wherever it is shown: the terminal, TensorBoard, flights of the champions."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.cases.starts import cases_of, given_start
from pipeline.flight.control.controller import law_of
from pipeline.flight.fly.population import fly_population, lanes_for
from pipeline.flight.world.pack import pack_world
from pipeline.run.progress import Progress
from pipeline.settings.experiment import Experiment, Logger, Optimizer, SettingError
from pipeline.training.evolution.state import Generation
from pipeline.training.genome import Genome

#: logs a training so far, given all rows of its logbook
Log = Callable[[Sequence[Mapping[str, float]]], None]

#: longest time between writes to the disk, s
FLUSH_S = 5


class TrainingProgress(Progress):
    """The generations of all rounds, each with its first population."""

    def __init__(self, settings: Optimizer) -> None:
        self._per_round = settings.generations + 1
        super().__init__("generation", settings.rounds * self._per_round)

    def show_generation(self, generation: Generation) -> None:
        """Show a generation that has just been evaluated."""
        parts = generation.parts
        self.show(
            generation.round * self._per_round + generation.generation + 1,
            f"round {generation.round + 1}, fitness {generation.best:.4g}: "
            f"delta-v {parts['delta_v_m_s']:.3f} m/s, {parts['points']:.2f} points, "
            f"{parts['short']:.0f} short, {parts['outside']:.0f} outside",
        )


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


@contextmanager
def logged(logger: Logger, name: str) -> Iterator[Log]:
    """Open the logger of a training, and close it when the training ends.

    TensorBoard gets one scalar for each column of the logbook, over the generations. A resumed training
    writes all of them again; TensorBoard then ignores what was written before, in another file.

    Parameters
    ----------
    logger : Logger
    name : str
        Of the training, see `name_of`: its subfolder of `logger.place`.

    Raises
    ------
    SettingError
        If the logger's package is not installed.
    """
    if logger.kind == "none":
        yield lambda rows: None
        return
    try:
        from tensorboardX import SummaryWriter  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise SettingError(
            f"logger={logger.kind} needs the package {error.name}; install it: "
            "python -m pip install tensorboardX tensorboard"
        ) from error
    num_logged = 0
    with SummaryWriter(str(Path(logger.place, name)), purge_step=0, flush_secs=FLUSH_S) as board:

        def log(rows: Sequence[Mapping[str, float]]) -> None:
            nonlocal num_logged
            for step in range(num_logged, len(rows)):
                for column, value in rows[step].items():
                    board.add_scalar(column, value, step)
            num_logged = max(num_logged, len(rows))

        yield log


def name_of(folder: Path) -> str:
    """Return a run's name: its folder, relative to the working directory if below it."""
    whole, here = folder.absolute(), Path.cwd()
    return whole.relative_to(here if whole.is_relative_to(here) else whole.anchor).as_posix()
