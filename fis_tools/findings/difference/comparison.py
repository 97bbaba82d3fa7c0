"""Two systems compared: what changed in variables, terms, rules and outputs."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from fis_tools import model
from fis_tools.analysis.arrays import spread_inputs
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile as compiled
from fis_tools.formats.serialize import fingerprint
from fis_tools.model import FuzzyController, FuzzySystem, Rule, Term, Variable, peak
from fis_tools.model.intervals import UPPER, bound_of, sampled_bounds
from fis_tools.words.text import number

Thing = TypeVar("Thing")


class Source(NamedTuple):
    """One of the two controllers that are compared.

    Attributes
    ----------
    controller : FuzzyController
    file : str
        Where it was read from; empty if from no file.
    """

    controller: FuzzyController
    file: str

    def plain(self) -> dict[str, str]:
        """Return its name, its file and its fingerprint, as a signature refers to it."""
        sha256 = fingerprint(self.controller)
        return {"name": self.controller.name, "file": self.file, "sha256": sha256}


@dataclass(frozen=True)
class Fact:
    """A property whose value changed.

    Parameters
    ----------
    what : str
        Such as ``and operator``.
    before, after : str
        Its values, in words.
    """

    what: str
    before: str
    after: str


@dataclass(frozen=True)
class Pair(Generic[Thing]):
    """An item before and after a change; None before it was added, or after it was removed."""

    before: Thing | None
    after: Thing | None

    @property
    def present(self) -> Thing:
        """The item after the change; if it was removed, before it."""
        present = self.after or self.before
        assert present is not None  # noqa: S101 - one of them stands
        return present

    @property
    def state(self) -> str:
        """``added``, ``removed`` or ``changed``."""
        if self.before is None:
            return "added"
        return "removed" if self.after is None else "changed"


@dataclass(frozen=True)
class TermChange(Pair[Term]):
    """A term that was added, removed, renamed, or redefined.

    Parameters
    ----------
    before, after : Term or None
        None if it did not exist, or no longer exists.
    moved : float
        How far the middle of its highest points moved, in units of the variable; 0 for a term that was
        added or removed.
    share : float
        The same as a fraction of the width of the wider universe.
    similarity : float
        Jaccard: the area under the lower of the two functions over that under the higher.
    """

    moved: float = 0.0
    share: float = 0.0
    similarity: float = 0.0


@dataclass(frozen=True)
class VariableChange(Pair[Variable]):
    """A variable that was added or removed, or in which something changed.

    Parameters
    ----------
    before, after : Variable or None
        None if it did not exist, or no longer exists.
    kind : str
        ``input`` or ``output``.
    facts : tuple of Fact
        Its unit, universe, default and the like.
    terms : tuple of TermChange
        Those that changed, in their present order.
    """

    kind: str
    facts: tuple[Fact, ...] = ()
    terms: tuple[TermChange, ...] = ()


@dataclass(frozen=True)
class RuleChange(Pair[Rule]):
    """A rule that was added or removed, or concludes something else.

    Parameters
    ----------
    before, after : Rule or None
        None if it did not exist, or no longer exists.
    numbers : (int or None, int or None)
        Its numbers before and after, from 1.
    """

    numbers: tuple[int | None, int | None]

    @property
    def number(self) -> int:
        """The present number, or the former one of a removed rule."""
        before, after = self.numbers
        return after or before or 0


@dataclass(frozen=True)
class OutputChange:
    """How far an output changed, over some samples.

    Parameters
    ----------
    output : Variable
        Its present form.
    where : str
        Which samples: ``the ranges`` or ``the flights``.
    num_samples : int
        How many.
    mean, largest : float
        Size of the change, in the output's unit.
    mean_share, largest_share : float
        The same as a fraction of the wider range of the output.
    inputs : dict
        Where it is largest, by the inputs' names.
    before, after : float
        The outputs there.
    """

    output: Variable
    where: str
    num_samples: int
    mean: float
    largest: float
    mean_share: float
    largest_share: float
    inputs: dict[str, float]
    before: float
    after: float


@dataclass(frozen=True)
class SystemDifference(Pair[FuzzySystem]):
    """The differences between two systems of the same name.

    Parameters
    ----------
    before, after : FuzzySystem or None
        None if it did not exist, or no longer exists.
    facts : tuple of Fact
        Operators, defuzzifier, and the order of the inputs.
    variables : tuple of VariableChange
        Those that changed.
    rules : tuple of RuleChange
        Those that changed.
    outputs : tuple of OutputChange
        Of each output that both have, over each kind of samples; empty where the inputs are not the same.
    """

    facts: tuple[Fact, ...] = ()
    variables: tuple[VariableChange, ...] = ()
    rules: tuple[RuleChange, ...] = ()
    outputs: tuple[OutputChange, ...] = ()

    @property
    def name(self) -> str:
        """The name of the system."""
        return self.present.name

    @property
    def is_empty(self) -> bool:
        """Whether nothing changed."""
        is_kept = self.before is not None and self.after is not None
        return is_kept and not (self.facts or self.variables or self.rules)


#: How a number is written.
Write = Callable[[float], str]

#: The similarity from which a removed and an added term count as one that was renamed.
RENAMED_FROM = 0.7
#: New names of terms, by variable and old name.
Names = dict[tuple[str, str], str]


def system_facts(before: FuzzySystem, after: FuzzySystem) -> tuple[Fact, ...]:
    """Compare the properties of two systems."""
    facts = [
        Fact(field.replace("_", " "), getattr(before, field), getattr(after, field))
        for field in ("and_operator", "or_operator", "defuzzifier", "implication")
    ]
    for what in ("inputs", "outputs"):
        names = [[variable.name for variable in getattr(system, what)] for system in (before, after)]
        if set(names[0]) == set(names[1]):
            facts.append(Fact(f"order of {what}", ", ".join(names[0]), ", ".join(names[1])))
    return tuple(fact for fact in facts if fact.before != fact.after)


def compare_variables(before: FuzzySystem, after: FuzzySystem) -> tuple[VariableChange, ...]:
    """Compare the variables of two systems, by their names."""
    changes = []
    for kind, old, new in (("input", before.inputs, after.inputs), ("output", before.outputs, after.outputs)):
        removed = {variable.name: variable for variable in old}
        for variable in new:
            same = removed.pop(variable.name, None)
            if same is None:
                changes.append(VariableChange(None, variable, kind))
            elif same != variable:
                facts, terms = tuple(_variable_facts(same, variable)), tuple(_compare_terms(same, variable))
                changes.append(VariableChange(same, variable, kind, facts, terms))
        changes += [VariableChange(variable, None, kind) for variable in removed.values()]
    return tuple(changes)


def _variable_facts(before: Variable, after: Variable) -> Iterator[Fact]:
    """Yield which properties of a variable changed, with both values in words."""
    for what, words in _IN_WORDS.items():
        if words(before, repr) != words(after, repr):
            write = number if words(before, number) != words(after, number) else repr
            yield Fact(what, words(before, write), words(after, write))
    order = [[term.name for term in variable.terms] for variable in (before, after)]
    if order[0] != order[1] and set(order[0]) == set(order[1]):
        yield Fact("order of terms", ", ".join(order[0]), ", ".join(order[1]))


def _points_words(variable: Variable, write: Write) -> str:
    if variable.points is None:
        return f"{variable.num_points}, even"
    return f"{variable.num_points} of its own: {', '.join(map(write, variable.points))}"


#: What a variable says of itself besides its terms, numbers written in some way.
_IN_WORDS: dict[str, Callable[[Variable, Write], str]] = {
    "unit": lambda v, _: v.unit or "none",
    "range": lambda v, write: f"{write(v.minimum)} to {write(v.maximum)}",
    "points": _points_words,
    "default": lambda v, write: "none" if v.default is None else write(v.default),
    "defuzzifier": lambda v, _: v.defuzzifier or "the system's",
    "accumulation": lambda v, _: v.accumulation,
    "aggregation": lambda v, _: v.aggregation,
    "description": lambda v, _: v.description or "none",
}


def _compare_terms(before: Variable, after: Variable) -> Iterator[TermChange]:
    """Yield the terms that changed: the present ones, then the removed ones."""
    removed = {term.name: term for term in before.terms}
    pairs = [(removed.pop(term.name, None), term) for term in after.terms]
    for index, (old, new) in enumerate(pairs):
        if old is None and removed:
            likest = max(removed.values(), key=lambda term: _similarity(before, term, after, new))
            if _similarity(before, likest, after, new) >= RENAMED_FROM:
                pairs[index] = (removed.pop(likest.name), new)
    for old, new in pairs:
        if old is None:
            yield TermChange(None, new)
        elif old != new or not _is_same_function(before, old, after, new):
            moved = _middle(after, new) - _middle(before, old)
            width = max(v.span for v in (before, after))
            yield TermChange(old, new, moved, abs(moved) / width, _similarity(before, old, after, new))
    for old in removed.values():
        yield TermChange(old, None)


def _is_same_function(before: Variable, old: Term, after: Variable, new: Term) -> bool:
    """Return whether two terms have the same memberships on a common universe."""
    if not (before.has_sets and after.has_sets):
        return old == new
    is_same_universe = np.array_equal(before.universe, after.universe)
    return not is_same_universe or np.array_equal(sampled_bounds(before, old), sampled_bounds(after, new))


def _middle(variable: Variable, term: Term) -> float:
    """Return a term's location: the middle of its highest points."""
    mean = getattr(term.membership, "mean", getattr(term.membership, "peak", None))
    if mean is not None:
        return float(mean)
    if isinstance(term.membership, model.Formula):
        return 0.0
    if isinstance(term.membership, model.Number):
        return term.membership.row(0)[-1]
    return peak(variable, replace(term, membership=bound_of(term.membership, UPPER)))


def _similarity(before: Variable, old: Term, after: Variable, new: Term) -> float:
    """Return the Jaccard similarity of two functions: area of their minimum over area of their maximum.

    Of interval type-2 sets, areas of the lower and the upper functions are added (D. Wu and J. M. Mendel,
    Information Sciences 179, 2009).
    """
    if not (before.has_sets and after.has_sets):
        return float(old.membership == new.membership)
    points = np.union1d(before.universe, after.universe)
    points = np.union1d(points, np.linspace(points[0], points[-1], 2001))
    first, other = (
        np.stack(
            [
                np.interp(points, variable.universe, bound, left=0.0, right=0.0)
                for bound in sampled_bounds(variable, term)
            ]
        )
        for variable, term in ((before, old), (after, new))
    )
    joint = float(np.trapezoid(np.maximum(first, other), points).sum())
    return float(np.trapezoid(np.minimum(first, other), points).sum()) / joint if joint > 0.0 else 1.0


def new_names(variables: Sequence[VariableChange]) -> Names:
    """Return the new names of renamed terms."""
    return {
        (change.present.name, term.before.name): term.after.name
        for change in variables
        for term in change.terms
        if term.before is not None and term.after is not None and term.before.name != term.after.name
    }


def compare_rules(before: FuzzySystem, after: FuzzySystem, names: Names) -> tuple[RuleChange, ...]:
    """Compare the rules of two systems by their antecedents; the order of rules and statements is ignored.

    A renamed term counts as the same.
    """
    removed: dict[object, list[tuple[object, int, Rule]]] = defaultdict(list)
    for index, rule in enumerate(before.rules, start=1):
        called = model.with_terms(rule, names)
        removed[model.canonical(called.antecedent)].append((_meaning(called), index, rule))
    changes = []
    for index, rule in enumerate(after.rules, start=1):
        same = removed[model.canonical(rule.antecedent)]
        kept = next((entry for entry in same if entry[0] == _meaning(rule)), None)
        if kept is not None:
            same.remove(kept)
        else:
            changes.append(RuleChange(None, rule, (None, index)))
    for position, change in enumerate(changes):
        if same := removed[model.canonical(change.present.antecedent)]:
            _, index, rule = same.pop(0)
            changes[position] = replace(change, before=rule, numbers=(index, change.number))
    left = sorted((index, rule) for entries in removed.values() for _, index, rule in entries)
    return (*changes, *(RuleChange(rule, None, (index, None)) for index, rule in left))


def _meaning(rule: Rule) -> tuple[object, ...]:
    """Return the part of a rule beside its antecedent by which two rules are the same."""
    consequents = sorted((c.variable, c.term, c.weight) for c in rule.consequents)
    return consequents, rule.label, rule.and_operator, rule.or_operator


def compare_outputs(
    before: FuzzySystem, after: FuzzySystem, samples: Floats | None = None
) -> tuple[OutputChange, ...]:
    """Compare the common outputs of two systems, over the input ranges and over samples.

    Parameters
    ----------
    before, after : FuzzySystem
        Of inputs of the same names, in any order; without these nothing is compared.
    samples : (n, num_inputs), optional
        Inputs in the order of `after`.
    """
    names = [variable.name for variable in after.inputs]
    if sorted(names) != sorted(variable.name for variable in before.inputs):
        return ()
    spread = spread_inputs(over_both_ranges(before, after))
    changes = []
    for where, inputs in (("the ranges", spread), ("the flights", samples)):
        if inputs is not None and len(inputs):
            columns = dict(zip(names, inputs.T, strict=True))
            old, new = compiled(before)(columns), compiled(after)(columns)
            for output in (output for output in after.outputs if output.name in old):
                pair = np.array((old[output.name], new[output.name]))
                has_value = np.isfinite(pair).all(axis=0)  # a formula may have none
                if has_value.any():
                    at = {name: column[has_value] for name, column in columns.items()}
                    changes.append(_change(before, output, where, at, pair[:, has_value]))
    return tuple(changes)


def over_both_ranges(before: FuzzySystem, after: FuzzySystem) -> FuzzySystem:
    """Return a system whose inputs have ranges as wide as in both; for their ranges only."""
    wider = []
    for variable in after.inputs:
        old = before.variable(variable.name)
        low, high = min(old.minimum, variable.minimum), max(old.maximum, variable.maximum)
        wider.append(replace(variable, minimum=low, maximum=high))
    return replace(after, inputs=tuple(wider))


def _change(
    before: FuzzySystem, output: Variable, where: str, inputs: dict[str, Floats], values: Floats
) -> OutputChange:
    """Return how far an output moved between two systems, on average and at most, and where."""
    sizes = np.abs(values[1] - values[0])
    worst = int(np.argmax(sizes))
    width = max(v.span for v in (before.variable(output.name), output))
    mean, largest = float(sizes.mean()), float(sizes[worst])
    at = {name: float(column[worst]) for name, column in inputs.items()}
    sides = values[:, worst].tolist()
    return OutputChange(output, where, len(sizes), mean, largest, mean / width, largest / width, at, *sides)
