"""A controller that can be proved, its opposite, and its problem near the chief."""

from dataclasses import replace
from functools import cache

from fis_tools.formats import serialize
from fis_tools.model import Consequent, FuzzyController, FuzzySystem, Rule
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
    """The controller whose rules conclude the opposite."""

    def opposite(system: FuzzySystem) -> FuzzySystem:
        terms = [term.name for term in system.outputs[0].terms]
        swapped = dict(zip(terms, reversed(terms), strict=True))

        def concluding(rule: Rule) -> Rule:
            (one,) = rule.consequents
            return replace(rule, consequents=(Consequent(one.variable, swapped[one.term]),))

        return replace(system, rules=tuple(map(concluding, system.rules)))

    return replace(controller, systems=tuple(map(opposite, controller.systems)))


@cache
def job(*overrides: str) -> Job:
    fixed = ("+experiment=prove", "problem=docking_planar", "controller=steady", *NEAR)
    return compose_experiment([*fixed, *overrides])
