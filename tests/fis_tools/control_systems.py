"""scikit-fuzzy's control systems built from fuzzy systems, and its inference, which the engines must equal.

Every call builds fresh variables. scikit-fuzzy keeps state on classes, keyed by objects and by ``id``, so two
control systems on the same variables can read each other's cached memberships.
"""

from functools import reduce
from operator import and_, or_
from typing import Any

import networkx as nx
import numpy as np
from skfuzzy import control
from skfuzzy.control.controlsystem import CrispValueCalculator

from fis_tools.array_types import Floats
from fis_tools.model import And, Expression, FuzzySystem, Hedged, Is, Not, Or, Variable, sample
from fis_tools.model.operators import ACCUMULATIONS, AND_OPERATORS, OR_OPERATORS

#: Results that a reference engine keeps before it empties scikit-fuzzy's cache.
RUNS_KEPT = 1000


def build_control_system(system: FuzzySystem) -> control.ControlSystem:
    """Build a scikit-fuzzy ControlSystem with variables of its own.

    Rules carry their labels, or their numbers from 1 on where they have none. The rule graph is composed at
    once: ``addrule`` walks the whole graph for every rule, some seconds for 125 rules. All variables are in
    it, in order, also those that no rule mentions.
    """
    variables = {v.name: _with_terms(control.Antecedent(v.universe, v.name), v) for v in system.inputs}
    variables |= {v.name: _with_terms(_build_output(system, v), v) for v in system.outputs}
    rules = [
        control.Rule(
            antecedent=_build_expression(rule.antecedent, variables),
            consequent=[
                variables[consequent.variable][consequent.term] % float(consequent.weight)
                for consequent in rule.consequents
            ],
            label=rule.label or str(number),
            and_func=AND_OPERATORS[system.and_operator_of(rule)],
            or_func=OR_OPERATORS[system.or_operator_of(rule)],
        )
        for number, rule in enumerate(system.rules, start=1)
    ]
    control_system = control.ControlSystem()
    graph = nx.DiGraph()
    graph.add_nodes_from(variables.values())
    control_system.graph = nx.compose_all([graph, *(rule.graph for rule in rules)])
    return control_system


def build_simulation(system: FuzzySystem) -> control.ControlSystemSimulation:
    """Build a simulation on a control system of its own; two simulations on one would share their inputs."""
    return control.ControlSystemSimulation(build_control_system(system))


def _build_output(system: FuzzySystem, variable: Variable) -> control.Consequent:
    output = control.Consequent(variable.universe, variable.name, system.defuzzifier_of(variable))
    if variable.accumulation != "max":
        output.accumulation_method = ACCUMULATIONS[variable.accumulation]
    return output


def _with_terms(fuzzy_variable: Any, variable: Variable) -> Any:
    for term in variable.terms:
        fuzzy_variable[term.name] = sample(variable, term)
    return fuzzy_variable


def _build_expression(expression: Expression, variables: dict[str, Any]) -> Any:
    match expression:
        case Is(variable, term):
            return variables[variable][term]
        case Not(operand):
            return ~_build_expression(operand, variables)
        case Hedged(hedge, _):
            raise ValueError(f"a rule says {hedge!r}, which scikit-fuzzy does not know")
        case And(operands):
            return reduce(and_, [_build_expression(operand, variables) for operand in operands])
        case Or(operands):
            return reduce(or_, [_build_expression(operand, variables) for operand in operands])


class _Sorted(control.ControlSystem):  # type: ignore[misc]
    """A control system that has sorted its rules; scikit-fuzzy's sorts them anew for every sample."""

    def __init__(self, plain: control.ControlSystem) -> None:
        super().__init__()
        self.graph = plain.graph
        self._rules = list(plain.rules)

    @property
    def rules(self) -> list[control.Rule]:
        """Rules in the order of calculation."""
        return self._rules


class ReferenceEngine:
    """Inference by scikit-fuzzy's own ``compute()``: slow, and the definition of what is right.

    Parameters
    ----------
    system : FuzzySystem
        What to evaluate.
    """

    def __init__(self, system: FuzzySystem) -> None:
        self.system = system
        built = _Sorted(build_control_system(system))
        # Flushing inside `compute` would take the cuts away before `_fires` can look at them.
        self._simulation = control.ControlSystemSimulation(built, flush_after_run=2 * RUNS_KEPT)
        self._runs = 0
        self._outputs = {variable.label: variable for variable in self._simulation.ctrl.consequents}

    def compute(self, inputs: Floats) -> Floats:
        """Infer the outputs for one sample.

        Parameters
        ----------
        inputs : (num_inputs,)
            In the order of the system's inputs; clipped to the universes.

        Returns
        -------
        (num_outputs,)
            An output's default where no rule that concludes on it fires.
        """
        self._runs += 1
        if self._runs % RUNS_KEPT == 0:
            self._simulation.reset()
        for variable, value in zip(self.system.inputs, inputs, strict=True):
            self._simulation.input[variable.name] = float(value)
        # A repeated input that fires no rule leaves the previous output in place: start from none.
        self._simulation.output = {}
        with np.errstate(divide="ignore", invalid="ignore"):  # a bisector of an area with a gap
            self._simulation.compute()
        return np.array([self._crisp(variable) for variable in self.system.outputs])

    def _crisp(self, variable: Variable) -> float:
        assert variable.default is not None
        if variable.name not in self._simulation.output or not self._fires(variable):
            return variable.default
        return float(self._simulation.output[variable.name])

    def _fires(self, variable: Variable) -> bool:
        """Return whether anything is left to defuzzify; scikit-fuzzy asks this for areas only."""
        if self.system.defuzzifier_of(variable) in {"centroid", "bisector"}:
            return True
        calculator = CrispValueCalculator(self._outputs[variable.name], self._simulation)
        _, aggregated, _ = calculator.find_memberships()
        return bool(aggregated.sum() > 0)


def by_scikit_fuzzy(system: FuzzySystem, rows: Floats) -> Floats:
    """Outputs of samples, (n, num_outputs)."""
    engine = ReferenceEngine(system)
    return np.array([engine.compute(row) for row in rows])
