"""Inspection as a task of reinforcement learning, for Gymnasium: the flights are those of all experiments.

``gymnasium.make("pipeline.gym:Inspection-v0", overrides=["world=leo"])`` makes one flight,
``gymnasium.make_vec("pipeline.gym:Inspection-v0", num_envs=64)`` many.
`pipeline.gym.suite` has the tasks that results are compared on.
"""

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "pipeline.gym needs Gymnasium; install it: python -m pip install gymnasium"
    ) from error

from pipeline.flight.fly.stepping import OBSERVED
from pipeline.gym import suite
from pipeline.gym.env import InspectionEnv, ReachEnv, ReachReward
from pipeline.gym.episodes import AFRL, AFRL_WEIGHTED, Reward, Task, task_of
from pipeline.gym.normalized import NormalizedObservation, NormalizedVectorObservation
from pipeline.gym.six_dof import AFRL_SIX_DOF, SixDofInspectionEnv, SixDofReward
from pipeline.gym.vector import InspectionVectorEnv

gymnasium.register(
    "Inspection-v0",
    entry_point="pipeline.gym.env:InspectionEnv",
    vector_entry_point="pipeline.gym.vector:InspectionVectorEnv",
)
gymnasium.register("SixDofInspection-v0", entry_point="pipeline.gym.six_dof:SixDofInspectionEnv")
suite.register()
gymnasium.register("Reach-v0", entry_point="pipeline.gym.env:ReachEnv")
