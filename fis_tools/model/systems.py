"""Fuzzy systems, and controllers made of them."""

from dataclasses import dataclass

from fis_tools.model.operators import WEIGHING, AndOperator, Defuzzifier, OrOperator
from fis_tools.model.rules import Rule
from fis_tools.model.variables import Variable


@dataclass(frozen=True)
class FuzzySystem:
    """A fuzzy inference system: each output of Mamdani, Takagi-Sugeno or Tsukamoto type.

    A Mamdani output has rules that conclude fuzzy sets, which are aggregated and defuzzified. An output is
    weighted if its defuzzifier is ``weighted_average`` or ``weighted_sum``: each rule then concludes a
    number, weighted by its firing strength. The number is a term itself (Takagi-Sugeno: `Constant`,
    `Linear`), or the point where a term's degree equals the strength (Tsukamoto: a `MonotoneFunction`).

    Parameters
    ----------
    name : str
        The system's name.
    inputs, outputs : tuple of Variable
        In the order in which values are passed and returned.
    rules : tuple of Rule
        In the order in which firing strengths are reported.
    and_operator, or_operator : str
        How statements combine, in rules without their own operators.
    defuzzifier : str
        How an aggregated output becomes a number, by scikit-fuzzy's names, unless the output has its own.
    implication : str
        How a rule's strength shapes the term that it concludes: ``min`` cuts it, ``product`` scales it;
        no effect on weighted outputs.
    """

    name: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    and_operator: AndOperator = "min"
    or_operator: OrOperator = "max"
    defuzzifier: Defuzzifier = "centroid"
    implication: AndOperator = "min"

    def cuts(self, output: Variable) -> bool:
        """Return whether an output's terms are cut and aggregated by the maximum."""
        return self.implication == "min" and output.aggregation == "max" and not self.weighs(output)

    def weighs(self, output: Variable) -> bool:
        """Return whether an output is a weighted average or sum (Takagi-Sugeno or Tsukamoto)."""
        return self.defuzzifier_of(output) in WEIGHING

    @property
    def weighed(self) -> tuple[Variable, ...]:
        """The outputs that are weighted averages or sums."""
        return tuple(output for output in self.outputs if self.weighs(output))

    def variable(self, name: str) -> Variable:
        """Return the input or output called `name`.

        Raises
        ------
        KeyError
            If there is none.
        """
        for variable in (*self.inputs, *self.outputs):
            if variable.name == name:
                return variable
        known = ", ".join(v.name for v in (*self.inputs, *self.outputs))
        raise KeyError(f"system {self.name!r} has no variable {name!r}; its variables are {known}")

    def and_operator_of(self, rule: Rule) -> AndOperator:
        """Return how `and` combines in one of its rules."""
        return rule.and_operator or self.and_operator

    def or_operator_of(self, rule: Rule) -> OrOperator:
        """Return how `or` combines in one of its rules."""
        return rule.or_operator or self.or_operator

    def defuzzifier_of(self, output: Variable) -> Defuzzifier:
        """Return how one of its outputs becomes a number."""
        return output.defuzzifier or self.defuzzifier


@dataclass(frozen=True)
class FuzzyController:
    """A set of fuzzy systems, with further data for their user.

    Parameters
    ----------
    name : str
        The controller's name.
    systems : tuple of FuzzySystem
        In the order in which they are shown.
    attributes : tuple of (str, str)
        Facts for the controller's user; passed on without interpretation, sorted by key.
    provenance : tuple of (str, str)
        Origin of the controller; passed on without interpretation, sorted by key.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    attributes: tuple[tuple[str, str], ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()
