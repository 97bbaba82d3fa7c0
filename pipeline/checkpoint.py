"""The state of an evolution between two generations, on disk: no pickle, written whole or not at all."""

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.artifacts import write_atomically

Floats = NDArray[np.float64]

VERSION = 1


class CheckpointError(ValueError):
    """A checkpoint that cannot be gone on from."""


@dataclass(frozen=True, kw_only=True)
class Generation:
    """What is known once a generation has been evaluated.

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
        Of the mutation that led here.
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
        """Return everything but the genome and the parts, by name."""
        names = ("round", "generation", "evaluations", "best", "mean", "std", "step_size")
        return {name: getattr(self, name) for name in names}


@dataclass
class State:
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
        Of Python's random generator, as `random.getstate` gives it.
    generator : numpy Generator
        PCG64.
    history : list of Generation
        All generations so far.
    """

    round: int
    generation: int
    evaluations: int
    step_size: float
    genomes: Floats
    fitness: Floats
    parts: dict[str, Floats]
    python_state: tuple[Any, ...]
    generator: np.random.Generator
    history: list[Generation] = field(default_factory=list)


def save(path: Path, state: State, fingerprint: Mapping[str, Any]) -> None:
    """Write a state: arrays and one JSON text in an .npz.

    Parameters
    ----------
    path : Path
    state : State
    fingerprint : mapping
        What must be the same when the evolution is resumed; plain values.
    """
    note = {
        "version": VERSION,
        "fingerprint": dict(fingerprint),
        "round": state.round,
        "generation": state.generation,
        "evaluations": state.evaluations,
        "step_size": state.step_size,
        "parts": list(state.parts),
        "python_state": state.python_state,
        "numpy_state": state.generator.bit_generator.state,
        "history": [{**g.row(), "parts": dict(g.parts)} for g in state.history],
    }
    stream = io.BytesIO()
    np.savez(
        stream,
        note=np.frombuffer(json.dumps(note).encode(), dtype=np.uint8),
        genomes=state.genomes,
        fitness=state.fitness,
        parts=np.array(list(state.parts.values())).reshape(len(state.parts), len(state.fitness)),
        champions=np.array([g.champion for g in state.history]),
    )
    write_atomically(path, stream.getvalue())


def load(path: Path, fingerprint: Mapping[str, Any]) -> State:
    """Read a state that `save` wrote.

    Raises
    ------
    CheckpointError
        If the file is damaged, of another version, or its fingerprint differs.
    """
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            note = json.loads(arrays["note"].tobytes())
            genomes, fitness, parts, champions = (
                arrays[name] for name in ("genomes", "fitness", "parts", "champions")
            )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise CheckpointError(
            f"{path} is not a readable checkpoint ({error}); delete it to start the training afresh"
        ) from error
    if note["version"] != VERSION:
        raise CheckpointError(
            f"{path} has checkpoint version {note['version']}, this program reads {VERSION}; "
            "delete it to start the training afresh"
        )
    for name, value in fingerprint.items():
        if note["fingerprint"].get(name) != value:
            raise CheckpointError(
                f"{path} was written with {name} = {note['fingerprint'].get(name)}, now it is {value}; "
                "resume with the configuration of that run, or start a new one"
            )
    generator = np.random.default_rng()
    generator.bit_generator.state = note["numpy_state"]
    version, internal, gauss = note["python_state"]
    return State(
        round=note["round"],
        generation=note["generation"],
        evaluations=note["evaluations"],
        step_size=note["step_size"],
        genomes=genomes,
        fitness=fitness,
        parts=dict(zip(note["parts"], parts, strict=True)),
        python_state=(version, tuple(internal), gauss),
        generator=generator,
        history=[Generation(champion=c, **row) for row, c in zip(note["history"], champions, strict=True)],
    )
