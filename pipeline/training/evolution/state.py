"""The state of an evolution: the results of a generation, and everything that the next one depends on.

Between two generations it is on disk, without pickle, written atomically.
"""

import io
import json
import random
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.run.writing import write_atomically
from plain_files.file_access import read_bytes


@dataclass(frozen=True, kw_only=True)
class Generation:
    """Results of an evaluated generation.

    Parameters
    ----------
    round : int
        From 0.
    generation : int
        Within the round; 0 is the initial population.
    evaluations : int
        Individuals evaluated since the beginning, all rounds together.
    best, mean, std : float
        Fitness over the population; std with ddof = 1.
    step_size : float
        Of the mutation that produced it.
    parts : mapping of str to float
        The champion's fitness parts.
    champion : (num_genes,) array
        The genome of the best individual.
    """

    round: int
    generation: int
    evaluations: int
    best: float
    mean: float
    std: float
    step_size: float
    parts: Mapping[str, float]
    champion: Floats

    def row(self) -> dict[str, Any]:
        """Return the columns of the logbook: all fields except the genome and the parts."""
        names = ("round", "generation", "evaluations", "best", "mean", "std", "step_size")
        return {name: getattr(self, name) for name in names}


@dataclass
class EvolutionState:
    """Everything the next generation depends on.

    Parameters
    ----------
    round, generation, evaluations : int
        As in `Generation`.
    step_size : float
        Of the next mutation, before it adapts.
    genomes : (population_size, num_genes) array
    fitness : (population_size,) array
    parts : dict of str to (population_size,) array
    python_state : tuple
        Of Python's random generator, from `random.getstate`.
    generator : numpy Generator
        PCG64.
    strategy : dict of str to array
        Of CMA-ES; empty for the other algorithms.
    history : list of Generation
        All generations so far.
    """

    round: int
    step_size: float
    genomes: Floats
    python_state: tuple[Any, ...]
    generator: np.random.Generator
    generation: int = 0
    evaluations: int = 0
    fitness: Floats = field(default_factory=lambda: np.empty(0))
    parts: dict[str, Floats] = field(default_factory=dict)
    strategy: dict[str, Floats] = field(default_factory=dict)
    history: list[Generation] = field(default_factory=list)


@contextmanager
def drawing(state: EvolutionState) -> Iterator[random.Random]:
    """Yield the generator of a state, in which it is stored again at the end."""
    generator = random.Random()  # noqa: S311
    generator.setstate(state.python_state)
    yield generator
    state.python_state = generator.getstate()


VERSION = 2

#: numbers of a state that are kept as they are
_NUMBERS = ("round", "generation", "evaluations", "step_size")
_ARRAYS = ("genomes", "fitness", "parts", "champions")
#: prefix of the arrays with CMA-ES's state
_STRATEGY = "strategy_"
_AFRESH = "delete it to start the training afresh"


class CheckpointError(ValueError):
    """Raised for a checkpoint that cannot be resumed."""


def save(path: Path, state: EvolutionState, fingerprint: Mapping[str, Any]) -> None:
    """Write a state: arrays and one JSON text in an .npz.

    Parameters
    ----------
    path : Path
    state : EvolutionState
    fingerprint : mapping
        Values that must not change when the evolution is resumed.
    """
    note = {
        "version": VERSION,
        "fingerprint": dict(fingerprint),
        **{name: getattr(state, name) for name in _NUMBERS},
        "parts": list(state.parts),
        "strategy": list(state.strategy),
        "python_state": state.python_state,
        "numpy_state": state.generator.bit_generator.state,
        "history": [{**g.row(), "parts": dict(g.parts)} for g in state.history],
    }
    stream = io.BytesIO()
    arrays: dict[str, Any] = {
        "note": np.frombuffer(json.dumps(note).encode(), dtype=np.uint8),
        "genomes": state.genomes,
        "fitness": state.fitness,
        "parts": np.array(list(state.parts.values())).reshape(len(state.parts), len(state.fitness)),
        "champions": np.array([g.champion for g in state.history]),
        **{_STRATEGY + name: values for name, values in state.strategy.items()},
    }
    np.savez(stream, **arrays)
    write_atomically(path, stream.getvalue())


def load(path: Path, fingerprint: Mapping[str, Any]) -> EvolutionState:
    """Read a state that `save` wrote.

    Raises
    ------
    CheckpointError
        If the file is damaged, of another version, or its fingerprint differs.
    """
    note, arrays = _read(path)
    if note.get("version") != VERSION:
        raise CheckpointError(
            f"{path} has checkpoint version {note.get('version')}, this program reads {VERSION}; {_AFRESH}"
        )
    written = note.get("fingerprint")
    if not isinstance(written, dict):
        raise _damaged(path)
    for name, value in fingerprint.items():
        if written.get(name) != value:
            raise CheckpointError(
                f"{path} was written with {name} = {written.get(name)}, now it is {value}; "
                "resume with the configuration of that run, or start a new one"
            )
    try:
        return _state_from(note, arrays)
    except (KeyError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise _damaged(path) from error


#: of a checkpoint: that of a thousand individuals over a thousand generations takes some 20 MB
MOST_UNPACKED = 256 * 1024**2
#: errors that NumPy raises for a damaged archive; it parses array headers as Python
_UNREADABLE = (
    *(
        OSError,
        ValueError,
        KeyError,
        EOFError,
        RuntimeError,
        SyntaxError,
        AttributeError,
        NotImplementedError,
    ),
    *(zipfile.BadZipFile, zlib.error, tokenize.TokenError),
)


def _damaged(path: Path) -> CheckpointError:
    return CheckpointError(f"{path} is not a readable checkpoint (damaged, or cut short); {_AFRESH}")


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the note and the arrays of a file that `save` wrote."""
    try:
        content = read_bytes(path)
    except OSError as error:
        raise CheckpointError(f"{path} cannot be read ({error.strerror}); {_AFRESH}") from error
    if not content.startswith(b"PK"):  # not an archive; numpy's message would be about pickles
        raise _damaged(path)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as members:
            unpacked = sum(member.file_size for member in members.infolist())
        if unpacked > MOST_UNPACKED:
            raise CheckpointError(f"{path} unpacks to {unpacked} bytes; at most {MOST_UNPACKED} are read")
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            note = json.loads(archive["note"].tobytes())
            learnt = [name for name in archive.files if name.startswith(_STRATEGY)]
            arrays = {name: archive[name] for name in (*_ARRAYS, *learnt)}
    except _UNREADABLE as error:
        raise _damaged(path) from error
    if not isinstance(note, dict):
        raise _damaged(path)
    return note, arrays


def _state_from(note: Mapping[str, Any], arrays: Mapping[str, Any]) -> EvolutionState:
    """Build the state; wrong states of the random generators raise."""
    generator = np.random.default_rng()
    generator.bit_generator.state = note["numpy_state"]
    version, internal, gauss = note["python_state"]
    python_state = (version, tuple(internal), gauss)
    random.Random().setstate(python_state)  # noqa: S311 - a test, nothing is drawn
    rows = zip(note["history"], arrays["champions"], strict=True)
    return EvolutionState(
        **{name: note[name] for name in _NUMBERS},
        genomes=arrays["genomes"],
        fitness=arrays["fitness"],
        parts=dict(zip(note["parts"], arrays["parts"], strict=True)),
        python_state=python_state,
        generator=generator,
        strategy={name: arrays[_STRATEGY + name] for name in note["strategy"]},
        history=[Generation(champion=champion, **row) for row, champion in rows],
    )
