"""Fuzzy Markup Language files (`.fml`, `.xml`), IEEE Std 1855: read and written, Mamdani rule bases.

What is written has the elements of the standard: a knowledge base of variables and terms, a rule base of flat
rules with a connector, an operator and a weight each, ``not`` as the modifier of a clause. All names of a
file differ, as its schema asks. Shapes that the standard does not know are written as its custom shapes,
which only `fis_tools` reads.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from html import escape

from fis_tools.formats.error import ControllerFileError
from fis_tools.formats.exchange import foreign, xml
from fis_tools.formats.exchange.antecedents import operands_of, statement_of
from fis_tools.formats.exchange.carried import Reading, Written, comment, understand
from fis_tools.formats.exchange.dialect import Dialect, only_system, say, settle
from fis_tools.formats.exchange.foreign import Extent, Table
from fis_tools.formats.exchange.losses import losses
from fis_tools.formats.exchange.methods import AGGREGATIONS, AND, DEFUZZIFIERS, HEDGES, OR, meanings
from fis_tools.formats.exchange.xml import Element
from fis_tools.model import (
    Aggregation,
    And,
    Consequent,
    Defuzzifier,
    Expression,
    FuzzyController,
    FuzzySystem,
    Hedged,
    Is,
    MembershipFunction,
    Not,
    Or,
    Rule,
    Sampled,
    Term,
    TwoSidedGaussian,
    Variable,
)
from fis_tools.model.shape import SHAPES, words_of

DIALECT = Dialect(
    title="an FML file", holds_units=True, has_unique_names=True, has_weighed_outputs=False, hedges="fml"
)
#: Modifiers of a clause.
_MODIFIERS: dict[str, Callable[[Expression], Expression]] = {
    "not": Not,
    **{word: partial(Hedged, hedge) for word, hedge in meanings(HEDGES, "fml").items()},
}

NAMESPACE = "http://www.ieee1855.org"

#: What the names of shapes beyond the standard begin with; the rest is our own name.
CUSTOM = "custom_"
_FLANKS: foreign.FlankWords = {
    "rightLinearShape": foreign.rising,
    "leftLinearShape": foreign.falling,
    "rectangularShape": foreign.level,
}


def write(controller: FuzzyController) -> Written:
    """Write a controller with one system.

    Raises
    ------
    fis_tools.formats.exchange.antecedents.NotExpressible
        If the format cannot say what the system computes.
    fis_tools.model.validate.InvalidSystem
        If something is wrong with the controller.
    """
    carried = comment(controller)
    said = say(only_system(controller, DIALECT), DIALECT)
    system = said.system
    taken = {system.name, *(v.name for v in (*system.inputs, *system.outputs))}
    taken |= {term.name for variable in (*system.inputs, *system.outputs) for term in variable.terms}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<!-- {carried} -->",
        f'<fuzzySystem xmlns="{NAMESPACE}"{_attributes(name=system.name)}>',
        "  <knowledgeBase>",
        *(line for variable in system.inputs for line in _variable_lines(system, variable, is_output=False)),
        *(line for variable in system.outputs for line in _variable_lines(system, variable, is_output=True)),
        "  </knowledgeBase>",
        "  <mamdaniRuleBase"
        + _attributes(
            name=_unused("rules", taken),
            activationMethod=AND[system.implication].fml,
            andMethod=AND[system.and_operator].fml,
            orMethod=OR[system.or_operator].fml,
        )
        + ">",
    ]
    for place, rule in enumerate(system.rules, start=1):
        lines += _rule_lines(system, rule, _unused(f"rule_{place}", taken))
    lines += ["  </mamdaniRuleBase>", "</fuzzySystem>"]
    return Written("\n".join(lines) + "\n", (*losses(controller, said, DIALECT), *_strangers(system)))


def _unused(name: str, taken: set[str]) -> str:
    return name if name not in taken else _unused(f"{name}_", taken)


def _attributes(**words: str) -> str:
    return "".join(f' {key}="{escape(word)}"' for key, word in words.items())


def _variable_lines(system: FuzzySystem, variable: Variable, *, is_output: bool) -> Iterator[str]:
    words = {
        "name": variable.name,
        "scale": variable.unit,
        "domainleft": repr(variable.minimum),
        "domainright": repr(variable.maximum),
        "type": "output" if is_output else "input",
    }
    if is_output:
        defuzzifier = system.defuzzifier_of(variable)
        words["accumulation"] = AGGREGATIONS[variable.aggregation].fml
        words["defuzzifier"] = DEFUZZIFIERS[defuzzifier].fml
        words["defaultValue"] = repr(variable.default)
    yield f"    <fuzzyVariable{_attributes(**words)}>"
    for term in variable.terms:
        yield f"      <fuzzyTerm{_attributes(name=term.name, complement='false')}>"
        yield from (f"        {line}" for line in _shape_lines(variable, term))
        yield "      </fuzzyTerm>"
    yield "    </fuzzyVariable>"


def _shape_lines(variable: Variable, term: Term) -> Iterator[str]:
    if isinstance(term.membership, Sampled):
        yield '<pointSetShape interpolationMethod="linear">'
        for x, y in foreign.sampled_points(variable, term.membership):
            yield f"  <point{_attributes(x=repr(x), y=repr(y))}/>"
        yield "</pointSetShape>"
        return
    if _is_standard(term):
        word, values = foreign.shape_words(term.membership, "fml")
        numbers = {f"param{place}": repr(value) for place, value in enumerate(values, start=1)}
        yield f"<{word}{_attributes(**numbers)}/>"
        return
    entry = term.membership.entry
    yield f'<customShape name="{CUSTOM}{entry.name}">'
    for name in entry.kinds:
        yield f"  <parameter{_attributes(value=repr(float(getattr(term.membership, name))))}/>"
    yield "</customShape>"


def _is_standard(term: Term) -> bool:
    return "fml" in term.membership.entry.words


def _custom_shapes() -> foreign.ShapeWords:
    """Return the shapes beyond the standard, with all their numbers in the order of the model."""
    return {
        f"{CUSTOM}{name}": (kind, tuple(kind.entry.kinds))
        for name, kind in SHAPES.items()
        if kind.entry.kinds and "fml" not in kind.entry.words
    }


def _rule_lines(system: FuzzySystem, rule: Rule, name: str) -> Iterator[str]:
    words = {
        "name": name,
        "andMethod": AND[system.and_operator_of(rule)].fml,
        "orMethod": OR[system.or_operator_of(rule)].fml,
        "connector": "or" if isinstance(rule.antecedent, Or) else "and",
        "weight": repr(rule.consequents[0].weight),
    }
    yield f"    <rule{_attributes(**words)}>"
    yield "      <antecedent>"
    for leaf in operands_of(rule.antecedent):
        statement = statement_of(leaf)
        word = HEDGES[leaf.hedge].fml if isinstance(leaf, Hedged) else "not"
        modifier = _attributes(modifier=word) if leaf != statement else ""
        yield _clause(statement.variable, statement.term, modifier, 8)
    yield "      </antecedent>"
    yield "      <consequent>"
    yield "        <then>"
    yield from (_clause(c.variable, c.term, "", 10) for c in rule.consequents)
    yield "        </then>"
    yield "      </consequent>"
    yield "    </rule>"


def _clause(variable: str, term: str, modifier: str, indent: int) -> str:
    inside = f"<variable>{variable}</variable><term>{term}</term>"
    return f"{' ' * indent}<clause{modifier}>{inside}</clause>"


def _strangers(system: FuzzySystem) -> Iterator[str]:
    """Tell what only `fis_tools` reads."""
    custom = [
        f"{variable.name} {term.name}"
        for variable in (*system.inputs, *system.outputs)
        for term in variable.terms
        if not _is_standard(term) and not isinstance(term.membership, Sampled)
    ]
    if custom:
        names = ", ".join(custom)
        yield f"IEEE 1855 does not know the shapes of {names}: they are custom shapes, which fis_tools reads"


# Reading.


def read(text: str) -> Reading:
    """Read an FML file.

    Raises
    ------
    fis_tools.formats.error.ControllerFileError
        If it is damaged or hostile, or says what a fuzzy system of ours cannot; with the line.
    """
    root, comments = xml.read(text)
    return understand(_system(root), comments, DIALECT)


def _system(root: Element) -> FuzzySystem:
    if root.name != "fuzzySystem":
        raise ControllerFileError(
            f"line {root.line}: the document is a {root.name[:40]!r}; expected a 'fuzzySystem' of IEEE 1855"
        )
    bases = list(root.all("knowledgeBase"))
    rule_bases = [child for child in root.children if child.name != "knowledgeBase"]
    for base in rule_bases:
        if base.name != "mamdaniRuleBase":
            raise ControllerFileError(
                f"line {base.line}: {base.name[:40]!r} cannot be read; expected 'mamdaniRuleBase': "
                "Takagi-Sugeno, Tsukamoto and AnYa rule bases are not read; export the system as .fll or .fis"
            )
    if len(bases) != 1 or len(rule_bases) != 1:
        raise ControllerFileError(
            f"the system has {len(bases)} knowledge bases and {len(rule_bases)} rule bases; expected one each"
        )
    variables = [_variable(child) for child in bases[0].children]
    (rule_base,) = rule_bases
    activation = rule_base.attributes.get("activationMethod", "MIN")
    conjunction, disjunction = (
        rule_base.attributes.get("andMethod", "MIN"),
        rule_base.attributes.get("orMethod", "MAX"),
    )
    return settle(
        FuzzySystem(
            name=root.attributes.get("name", "").strip() or "unnamed",
            inputs=tuple(variable for variable, is_output in variables if not is_output),
            outputs=tuple(variable for variable, is_output in variables if is_output),
            rules=tuple(_rule(child, rule_base) for child in rule_base.children),
            and_operator=foreign.choice(
                meanings(AND, "fml"), conjunction, f"line {rule_base.line}: andMethod", ""
            ),
            or_operator=foreign.choice(
                meanings(OR, "fml"), disjunction, f"line {rule_base.line}: orMethod", ""
            ),
            implication=foreign.choice(
                meanings(AND, "fml"), activation, f"line {rule_base.line}: activationMethod", ""
            ),
        )
    )


def _attribute(element: Element, key: str) -> str:
    if key not in element.attributes:
        raise ControllerFileError(f"line {element.line}: {element.name} has no {key}; add it")
    return element.attributes[key].strip()


def _number(element: Element, key: str) -> float:
    return foreign.number(_attribute(element, key), f"line {element.line}: {key}")


def _expect(element: Element, key: str, allowed: Sequence[str]) -> None:
    word = element.attributes.get(key, allowed[0])
    if word.upper() not in allowed:
        raise ControllerFileError(
            f"line {element.line}: {key} is {word[:40]!r} and cannot be read; expected {' or '.join(allowed)}"
        )


def _variable(element: Element) -> tuple[Variable, bool]:
    if element.name != "fuzzyVariable":
        raise ControllerFileError(
            f"line {element.line}: {element.name[:40]!r} cannot be read; expected a 'fuzzyVariable'"
        )
    _expect(element, "type", ("INPUT", "OUTPUT"))
    is_output = element.attributes.get("type", "input").lower() == "output"
    extent = Extent(_number(element, "domainleft"), _number(element, "domainright"))
    terms = [_term(child, extent) for child in element.children]
    defuzzifier: Defuzzifier | None = None
    aggregation: Aggregation = "max"
    if is_output:
        word = element.attributes.get("accumulation", "MAX")
        where = f"line {element.line}: the accumulation"
        aggregation = foreign.choice(meanings(AGGREGATIONS, "fml"), word, where, "")
        word = element.attributes.get("defuzzifier", "COG")
        defuzzifier = foreign.choice(
            meanings(DEFUZZIFIERS, "fml"), word, f"line {element.line}: the defuzzifier", ""
        )
    return (
        foreign.variable(
            _attribute(element, "name"),
            extent,
            terms,
            is_output=is_output,
            unit=element.attributes.get("scale", "").strip(),
            default=_default(element) if is_output else None,
            defuzzifier=defuzzifier,
            aggregation=aggregation,
        ),
        is_output,
    )


def _default(element: Element) -> float:
    """Return what an output is when no rule fires; the standard says 0 where a file says nothing."""
    return _number(element, "defaultValue") if "defaultValue" in element.attributes else 0.0


def _term(element: Element, extent: Extent) -> tuple[str, MembershipFunction | Table]:
    where = f"line {element.line}"
    if element.name != "fuzzyTerm" or len(element.children) != 1:
        raise ControllerFileError(
            f"{where}: expected a 'fuzzyTerm' with one shape; correct {element.name[:40]!r}"
        )
    _expect(element, "complement", ("FALSE",))
    (shape,) = element.children
    name = _attribute(element, "name")
    if shape.name == "pointSetShape":
        _expect(shape, "interpolationMethod", ("LINEAR",))
        pairs = [(_number(point, "x"), _number(point, "y")) for point in shape.all("point")]
        return name, foreign.table([number for pair in pairs for number in pair], f"line {shape.line}")
    if shape.name == "customShape":
        values = [_number(parameter, "value") for parameter in shape.all("parameter")]
        return name, foreign.shape(
            _attribute(shape, "name"), values, extent, _custom_shapes(), {}, f"line {shape.line}"
        )
    numbers = sorted(key for key in shape.attributes if key.startswith("param"))
    values = [_number(shape, key) for key in numbers]
    if shape.name in {"leftGaussianShape", "rightGaussianShape"}:
        return name, _half_gaussian(shape, values, extent)
    return name, foreign.shape(shape.name, values, extent, words_of("fml"), _FLANKS, f"line {shape.line}")


def _half_gaussian(shape: Element, values: Sequence[float], extent: Extent) -> TwoSidedGaussian:
    """Read a Gaussian that is one on one side of its mean."""
    if len(values) != 2:
        raise ControllerFileError(f"line {shape.line}: {shape.name} has {len(values)} numbers; expected 2")
    mean, width = values
    if shape.name == "leftGaussianShape":
        return TwoSidedGaussian(min(mean, extent.low), width, mean, width)
    return TwoSidedGaussian(mean, width, max(mean, extent.high), width)


def _rule(element: Element, base: Element) -> Rule:
    where = f"line {element.line}"
    if element.name != "rule":
        raise ControllerFileError(f"{where}: expected a 'rule'; correct {element.name[:40]!r}")
    _expect(element, "connector", ("AND", "OR"))
    is_or = element.attributes.get("connector", "and").lower() == "or"
    words = {**base.attributes, **element.attributes}
    weight = foreign.number(element.attributes.get("weight", "1"), f"{where}: the weight")
    leaves = [_leaf(clause) for clause in _only(element, "antecedent").children]
    consequent = _only(element, "consequent")
    if any(True for _ in consequent.all("else")):
        raise ControllerFileError(
            f"{where}: 'else' cannot be read; write it as a rule of its own, with 'not'"
        )
    concluded = [_clause_of(clause) for clause in _only(consequent, "then").children]
    if not leaves or not concluded:
        raise ControllerFileError(
            f"{where}: the rule asks or concludes nothing; give it a clause on each side"
        )
    rule = Rule(
        leaves[0] if len(leaves) == 1 else Or(tuple(leaves)) if is_or else And(tuple(leaves)),
        tuple(Consequent(variable, term, weight) for variable, term in concluded),
    )
    return replace(
        rule,
        and_operator=foreign.choice(
            meanings(AND, "fml"), words.get("andMethod", "MIN"), f"{where}: andMethod", ""
        ),
        or_operator=foreign.choice(
            meanings(OR, "fml"), words.get("orMethod", "MAX"), f"{where}: orMethod", ""
        ),
    )


def _only(element: Element, name: str) -> Element:
    found = list(element.all(name))
    if len(found) != 1:
        raise ControllerFileError(
            f"line {element.line}: {element.name} has {len(found)} {name}; expected one"
        )
    return found[0]


def _leaf(element: Element) -> Expression:
    """Read a clause of an antecedent."""
    modifier = element.attributes.get("modifier", "")
    statement = Is(*_clause_of(element, _MODIFIERS))
    return _MODIFIERS[modifier](statement) if modifier else statement


def _clause_of(element: Element, modifiers: Iterable[str] = ()) -> tuple[str, str]:
    """Return the variable and the term of a clause."""
    if element.name != "clause":
        raise ControllerFileError(f"line {element.line}: expected a 'clause'; correct {element.name[:40]!r}")
    modifier = element.attributes.get("modifier", "")
    if modifier and modifier not in modifiers:
        raise ControllerFileError(
            f"line {element.line}: the modifier {modifier[:40]!r} cannot be read; define a term for it"
        )
    return _only(element, "variable").text.strip(), _only(element, "term").text.strip()
