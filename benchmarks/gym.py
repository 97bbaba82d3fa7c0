"""Control steps per second of environments for learners."""

from itertools import product
from typing import Any

import numpy as np

from benchmarks.timing import best_cpu_seconds, line
from pipeline.gym import InspectionEnv, InspectionVectorEnv, SixDofInspectionEnv

SIZES, NUM_STEPS = (64, 1024), 400
#: size of the forces, as a share of the limit: episodes have about the paper's length
SPREAD = 0.003


def alone() -> None:
    """Print steps per second of single environments, to set beside those of AFRL's own and of bsk_rl's."""
    envs = {world: InspectionEnv([world]) for world in ("world=afrl", "world=rso")}
    for what, env in {**envs, "six degrees of freedom": SixDofInspectionEnv()}.items():
        size = env.action_space.shape or (3,)
        actions = np.random.default_rng(1).normal(0.0, SPREAD, (NUM_STEPS, *size)).astype(np.float32)

        def fly(env: Any = env, actions: Any = actions) -> None:
            env.reset(seed=1)
            for action in actions:
                if any(env.step(action)[2:4]):
                    env.reset()

        line(f"one {type(env).__name__}, {what}: steps a second", f"{NUM_STEPS / best_cpu_seconds(fly):,.0f}")


def run() -> None:
    """Print steps per second on one thread: of single environments, and of vector ones in each world."""
    alone()
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
        label = " ".join(words) or "world=paper"
        line(f"{num_flights} flights, {label}: steps a second", f"{NUM_STEPS * num_flights / seconds:,.0f}")
