"""How many flights and control periods a training takes: ``python -m benchmarks budget WORDS``.

Of a search, population times generations, with that which a round begins with, times rounds times starts.
That is the most, since no genome is flown twice in a round; flights that validate candidates come on top.
Of a policy, what its file says.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import onnx

from pipeline.command_line.config import compose_experiment


def of_search(words: Sequence[str]) -> str:
    """Return the budget of a command of the pipeline."""
    experiment: Any = compose_experiment(list(words)).experiment
    optimizer, mission = experiment.optimizer, experiment.mission
    # a round begins with a generation before those that it breeds
    candidates = optimizer.population_size * (optimizer.generations + 1) * optimizer.rounds
    flights = candidates * experiment.starts.num_cases
    return f"{flights:,} flights at most, {flights * mission.num_controls / 1e6:.1f} million control periods"


def training_of(path: Path) -> dict[str, Any]:
    """Return how the file of a policy says that it was trained; nothing if it does not."""
    facts = {each.key: each.value for each in onnx.load(path).metadata_props}
    told: dict[str, Any] = json.loads(facts.get("training", "{}"))
    return told


def of_policy(path: str) -> str:
    """Return the budget that the file of a policy tells."""
    training = training_of(Path(path))
    if "done" not in training:
        sys.exit(f"{path} does not say how it was trained; python -m benchmarks.ppo writes files that do")
    flights = f"{training['flights']:,} flights, " if "flights" in training else ""
    return f"{flights}{training['done'] / 1e6:.1f} million control periods"


def main(arguments: Sequence[str]) -> int:
    """Print one."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks budget", description=__doc__)
    parser.add_argument("words", nargs="+", help="of a training, or the file of a policy")
    words = parser.parse_args(arguments).words
    print(of_policy(words[0]) if words[0].endswith(".onnx") else of_search(words))
    return 0
