"""Fuzzy Markup Language files (`.fml`, `.xml`), IEEE Std 1855: read and written, all but AnYa rule bases.

What is written has the elements of the standard: a knowledge base of variables and terms, a rule base of flat
rules with a connector, an operator and a weight each, ``not`` as the modifier of a clause. All names of a
file differ, as its schema asks.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from fis_tools import model
from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import foreign, xml
from fis_tools.formats.exchange.antecedents import operands_of, statement_of
from fis_tools.formats.exchange.carried import understand
from fis_tools.formats.exchange.dialect import Dialect, Expressed, settle
from fis_tools.formats.exchange.foreign import Extent, Table
from fis_tools.formats.exchange.vocabulary import AGGREGATIONS, AND, DEFUZZIFIERS, HEDGES, OR, meanings
from fis_tools.formats.exchange.writing import written
from fis_tools.formats.exchange.xml import Element
from fis_tools.formats.serialize import Reading, Written
from fis_tools.model.operators import WEIGHING
from fis_tools.model.shape import words_of
from fis_tools.model.systems import has_sets

DIALECT = Dialect(
    title="an FML file",
    words="fml",
    holds_units=True,
    has_unique_names=True,
    weighs_one_kind=True,
    hedges="fml",
)
_Name = TypeVar("_Name", bound=str)
#: How numbers are weighed.
_COMBINATIONS = {way: DEFUZZIFIERS[way] for way in WEIGHING}
#: Modifiers of a clause.
_MODIFIERS: dict[str, Callable[[model.Expression], model.Expression]] = {
    "not": model.Not,
    **{word: partial(model.Hedged, hedge) for word, hedge in meanings(HEDGES, "fml").items()},
}


def _tags(kind: str, prefix: str = "") -> dict[str, str]:
    """Return what the elements of a rule base are called; a clause is one of a consequent."""
    words = ("rule", "consequent", "then", "else", "clause")
    tags = {word: f"{prefix}{word.capitalize()}" if prefix else word for word in words}
    return {"base": f"{kind}RuleBase", **tags}


_MAMDANI, _TSUKAMOTO, _TSK = _tags("mamdani"), _tags("tsukamoto"), _tags("tsk", prefix="tsk")
_RULE_BASES = {tags["base"]: tags for tags in (_MAMDANI, _TSK, _TSUKAMOTO)}

NAMESPACE = "http://www.ieee1855.org"

_FLANKS: foreign.FlankWords = {
    "rightLinearShape": foreign.rising,
    "leftLinearShape": foreign.falling,
    "rectangularShape": foreign.level,
}


def write(controller: model.FuzzyController) -> Written:
    """Write a controller with one system; see `fis_tools.formats.exchange.writing.written`."""
    return written(controller, DIALECT, "fml.jinja", _facts)


def _facts(expressed: Expressed) -> dict[str, Any]:
    system = expressed.system
    variables = (*system.inputs, *system.outputs)
    taken = {system.name, *(v.name for v in variables), *(term.name for v in variables for term in v.terms)}
    is_number = not all(map(has_sets, system.outputs))
    return {
        "namespace": NAMESPACE,
        "tags": _TSK if is_number else _TSUKAMOTO if system.weighed else _MAMDANI,
        "has_sets": has_sets,
        "coefficients": partial(_coefficients, num_inputs=len(system.inputs)),
        "shape": _shape,
        "unused": partial(_unused, taken=taken),
        "connector": lambda rule: "or" if isinstance(rule.antecedent, model.Or) else "and",
        "clauses": _clauses,
    }


def _unused(name: str, taken: set[str]) -> str:
    return name if name not in taken else _unused(f"{name}_", taken)


def _coefficients(term: model.Term, num_inputs: int) -> list[float]:
    """Return a number's constant, then the factor of each input."""
    shape = term.membership
    assert isinstance(shape, model.Constant | model.Linear)  # noqa: S101 - any other has been refused
    *factors, constant = shape.row(num_inputs if isinstance(shape, model.Linear) else 0)
    return [float(constant), *map(float, factors)]


def _shape(variable: model.Variable, term: model.Term) -> tuple[str, list[Any]]:
    """Return the element of a term, and its numbers or points."""
    shape = term.membership
    if isinstance(shape, model.Sampled):
        points = zip(variable.universe.tolist(), shape.values, strict=True)
        return "pointSetShape", [(float(x), float(y)) for x, y in points]
    if isinstance(shape, model.Ramp):
        side = "right" if shape.start < shape.end else "left"
        return f"{side}LinearShape", sorted((float(shape.start), float(shape.end)))
    word, *order = shape.entry.words["fml"]
    return word, [float(getattr(shape, name)) for name in order or shape.entry.kinds]


def _clauses(rule: model.Rule) -> Iterator[tuple[str, model.Is]]:
    """Yield each statement of an antecedent with the modifier before it, or none."""
    for leaf in operands_of(rule.antecedent):
        statement = statement_of(leaf)
        word = HEDGES[leaf.hedge].fml if isinstance(leaf, model.Hedged) else "not"
        yield "" if leaf == statement else word, statement


# Reading.


def read(text: str) -> Reading:
    """Read an FML file.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If it is damaged or hostile, or says what a fuzzy system of ours cannot; with the line.
    """
    root, comments = xml.read(text)
    return understand(_system(root), comments, DIALECT)


def _system(root: Element) -> model.FuzzySystem:
    if root.kind != "fuzzySystem":
        raise ControllerFileError(
            f"line {root.line}: the document is a {root.kind[:40]!r}; expected a 'fuzzySystem' of IEEE 1855"
        )
    bases = list(root.all("knowledgeBase"))
    rule_bases = [child for child in root.children if child.kind != "knowledgeBase"]
    for base in rule_bases:
        foreign.choice(_RULE_BASES, base.kind, f"line {base.line}:")
    if len(bases) != 1 or len(rule_bases) != 1:
        raise ControllerFileError(
            f"the system has {len(bases)} knowledge bases and {len(rule_bases)} rule bases; expected one each"
        )
    is_input = [child.entry("type", "input")[1].lower() != "output" for child in bases[0].children]
    variables = [_variable(child, sum(is_input)) for child in bases[0].children]
    (rule_base,) = rule_bases
    tags = _RULE_BASES[rule_base.kind]
    implication: model.AndOperator = "min"
    if tags is _MAMDANI:  # numbers are weighed, not implied
        implication = rule_base.chosen(meanings(AND, "fml"), "activationMethod", "MIN")
    return settle(
        model.FuzzySystem(
            name=root.entry("name", "")[1] or "unnamed",
            inputs=tuple(variable for variable, is_output in variables if not is_output),
            outputs=tuple(variable for variable, is_output in variables if is_output),
            rules=tuple(_rule(child, rule_base, tags) for child in rule_base.children),
            and_operator=rule_base.chosen(meanings(AND, "fml"), "andMethod", "MIN"),
            or_operator=rule_base.chosen(meanings(OR, "fml"), "orMethod", "MAX"),
            implication=implication,
        )
    )


def _number_term(element: Element, num_inputs: int) -> tuple[str, model.Number]:
    """Read a term that is a number."""
    _, order = element.entry("order")
    element.expect("order", "0", "1")
    texts = [value.text for value in element.all("tskValue")]
    constant, *factors = foreign.numbers(texts, f"line {element.line}") or [0.0]
    expected = num_inputs + 1 if order == "1" else 1
    if element.kind != "tskTerm" or len(texts) != expected:
        raise ControllerFileError(
            f"line {element.line}: {element.kind[:40]!r} has {len(texts)} values; expected a 'tskTerm' of "
            f"{expected}, the constant first"
        )
    shape = model.Linear(tuple(factors), constant) if order == "1" else model.Constant(constant)
    return element.entry("name")[1], shape


def _variable(element: Element, num_inputs: int) -> tuple[model.Variable, bool]:
    """Read a variable, and whether it is an output; one whose terms are numbers has no range."""
    is_number, is_tsukamoto = element.kind == "tskVariable", element.kind == "tsukamotoVariable"
    terms: Sequence[tuple[str, model.MembershipFunction | Table]]
    if is_number:
        is_output, extent = True, Extent(0.0, 0.0)
        terms = [_number_term(child, num_inputs) for child in element.children]
    else:
        if element.kind != "fuzzyVariable" and not is_tsukamoto:
            raise ControllerFileError(
                f"line {element.line}: {element.kind[:40]!r} cannot be read; expected a 'fuzzyVariable'"
            )
        element.expect("type", "input", "output")
        is_output = element.entry("type", "input")[1].lower() == "output"
        extent = Extent(element.number("domainleft"), element.number("domainright"))
        terms = [_term(child, extent, is_tsukamoto=is_tsukamoto) for child in element.children]
    defuzzifier: model.Defuzzifier | None = None
    aggregation: model.Aggregation = "max"
    if is_number or is_tsukamoto:
        defuzzifier = element.chosen(meanings(_COMBINATIONS, "fml"), "combination", "WA")
        aggregation = "unbounded_sum"
    elif is_output:
        aggregation = element.chosen(meanings(AGGREGATIONS, "fml"), "accumulation", "MAX")
        defuzzifier = element.chosen(meanings(DEFUZZIFIERS, "fml"), "defuzzifier", "COG")
    variable = foreign.variable(
        element.entry("name")[1],
        extent,
        terms,
        is_output=is_output,
        unit=element.entry("scale", "")[1],
        # where a file says nothing, the standard says 0
        default=element.number("defaultValue", "0") if is_output else None,
        defuzzifier=defuzzifier,
        aggregation=aggregation,
    )
    return variable, is_output


def _term(
    element: Element, extent: Extent, *, is_tsukamoto: bool
) -> tuple[str, model.MembershipFunction | Table]:
    where, tag = f"line {element.line}", "tsukamotoTerm" if is_tsukamoto else "fuzzyTerm"
    if element.kind != tag or len(element.children) != 1:
        raise ControllerFileError(
            f"{where}: expected a {tag!r} with one shape; correct {element.kind[:40]!r}"
        )
    element.expect("complement", "false")
    (shape,) = element.children
    name = element.entry("name")[1]
    if shape.kind == "pointSetShape":
        shape.expect("interpolationMethod", "linear")
        pairs = [(point.number("x"), point.number("y")) for point in shape.all("point")]
        return name, foreign.table([number for pair in pairs for number in pair], f"line {shape.line}")
    numbers = sorted(key for key in shape.settings if key.startswith("param"))
    values = [shape.number(key) for key in numbers]
    if is_tsukamoto:
        return name, _monotone(shape, values, extent)
    if shape.kind in {"leftGaussianShape", "rightGaussianShape"}:
        return name, _half_gaussian(shape, values, extent)
    return name, foreign.shape(shape.kind, values, extent, words_of("fml"), _FLANKS, f"line {shape.line}")


def _monotone(shape: Element, values: Sequence[float], extent: Extent) -> model.MembershipFunction:
    """Read what a rule of Tsukamoto's can conclude."""
    where = f"line {shape.line}"
    known = {word: pair for word, pair in words_of("fml").items() if word in {"sShape", "zShape"}}
    known["rightLinearShape"] = known["leftLinearShape"] = (model.Ramp, ("start", "end"))
    ordered = values[::-1] if shape.kind == "leftLinearShape" else values
    return foreign.shape(shape.kind, ordered, extent, known, {}, where)


def _half_gaussian(shape: Element, values: Sequence[float], extent: Extent) -> model.TwoSidedGaussian:
    """Read a Gaussian that is one on one side of its mean."""
    if len(values) != 2:
        raise ControllerFileError(f"line {shape.line}: {shape.kind} has {len(values)} numbers; expected 2")
    mean, width = values
    if shape.kind == "leftGaussianShape":
        return model.TwoSidedGaussian(min(mean, extent.low), width, mean, width)
    return model.TwoSidedGaussian(mean, width, max(mean, extent.high), width)


def _rule(element: Element, base: Element, tags: Mapping[str, str]) -> model.Rule:
    where = f"line {element.line}"
    if element.kind != tags["rule"]:
        raise ControllerFileError(f"{where}: expected a {tags['rule']!r}; correct {element.kind[:40]!r}")
    element.expect("connector", "and", "or")
    is_or = element.entry("connector", "and")[1].lower() == "or"
    joined = replace(element, settings={**base.settings, **element.settings})
    weight = element.number("weight", "1")
    leaves = [_leaf(clause) for clause in _only(element, "antecedent").children]
    consequent = _only(element, tags["consequent"])
    if any(True for _ in consequent.all(tags["else"])):
        raise ControllerFileError(
            f"{where}: 'else' cannot be read; write it as a rule of its own, with 'not'"
        )
    concluded = [
        _clause_of(clause, tag=tags["clause"]) for clause in _only(consequent, tags["then"]).children
    ]
    if not leaves or not concluded:
        raise ControllerFileError(
            f"{where}: the rule asks or concludes nothing; give it a clause on each side"
        )
    return model.Rule(
        leaves[0] if len(leaves) == 1 else (model.Or if is_or else model.And)(tuple(leaves)),
        tuple(model.Consequent(variable, term, weight) for variable, term in concluded),
        and_operator=joined.chosen(meanings(AND, "fml"), "andMethod", "MIN"),
        or_operator=joined.chosen(meanings(OR, "fml"), "orMethod", "MAX"),
    )


def _only(element: Element, name: str) -> Element:
    found = list(element.all(name))
    if len(found) != 1:
        raise ControllerFileError(
            f"line {element.line}: {element.kind} has {len(found)} {name}; expected one"
        )
    return found[0]


def _leaf(element: Element) -> model.Expression:
    """Read a clause of an antecedent."""
    modifier = element.entry("modifier", "")[1]
    statement = model.Is(*_clause_of(element, _MODIFIERS))
    return _MODIFIERS[modifier](statement) if modifier else statement


def _clause_of(element: Element, modifiers: Iterable[str] = (), *, tag: str = "clause") -> tuple[str, str]:
    """Return the variable and the term of a clause."""
    if element.kind != tag:
        raise ControllerFileError(f"line {element.line}: expected a {tag!r}; correct {element.kind[:40]!r}")
    modifier = element.entry("modifier", "")[1]
    if modifier and modifier not in modifiers:
        raise ControllerFileError(
            f"line {element.line}: the modifier {modifier[:40]!r} cannot be read; define a term for it"
        )
    return _only(element, "variable").text.strip(), _only(element, "term").text.strip()
