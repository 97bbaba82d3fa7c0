"""MATLAB's `.fis` files: read and written; Mamdani and Sugeno systems, and Tsukamoto's as fuzzylite has them.

The form is that of Fuzzy Logic Toolbox's `writefis`; GNU Octave's `readfis` and fuzzylite read it too. A
Gaussian's numbers are the standard deviation and the mean, in this order. A rule is a line of term numbers,
0 where it does not speak of a variable and negative for `not`: ``1 -2, 3 (0.5) : 1``, weight in parentheses,
1 for `and`, 2 for `or`.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from fis_tools import model
from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import antecedents, foreign, vocabulary
from fis_tools.formats.exchange.dialect import Dialect, Expressed
from fis_tools.formats.exchange.fis_sections import (
    quoted_word,
    section_of,
    sections_of,
    whole_number,
    words_in,
)
from fis_tools.formats.exchange.fll_rules import hedged_rules
from fis_tools.formats.exchange.foreign import FileBlock
from fis_tools.formats.exchange.vocabulary import AGGREGATIONS, AND, DEFUZZIFIERS, OR, meanings
from fis_tools.formats.exchange.writing import term_words, understand, written
from fis_tools.formats.serialize import Reading, Written
from fis_tools.model import Expression, FuzzySystem, Hedge, Rule, Semantics, Term, Variable
from fis_tools.model.operators import WEIGHING
from fis_tools.model.systems import with_joint_operators

DIALECT = Dialect(
    title="a .fis file",
    semantics="matlab",
    words="fis",
    holds_defaults=False,
    repeats_variables=False,
    has_rule_operators=False,
    has_output_methods=False,
    has_walls=False,
)
_WORDS = foreign.TermWords(
    "fis",
    {
        "linsmf": foreign.rising,
        "linzmf": foreign.falling,
        "rectmf": foreign.level,
        "rampmf": foreign.ramp,
        "binarymf": foreign.step,
    },
    "wtaver and wtsum",
)
#: fuzzylite writes nothing where no rule needs an operator.
_AND: dict[str, model.AndOperator] = {"": "min", **meanings(AND, "fis"), "algebraic_product": "product"}
_OR: dict[str, model.OrOperator] = {
    "": "max",
    **meanings(OR, "fis"),
    "algebraic_sum": "probabilistic_sum",
    **vocabulary.NORMALIZED_SUMS,
}
_AGGREGATIONS: dict[str, model.Aggregation] = {**meanings(AGGREGATIONS, "fis"), **_OR}


def write(controller: model.FuzzyController) -> Written:
    """Write a controller with one system; see `fis_tools.formats.exchange.writing.written`."""
    return written(controller, DIALECT, "fis.jinja", _facts)


def _facts(expressed: Expressed) -> dict[str, Any]:
    """Return what the template needs."""
    system, kind = expressed.system, "mamdani"
    if system.weighed:
        kind = "tsukamoto" if system.outputs[0].has_sets else "sugeno"
    return {
        "kind": kind,
        "words": term_words,
        "rules": [_rule_numbers(system, rule) for rule in system.rules],
    }


def _rule_numbers(system: FuzzySystem, rule: Rule) -> tuple[list[int], list[int], float, int]:
    """Return a rule's term numbers of inputs and of outputs, its weight, and how its statements join."""
    conditions: dict[str, int] = {}
    for leaf in antecedents.operands_of(rule.antecedent):
        statement = antecedents.statement_of(leaf)
        index = system.variable(statement.variable).term_index(statement.term) + 1
        conditions[statement.variable] = -index if isinstance(leaf, model.Not) else index
    concluded = {c.variable: system.variable(c.variable).term_index(c.term) + 1 for c in rule.consequents}
    left, right = (
        [numbers.get(variable.name, 0) for variable in variables]
        for numbers, variables in ((conditions, system.inputs), (concluded, system.outputs))
    )
    return left, right, rule.consequents[0].weight, 2 if isinstance(rule.antecedent, model.Or) else 1


#: What files of interval type-2 systems have.
_TYPE_2 = re.compile(r"(?im)^\s*(MF\d+[UL]\s*=|Type\w*Red\w*\s*=|Type\s*=\s*['\"]\w*type-?2)")


def read(text: str) -> Reading:
    """Read a `.fis` file.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If it is damaged or says what a fuzzy system of ours cannot; with the line.
    """
    foreign.require_short_words(text)
    notes: list[str] = []
    if _TYPE_2.search(text):
        raise ControllerFileError(
            "the file has interval type-2 sets, which no two programs write alike; they are read from YAML, "
            "as shape: between"
        )
    sections, comments = sections_of(text, notes)
    is_fuzzylites = any("generated with fuzzylite" in words for _, words in comments)
    fractions = antecedents.FUZZYLITES_FRACTIONS if is_fuzzylites else antecedents.FRACTIONS
    reading = understand(_system(sections, fractions, notes), comments, DIALECT)
    return replace(reading, assumptions=(*reading.assumptions, *notes))


#: Kinds of systems; hybrid is fuzzylite's word for outputs of several kinds.
_TYPES = ("mamdani", "sugeno", "tsukamoto", "hybrid")
#: What stands for hedges in the fraction of a term's number; fuzzylite's for `any`.
Fractions = Mapping[float, tuple[Hedge, ...]]
_ANY = 0.99


def _system(sections: dict[str, FileBlock], fractions: Fractions, notes: list[str]) -> FuzzySystem:
    """Build the system that the sections of a `.fis` file describe."""
    head = section_of(sections, "[System]")
    kind, stands = quoted_word(head, "Type")
    if kind not in _TYPES:
        raise ControllerFileError(f"{stands} is {kind[:40]!r}; expected one of {', '.join(_TYPES)}")
    method, where = quoted_word(head, "DefuzzMethod")
    defuzzifier = foreign.choice(meanings(DEFUZZIFIERS, "fis"), method, where)
    weighs = defuzzifier in WEIGHING
    if weighs == (kind in {"mamdani", "hybrid"}):
        raise ControllerFileError(
            f"{stands} is {kind!r}, but {where} is {method!r}; outputs of mamdani are defuzzified, those of "
            "sugeno and tsukamoto by wtaver or wtsum: correct one of them"
        )
    counts = {key: whole_number(head, key) for key in ("NumInputs", "NumOutputs", "NumRules")}
    expected = [f"[Input{index}]" for index in range(1, counts["NumInputs"] + 1)]
    expected += [f"[Output{index}]" for index in range(1, counts["NumOutputs"] + 1)]
    for title, section in sections.items():
        if title not in {*expected, "[System]", "[Rules]"}:
            raise ControllerFileError(
                f"line {section.line}: {title[:40]} is not one of the sections that [System] counts; "
                "correct NumInputs or NumOutputs, or drop it"
            )
    by_title = {title: section_of(sections, title) for title in expected}
    inputs = [_variable(by_title[title], None, notes) for title in expected if title.startswith("[Input")]
    names = [variable.name for variable in inputs]
    outputs = []
    for title in expected[len(inputs) :]:
        is_number = weighs or (kind == "hybrid" and _concludes_numbers(by_title[title]))
        output = _variable(by_title[title], names if is_number else None, notes)
        if is_number and not weighs:
            output = replace(output, defuzzifier="weighted_average")
            notes.append(f"{output.name} concludes numbers: their weighted average is taken")
        outputs.append(replace(output, aggregation="unbounded_sum") if is_number else output)
    lines = section_of(sections, "[Rules]").listed
    if len(lines) < counts["NumRules"]:
        raise ControllerFileError(
            f"[System] says NumRules={counts['NumRules']} but [Rules] has {len(lines)} lines; correct the "
            "number, or get a whole copy of the file"
        )
    if len(lines) > counts["NumRules"]:
        notes.append(f"[System] says NumRules={counts['NumRules']} but has {len(lines)} rules: all are taken")
    rules = tuple(
        rule for line, content in lines for rule in _rules(line, content, inputs, outputs, fractions)
    )
    and_operator = foreign.choice(_AND, *quoted_word(head, "AndMethod"), "or rewrite the rules")
    or_operator = foreign.choice(_OR, *quoted_word(head, "OrMethod"), "or rewrite the rules")
    aggregation = foreign.choice(_AGGREGATIONS, *quoted_word(head, "AggMethod"))
    implication = foreign.choice(_AND, *quoted_word(head, "ImpMethod"))
    name = (quoted_word(head, "Name")[0] if "Name" in head.settings else "") or "unnamed"
    outputs = [_with_complements(output, rules) for output in outputs]
    joined = tuple(o if o.aggregation != "max" else replace(o, aggregation=aggregation) for o in outputs)
    methods = (and_operator, or_operator, defuzzifier)
    read = FuzzySystem(name, antecedents.with_any(inputs, rules), joined, rules, *methods)
    read = replace(read, semantics="matlab")
    return with_joint_operators(
        read if weighs else replace(read, implication=implication)
    )  # MATLAB states an implication always


def _concludes_numbers(section: FileBlock) -> bool:
    """Return whether an output's terms are numbers, which only weighted defuzzifiers take."""
    values = [value for key, (_, value) in section.settings.items() if key.startswith("MF")]
    return all(re.search(r":\s*['\"](constant|linear|function)['\"]", value) for value in values)


def _variable(section: FileBlock, weighed_by: Sequence[str] | None, notes: list[str]) -> Variable:
    """Read a variable; for a weighted output, `weighed_by` are the names of the inputs."""
    is_output = section.kind.startswith("[Output")
    name, _ = quoted_word(section, "Name")
    section.expect("Enabled", "1", "1.0")
    if weighed_by is not None:
        section.expect("LockRange", "0", "0.0")
    if section.chosen({"0": False, "1": True}, "LockPrevious", "0"):
        notes.append(foreign.kept_words(name))
    num_terms = whole_number(section, "NumMFs", 1 if is_output else 0)
    keys_given = [key for key in section.settings if key.startswith("MF")]
    keys = [f"MF{index}" for index in range(1, max(num_terms, len(keys_given)) + 1)]
    if sorted(keys_given) != sorted(keys):
        raise ControllerFileError(
            f"{section.kind} says NumMFs={num_terms} but has {', '.join(keys_given) or 'none'}; number them "
            "from MF1 on, or get a whole copy of the file"
        )
    if len(keys_given) > num_terms:
        notes.append(f"{section.kind} says NumMFs={num_terms} but has {len(keys_given)} terms: all are taken")
    extent = section.extent("Range", words_in)
    states_default = is_output and section.entry("Default", "nan")[1].lower() != "nan"
    terms = [_term(*section.settings[key], weighed_by) for key in keys]
    variable = foreign.variable(name, extent, _numbered(name, terms, notes), is_output=is_output)
    return replace(variable, default=section.number("Default") if states_default else None)


def _numbered(variable: str, terms: list[foreign.Named], notes: list[str]) -> list[foreign.Named]:
    """Return terms with numbers appended to shared names; rules refer to terms by position."""
    counts = Counter(name for name, _ in terms)
    notes += [
        f"{variable} has {count} terms called {name!r}: they are numbered"
        for name, count in counts.items()
        if count > 1
    ]
    return [
        (name if counts[name] == 1 else f"{name} {number}", membership)
        for number, (name, membership) in enumerate(terms, start=1)
    ]


_TERM = re.compile(r"(['\"])(?P<name>.*)\1\s*:\s*(['\"])(?P<shape>\w+)\3\s*,\s*(?P<numbers>\[[^\]]*\])")


def _term(line: int, value: str, weighed_by: Sequence[str] | None) -> foreign.Named:
    """Read a term: its name and its shape."""
    where = f"line {line}"
    parts = _TERM.fullmatch(value)
    if parts is None:
        raise ControllerFileError(f"{where}: {value[:40]!r} is not a term; expected 'name':'trimf',[0 1 2]")
    raw = parts["numbers"]
    values = [raw[1:-1]] if parts["shape"] == "function" else words_in(raw, where)
    return parts["name"], _WORDS.read(parts["shape"], values, weighed_by, where)


_RULE = re.compile(
    r"(?P<asked>[^,():]*),(?P<concluded>[^,():]*)\((?P<weight>[^,():]*)\)\s*:\s*(?P<join>[12])"
)


def _rules(
    line: int, content: str, inputs: Sequence[Variable], outputs: Sequence[Variable], fractions: Fractions
) -> list[Rule]:
    """Read a rule; where it concludes with hedges, it becomes one for each that it uses."""
    where = f"line {line}"
    parts = _RULE.fullmatch(content)
    if parts is None:
        raise ControllerFileError(
            f"{where}: {content[:40]!r} is not a rule; expected term numbers, weight and connection as in "
            f"'{'1 ' * len(inputs)}, {'1 ' * len(outputs)}(1) : 1'"
        )
    conditions = _term_numbers(parts["asked"], inputs, fractions, where)
    concluded = _term_numbers(parts["concluded"], outputs, fractions, where)
    weight = foreign.number(parts["weight"], where)
    if not conditions or not concluded:
        raise ControllerFileError(f"{where}: the rule asks or concludes nothing; give it a term on each side")
    for is_negated, hedges, statement in concluded:
        tool: Semantics = "fuzzylite" if fractions is antecedents.FUZZYLITES_FRACTIONS else "matlab"
        (output,) = (output for output in outputs if output.name == statement.variable)
        if statement.term == antecedents.ANY or (is_negated and (tool == "fuzzylite" or not output.has_sets)):
            what = "not" if is_negated else antecedents.ANY
            raise ControllerFileError(foreign.denied_conclusion(where, what, tool))
        if hedges and fractions is not antecedents.FUZZYLITES_FRACTIONS:
            raise ControllerFileError(
                f"{where}: the hedge on {statement.term!r}, which the rule concludes, is none of MATLAB's, "
                "and Octave changes by it what fuzzylite does not; conclude a term made for it"
            )
    leaves = [_expressed(*each) for each in conditions]
    kind = model.Or if parts["join"] == "2" else model.And
    antecedent = leaves[0] if len(leaves) == 1 else kind(tuple(leaves))
    return hedged_rules(
        antecedent,
        [(hedges, s.variable, f"{_DENIED * is_negated}{s.term}") for is_negated, hedges, s in concluded],
        weight,
        where,
    )


#: What the name of a term begins with that MATLAB makes of another by its complement.
_DENIED = "not "


def _with_complements(output: Variable, rules: Sequence[Rule]) -> Variable:
    """Give an output the complements that rules conclude of its terms, exact at its points."""
    used = {term for owner, term in model.used_terms(rules) if owner == output.name}
    terms = [term for term in output.terms if _DENIED + term.name in used]
    complements = (model.Sampled(tuple((1.0 - model.sample(output, term)).tolist())) for term in terms)
    denied = (Term(_DENIED + term.name, shape) for term, shape in zip(terms, complements, strict=True))
    return replace(output, terms=(*output.terms, *denied))


#: What a rule says of a variable: whether it is denied, the hedges before the term, and the statement.
_Said = tuple[bool, tuple[Hedge, ...], model.Is]


def _expressed(is_negated: bool, hedges: Sequence[Hedge], statement: model.Is) -> Expression:
    expressed = antecedents.hedged(hedges, statement)
    return model.Not(expressed) if is_negated else expressed


def _term_numbers(words: str, variables: Sequence[Variable], fractions: Fractions, where: str) -> list[_Said]:
    """Read one term number for each variable; hedges stand in its fraction."""
    values = [foreign.number(word, where) for word in words.split()]
    if len(values) != len(variables):
        raise ControllerFileError(
            f"{where}: {len(values)} term numbers for {len(variables)} variables; give one each"
        )
    pairs = []
    for value, variable in zip(values, variables, strict=True):
        fraction = round(abs(value) % 1.0, 9)
        if fraction and fraction not in {*fractions, _ANY}:
            raise ControllerFileError(
                f"{where}: the term number {value:g} of {variable.name} has a hedge in its fraction that is "
                f"none of {', '.join(map(str, fractions))}; define a term for it and name that"
            )
        number = int(abs(value))
        if number > len(variable.terms) or (number == 0 and fraction not in {0.0, _ANY}):
            raise ControllerFileError(
                f"{where}: {variable.name} has {len(variable.terms)} terms, and none numbered {abs(value):g}"
            )
        if number or fraction:
            name = antecedents.ANY if fraction == _ANY else variable.terms[number - 1].name
            pairs.append((value < 0, fractions.get(fraction, ()), model.Is(variable.name, name)))
    return pairs
