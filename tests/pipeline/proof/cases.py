"""A controller that can be proved, its opposite, and its problem near the chief."""

from dataclasses import replace
from functools import cache

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.command_line.config import Job, compose_experiment
from tests.places import PROJECT

#: the least and the greatest start, m and m/s
BOX = "[[3.0,4.0,0.0,-0.03,-0.03,0.0],[3.5,4.5,0.0,0.03,0.03,0.0]]"


#: a problem near the chief, which is proved in a moment
NEAR = (f"monte_carlo.box={BOX}", "problem.goal_radius_m=1.5", "prove.cells=48")


@cache
def steady() -> FuzzyController:
    return serialize.load(PROJECT / "conf" / "controller" / "steady.yaml")


def reversed_in_sign(controller: FuzzyController) -> FuzzyController:
    """The controller whose rules conclude the opposite: terms of its outputs have each other's names."""
    systems = []
    for system in controller.systems:
        (output,) = system.outputs
        pairs = zip(output.terms, reversed(output.terms), strict=True)
        terms = tuple(replace(term, name=opposite.name) for term, opposite in pairs)
        systems.append(replace(system, outputs=(replace(output, terms=terms),)))
    return replace(controller, systems=tuple(systems))


@cache
def job(*overrides: str) -> Job:
    fixed = ("+experiment=prove", "problem=docking_planar", "controller=steady", *NEAR)
    return compose_experiment([*fixed, *overrides])
