"""Control steps per second of environments for learners."""

from itertools import product
from typing import Any

import numpy as np

from benchmarks.timing import best_cpu_seconds, line
from pipeline.gym import InspectionVectorEnv

SIZES, NUM_STEPS = (64, 1024), 400
#: size of the forces, as a share of the limit: episodes have about the paper's length
SPREAD = 0.003


def run() -> None:
    """Print steps per second of vector environments, on one thread, in each world."""
    print("Gymnasium: vector environments, one thread, episodes started anew")
    worlds = ((), ("safety=filter",), ("world=afrl",), ("world=leo",))
    for num_flights, words in product(SIZES, worlds):
        actions = np.random.default_rng(1).normal(0.0, SPREAD, (NUM_STEPS, num_flights, 3)).astype(np.float32)
        many = InspectionVectorEnv(num_flights, words)
        many.reset(seed=1)

        def fly(many: InspectionVectorEnv = many, actions: Any = actions) -> None:
            for row in actions:
                many.step(row)

        seconds = best_cpu_seconds(fly)
        told = " ".join(words) or "world=paper"
        line(f"{num_flights} flights, {told}: steps a second", f"{NUM_STEPS * num_flights / seconds:,.0f}")
