"""Controllers as C99: one file that stands alone, for flight code and hardware in the loop.

What is written takes the steps of `fis_tools.engines.inference` in the same order and with the same
arithmetic. Tables are constant, loops bounded, nothing is allocated, nothing global changes, and of the
library only ``math.h`` and ``stdbool.h`` are included.

A file has the functions of ``parts.c`` that it calls. Of the thrust logic there is one function, called
once in each control period: `fis_tools.model.thrust` says what it is. The function does what
`pipeline.flight.period.decide.thrust` does, but for the safety layer, which is no part of the controller.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial, reduce
from math import isfinite
from pathlib import Path
from textwrap import wrap
from typing import Literal

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats, Integers
from fis_tools.engines.program import Conclusion, assemble
from fis_tools.file_access import read_shipped
from fis_tools.formats import rendered
from fis_tools.model import FuzzyController, FuzzySystem, Term, Variable, memberships_at, sample, thrust
from fis_tools.model.intervals import require_type_1
from fis_tools.model.thrust import ThrustLogic
from fis_tools.model.trees import require_unwired
from fis_tools.plain_text import distinct
from fis_tools.words.text import number, sentence, shape_words, summary, with_unit

#: What the C function of a defuzzifier is called; that of any other method is called ``fuzzy_`` and its name.
DEFUZZIFIERS = {
    "centroid": "centroid",
    "bisector": "bisector",
    "mom": "mean_of_maximum",
    "som": "smallest_of_maximum",
    "lom": "largest_of_maximum",
}


def defuzzifiers_of(system: FuzzySystem) -> dict[str, str]:
    """Return the names of the C functions of a system's defuzzifiers."""
    if not system.is_sampled:
        return DEFUZZIFIERS
    ways_of_tools = {"matlab": ("bisector", "som", "lom"), "fuzzylite": ("bisector",), "fcl": ("bisector",)}
    return {
        way: f"sampled_{name}" + (f"_{system.semantics}" if way in ways_of_tools[system.semantics] else "")
        for way, name in DEFUZZIFIERS.items()
    }


_CONCLUDE = "conclude_by_IMPLICATION_and_AGGREGATION"
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CALL = re.compile(r"\b(\w+)\(")


@cache
def _functions() -> dict[str, str]:
    """Return the texts of the functions by their names."""
    text = read_shipped(Path(__file__).with_name("parts.c"))
    _opening, *functions = re.split(r"\n\n(?=/\*|static)", text.rstrip("\n"))
    return {_CALL.findall(_COMMENT.sub("", function))[0]: f"{function}\n" for function in functions}


def called(text: str) -> list[str]:
    """Return the functions that a text calls, and those that these call, callees first.

    Parameters
    ----------
    text : str
        C source; what its comments say calls nothing.
    """
    functions = _functions()
    reached: set[str] = set()
    waiting = [text]
    while waiting:
        names = set(_CALL.findall(_COMMENT.sub("", waiting.pop())))
        new = (names & functions.keys()) - reached
        reached |= new
        waiting += (functions[name] for name in new)
    return [function for name, function in functions.items() if name in reached]


def conclude(implication: str, aggregation: str) -> tuple[str, str]:
    """Return the name and text of the function that adds a rule's implied set to the aggregate."""

    def filled(text: str) -> str:
        return text.replace("IMPLICATION", implication).replace("AGGREGATION", aggregation)

    return filled(_CONCLUDE), filled(_functions()[_CONCLUDE])


#: words that no member of a structure may be called
_KEYWORDS = frozenset(
    {
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum"),
        *("extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return"),
        *("short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void"),
        *("volatile", "while", "attitude", "is_complete"),
    }
)

#: unit and meaning of what coasting is decided by
_FORESEEN = {
    "missed": ("", "how many points coasting to the end would leave unseen"),
    "coasting_nearest": ("m", "least distance on the way"),
    "coasting_farthest": ("m", "greatest distance on the way"),
}


def members(controller: FuzzyController, logic: ThrustLogic) -> Mapping[str, tuple[str, str, str]]:
    """Return the members of `step`'s structure of signals: member by signal, its unit, its meaning.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.

    Returns
    -------
    mapping of str to (str, str, str)
        In the order of the members.
    """
    sensed: dict[str, Variable] = {v.name: v for system in controller.systems for v in system.inputs}
    fields: dict[str, tuple[str, str, str]] = {}
    taken: set[str] = set()
    foreseen = _FORESEEN if logic.may_coast else {}
    for name in dict.fromkeys([*sensed, *foreseen]):
        word = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name) or "_"
        if word[0].isdigit() or word in _KEYWORDS:
            word = f"signal_{word}"
        while word in taken:
            word += "_"
        taken.add(word)
        unit, about = foreseen.get(name, ("", ""))
        if name in sensed:
            unit, about = sensed[name].unit, sensed[name].description or about
        fields[name] = (word, unit, about)
    return fields


def step_structures(controller: FuzzyController, logic: ThrustLogic) -> str:
    """Render the structures that `step` takes and returns."""
    signals = (
        (word, wrap(f"/* {_plain(', '.join(filter(None, (unit, about))))} */", 100, subsequent_indent=" * "))
        for word, unit, about in members(controller, logic).values()
    )
    axes = "in the axes that attitude turns from" if logic.is_turned else f"{logic.force_axes} axes"
    reasons = {word: thrust.REASONS[word] for word in thrust.LOGIC_REASONS}
    return rendered("c/step.h.jinja", logic=logic, signals=signals, reasons=reasons, fired_axes=_plain(axes))


def step_functions(controller: FuzzyController, logic: ThrustLogic, infer: Mapping[str, str]) -> str:
    """Render the functions `start` and `step`.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.
    infer : mapping of str to str
        The function that infers a system, by the system's name.
    """
    words = {name: member for name, (member, _, _) in members(controller, logic).items()}
    requested = [
        (
            thrust.COMPONENTS.index(system.outputs[0].name),
            infer[system.name],
            [words[v.name] for v in system.inputs],
        )
        for system in controller.systems
    ]
    foreseen = [words[name] for name in thrust.FORESEEN] if logic.may_coast else []
    return rendered(
        "c/step.c.jinja", logic=logic, systems=requested, foreseen=foreseen, silent_n=thrust.SILENT_N
    )


WIDTH = 110
#: a membership is on a straight line if it differs from it by less: by rounding
STRAIGHT = 1e-14
_wrap = partial(wrap, break_long_words=False, break_on_hyphens=False)

#: What the written file compiles with. Not ``-Wfloat-equal``: equal heights are told apart on purpose.
WARNINGS = (
    "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Wundef -Wcast-qual "
    "-Wstrict-prototypes -Wmissing-prototypes -Werror"
)

_OPENING = """\
#include <math.h>
#include <stdbool.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: results depend on exact comparisons"
#endif
"""


def write(controller: FuzzyController, bare: bool = False) -> str:
    """Write a controller as one C99 source file.

    A controller that commands a force becomes ``void step(state, signals, mission, force)``, inference and
    `fis_tools.model.ThrustLogic`, which a flight computer calls once in each control period. Any other
    controller becomes a function a system: one with one output ``double infer_NAME(const double inputs[K])``,
    one with several ``void infer_NAME(const double inputs[K], double outputs[M])``.

    Inputs stand in the system's order and are clipped to their universes; if one is NaN, so is every output.
    Where no rule fires an output is its default, or NaN where it has none. Numbers are the shortest decimals
    that read back as the same doubles.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    bare : bool
        Write a function a system, ``bare_infer_NAME``, without the thrust logic of a controller that has one.

    Raises
    ------
    ValueError
        If an attribute of the thrust logic is no number, a rule concludes a formula, or the controller plans
        its pushes ahead.
    """
    require_type_1(controller.systems, "C")
    require_unwired([controller], "C")
    logic = thrust.thrust_logic(controller)
    has_step = logic is not None and not bare
    if has_step and logic is not None and logic.plans_ahead:
        raise ValueError(
            f"controller {controller.name!r} plans its pushes ahead (foresight_pushes), which C source does "
            "not; write its rules alone with --bare, or leave foresight_pushes out"
        )
    prefix = "infer" if logic is None or has_step else "bare_infer"
    identifiers = _identifiers(system.name for system in controller.systems)
    systems = [_System(name, system) for name, system in zip(identifiers, controller.systems, strict=True)]
    names = [f"{prefix}_{name}" for name in identifiers]
    static = "static " if has_step else ""
    signatures = [
        static + _signature(name, system.system) for name, system in zip(names, systems, strict=True)
    ]
    needed = [
        *dict.fromkeys(
            system.conclude(output)[1]
            for system in systems
            for output in system.outputs
            if output.kind == "implied"
        ),
        *(system.text(signature) for system, signature in zip(systems, signatures, strict=True)),
    ]
    declared = [f"{signature};" for signature in signatures]
    if logic is not None and has_step:
        infer = dict(zip((system.system.name for system in systems), names, strict=True))
        needed.append(step_functions(controller, logic, infer))
        declared.insert(0, step_structures(controller, logic).rstrip())
    shared = called("".join(needed))
    return "\n".join([_header(controller, logic, has_step), _OPENING, *declared, "", *shared, *needed])


def function_name(system: FuzzySystem) -> str:
    """Return the name of the function that infers a system, written alone."""
    return f"infer_{_identifiers([system.name])[0]}"


def _signature(name: str, system: FuzzySystem) -> str:
    """Return a function's declaration without its end."""
    inputs = f"const double inputs[{len(system.inputs)}]"
    if len(system.outputs) == 1:
        return f"double {name}({inputs})"
    return f"void {name}({inputs}, double outputs[{len(system.outputs)}])"


def _header(controller: FuzzyController, logic: ThrustLogic | None, has_step: bool) -> str:
    text = rendered(
        "c/head.jinja",
        controller=controller,
        logic=logic,
        has_step=has_step,
        warnings=WARNINGS,
        titles=dict.fromkeys(model.TOOLS[system.semantics].title for system in controller.systems),
    )
    title, *paragraphs = (" ".join(paragraph.split()) for paragraph in text.split("\n\n"))
    facts = [f"{key}: {value}" for key, value in (*controller.attributes, *controller.provenance)]
    lines = (line for paragraph in paragraphs for line in ("", paragraph))
    return _comment([title, *(["", *facts] if facts else []), *lines])


def _comment(paragraphs: Sequence[str], indent: int = 0) -> str:
    lines = [line for text in paragraphs for line in _wrap(_plain(text), WIDTH - 8) or [""]]
    before = " " * indent
    if len(lines) == 1:
        return f"{before}/* {lines[0]} */"
    return "\n".join([f"{before}/*", *(f"{before} * {line}".rstrip() for line in lines), f"{before} */"])


def _plain(text: str) -> str:
    """Keep a text from ending its comment, from opening another and from spelling a trigraph."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")


def _identifiers(names: Iterable[str]) -> list[str]:
    """Turn names into words that can be part of a C identifier, no two alike."""
    return distinct(re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed" for name in names)


def _bends(variable: Variable) -> Integers:
    """Return the indices of the points of a universe where some term bends.

    All places, if bends that are too slight to see next to rounding add up.
    """
    universe = variable.universe
    rows = np.array([sample(variable, term) for term in variable.terms])
    middle = (universe[1:-1] - universe[:-2]) / (universe[2:] - universe[:-2])
    straight = rows[:, :-2] + middle * (rows[:, 2:] - rows[:, :-2])
    is_bent = (np.abs(rows[:, 1:-1] - straight) > STRAIGHT).any(axis=0)
    kept = np.flatnonzero([True, *is_bent, True])
    again = np.array([np.interp(universe, universe[kept], row[kept]) for row in rows])
    return kept if np.abs(again - rows).max() < 10.0 * STRAIGHT else np.arange(len(universe))


Kind = Literal["input", "formula", "weighed", "cut", "implied", "silent"]


@dataclass(frozen=True)
class _Signal:
    """An input or output as C needs it.

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

    def values(self, term: Term) -> list[float]:
        """Return a row of its table."""
        if self.points is not None:
            return memberships_at(self.variable, term, self.points).tolist()
        return sample(self.variable, term)[self.bends].tolist()

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
            table = f"table_{name}__{self.word}_{number}"
            return f"degree_table(x, {table}[0], {table}[1], {len(_table(self.variable, term)[0])})"
        numbers = ", ".join(repr(float(getattr(shape, key))) for key in shape.entry.kinds)
        return f"degree_{shape.entry.name}(x, {numbers})"

    def row(self, term: str) -> int:
        """Return which row of its table a term is."""
        return [each.name for each in self.terms].index(term)


def _table(variable: Variable, term: Term) -> tuple[list[float], list[float]]:
    """Return the points of a term without a formula, and its values at these."""
    if isinstance(term.membership, model.Polyline):
        return list(map(float, term.membership.x)), list(map(float, term.membership.y))
    return variable.universe.tolist(), sample(variable, term).tolist()


class _System:
    """A system of a controller as C needs it."""

    def __init__(self, name: str, system: FuzzySystem) -> None:
        words = _identifiers(variable.name for variable in system.variables)
        self.name = name
        self.system = system
        self.inputs = [
            _Signal(variable, word, "formula", variable.terms, np.arange(0))
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
        names = {consequent.term for _, consequent in self.system.conclusions_on(variable)}
        terms = [term for term in variable.terms if term.name in names]
        kind: Kind = "cut" if self.system.cuts(variable) else "implied"
        if self.system.weighs(variable):
            kind = "weighed"
        indices, points = np.arange(variable.num_points), None
        if self.system.is_sampled and kind != "weighed":
            kind, points = "implied", self.system.points_of(variable)
        return _Signal(variable, word, kind if terms else "silent", terms, indices, points)

    def conclude(self, output: _Signal) -> tuple[str, str]:
        """Return the name and text of the function that adds rules' implied sets where terms are not cut."""
        return conclude(self.system.implication, output.variable.aggregation)

    def text(self, signature: str) -> str:
        """Render the tables, and the function: fuzzify the inputs, fire the rules, defuzzify the outputs."""
        outputs = zip(self.outputs, assemble(self.system).conclusions, strict=True)
        cut = [c for output, c in outputs if output.kind == "cut" and isinstance(c, Conclusion)]
        text = rendered(
            "c/system.c.jinja",
            name=self.name,
            signature=signature,
            system=self.system,
            inputs=self.inputs,
            outputs=self.outputs,
            asked=self._wanted_terms,
            about=_comment(list(self._about())),
            rules=list(self._rules()),
            defuzzifiers=defuzzifiers_of(self.system),
            most_points=max((len(c.universe) + len(c.runs) for c in cut), default=0),
            # gcc warns of moving within an array of one
            most_crossings=max([2, *(len(c.runs) for c in cut)]),
            numbers=_numbers,
            comment=_comment,
            shape_words=shape_words,
        )
        return "\n".join(broken for line in text.split("\n") for broken in _broken(line))

    def _wanted_terms(self, input_: _Signal) -> list[int]:
        """Return the indices of an input's terms that rules ask for."""
        used = model.used_terms(self.system.rules)
        return [n for n, term in enumerate(input_.terms) if (input_.variable.name, term.name) in used]

    def _about(self) -> Iterator[str]:
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
            about = _comment([f"Rule {rule_number}{label}: {sentence(rule)}."], 4)
            yield about, self._degree(rule, rule.antecedent), concluded

    def _conclusion(self, consequent: model.Consequent, cut: set[str]) -> str:
        """Render a rule's conclusion; `cut` are the heights that have been set before."""
        output, weight = self.signals[consequent.variable], float(consequent.weight)
        scaled = "strength" if weight == 1.0 else f"strength * {weight!r}"
        row, word = output.row(consequent.term), output.word
        if output.kind == "weighed":
            strength = scaled if weight == 1.0 else f"({scaled})"
            concluded = self._number(output.terms[row].membership, strength, output.variable)
            return f"weigh({strength}, {concluded}, &total_{word}, &moment_{word})"
        if output.kind == "implied":
            return (
                f"{self.conclude(output)[0]}(memberships_{self.name}__{word}[{row}], "
                f"{len(output.universe)}, strength * {weight!r}, heights_{word})"
            )
        target = f"cuts_{word}[{row}]"
        if target in cut:
            return f"{target} = fuzzy_{output.variable.accumulation}({scaled}, {target})"
        cut.add(target)
        return f"{target} = {scaled}"

    def _degree(self, rule: model.Rule, expression: model.Expression) -> str:
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
                    terms.append(f"{float(factor)!r} * {taken}")
            return " + ".join(terms)
        first, second = (repr(float(getattr(shape, name))) for name in shape.entry.kinds)
        location = f"where_{shape.entry.name}({strength} < 1.0 ? {strength} : 1.0, {first}, {second})"
        if isinstance(shape, model.Sigmoid):  # reaches one nowhere
            end = output.maximum if shape.slope > 0.0 else output.minimum
            return f"{strength} < 1.0 ? {location} : {float(end)!r}"
        return location


def _extent(variable: Variable) -> str:
    return f"{with_unit(variable)}, {number(variable.minimum)} to {number(variable.maximum)}"


def _numbers(values: Sequence[float], indent: int) -> str:
    """Write numbers that read back as the same doubles, as many on a line as fit."""
    before = " " * indent
    return "\n".join(
        _wrap(", ".join(map(repr, values)), WIDTH, initial_indent=before, subsequent_indent=before)
    )


def _broken(line: str) -> list[str]:
    """Break a statement that is too long between its words."""
    if len(line) <= WIDTH or line.endswith("*/"):
        return [line]
    return _wrap(line.lstrip(), WIDTH, initial_indent=" " * 4, subsequent_indent=" " * 8)
