"""One fuzzy system as C: its tables, and the function that infers it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from math import isfinite
from typing import Literal

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats, Integers
from fis_tools.engines.degrees import tabulated
from fis_tools.engines.program import Conclusion, assemble
from fis_tools.formats import rendered
from fis_tools.formats.c.text import broken, comment, exact, identifiers, table
from fis_tools.formats.c.transcribed import entries
from fis_tools.formats.c.transcribed.writer import C
from fis_tools.model import FuzzySystem, Term, Variable, memberships_at, sample
from fis_tools.words.text import number, sentence, shape_words, summary, with_unit

#: a membership is on a straight line if it differs from it by a smaller part of itself and its neighbours, by
#: rounding: a faint one may decide where others are zero, and one that is nearly whole where it is negated
STRAIGHT = 1e-14
#: of what is nearly whole, no less than its last digits
LAST_DIGITS = 4.0 * np.finfo(float).eps


def _bends(variable: Variable) -> Integers:
    """Return the indices of the points of a universe where some term bends.

    All places, if bends that are too slight to see next to rounding add up.
    """
    universe = variable.universe
    rows = np.array([sample(variable, term) for term in variable.terms])
    middle = (universe[1:-1] - universe[:-2]) / (universe[2:] - universe[:-2])
    straight = rows[:, :-2] + middle * (rows[:, 2:] - rows[:, :-2])
    three = np.array([rows[:, :-2], rows[:, 1:-1], rows[:, 2:]])
    is_bent = (np.abs(rows[:, 1:-1] - straight) > _rounding(three.max(axis=0), three.min(axis=0))).any(axis=0)
    kept = np.flatnonzero([True, *is_bent, True])
    again = np.array([np.interp(universe, universe[kept], row[kept]) for row in rows])
    is_equal = np.abs(again - rows) <= 10.0 * _rounding(np.minimum(again, rows), np.maximum(again, rows))
    return kept if is_equal.all() else np.arange(len(universe))


def _rounding(membership: Floats, of_complement: Floats) -> Floats:
    """Return what counts as rounding of a membership, and of what a second one leaves to one."""
    return np.minimum(STRAIGHT * membership, np.maximum(STRAIGHT * (1.0 - of_complement), LAST_DIGITS))


Kind = Literal["input", "formula", "weighed", "cut", "implied", "silent"]


@dataclass(frozen=True)
class _Signal:
    """An input or output of a system, prepared for C: its table, formulas and names.

    Parameters
    ----------
    variable : Variable
    word : str
        What it is called.
    kind : {"input", "formula", "weighed", "cut", "implied", "silent"}
        Of an input whether it has a table or formulas; of an output what becomes of its terms: numbers are
        weighed, sets are cut, or changed by another implication, or concluded by no rule.
    terms : sequence of Term
        In the rows of its table; of an output those that some rule concludes.
    bends : Integers
        The points of its universe that the table holds.
    points : Floats, optional
        What the table holds instead, where an output is a sum over points.
    """

    variable: Variable
    word: str
    kind: Kind
    terms: Sequence[Term]
    bends: Integers
    points: Floats | None = None

    @property
    def universe(self) -> list[float]:
        """The points that its table holds."""
        if self.points is not None:
            return self.points.tolist()
        return self.variable.universe[self.bends].tolist()

    @property
    def rows(self) -> list[list[float]]:
        """Each term's memberships at the points of its table."""
        if self.points is not None:
            return [memberships_at(self.variable, term, self.points).tolist() for term in self.terms]
        return [sample(self.variable, term)[self.bends].tolist() for term in self.terms]

    @property
    def notes(self) -> list[str]:
        """What the comments above the rows of its table say."""
        return [f"{term.name}: {shape_words(term)}" for term in self.terms]

    @property
    def tables(self) -> list[tuple[int, Term, list[float], list[float]]]:
        """The terms without a formula, each with its number, its points and its values."""
        return [
            (number, term, *_table(self.variable, term))
            for number, term in enumerate(self.terms)
            if isinstance(term.membership, model.Polyline | model.Sampled)
        ]

    def formula(self, number: int, term: Term, name: str) -> str:
        """Return the call that evaluates a term at ``x``."""
        shape = term.membership
        if isinstance(shape, model.Polyline | model.Sampled):
            table, count = f"table_{name}__{self.word}_{number}", len(_table(self.variable, term)[0])
            rows = {"points": f"{table}[0]", "values": f"{table}[1]"}
            sizes = dict.fromkeys(rows, (count,))
            return C().calling(entries.ENTRIES["degree_table"](), {"x": "x", **rows}, sizes)
        numbers = {key: repr(float(getattr(shape, key))) for key in shape.entry.kinds}
        return C().calling(entries.degree_of(shape.entry.name), {"x": "x", **numbers}, {})

    def row(self, term: str) -> int:
        """Return which row of its table a term is."""
        return [each.name for each in self.terms].index(term)


def _table(variable: Variable, term: Term) -> tuple[list[float], list[float]]:
    """Return the points of a term without a formula, and its values at these."""
    if isinstance(term.membership, model.Polyline):
        return list(map(float, term.membership.x)), list(map(float, term.membership.y))
    return variable.universe.tolist(), sample(variable, term).tolist()


class System:
    """A fuzzy system, prepared for C; `text` renders it."""

    def __init__(self, name: str, system: FuzzySystem) -> None:
        words = identifiers(variable.name for variable in system.variables)
        self.name = name
        self.system = system
        self.inputs = [
            _Signal(variable, word, "formula", tabulated(variable).terms, np.arange(0))
            if system.is_sampled
            else _Signal(variable, word, "input", variable.terms, _bends(variable))
            for variable, word in zip(system.inputs, words, strict=False)
        ]
        self.outputs = [
            self._output(variable, word)
            for variable, word in zip(system.outputs, words[len(system.inputs) :], strict=True)
        ]
        self.signals = {signal.variable.name: signal for signal in (*self.inputs, *self.outputs)}

    def _output(self, variable: Variable, word: str) -> _Signal:
        """Return an output's description for C: the kind of its inference, its terms and points."""
        names = {consequent.term for _, consequent in self.system.conclusions_on(variable)}
        terms = [term for term in variable.terms if term.name in names]
        kind: Kind = "cut" if self.system.cuts(variable) else "implied"
        if self.system.weighs(variable):
            kind = "weighed"
        indices, points = np.arange(variable.num_points), None
        if self.system.is_sampled and kind != "weighed":
            kind, points = "implied", self.system.points_of(variable)
        return _Signal(variable, word, kind if terms else "silent", terms, indices, points)

    def text(self, signature: str) -> str:
        """Render the tables, and the function: fuzzify the inputs, fire the rules, defuzzify the outputs."""
        outputs = zip(self.outputs, assemble(self.system).conclusions, strict=True)
        runs = {
            output.word: conclusion.runs.tolist()
            for output, conclusion in outputs
            if output.kind == "cut" and isinstance(conclusion, Conclusion)
        }
        cut = [output for output in self.outputs if output.word in runs]
        text = rendered(
            "c/system.c.jinja",
            name=self.name,
            signature=signature,
            system=self.system,
            inputs=self.inputs,
            outputs=self.outputs,
            asked=self._wanted_terms,
            about=comment(list(self._about())),
            rules=list(self._rules()),
            runs=runs,
            ends={output.word: list(self._end(output, runs)) for output in self.outputs},
            most_heights=max((len(output.universe) for output in cut), default=0),
            most_points=max((len(output.universe) + len(runs[output.word]) for output in cut), default=0),
            # gcc warns of moving within an array of one
            most_crossings=max([2, *(len(runs[output.word]) for output in cut)]),
            table=table,
            comment=comment,
            shape_words=shape_words,
        )
        return "\n".join(part for line in text.split("\n") for part in broken(line))

    def _end(self, output: _Signal, runs: Mapping[str, list[list[int]]]) -> Iterator[str]:
        """Yield the statement that aggregates terms that are cut, and the expression of what is concluded."""
        word, suffix, count = output.word, f"{self.name}__{output.word}", len(output.universe)
        default = output.variable.default
        otherwise = "(double)NAN" if default is None else exact(float(default))
        if output.kind == "silent":
            yield otherwise
            return
        way = self.system.defuzzifier_of(output.variable)
        if output.kind == "weighed":
            mean = f"moment_{word}" if way == "weighted_sum" else f"(moment_{word} / total_{word})"
            yield f"(total_{word} > 0.0) ? {mean} : {otherwise}"
            return
        defuzzify = entries.defuzzifying(self.system.semantics, way)
        values = {"default_value": otherwise, "count": str(count)}
        if output.kind == "implied":
            heights = dict.fromkeys(("y", "heights"), f"heights_{word}")
            values |= {"x": f"universe_{suffix}", **heights}
            yield C().calling(defuzzify, values, dict.fromkeys(values, (count,)))
            return
        arrays = {
            **{"universe": f"universe_{suffix}", "memberships": f"&memberships_{suffix}[0][0]"},
            **{"runs": f"&runs_{suffix}[0][0]", "cuts": f"cuts_{word}"},
            **{room: room for room in ("heights", "crossings", "x", "y")},
        }
        num_terms = len(output.terms)
        sizes: dict[str, tuple[int, ...]] = {
            "universe": (count,),
            "memberships": (num_terms, count),
            "cuts": (num_terms,),
        }
        sizes["runs"] = (len(runs[word]), 3)
        yield f"count = {C().calling(entries.aggregating(), arrays, sizes)};"
        yield C().calling(defuzzify, {"x": "x", "y": "y", **values, "count": "count"}, {})

    def _wanted_terms(self, input_: _Signal) -> list[int]:
        """Return the indices of an input's terms that rules ask for."""
        used = model.used_terms(self.system.rules)
        return [n for n, term in enumerate(input_.terms) if (input_.variable.name, term.name) in used]

    def _about(self) -> Iterator[str]:
        """Yield what the comment above the function says: its inputs, outputs and defaults."""
        yield f"{self.system.name}: {summary(self.system)}."
        for index, variable in enumerate(self.system.inputs):
            yield f"inputs[{index}] is {_extent(variable)}."
        for index, output in enumerate(self.system.outputs):
            what = "The result" if len(self.outputs) == 1 else f"outputs[{index}]"
            default = "NaN" if output.default is None else number(output.default)
            yield f"{what} is {_extent(output)}; {default} when no rule fires."

    def _rules(self) -> Iterator[tuple[str, str, list[str]]]:
        """Yield each rule in words, its strength, and the statements by which it concludes."""
        cut: set[str] = set()
        for rule_number, rule in enumerate(self.system.rules, start=1):
            label = f" [{rule.label}]" if rule.label else ""
            concluded = [self._conclusion(consequent, cut) for consequent in rule.consequents]
            about = comment([f"Rule {rule_number}{label}: {sentence(rule)}."], 4)
            yield about, self._degree(rule, rule.antecedent), concluded

    def _conclusion(self, consequent: model.Consequent, cut: set[str]) -> str:
        """Render a rule's conclusion; `cut` are the heights that have been set before."""
        output, weight = self.signals[consequent.variable], float(consequent.weight)
        scaled = "strength" if weight == 1.0 else f"strength * {weight!r}"
        row, word = output.row(consequent.term), output.word
        if output.kind == "weighed":
            strength = scaled if weight == 1.0 else f"({scaled})"
            concluded = self._number(output.terms[row].membership, strength, output.variable)
            is_sum = self.system.defuzzifier_of(output.variable) == "weighted_sum"
            weigh = "weigh" if is_sum else "weigh_in"
            return f"{weigh}({strength}, {concluded}, &total_{word}, &moment_{word})"
        if output.kind == "implied":
            values = {
                "sampled": f"memberships_{self.name}__{word}[{row}]",
                "strength": f"strength * {weight!r}",
                "heights": f"heights_{word}",
            }
            imply = entries.implying(self.system.implication, output.variable.aggregation)
            return C().calling(imply, values, dict.fromkeys(values, (len(output.universe),)))
        target = f"cuts_{word}[{row}]"
        if target in cut:
            return f"{target} = fuzzy_{output.variable.accumulation}({scaled}, {target})"
        cut.add(target)
        return f"{target} = {scaled}"

    def _degree(self, rule: model.Rule, expression: model.Expression) -> str:
        """Return a C expression for the degree to which an antecedent holds."""
        match expression:
            case model.Is(variable, term):
                return f"degrees_{self.signals[variable].word}[{self.signals[variable].row(term)}]"
            case model.Not(operand):
                return f"fuzzy_not({self._degree(rule, operand)})"
            case model.Hedged(hedge, operand):
                return f"fuzzy_{hedge}({self._degree(rule, operand)})"
        is_and = isinstance(expression, model.And)
        word = self.system.and_operator_of(rule) if is_and else self.system.or_operator_of(rule)
        operands = [self._degree(rule, operand) for operand in expression.operands]
        return reduce(lambda left, right: f"fuzzy_{word}({left}, {right})", operands)

    def _number(self, shape: model.MembershipFunction, strength: str, output: Variable) -> str:
        """Write the number that a rule of some strength concludes, an expression of doubles."""
        if self.system.joins_numbers(output) and output.accumulation != "unbounded_sum":
            raise ValueError(
                f"output {output.name!r} joins rules that conclude one number by {output.accumulation}, "
                "and C is written for those that add up; export as json"
            )
        if isinstance(shape, model.Formula):
            raise ValueError(
                f"output {output.name!r} concludes the formula {shape.text[:40]!r}, and C is written for "
                "numbers linear in the inputs; export as fll or json"
            )
        inputs = self.system.inputs
        if isinstance(shape, model.Number):
            *coefficients, constant = shape.row(len(inputs))
            terms = [repr(float(constant))]
            for index, (factor, v) in enumerate(zip(coefficients, inputs, strict=True)):
                if factor:
                    low, high = self.system.limits_of(v)
                    taken = f"inputs[{index}]"
                    if isfinite(low):
                        taken = f"inside({taken}, {low!r}, {high!r})"
                    terms.append(f"({float(factor)!r} * {taken})")
            return " + ".join(terms)
        first, second = (repr(float(getattr(shape, name))) for name in shape.entry.kinds)
        degree = f"({strength} < 1.0) ? {strength} : 1.0"
        values = {"first": first, "second": second, "degree": degree}
        location = C().calling(entries.where(shape.entry.name), values, {})
        if isinstance(shape, model.Sigmoid | model.Concave):  # infinitely far at some
            low, high = float(output.minimum), float(output.maximum)
            return f"finite_or_end({location}, {low!r}, {high!r})"
        return location


def _extent(variable: Variable) -> str:
    return f"{with_unit(variable)}, {number(variable.minimum)} to {number(variable.maximum)}"
