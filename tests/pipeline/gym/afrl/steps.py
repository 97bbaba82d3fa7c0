"""Print how many steps a second AFRL's own environments make: ``python steps.py SIMS``, as `make_tables.py`.

Actions are small, so that episodes last; in processor time, the best of three.
"""

import sys
import time

import numpy as np

NUM_STEPS = 200


def main() -> None:
    """Step each of them."""
    sys.path.insert(0, sys.argv[1])
    from safe_autonomy_sims.gym import inspection  # noqa: PLC0415 - found only now

    for name in ("InspectionEnv", "WeightedInspectionEnv", "WeightedSixDofInspectionEnv"):
        env, seconds = getattr(inspection, name)(), []
        for _ in range(3):
            env.reset(seed=1)
            actions = np.random.default_rng(1).normal(0.0, 0.003, (NUM_STEPS, *env.action_space.shape))
            actions = (actions * env.action_space.high).astype(env.action_space.dtype)
            begun = time.process_time()
            for action in actions:
                if any(env.step(action)[2:4]):
                    env.reset()
            seconds.append(time.process_time() - begun)
        sys.stdout.write(f"{name}: {NUM_STEPS / min(seconds):,.0f} steps a second\n")


if __name__ == "__main__":
    main()
