"""Controllers as C99: one file that stands alone, for flight code and hardware in the loop.

What is written takes the steps of `fis_tools.engines.inference` in the same order and with the same
arithmetic. Tables are constant, loops bounded, nothing is allocated, nothing global changes, and of the
library only ``math.h`` and ``stdbool.h`` are included.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import partial, reduce
from textwrap import wrap

import numpy as np

from fis_tools import model
from fis_tools.array_types import Integers
from fis_tools.engines.program import Conclusion, assemble
from fis_tools.formats.c import parts
from fis_tools.model.thrust import ThrustLogic, thrust_logic
from fis_tools.model.variables import sample
from fis_tools.words.text import number, sentence, shape_words, summary, with_unit

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


def write(controller: model.FuzzyController, bare: bool = False) -> str:
    """Write a controller as one C99 source file.

    A controller that commands a force becomes ``void step(state, signals, mission, force)``, inference and
    `fis_tools.model.thrust.ThrustLogic`, which a flight computer calls once in each control period. Any other
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
        If an attribute of the thrust logic is no number, or a rule concludes a formula.
    """
    logic = thrust_logic(controller)
    prefix = "infer" if logic is None else "bare_infer" if bare else "static infer"
    identifiers = _identifiers(system.name for system in controller.systems)
    named = zip(identifiers, controller.systems, strict=True)
    written = [_Part(name, system, prefix) for name, system in named]
    own = [
        *dict.fromkeys(text for part in written for text in part.conclusion_functions()),
        *(block for part in written for block in (*part.tables(), part.function())),
    ]
    declared = [f"{part.signature};" for part in written]
    if logic is not None and not bare:
        infer = {part.system.name: part.function_name for part in written}
        own.append(parts.step_functions(controller, logic, infer))
        declared.insert(0, parts.step_structures(controller, logic).rstrip())
    shared = parts.called("".join(own))
    header = _header(controller, logic, has_step=logic is not None and not bare)
    return "\n".join([header, _OPENING, *declared, "", *shared, *own])


def function_name(system: model.FuzzySystem) -> str:
    """Return what the function is called that infers a system, written alone."""
    return f"infer_{_identifiers([system.name])[0]}"


def _header(controller: model.FuzzyController, logic: ThrustLogic | None, *, has_step: bool) -> str:
    facts = [f"{key}: {value}" for key, value in (*controller.attributes, *controller.provenance)]
    about: tuple[str, ...] = ()
    if has_step:
        title, about = f"Fuzzy controller {controller.name} with its thrust logic, in C99.", parts.ABOUT
    elif logic is not None:
        title = f"BARE INFERENCE of fuzzy controller {controller.name}, in C99."
        about = (
            "This is not the controller: decision period, coasting, dead bands, axes and clip are left out. "
            "Flown so, it fires what the controller does not.",
        )
    else:
        title = f"Fuzzy controller {controller.name}, in C99."
    return _comment(
        title,
        "",
        *([*facts, ""] if facts else []),
        *(line for paragraph in about for line in (paragraph, "")),
        "Each fuzzy system is inferred as scikit-fuzzy 0.5 does: memberships are linear between the points "
        "of a universe (of inputs tables hold those where one bends), terms are cut at the strength of "
        "their rules and joined by their maximum, and points are inserted where a cut crosses its own "
        "term; outputs that are weighted averages or sums take a number from each rule. Inputs are clipped "
        "to their universes; if one is NaN, so is every output. Tables are constant, and the functions may "
        "run in several threads.",
        "",
        parts.RULES,
        "",
        f"Compiles with: gcc {WARNINGS}",
        "",
        "Doubles must be IEEE 754, in plain double precision. For a processor with fused multiply-add, "
        "-ffp-contract=off keeps the last digits.",
    )


def _comment(*paragraphs: str, indent: str = "") -> str:
    lines = [line for text in paragraphs for line in _wrap(_plain(text), WIDTH - 8) or [""]]
    if len(lines) == 1:
        return f"{indent}/* {lines[0]} */"
    return "\n".join([f"{indent}/*", *(f"{indent} * {line}".rstrip() for line in lines), f"{indent} */"])


def _plain(text: str) -> str:
    """Keep a text from ending its comment, from opening another and from spelling a trigraph."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return parts.plain(printable)


def _identifiers(names: Iterable[str]) -> list[str]:
    """Turn names into words that can be part of a C identifier, no two alike."""
    found: list[str] = []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed"
        numbered = (f"{word}_{count}" for count in range(2, len(found) + 3))
        found.append(next(choice for choice in (word, *numbered) if choice not in found))
    return found


def _bends(variable: model.Variable) -> Integers:
    """Return the places of a universe's points where some term bends: between them all are straight.

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


class _Part:
    """One system of a controller on its way to C."""

    def __init__(self, name: str, system: model.FuzzySystem, prefix: str) -> None:
        variables = (*system.inputs, *system.outputs)
        words = _identifiers(variable.name for variable in variables)
        self.name = name
        self.system = system
        self.prefix = prefix
        self.words = {variable.name: word for variable, word in zip(variables, words, strict=True)}
        self.conclusions = dict(
            zip((output.name for output in system.outputs), assemble(system).conclusions, strict=True)
        )
        #: the points of each input's universe that its tables hold
        self.bends = {variable.name: _bends(variable) for variable in system.inputs}
        #: the terms of each output that some rule concludes, in the rows of its table
        self.concluded = {output.name: self._concluded(output) for output in system.outputs}

    def _concluded(self, output: model.Variable) -> list[model.Term]:
        names = {c.term for rule in self.system.rules for c in rule.consequents if c.variable == output.name}
        return [term for term in output.terms if term.name in names]

    @property
    def signature(self) -> str:
        """The function's declaration without its end."""
        linkage = "static " if self.prefix.startswith("static ") else ""
        inputs = f"const double inputs[{len(self.system.inputs)}]"
        if len(self.system.outputs) == 1:
            return f"{linkage}double {self.function_name}({inputs})"
        outputs = f"double outputs[{len(self.system.outputs)}]"
        return f"{linkage}void {self.function_name}({inputs}, {outputs})"

    @property
    def function_name(self) -> str:
        """What the function is called."""
        return f"{self.prefix.removeprefix('static ')}_{self.name}"

    def _cutting(self) -> list[Conclusion]:
        """Return what becomes of the outputs whose terms are cut."""
        outputs = (o for o in self.system.outputs if self.concluded[o.name] and self.system.cuts(o))
        found = (self.conclusions[output.name] for output in outputs)
        return [conclusion for conclusion in found if isinstance(conclusion, Conclusion)]

    def conclusion_functions(self) -> Iterator[str]:
        """Write the functions by which rules add what they imply, where terms are not cut."""
        for output in self.system.outputs:
            if (
                self.concluded[output.name]
                and not self.system.cuts(output)
                and not self.system.weighs(output)
            ):
                yield self._conclude(output)[1]

    def _conclude(self, output: model.Variable) -> tuple[str, str]:
        return parts.conclude(self.system.implication, output.aggregation)

    def tables(self) -> Iterator[str]:
        """Write universes and sampled membership functions."""
        for variable in self.system.inputs:
            yield self._table(variable, variable.terms, self.bends[variable.name])
        for variable in self.system.outputs:
            if self.concluded[variable.name] and not self.system.weighs(variable):
                yield self._table(variable, self.concluded[variable.name])

    def _table(
        self, variable: model.Variable, terms: Sequence[model.Term], points: Integers | slice = slice(None)
    ) -> str:
        universe = variable.universe[points]
        size = f"[{len(universe)}]"
        lines = [
            f"static const double universe_{self._place(variable)}{size} = {{",
            *_numbers(universe.tolist(), "    "),
            "};",
            f"static const double memberships_{self._place(variable)}[{len(terms)}]{size} = {{",
        ]
        for term in terms:
            lines.append(_comment(f"{term.name}: {shape_words(term)}", indent="    "))
            lines += ["    {", *_numbers(sample(variable, term)[points].tolist(), "        "), "    },"]
        return "\n".join([*lines, "};", ""])

    def _place(self, variable: model.Variable) -> str:
        return f"{self.name}__{self.words[variable.name]}"

    def function(self) -> str:
        """Write the function: fuzzify the inputs, fire the rules one by one, defuzzify the outputs."""
        system = self.system
        places = ["The result"] if len(system.outputs) == 1 else [
            f"outputs[{place}]" for place in range(len(system.outputs))
        ]  # fmt: skip
        defaults = ["NaN" if output.default is None else number(output.default) for output in system.outputs]
        about = [f"{system.name}: {summary(system)}."]
        about += [f"inputs[{place}] is {_extent(variable)}." for place, variable in enumerate(system.inputs)]
        about += [
            f"{place} is {_extent(output)}; {default} when no rule fires."
            for place, output, default in zip(places, system.outputs, defaults, strict=True)
        ]
        body = [*self._declarations(), *self._fuzzification(), *self._rules(), *self._results()]
        lines = [_comment(*about), self.signature, "{", *(f"    {line}".rstrip() for line in body), "}", ""]
        return "\n".join(lines)

    def _declarations(self) -> Iterator[str]:
        for variable in self.system.inputs:
            yield f"double degrees_{self.words[variable.name]}[{len(variable.terms)}];"
        for output in self.system.outputs:
            terms = self.concluded[output.name]
            if terms and self.system.weighs(output):
                yield f"double total_{self.words[output.name]} = 0.0;"
                yield f"double moment_{self.words[output.name]} = 0.0;"
            elif terms and self.system.cuts(output):
                yield f"double cuts_{self.words[output.name]}[{len(terms)}];"
            elif terms:
                yield f"double heights_{self.words[output.name]}[{output.num_points}] = {{0.0}};"
        cut = self._cutting()
        if cut:
            points = max(len(c.universe) + len(c.runs) for c in cut)
            crossings = max(2, *(len(c.runs) for c in cut))  # gcc warns of moving within an array of one
            yield f"double crossings[{crossings}];"
            yield f"double x[{points}];"
            yield f"double y[{points}];"
        yield "double strength;"
        if cut:
            yield "int count;"
        yield ""

    def _fuzzification(self) -> Iterator[str]:
        missing = " || ".join(f"isnan(inputs[{place}]) != 0" for place in range(len(self.system.inputs)))
        yield from _wrapped(f"if ({missing}) {{")
        if len(self.system.outputs) == 1:
            yield "    return NAN;"
        else:
            yield from (f"    outputs[{place}] = NAN;" for place in range(len(self.system.outputs)))
            yield "    return;"
        yield "}"
        for place, variable in enumerate(self.system.inputs):
            table, size = self._place(variable), len(self.bends[variable.name])
            yield from _wrapped(
                f"fuzzify(inputs[{place}], universe_{table}, {size}, &memberships_{table}[0][0], "
                f"{len(variable.terms)}, degrees_{self.words[variable.name]});"
            )

    def _rules(self) -> Iterator[str]:
        cut: set[str] = set()
        accumulations = {output.name: output.accumulation for output in self.system.outputs}
        for place, rule in enumerate(self.system.rules, start=1):
            label = f" [{rule.label}]" if rule.label else ""
            yield ""
            yield from _comment(f"Rule {place}{label}: {sentence(rule)}.").splitlines()
            yield from _wrapped(f"strength = {self._degree(rule, rule.antecedent)};")
            for consequent in rule.consequents:
                output = self.system.variable(consequent.variable)
                if self.system.weighs(output):
                    yield from _wrapped(self._weighing(output, consequent))
                    continue
                if not self.system.cuts(output):
                    yield from _wrapped(self._conclusion(output, consequent))
                    continue
                terms = [term.name for term in self.concluded[consequent.variable]]
                target = f"cuts_{self.words[consequent.variable]}[{terms.index(consequent.term)}]"
                value = "strength" if consequent.weight == 1.0 else f"strength * {float(consequent.weight)!r}"
                if target in cut:
                    value = f"fuzzy_{accumulations[consequent.variable]}({value}, {target})"
                cut.add(target)
                yield f"{target} = {value};"

    def _weighing(self, output: model.Variable, consequent: model.Consequent) -> str:
        """Write the call by which a rule adds the number that it concludes."""
        weight = float(consequent.weight)
        strength = "strength" if weight == 1.0 else f"(strength * {weight!r})"
        shape = output.terms[output.term_index(consequent.term)].membership
        number = _number_concluded(shape, strength, self.system.inputs, output)
        total, moment = f"total_{self.words[output.name]}", f"moment_{self.words[output.name]}"
        return f"weigh({strength}, {number}, &{total}, &{moment});"

    def _conclusion(self, output: model.Variable, consequent: model.Consequent) -> str:
        """Write the call by which a rule adds what it implies."""
        row = [term.name for term in self.concluded[output.name]].index(consequent.term)
        strength = f"strength * {float(consequent.weight)!r}"
        return (
            f"{self._conclude(output)[0]}(memberships_{self._place(output)}[{row}], {output.num_points}, "
            f"{strength}, heights_{self.words[output.name]});"
        )

    def _degree(self, rule: model.Rule, expression: model.Expression) -> str:
        match expression:
            case model.Is(variable, term):
                index = self.system.variable(variable).term_index(term)
                return f"degrees_{self.words[variable]}[{index}]"
            case model.Not(operand):
                return f"fuzzy_not({self._degree(rule, operand)})"
            case model.Hedged(hedge, operand):
                return f"fuzzy_{hedge}({self._degree(rule, operand)})"
        is_and = isinstance(expression, model.And)
        word = self.system.and_operator_of(rule) if is_and else self.system.or_operator_of(rule)
        operands = [self._degree(rule, operand) for operand in expression.operands]
        return reduce(lambda left, right: f"fuzzy_{word}({left}, {right})", operands)

    def _results(self) -> Iterator[str]:
        is_one = len(self.system.outputs) == 1
        for place, output in enumerate(self.system.outputs):
            target = "return" if is_one else f"outputs[{place}] ="
            default = "NAN" if output.default is None else repr(float(output.default))
            yield ""
            if not self.concluded[output.name]:
                yield f"{target} {default}; /* no rule concludes it */"
                continue
            if self.system.weighs(output):
                total, moment = f"total_{self.words[output.name]}", f"moment_{self.words[output.name]}"
                is_sum = self.system.defuzzifier_of(output) == "weighted_sum"
                value = moment if is_sum else f"{moment} / {total}"
                yield f"{target} {total} > 0.0 ? {value} : {default};"
                continue
            table, size = self._place(output), len(self.concluded[output.name])
            defuzzifier = parts.DEFUZZIFIERS[self.system.defuzzifier_of(output)]
            if not self.system.cuts(output):
                heights, count = f"heights_{self.words[output.name]}", output.num_points
                yield from _wrapped(
                    f"{target} greatest({heights}, {count}) > 0.0 ? "
                    f"{defuzzifier}(universe_{table}, {heights}, {count}) : {default};"
                )
                continue
            yield from _wrapped(
                f"count = aggregate(universe_{table}, {output.num_points}, &memberships_{table}[0][0], "
                f"cuts_{self.words[output.name]}, {size}, crossings, x, y);"
            )
            yield f"{target} greatest(y, count) > 0.0 ? {defuzzifier}(x, y, count) : {default};"


def _number_concluded(
    shape: model.MembershipFunction, strength: str, inputs: Sequence[model.Variable], output: model.Variable
) -> str:
    """Write the number that a rule of some strength concludes, an expression of doubles."""
    if isinstance(shape, model.Formula):
        raise ValueError(
            f"output {output.name!r} concludes the formula {shape.text[:40]!r}, and C is written for numbers "
            "linear in the inputs; export as fll or json"
        )
    if isinstance(shape, model.Number):
        *coefficients, constant = shape.row(len(inputs))
        terms = [repr(float(constant))]
        terms += [
            f"{float(coefficient)!r} * inside(inputs[{place}], {float(v.minimum)!r}, {float(v.maximum)!r})"
            for place, (coefficient, v) in enumerate(zip(coefficients, inputs, strict=True))
            if coefficient
        ]
        return " + ".join(terms)
    assert isinstance(shape, model.MonotoneFunction)  # noqa: S101 - any other has been refused by validation
    first, second = (repr(float(getattr(shape, name))) for name in shape.entry.kinds)
    place = f"where_{shape.entry.name}({strength} < 1.0 ? {strength} : 1.0, {first}, {second})"
    if isinstance(shape, model.Sigmoid):  # reaches one nowhere
        end = output.maximum if shape.slope > 0.0 else output.minimum
        return f"{strength} < 1.0 ? {place} : {float(end)!r}"
    return place


def _extent(variable: model.Variable) -> str:
    return f"{with_unit(variable)}, {number(variable.minimum)} to {number(variable.maximum)}"


def _numbers(values: Sequence[float], indent: str) -> list[str]:
    """Write numbers that read back as the same doubles, as many on a line as fit."""
    return _wrap(", ".join(map(repr, values)), WIDTH, initial_indent=indent, subsequent_indent=indent)


def _wrapped(statement: str) -> list[str]:
    """Break a long statement between its words."""
    return _wrap(statement, WIDTH - 4, subsequent_indent="    ")
