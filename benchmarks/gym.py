"""Control steps per second of environments for learners."""

import numpy as np

from benchmarks.timing import best_cpu_seconds, line
from pipeline.gym import InspectionVectorEnv

NUM_FLIGHTS, NUM_STEPS = 64, 400
#: size of the forces, as a share of the limit: episodes have about the paper's length
SPREAD = 0.003


def run() -> None:
    """Print steps per second of one vector environment, on one thread, in each world."""
    print(f"Gymnasium: one vector environment of {NUM_FLIGHTS} flights, one thread, episodes started anew")
    actions = np.random.default_rng(1).normal(0.0, SPREAD, (NUM_STEPS, NUM_FLIGHTS, 3)).astype(np.float32)
    for words in ((), ("safety=filter",), ("world=afrl",), ("world=leo",)):
        many = InspectionVectorEnv(NUM_FLIGHTS, words)
        many.reset(seed=1)

        def fly(many: InspectionVectorEnv = many) -> None:
            for row in actions:
                many.step(row)

        seconds = best_cpu_seconds(fly)
        told = " ".join(words) or "world=paper"
        line(f"{told}: control steps a second", f"{NUM_STEPS * NUM_FLIGHTS / seconds:,.0f}")
