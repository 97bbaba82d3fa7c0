"""Print how many steps a second bsk_rl's inspection makes: ``python benchmarks/rso.py``.

It runs in an environment of its own with ``pip install bsk-rl``. Basilisk fetches ephemerides and a gravity
field at first use; where they lie in a folder already, name it in ``BSK_SUPPORT_DATA_CACHE``. The satellites,
points and limits are those of bsk_rl's example. A step is a small impulse and a drift of 60 s, as long as a
control period of ``world=rso``; in processor time, the best of three.
"""

import sys
import time
from typing import Any, ClassVar

import numpy as np
from Basilisk.architecture import bskLogging
from bsk_rl import ConstellationTasking, act, data, obs, sats, scene
from bsk_rl.sim import dyn, fsw
from bsk_rl.utils.orbital import random_orbit, random_unit_vector, relative_to_chief

NUM_STEPS, DRIFT_S, SPREAD_M_S = 100, 60.0, 0.02
#: of starts and impulses; unit vectors and orbits come from NumPy's global state
DRAWS = np.random.default_rng(1)


class Chief(sats.Satellite):
    """Points at the Earth."""

    observation_spec: ClassVar = [obs.SatProperties({"prop": "one", "fn": lambda _: 1.0})]
    action_spec: ClassVar = [act.NadirPoint(duration=1e9)]
    dyn_type = (dyn.ConjunctionDynModel, dyn.RSODynModel)
    fsw_type = fsw.FSWModel


class Deputy(sats.Satellite):
    """Fires impulses and drifts; it senses where it is and what it may still spend."""

    observation_spec: ClassVar = [
        obs.SatProperties({"prop": "dv_available", "norm": 10}),
        obs.RelativeProperties(
            {"prop": "r_DC_Hc", "norm": 500}, {"prop": "v_DC_Hc", "norm": 5}, chief_name="RSO"
        ),
    ]
    action_spec: ClassVar = [
        act.ImpulsiveThrustHill(
            chief_name="RSO", max_dv=1.0, max_drift_duration=11400.0, fsw_action="action_inspect_rso"
        )
    ]
    dyn_type = (dyn.MaxRangeDynModel, dyn.ConjunctionDynModel, dyn.RSOInspectorDynModel)
    fsw_type = (fsw.SteeringFSWModel, fsw.MagicOrbitalManeuverFSWModel, fsw.RSOInspectorFSWModel)


def started(satellites: list[Any]) -> Any:
    """Draw an orbit 500 to 1,100 km high, and where the deputy starts."""
    orbit = random_orbit(a=6371.0 + DRAWS.uniform(500.0, 1100.0), e=0.0)

    def beside() -> Any:
        position = random_unit_vector() * DRAWS.uniform(250.0, 750.0)
        return np.concatenate([position, random_unit_vector() * DRAWS.uniform(0.0, 1.0)])

    return relative_to_chief("RSO", orbit, {"Inspector": beside})(satellites)


def environment() -> Any:
    """Return their example: a sphere of 100 points, seen within 250 m and lit within 60 degrees."""
    known = {
        **{"imageAttErrorRequirement": 1.0, "imageRateErrorRequirement": None, "instrumentBaudRate": 1},
        **{"dataStorageCapacity": 1e6, "batteryStorageCapacity": 1e9, "storedCharge_Init": 1e9, "u_max": 1.0},
        **{"conjunction_radius": 2.0, "dv_available_init": 10.0, "max_range_radius": 1000},
    }
    return ConstellationTasking(
        satellites=[
            Chief("RSO", sat_args={"conjunction_radius": 2.0}),
            Deputy("Inspector", sat_args={**known, "chief_name": "RSO"}),
        ],
        sat_arg_randomizer=started,
        scenario=scene.SphericalRSO(
            n_points=100,
            radius=1.0,
            theta_max=np.radians(30.0),
            range_max=250,
            theta_solar_max=np.radians(60.0),
        ),
        rewarder=data.RSOInspectionReward(completion_bonus=1.0, completion_threshold=0.9),
        time_limit=60000,
        sim_rate=5.0,
        log_level="ERROR",
    )


def main() -> None:
    """Step it."""
    bskLogging.setDefaultLogLevel(bskLogging.BSK_ERROR)
    env, seconds = environment(), []
    for seed in range(3):
        env.reset(seed=seed)
        begun, resets = time.process_time(), 0.0
        for _ in range(NUM_STEPS):
            impulse = DRAWS.normal(0.0, SPREAD_M_S, 3)
            _, _, ends, cuts, _ = env.step({"RSO": 0, "Inspector": np.array([*impulse, DRIFT_S])})
            if any(ends.values()) or any(cuts.values()):
                before = time.process_time()
                env.reset(seed=seed)
                resets += time.process_time() - before
        seconds.append(time.process_time() - begun - resets)
    sys.stdout.write(f"RSO inspection: {NUM_STEPS / min(seconds):,.1f} steps a second\n")


if __name__ == "__main__":
    main()
