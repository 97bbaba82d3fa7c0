"""scikit-fuzzy's control systems built from fuzzy systems, for the proof that the engines agree with it.

Every call builds fresh variables. scikit-fuzzy keeps state on classes, keyed by objects and by ``id``, so two
control systems on the same variables can read each other's cached memberships.
"""

from functools import reduce
from operator import and_, or_
from typing import Any

import networkx as nx
from skfuzzy import control

from fis_tools.model import And, Consequent, Expression, FuzzySystem, Hedged, Is, Not, Or, Rule, Variable
from fis_tools.model.operators import ACCUMULATIONS, AND_OPERATORS, OR_OPERATORS
from fis_tools.model.variables import sample


def build_control_system(system: FuzzySystem) -> control.ControlSystem:
    """Build a scikit-fuzzy ControlSystem with variables of its own.

    Rules carry their labels, or their numbers from 1 on where they have none. The rule graph is composed at
    once: ``addrule`` walks the whole graph for every rule, some seconds for 125 rules. All variables are in
    it, in order, also those that no rule mentions.
    """
    inputs = {v.name: _with_terms(control.Antecedent(v.universe, v.name), v) for v in system.inputs}
    outputs = {v.name: _with_terms(_build_output(system, v), v) for v in system.outputs}
    labels = _unique_labels(system)
    rules = [
        _build_rule(system, rule, label, inputs, outputs)
        for rule, label in zip(system.rules, labels, strict=True)
    ]
    control_system = control.ControlSystem()
    variables = nx.DiGraph()
    variables.add_nodes_from((*inputs.values(), *outputs.values()))
    control_system.graph = nx.compose_all([variables, *(rule.graph for rule in rules)])
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


def _unique_labels(system: FuzzySystem) -> list[str]:
    taken = {rule.label for rule in system.rules}
    labels = []
    for number, rule in enumerate(system.rules, start=1):
        label = rule.label or str(number)
        while not rule.label and label in taken:
            label = f"#{label}"
        labels.append(label)
    return labels


def _build_rule(
    system: FuzzySystem, rule: Rule, label: str, inputs: dict[str, Any], outputs: dict[str, Any]
) -> control.Rule:
    return control.Rule(
        antecedent=_build_expression(rule.antecedent, inputs),
        consequent=[_build_consequent(consequent, outputs) for consequent in rule.consequents],
        label=label,
        and_func=AND_OPERATORS[system.and_operator_of(rule)],
        or_func=OR_OPERATORS[system.or_operator_of(rule)],
    )


def _build_consequent(consequent: Consequent, outputs: dict[str, Any]) -> Any:
    return outputs[consequent.variable][consequent.term] % float(consequent.weight)


def _build_expression(expression: Expression, inputs: dict[str, Any]) -> Any:
    match expression:
        case Is(variable, term):
            return inputs[variable][term]
        case Not(operand):
            return ~_build_expression(operand, inputs)
        case Hedged(hedge, _):
            raise ValueError(f"a rule says {hedge!r}, which scikit-fuzzy does not know")
        case And(operands):
            return reduce(and_, [_build_expression(operand, inputs) for operand in operands])
        case Or(operands):
            return reduce(or_, [_build_expression(operand, inputs) for operand in operands])
