"""Read scikit-fuzzy control systems: from a ``ControlSystem`` to a `FuzzySystem` that computes the same.

What is read is what scikit-fuzzy 0.5 computes with: universes, sampled memberships, rule trees, weights, and
the methods of each rule and variable. `fis_tools.engines.inference` gives the results of ``compute()`` to the
last bit. What scikit-fuzzy has not is added: a default for each output, for when no rule fires. Inputs beyond
their universe are always clipped; memberships below `fis_tools.model.variables.SMALLEST_MEMBERSHIP` are
zero.
"""

import operator
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from skfuzzy import control
from skfuzzy.control.term import Term as FuzzyTerm
from skfuzzy.control.term import TermAggregate

from fis_tools import model
from fis_tools.array_types import Floats
from fis_tools.errors import raised_as, require_known
from fis_tools.model.chains import Named, NotResolvable, unchained
from fis_tools.model.operators import ACCUMULATIONS, AND_OPERATORS, OR_OPERATORS
from fis_tools.model.systems import with_joint_operators
from fis_tools.model.validate import MAX_NESTING, problems
from fis_tools.scikit_fuzzy.recognition import recognise

_Name = TypeVar("_Name", bound=str)

#: Our own functions, and others that people pass to rules and outputs; they give the same numbers.
_AND_NAMES: dict[Any, model.AndOperator] = {
    **{function: name for name, function in AND_OPERATORS.items()},
    **dict.fromkeys((np.minimum, min), "min"),
    **dict.fromkeys((operator.mul, control.accumulation_mult), "product"),
}
_OR_NAMES: dict[Any, model.OrOperator] = {
    **{function: name for name, function in OR_OPERATORS.items()},
    **dict.fromkeys((np.maximum, max, control.accumulation_max), "max"),
}
_ACCUMULATION_NAMES: dict[Any, model.Accumulation] = {
    **{function: name for name, function in ACCUMULATIONS.items()},
    **_OR_NAMES,
    **dict.fromkeys((operator.mul, control.accumulation_mult), "product"),
    # nothing is cut above one, so that a sum without a bound cuts where the bounded one does
    **dict.fromkeys((np.add, operator.add), "bounded_sum"),
}
#: In the order in which scikit-fuzzy looks for these words in a method's name.
_DEFUZZIFIERS: tuple[model.Defuzzifier, ...] = ("centroid", "bisector", "mom", "som", "lom")
#: Memberships this far outside [0, 1] are put inside.
ROUNDED = 1e-15
#: Number types in which scikit-fuzzy computes without loss.
_EXACT_TYPES = ("float64", "int32", "int64")
#: Characters of a rule that is named by its words.
MOST_WORDS = 120


class UnreadableControlSystem(ValueError):  # noqa: N818 - the sentence is the message
    """Raised for a control system that a `FuzzySystem` cannot express; says why, and what to do."""


def read_control_system(
    system: control.ControlSystem | control.ControlSystemSimulation,
    name: str = "control system",
    *,
    defaults: Mapping[str, float] | None = None,
) -> model.FuzzySystem:
    """Turn a scikit-fuzzy control system into a `FuzzySystem`.

    Parameters
    ----------
    system : ControlSystem or ControlSystemSimulation
        Left as it is; variables come in the order of its graph, rules in the order in which it computes them.
    name : str
        What to call the system.
    defaults : mapping, optional
        The value of an output when no rule fires, by the output's name. Others get zero, or the end of their
        universe that is nearest to zero; scikit-fuzzy has no result then.

    Raises
    ------
    UnreadableControlSystem
        If the system has what a `FuzzySystem` cannot say.
    """
    source = system.ctrl if isinstance(system, control.ControlSystemSimulation) else system
    if not isinstance(source, control.ControlSystem):
        raise UnreadableControlSystem(
            f"this is a {type(source).__name__}; pass a scikit-fuzzy ControlSystem or ControlSystemSimulation"
        )
    # The graph's own order is that of `source.rules`, which takes seconds where rules are many.
    rules = [node for node in source.graph.nodes() if isinstance(node, control.Rule)]
    defaults, labels = defaults or {}, [str(output.label) for output in source.consequents]
    require_known(defaults, labels, "defaults name an unknown output", UnreadableControlSystem)
    outputs = tuple(_output(output, defaults) for output in source.consequents)
    inputs = tuple(map(_variable, source.antecedents))
    read = with_joint_operators(model.FuzzySystem(name, inputs, outputs, _rules(rules, outputs)))
    sentences = problems(read)
    if sentences:
        raise UnreadableControlSystem("\n".join(sentences))
    return read


# Variables.


def _variable(source: Any) -> model.Variable:
    """Return a scikit-fuzzy variable as one of ours."""
    universe = _universe(source)
    low = float(universe[0])
    high = float(universe[-1])
    terms = tuple(_term(source, universe, term) for term in source.terms.values())
    return model.with_universe(model.Variable(str(source.label), "", low, high, terms), universe)


def _output(source: Any, defaults: Mapping[str, float]) -> model.Variable:
    """Return a scikit-fuzzy consequent as an output, with its default, defuzzifier and accumulation."""
    variable = _variable(source)
    nearest_to_zero = min(max(0.0, variable.minimum), variable.maximum)
    default = float(defaults.get(variable.name, nearest_to_zero))
    what = f"accumulation_method of {variable.name!r}"
    accumulation = _named(source.accumulation_method, _ACCUMULATION_NAMES, ACCUMULATIONS, what)
    return replace(variable, default=default, defuzzifier=_defuzzifier(source), accumulation=accumulation)


def _universe(source: Any) -> Floats:
    """Return a universe; raise UnreadableControlSystem unless it ascends."""
    universe = _exact(source.universe, f"the universe of {source.label!r}")
    if universe.ndim != 1 or len(universe) < 2 or not (np.diff(universe) > 0).all():
        raise UnreadableControlSystem(
            f"the universe of {source.label!r} is not a row of two or more ascending numbers; sort it, the "
            "memberships with it, and drop repeated points"
        )
    return universe


def _term(source: Any, universe: Floats, term: FuzzyTerm) -> model.Term:
    """Return a scikit-fuzzy term with the shape that its sampled memberships have."""
    where = f"the membership function of {source.label!r}, term {term.label!r}"
    values = _exact(term.mf, where)
    if values.shape != universe.shape:
        raise UnreadableControlSystem(
            f"{where} has shape {values.shape}, the universe {universe.shape}; give one value for each point"
        )
    least, greatest = float(values.min()), float(values.max())
    if not (least >= -ROUNDED and greatest <= 1.0 + ROUNDED):
        raise UnreadableControlSystem(
            f"{where} runs from {least:.6g} to {greatest:.6g}; memberships lie in [0, 1], scale them"
        )
    return model.Term(str(term.label), recognise(universe, np.clip(values, 0.0, 1.0)))


def _exact(values: Any, what: str) -> Floats:
    """Return numbers as float64; raise UnreadableControlSystem for types in which they were rounded."""
    array = np.asarray(values)
    if array.dtype.name not in _EXACT_TYPES:
        raise UnreadableControlSystem(
            f"{what} is stored as {array.dtype.name}, with which scikit-fuzzy rounds or fails; store it as "
            "float64 before you build the system"
        )
    return array.astype(np.float64)


def _defuzzifier(source: Any) -> model.Defuzzifier:
    """Return the name of a consequent's defuzzifier."""
    method = str(source.defuzzify_method)
    for name in _DEFUZZIFIERS:
        if name in method.lower():
            return name
    raise UnreadableControlSystem(
        f"the defuzzify_method of {source.label!r} is {method!r}; use one of {', '.join(_DEFUZZIFIERS)}"
    )


# Rules.


def _rules(sources: Sequence[control.Rule], outputs: Sequence[model.Variable]) -> tuple[model.Rule, ...]:
    """Read rules in the order in which they are computed, and say those of a chain of the inputs alone."""
    named = [Named(_called(source), _rule(source)) for source in sources]
    with raised_as(UnreadableControlSystem, NotResolvable):
        rules = unchained(named, {output.name: output for output in outputs})
    return _with_labels(sources, rules)


def _called(source: control.Rule) -> str:
    """Return a rule's name: its label, or its words where scikit-fuzzy's label is an address."""
    if isinstance(source.label, str):
        return f"rule {source.label!r}"
    words = f"if {source.antecedent} then {', '.join(map(str, source.consequent))}"
    words = " ".join(words.split())
    return f"rule {words if len(words) <= MOST_WORDS else words[: MOST_WORDS - 1] + '…'!r}"


def _rule(source: control.Rule) -> model.Rule:
    """Return a scikit-fuzzy rule as one of ours."""
    where = _called(source)
    antecedent = _expression(source.antecedent, where, 0)
    kinds = {type(part) for part in model.parts_of(antecedent)}
    and_operator = or_operator = None
    if model.And in kinds:
        and_operator = _named(source.and_func, _AND_NAMES, AND_OPERATORS, f"and_func of {where}")
    if model.Or in kinds:
        or_operator = _named(source.or_func, _OR_NAMES, OR_OPERATORS, f"or_func of {where}")
    consequents = []
    for weighted in source.consequent:
        term = _mentioned(weighted.term, control.Consequent, where)
        consequents.append(model.Consequent(*term, float(weighted.weight)))
    return model.Rule(antecedent, tuple(consequents), and_operator=and_operator, or_operator=or_operator)


def _expression(source: Any, where: str, depth: int) -> model.Expression:
    """Read a rule tree; a chain of the same word to the left, as ``a & b & c`` makes it, is one statement."""
    if depth > MAX_NESTING:
        raise UnreadableControlSystem(
            f"{where} nests and, or and not more than {MAX_NESTING} deep; split the rule"
        )
    if not isinstance(source, TermAggregate):
        return model.Is(*_mentioned(source, (control.Antecedent, control.Consequent), where))
    if source.kind == "not":
        return model.Not(_expression(source.term1, where, depth + 1))
    chain = [source.term2]
    first = source.term1
    while isinstance(first, TermAggregate) and first.kind == source.kind:
        chain.append(first.term2)
        first = first.term1
    operands = tuple(_expression(operand, where, depth + 1) for operand in (first, *reversed(chain)))
    return model.And(operands) if source.kind == "and" else model.Or(operands)


def _mentioned(term: Any, kind: Any, where: str) -> tuple[str, str]:
    """Return a statement's variable and term, refusing the wrong kind or one that is gone."""
    variable: Any = term.parent
    label = str(variable.label)
    if not isinstance(variable, kind):
        raise UnreadableControlSystem(
            f"{where} concludes {label!r}, which is an Antecedent; make it a Consequent"
        )
    if variable.terms.get(term.label) is not term:
        raise UnreadableControlSystem(
            f"{where} mentions a term {term.label!r} that {label!r} no longer has; build the rule again, "
            "after the terms"
        )
    return label, str(term.label)


def _named(function: Any, names: Mapping[Any, _Name], operators: Iterable[_Name], what: str) -> _Name:
    """Return the name of an operator given as a function."""
    if isinstance(function, Hashable) and function in names:
        return names[function]
    name = getattr(function, "__name__", type(function).__name__)
    cure = f"pass a function of fis_tools.model.operators: {', '.join(operators)}"
    raise UnreadableControlSystem(f"the {what} is {name}, which is not known; {cure}")


def _with_labels(sources: Sequence[control.Rule], rules: Sequence[model.Rule]) -> tuple[model.Rule, ...]:
    """Return rules with the labels that a person chose, not scikit-fuzzy's own numbers."""
    labels: list[str] = []
    for number, source in enumerate(sources, start=1):
        label = source.label if isinstance(source.label, str) else ""
        label = "" if label.lstrip("#") == str(number) else label
        labels.append(f"{label} #{number}" if label and label in labels else label)
    return tuple(replace(rule, label=label) for rule, label in zip(rules, labels, strict=True))
