"""FCL files taken apart by the grammar in `fcl.lark`, and turned into a fuzzy system."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from lark import Token, Tree

from fis_tools import model
from fis_tools.errors import ControllerFileError, raised_as
from fis_tools.formats.exchange import antecedents, foreign
from fis_tools.formats.exchange.antecedents import FUZZYLITES, with_any
from fis_tools.formats.exchange.dialect import OUTPUT_POINTS
from fis_tools.formats.exchange.fcl_syntax import Node
from fis_tools.formats.exchange.fcl_words import (
    ACCUMULATIONS,
    AND,
    DUALS,
    FUNCTIONS,
    FUZZYLITES_AND,
    FUZZYLITES_OR,
    METHODS,
    OR,
)
from fis_tools.formats.exchange.fll_rules import hedged_rules
from fis_tools.model import Expression, FuzzySystem, MembershipFunction, Rule, Semantics, Variable
from fis_tools.model.chains import Named, NotResolvable, unchained
from fis_tools.model.membership import words_of
from fis_tools.model.operators import WEIGHING
from fis_tools.model.systems import with_joint_operators
from fis_tools.model.validate import MAX_NESTING

#: Intervals into which jFuzzyLogic cuts an output's range.
RESOLUTION = 1000


class _Contents:
    """What the parts of a function block say."""

    def __init__(self) -> None:
        self.ranges: dict[str, tuple[float, float]] = {}
        #: Of outputs, where they are declared: jFuzzyLogic does not look at them.
        self.ignored: dict[str, tuple[float, float]] = {}
        self.terms: dict[str, dict[str, Node]] = {}
        self.settings: dict[str, dict[str, Token]] = {}
        self.inputs: list[str] = []
        self.outputs: list[str] = []
        self.blocks: list[Node] = []


def read_block(block: Node, semantics: Semantics) -> tuple[FuzzySystem, list[str]]:
    """Build the system of a function block; return it with notes on what was assumed."""
    contents, notes = _Contents(), list[str]()
    names = [child for child in block.children if isinstance(child, Token)]
    for part in block.children:
        if isinstance(part, Tree):
            _take(contents, part)
    name = str(names[0]) if names else "unnamed"
    _require_finished(contents, name)
    inputs = [_input(contents, name, semantics, notes) for name in dict.fromkeys(contents.inputs)]
    accumulation = "SUM" if semantics == "fcl" else "MAX"
    rules: list[Rule] = []
    implication: model.AndOperator = "min"
    for part in contents.blocks:
        operators: tuple[model.AndOperator, model.OrOperator] = ("min", "max")
        for entry in (entry for entry in part.children if isinstance(entry, Tree)):
            if entry.data == "rule":
                rules += _rules(entry, operators, semantics)
                continue
            word: Any = entry.children[1]
            match str(entry.children[0]).upper():
                case "ACT":
                    implication = _choice(AND if semantics == "fcl" else FUZZYLITES_AND, word, "ACT")
                case "ACCU":
                    accumulation = str(word).upper()
                case key:
                    operators = _operators(key, word, operators, semantics)
    outputs = [_output(contents, name, inputs, accumulation, semantics, notes) for name in contents.outputs]
    if semantics == "fuzzylite":  # fuzzylite passes on the height at which a term is cut
        named = [Named(f"rule {number}", rule) for number, rule in enumerate(rules, start=1)]
        with raised_as(ControllerFileError, NotResolvable):
            rules = unchained(named, {output.name: output for output in outputs})
    system = FuzzySystem(
        name,
        with_any(inputs, rules),
        tuple(outputs),
        tuple(rules),
        implication=implication,
        semantics=semantics,
    )
    if len(system.weighed) == len(outputs):
        system = replace(system, implication="min")
    return with_joint_operators(system), notes


def _require_finished(contents: _Contents, name: str) -> None:
    """Refuse a block that declares terms but no system, such as a file of membership functions."""
    rules = (entry for part in contents.blocks for entry in part.children if isinstance(entry, Tree))
    parts: dict[str, list[Any]] = {
        "inputs": contents.inputs,
        "outputs": contents.outputs,
        "terms of outputs": [output for output in contents.outputs if contents.terms.get(output)],
        "rules": [rule for rule in rules if rule.data == "rule"],
    }
    foreign.require_finished(f"the function block {name!r}", parts)


def _operators(
    key: str, word: Any, operators: tuple[model.AndOperator, model.OrOperator], semantics: Semantics
) -> tuple[model.AndOperator, model.OrOperator]:
    """Return the operators of a block after a setting; in jFuzzyLogic it sets both."""
    if semantics == "fuzzylite":
        if key == "AND":
            return _choice(FUZZYLITES_AND, word, "AND"), operators[1]
        return operators[0], _choice(FUZZYLITES_OR, word, "OR")
    if key == "AND":
        conjunction: model.AndOperator = _choice(AND, word, "AND")
        return conjunction, DUALS[conjunction]
    disjunction: model.OrOperator = _choice(OR, word, "OR")
    return next(each for each, of in DUALS.items() if of == disjunction), disjunction


def _take(contents: _Contents, part: Node) -> None:
    """Add a part of a function block to its contents."""
    kind = str(part.data)
    if kind in {"inputs", "outputs"}:
        for declared in part.children:
            name = str(declared.children[0])
            (contents.inputs if kind == "inputs" else contents.outputs).append(name)
            for each in declared.children[1:]:
                (contents.ranges if kind == "inputs" else contents.ignored)[name] = _range(each)
    elif kind == "rules":
        contents.blocks.append(part)
    else:
        name = str(part.children[0])
        listed = contents.inputs if kind == "fuzzify" else contents.outputs
        if name not in {*contents.inputs, *contents.outputs}:
            listed.append(name)
        for entry in part.children[1:]:
            if entry.data == "term":
                contents.terms.setdefault(name, {})[str(entry.children[0])] = entry.children[1]
            elif entry.data == "range":
                contents.ranges[name] = _range(entry)
            else:
                key = "DEFAULT" if entry.data == "default" else str(entry.children[0]).upper()
                word = entry.children[0 if key == "DEFAULT" else 1]
                contents.settings.setdefault(name, {})[key] = word
                if len(entry.children) > 1 and key == "DEFAULT":  # fuzzylite's 0 | NC
                    contents.settings[name]["KEPT"] = word


def _range(tree: Node) -> tuple[float, float]:
    low, high = (foreign.number(str(word), f"line {word.line}: the range") for word in tree.children)
    return low, high


def _choice(known: Mapping[str, Any], word: Token, what: str) -> Any:
    return foreign.choice(known, str(word).upper(), f"line {word.line}: {what}")


def _input(contents: _Contents, name: str, semantics: Semantics, notes: list[str]) -> Variable:
    """Return an input of a function block."""
    terms = [(term, _membership(tree, semantics)) for term, tree in contents.terms.get(name, {}).items()]
    if name in contents.outputs:
        raise ControllerFileError(f"{name!r} is an input and an output; declare it once")
    low, high = _extent(
        contents, name, [shape for _, (shape, _) in terms], [end for _, (_, end) in terms], notes
    )
    if low == high:  # jFuzzyLogic uses no range of an input
        low, high = low - 0.5, high + 0.5
        notes.append(f"the terms of {name} stand at one point: its range becomes {low:g} to {high:g}")
    return foreign.variable(name, (low, high), [(term, shape) for term, (shape, _) in terms], is_output=False)


def _output(
    contents: _Contents,
    name: str,
    inputs: Sequence[Variable],
    usual_accumulation: str,
    semantics: Semantics,
    notes: list[str],
) -> Variable:
    """Return an output of a function block, with its defuzzifier, accumulation and default."""
    settings, trees = contents.settings.get(name, {}), contents.terms.get(name, {})
    method: model.Defuzzifier = "centroid"
    if "METHOD" in settings:
        method = _choice(METHODS, settings["METHOD"], "METHOD")
    known = ACCUMULATIONS if semantics == "fcl" else {**ACCUMULATIONS, **FUZZYLITES_OR}
    accumulation = foreign.choice(known, str(settings.get("ACCU", usual_accumulation)).upper(), "ACCU")
    weighs = method in WEIGHING
    terms, ends = [], []
    for term, tree in trees.items():
        if weighs:
            names = [variable.name for variable in inputs]
            terms.append((term, _number(tree, names, semantics)))
            shape = terms[-1][1]
            values = [shape.value if isinstance(shape, model.Constant) else 0.0]
            ends.append((min(values), max(values)))
        else:
            shape, end = _membership(tree, semantics)
            terms.append((term, shape))
            ends.append(end)
    extent = _extent(contents, name, [shape for _, shape in terms], ends, notes)
    if extent[0] == extent[1] and not weighs:
        raise ControllerFileError(
            f"the terms of the output {name!r} stand at one point, and it has no RANGE to sum over; give one"
        )
    points = (OUTPUT_POINTS if semantics == "fuzzylite" else RESOLUTION + 1) if not weighs else None
    variable = foreign.variable(name, extent, terms, is_output=True, num_points=points)
    default = settings.get("DEFAULT")
    if "KEPT" in settings or (default is not None and str(default).upper() == "NC"):
        notes.append(foreign.kept_words(name))
    is_silent = default is None or str(default).upper() in {"NC", "NAN"}
    value = (
        None
        if is_silent
        else foreign.number(str(default), f"line {getattr(default, 'line', 0)}: the default")
    )
    is_joined = weighs and semantics == "fcl"
    return replace(
        variable,
        default=value,
        defuzzifier=method,
        accumulation=accumulation if is_joined else "max",
        aggregation="unbounded_sum" if weighs else accumulation,
    )


def _extent(
    contents: _Contents,
    name: str,
    shapes: Sequence[MembershipFunction],
    ends: Sequence[tuple[float, float]],
    notes: list[str],
) -> tuple[float, float]:
    """Return a variable's range; without one jFuzzyLogic takes that of its terms."""
    if name in contents.ranges:
        return contents.ranges[name]
    if not shapes:
        return 0.0, 1.0
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    where = " in DEFUZZIFY, where jFuzzyLogic looks for it," if name in contents.ignored else ","
    notes.append(f"{name} has no RANGE{where} and gets that of its terms, {low:g} to {high:g}, as there")
    return low, high


def _numbers(tree: Node, words: Sequence[Token]) -> list[float]:
    """Read numbers; refuse variables in their stead."""
    for word in words:
        if word.type == "NAME":
            raise ControllerFileError(
                f"line {word.line}: the variable {str(word)[:40]!r} stands for a number of a term, which "
                "moves with it; write a number"
            )
    return [foreign.number(str(word), f"line {word.line}") for word in words]


def _membership(tree: Node, semantics: Semantics) -> tuple[MembershipFunction, tuple[float, float]]:
    """Return a term's membership function, and the range that jFuzzyLogic gives it."""
    line = tree.meta.line
    match str(tree.data):
        case "points":
            pairs = [_numbers(point, point.children) for point in tree.children]
            x, y = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
            if any(left > right for left, right in pairwise(x)):
                raise ControllerFileError(f"line {line}: the points of a term do not ascend; sort them")
            return model.Polyline(tuple(x), tuple(y)), (x[0], x[-1])
        case "singleton":
            (x0,) = _numbers(tree, tree.children)
            return model.Triangular(x0, x0, x0), (x0, x0)
        case "shape":
            word, *words = tree.children
            return _shape(word, _numbers(tree, words), semantics)
    what = "singletons with heights" if tree.data == "spikes" else "a formula"
    raise ControllerFileError(
        f"line {line}: {what} cannot be read as a fuzzy set; write points, (x, y) (x, y)"
    )


def _shape(
    word: Token, numbers: list[float], semantics: Semantics
) -> tuple[MembershipFunction, tuple[float, float]]:
    """Return the shape of a word and its numbers, and its range."""
    where, name = f"line {word.line}", str(word).upper()
    is_fuzzylites = semantics == "fuzzylite" and str(word) != name
    if name == "COSINE" and len(numbers) == 2 and not is_fuzzylites:  # half the width, then the centre
        half, centre = numbers
        return model.Cosine(centre, 2.0 * half), (centre - half, centre + half)
    known = words_of("fcl")
    if name not in known or is_fuzzylites:
        shape = foreign.FUZZYLITES.read(str(word), [repr(number) for number in numbers], None, where)
    else:
        shape = foreign.shape(name, numbers, known, {}, where)
        if isinstance(shape, model.SigmoidDifference) and shape.is_reversed:
            raise ControllerFileError(
                f"{where}: the second sigmoid of {name} exceeds the first somewhere, where jFuzzyLogic takes "
                "the difference for zero, others for its absolute value; write points, (x, y) (x, y)"
            )
    return shape, _ends(shape)


def _ends(shape: MembershipFunction) -> tuple[float, float]:
    """Return the range that jFuzzyLogic gives a shape."""
    match shape:
        case model.Gaussian(mean, deviation):
            return mean - 4.0 * deviation, mean + 4.0 * deviation
        case model.TwoSidedGaussian(left, left_deviation, right, right_deviation):
            return left - 4.0 * left_deviation, right + 4.0 * right_deviation
        case model.GeneralizedBell(width, slope, centre):
            away = 999.0 ** (1.0 / (2.0 * slope)) * width
            return centre - away, centre + away
        case model.Sigmoid(inflection, slope):
            return inflection - 9.0 / abs(slope), inflection + 9.0 / abs(slope)
        case model.SigmoidDifference(first, first_slope, second, second_slope):
            ends = [
                (x - 9.0 / abs(s), x + 9.0 / abs(s))
                for x, s in ((first, first_slope), (second, second_slope))
            ]
            return min(low for low, _ in ends), max(high for _, high in ends)
    corners = shape.corners
    return (corners[0], corners[-1]) if corners else (0.0, 1.0)


def _number(tree: Node, inputs: Sequence[str], semantics: Semantics) -> MembershipFunction:
    """Return the number that a term of an output by COGS or COGF concludes."""
    line = tree.meta.line
    if tree.data == "singleton":
        return model.Constant(_numbers(tree, tree.children)[0])
    if tree.data == "formula":
        text = re.sub(r"(?i)^function", "", str(tree.children[0])).strip()
        if semantics == "fcl":
            text = re.sub(
                r"[^\W\d]\w*(?=\s*\()",
                lambda word: foreign.choice(FUNCTIONS, word[0].lower(), f"line {line}: the function"),
                text,
            )
        return foreign.concluded_formula(text, inputs, f"line {line}")
    if tree.data == "shape" and semantics == "fuzzylite":  # Tsukamoto's
        word, *words = tree.children
        return foreign.concluded(str(word), _numbers(tree, words), len(inputs), "fll", f"line {line}")
    raise ControllerFileError(
        f"line {line}: the output is a weighted average, and its term is a fuzzy set; write a number, or "
        "METHOD : COG"
    )


def _rules(
    tree: Node, operators: tuple[model.AndOperator, model.OrOperator], semantics: Semantics
) -> list[Rule]:
    """Return the rules that a RULE of the file stands for: one for each strength that it concludes with."""
    number, condition, *rest = [child for child in tree.children if not _is_word(child)]
    where = f"line {tree.meta.line}"
    weight = 1.0
    if isinstance(rest[-1], Token):
        weight = foreign.number(str(rest.pop()), where)
    conclusions = []
    for concluded in rest:
        assert isinstance(concluded, Tree)  # noqa: S101 - the grammar has nothing else here
        variable, *hedges, term = map(str, concluded.children)
        if hedges and hedges[0].lower() == "not":
            raise ControllerFileError(foreign.denied_conclusion(where, f"not {term}", semantics))
        if hedges and semantics == "fcl":
            raise ControllerFileError(f"{where}: {hedges[0][:40]!r} is no hedge of jFuzzyLogic's; drop it")
        for hedge in hedges:
            foreign.choice(FUZZYLITES, hedge, f"{where}: the hedge on a conclusion")
        conclusions.append((tuple(FUZZYLITES[hedge] for hedge in hedges), variable, term))
    assert isinstance(condition, Tree)  # noqa: S101 - likewise
    label = str(number) if isinstance(number, Token) and number.type == "NAME" else ""
    rules = hedged_rules(_antecedent(condition, semantics), conclusions, weight, where)
    return [replace(rule, label=label, and_operator=operators[0], or_operator=operators[1]) for rule in rules]


def _is_word(child: object) -> bool:
    return isinstance(child, Token) and child.type in {"THEN", "CONNECTIVE"}


def _antecedent(tree: Node, semantics: Semantics, depth: int = 0) -> Expression:
    """Return a condition; in jFuzzyLogic `and` and `or` bind alike, in fuzzylite `and` binds first."""
    if depth > MAX_NESTING:
        raise ControllerFileError(
            f"line {tree.meta.line}: nested more than {MAX_NESTING} deep; split the rule"
        )
    match str(tree.data):
        case "denied":
            return model.Not(_antecedent(tree.children[-1], semantics, depth + 1))
        case "statement":
            variable, *words = map(str, tree.children)
            is_denied = words[0].lower() == "not"
            *hedges, term = words[is_denied:]
            for hedge in hedges:
                foreign.choice(FUZZYLITES, hedge, f"line {tree.meta.line}: the hedge")
            statement = antecedents.hedged([FUZZYLITES[hedge] for hedge in hedges], model.Is(variable, term))
            return model.Not(statement) if is_denied else statement
    first, *others = [each for each in tree.children if isinstance(each, Tree)]
    words = [str(each).lower() for each in tree.children if isinstance(each, Token)]
    operands = [_antecedent(each, semantics, depth + 1) for each in (first, *others)]
    if semantics == "fuzzylite":
        return _joined_by_or(operands, words)
    joined = operands[0]
    for word, operand in zip(words, operands[1:], strict=True):
        kind = model.And if word == "and" else model.Or
        parts = joined.operands if isinstance(joined, kind) and joined is not operands[0] else (joined,)
        joined = kind((*parts, operand))
    return joined


def _joined_by_or(operands: Sequence[Expression], words: Sequence[str]) -> Expression:
    """Join operands by words of which `and` binds first."""
    groups = [[operands[0]]]
    for word, operand in zip(words, operands[1:], strict=True):
        if word == "and":
            groups[-1].append(operand)
        else:
            groups.append([operand])
    parts = tuple(group[0] if len(group) == 1 else model.And(tuple(group)) for group in groups)
    return parts[0] if len(parts) == 1 else model.Or(parts)
