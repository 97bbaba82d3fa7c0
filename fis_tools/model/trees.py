"""Trees: systems that take the outputs of others as inputs, with the inputs and outputs of the whole.

What comes through a wire is passed on as it is; each system then does with it what its program does with any
input, clips it or not. MATLAB calls such a tree a ``fistree``.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf
from typing import NamedTuple

from fis_tools.errors import Mistake, suggestion
from fis_tools.model.semantics import Semantics
from fis_tools.model.systems import FuzzyController, FuzzySystem, Wire
from fis_tools.model.variables import Variable


class End(NamedTuple):
    """An end of a wire: a variable of a system, by their indices."""

    system: int
    variable: int
    is_output: bool


@dataclass(frozen=True)
class FuzzyTree:
    """Wired systems as one function.

    Its values are those of its inputs, then the outputs of its systems, one system after the other.

    Parameters
    ----------
    name : str
    systems : tuple of FuzzySystem
        In an order in which they can be computed.
    inputs : tuple of Variable
        What no wire feeds, by the names in the systems; ``system/variable`` where several have one name.
    outputs : tuple of Variable
        What no wire takes on.
    columns : tuple of tuple of int
        Of each system: which of the values are its inputs.
    output_columns : tuple of int
        Which of the values are the outputs.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    columns: tuple[tuple[int, ...], ...]
    output_columns: tuple[int, ...]

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The inputs, then the outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def semantics(self) -> Semantics:
        """The program whose inference all systems mean."""
        return self.systems[0].semantics

    @property
    def is_sampled(self) -> bool:
        """Whether its systems compute as other programs than scikit-fuzzy do."""
        return self.systems[0].is_sampled

    @property
    def weighed(self) -> tuple[Variable, ...]:
        """The outputs that are weighted averages or sums."""
        last = zip(self.outputs, self.output_columns, strict=True)
        return tuple(v for v, column in last if self._system_of(column).weighs(self._value(column)))

    @property
    def first_outputs(self) -> tuple[int, ...]:
        """Of each system, the index of the value of its first output."""
        firsts, count = [], len(self.inputs)
        for system in self.systems:
            firsts.append(count)
            count += len(system.outputs)
        return tuple(firsts)

    def variable(self, name: str) -> Variable:
        """Return the input or output called `name`; raise KeyError if there is none."""
        for variable in self.variables:
            if variable.name == name:
                return variable
        known = ", ".join(v.name for v in self.variables)
        raise KeyError(f"{self.name!r} has no variable {name!r}; its variables are {known}")

    def limits_of(self, variable: Variable) -> tuple[float, float]:
        """Return the numbers beyond which an input makes no difference."""
        index = self.inputs.index(variable)
        ends = [
            system.limits_of(v)
            for system, columns in zip(self.systems, self.columns, strict=True)
            for v, column in zip(system.inputs, columns, strict=True)
            if column == index
        ]
        return min((low for low, _ in ends), default=-inf), max((high for _, high in ends), default=inf)

    def source(self, column: int) -> str:
        """Return the name of a value: an input, or ``system/output``."""
        if column < len(self.inputs):
            return self.inputs[column].name
        return f"{self._system_of(column).name}/{self._value(column).name}"

    def _system_of(self, column: int) -> FuzzySystem:
        """Return the system that computes the value in a column."""
        first = self.first_outputs
        return self.systems[max(index for index, start in enumerate(first) if start <= column)]

    def _value(self, column: int) -> Variable:
        """Return the variable whose value is in a column."""
        ends = (output for system in self.systems for output in system.outputs)
        return (*self.inputs, *ends)[column]


#: What has inputs and outputs, and can be compiled.
Inferable = FuzzySystem | FuzzyTree


def whole(controller: FuzzyController, cure: str) -> Inferable:
    """Return a controller as one function: its tree, or its only system; raise Mistake, which says the cure.

    Raises
    ------
    Mistake
        If it has several systems that are not wired.
    """
    return tree(controller) if controller.wires else controller.only_system(cure)


@lru_cache(maxsize=32)
def tree(controller: FuzzyController) -> FuzzyTree:
    """Return the tree of a controller without problems."""
    systems = controller.systems
    feeds = _feeds(controller)
    order = list(_ordered(systems, feeds))
    free = [end for end in _inputs(systems) if end not in feeds]
    taken = {source for source in feeds.values() if source.is_output}
    open_ends = [
        End(index, number, True)
        for index in order
        for number in range(len(systems[index].outputs))
        if End(index, number, True) not in taken
    ]
    variables = [_variable(systems, end) for end in (*free, *open_ends)]
    names = [variable.name for variable in variables]
    named = tuple(
        replace(variable, name=_text(systems, end)) if names.count(variable.name) > 1 else variable
        for variable, end in zip(variables, (*free, *open_ends), strict=True)
    )
    all_ends = [*free, *(End(i, n, True) for i in order for n in range(len(systems[i].outputs)))]
    column_of = {end: column for column, end in enumerate(all_ends)}
    columns = tuple(
        tuple(column_of[feeds.get(End(i, n, False), End(i, n, False))] for n in range(len(systems[i].inputs)))
        for i in order
    )
    return FuzzyTree(
        controller.name,
        tuple(systems[index] for index in order),
        named[: len(free)],
        named[len(free) :],
        columns,
        tuple(column_of[end] for end in open_ends),
    )


def wire_problems(controller: FuzzyController) -> Iterator[str]:
    """Yield the problems of a controller's wires, one sentence each."""
    if not controller.wires:
        return
    ends = _ends(controller.systems)
    wrong = [
        *(sentence for wire in controller.wires for sentence in _end_problems(wire, ends)),
        *_doubles(controller),
    ]
    if wrong:
        yield from wrong
        return
    for wire in controller.wires:
        yield from _pair_problems(controller.systems, wire, ends)
    yield from _loops(controller)
    tools = sorted({system.semantics for system in controller.systems})
    if len(tools) > 1:
        yield (
            f"the systems are wired and mean what {' and '.join(tools)} do; give all of them the same "
            "semantics, as import --as does"
        )


def _doubles(controller: FuzzyController) -> Iterator[str]:
    """Yield a sentence on names that several variables have, and on inputs that several wires feed."""
    systems = controller.systems
    names = Counter(_text(systems, end) for end in (*_inputs(systems), *_outputs(systems)))
    for name, count in names.items():
        if count > 1:
            yield f"two variables are written {name!r}; wires cannot tell them apart, so rename one"
    for target, count in Counter(wire.target for wire in controller.wires).items():
        if count > 1:
            yield f"{count} wires end at {target}; drop all but one of them"


def _end_problems(wire: Wire, ends: Mapping[str, End]) -> Iterator[str]:
    """Yield the problems of the names at a wire's ends."""
    for name in (wire.source, wire.target):
        if name not in ends:
            yield f"the wire from {wire.source!r} to {wire.target!r}: there is no {name!r}; " + suggestion(
                name, ends
            )
    if wire.target in ends and ends[wire.target].is_output:
        yield f"the wire from {wire.source} ends at the output {wire.target}; end it at an input"


def _pair_problems(systems: Sequence[FuzzySystem], wire: Wire, ends: Mapping[str, End]) -> Iterator[str]:
    """Yield the problems of a wire between two variables: units and ranges that differ."""
    source, target = (_variable(systems, ends[name]) for name in (wire.source, wire.target))
    if source.unit and target.unit and source.unit != target.unit:
        yield (
            f"{wire.source} is in {source.unit} and {wire.target} in {target.unit}; give both the same unit"
        )
    extents = [(variable.minimum, variable.maximum) for variable in (source, target)]
    if not ends[wire.source].is_output and extents[0] != extents[1]:
        yield f"{wire.source} and {wire.target} share a value and have other ranges; give them the same"


def _loops(controller: FuzzyController) -> Iterator[str]:
    """Yield a sentence on systems that wait for one another."""
    ends, targets = _ends(controller.systems), {wire.target: wire.source for wire in controller.wires}
    for target in targets:
        path = [target]
        while path[-1] in targets and not ends[path[-1]].is_output:
            path.append(targets[path[-1]])
            if path[-1] in path[:-1]:
                yield f"the inputs {', '.join(path[:-1])} share one another's value; give one of them its own"
                return
    feeds = _feeds(controller)
    computed = set(_ordered(controller.systems, feeds))
    if waiting := [s.name for index, s in enumerate(controller.systems) if index not in computed]:
        yield (
            f"the wires make a loop, so that none of {', '.join(waiting)} can be computed first; drop a wire "
            "of it"
        )


def _feeds(controller: FuzzyController) -> dict[End, End]:
    """Return the source of each wired input: an output, or an input that no wire feeds."""
    ends = _ends(controller.systems)
    direct = {ends[wire.target]: ends[wire.source] for wire in controller.wires}
    feeds = {}
    for target, source in direct.items():
        last = source
        while last in direct:
            last = direct[last]
        feeds[target] = last
    return feeds


def _ordered(systems: Sequence[FuzzySystem], feeds: Mapping[End, End]) -> Iterator[int]:
    """Yield systems, each after those that feed it; those of loops never."""
    waits = {
        index: {s.system for t, s in feeds.items() if t.system == index and s.is_output}
        for index in range(len(systems))
    }
    computed: set[int] = set()
    while ready := [i for i, before in waits.items() if i not in computed and before <= computed]:
        computed.add(ready[0])
        yield ready[0]


def _inputs(systems: Sequence[FuzzySystem]) -> list[End]:
    return [End(index, n, False) for index, s in enumerate(systems) for n in range(len(s.inputs))]


def _outputs(systems: Sequence[FuzzySystem]) -> list[End]:
    return [End(index, n, True) for index, s in enumerate(systems) for n in range(len(s.outputs))]


def _ends(systems: Sequence[FuzzySystem]) -> dict[str, End]:
    return {_text(systems, end): end for end in (*_inputs(systems), *_outputs(systems))}


def _text(systems: Sequence[FuzzySystem], end: End) -> str:
    return f"{systems[end.system].name}/{_variable(systems, end).name}"


def _variable(systems: Sequence[FuzzySystem], end: End) -> Variable:
    system = systems[end.system]
    return (system.outputs if end.is_output else system.inputs)[end.variable]


def require_unwired(controllers: Iterable[FuzzyController], what: str) -> None:
    """Raise Mistake for controllers whose systems are wired; `what` begins the sentence."""
    for controller in controllers:
        if controller.wires:
            raise Mistake(
                f"{what} is for systems by themselves, and those of {controller.name!r} are wired; take one "
                "with --system"
            )
