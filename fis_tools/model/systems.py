"""Fuzzy systems, and the controllers that they make up."""

from dataclasses import dataclass

from fis_tools.model.operators import WEIGHING, AndOperator, Defuzzifier, OrOperator
from fis_tools.model.rules import Rule
from fis_tools.model.variables import Variable


@dataclass(frozen=True)
class FuzzySystem:
    """A fuzzy inference system: each output by Mamdani, Takagi and Sugeno, or Tsukamoto.

    An output is of Mamdani's kind where its rules conclude fuzzy sets that together are defuzzified. It is
    weighed where its defuzzifier is ``weighted_average`` or ``weighted_sum``: each rule then concludes a
    number, which its firing strength weighs. The number is a term itself (Takagi and Sugeno: `Constant`,
    `Linear`), or the point where a term has the strength as its degree (Tsukamoto: a `MonotoneFunction`).

    Parameters
    ----------
    name : str
        What the system is called.
    inputs, outputs : tuple of Variable
        In the order in which values are passed and returned.
    rules : tuple of Rule
        In the order in which firing strengths are reported.
    and_operator, or_operator : str
        How statements combine, in rules that do not say it themselves.
    defuzzifier : str
        How an aggregated output becomes a number, by scikit-fuzzy's names, unless it says so itself.
    implication : str
        How the strength of a rule shapes the term that it concludes: ``min`` cuts it, ``product`` scales it;
        without effect on outputs that are weighed.
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
        """Return whether the terms of an output are cut, and the highest of them counts at each point."""
        return self.implication == "min" and output.aggregation == "max" and not self.weighs(output)

    def weighs(self, output: Variable) -> bool:
        """Return whether an output is a weighted average or sum, by Takagi and Sugeno or by Tsukamoto."""
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
    """Fuzzy systems that belong together, with what their user needs to know besides.

    Parameters
    ----------
    name : str
        What the controller is called.
    systems : tuple of FuzzySystem
        In the order in which they are shown.
    attributes : tuple of (str, str)
        Facts for whoever flies the controller; they are carried along unread, sorted by key.
    provenance : tuple of (str, str)
        Where the controller comes from; carried along unread, sorted by key.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    attributes: tuple[tuple[str, str], ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()
