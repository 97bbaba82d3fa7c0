"""A controller that can be proved, its opposite, and its problem near the chief."""

from functools import cache

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.command_line.config import Job, compose_experiment
from tests.places import PROJECT

#: a problem near the chief, which is proved in a moment
NEAR = (
    *("+experiment=prove", "problem=docking_planar", "controller=steady", "prove.cells=48"),
    "problem.goal_radius_m=1.5",
    # the least and the greatest start, m and m/s
    "monte_carlo.box=[[3.0,4.0,0.0,-0.03,-0.03,0.0],[3.5,4.5,0.0,0.03,0.03,0.0]]",
)


@cache
def steady() -> FuzzyController:
    return serialize.load(PROJECT / "conf" / "controller" / "steady.yaml")


@cache
def job() -> Job:
    return compose_experiment(list(NEAR))
