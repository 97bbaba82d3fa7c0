"""Fuzzy Control Language (IEC 61131-7): written for programmable controllers and fuzzylite, and read.

The language knows straight lines between points and nothing else. Triangles and trapezoids are written by
their corners; any other shape by its points on the universe, between which this program takes straight lines
too, so nothing is lost by it.

Read are files of fuzzylite, jFuzzyLogic and programmable controllers. A statement ends with a semicolon, or
with its line, as fuzzylite writes it. Words of the language are read in capitals or not. Besides points,
shapes are read by the names that fuzzylite and jFuzzyLogic give them.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fis_tools import model
from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import foreign
from fis_tools.formats.exchange.carried import understand
from fis_tools.formats.exchange.dialect import Dialect, Expressed
from fis_tools.formats.exchange.fll_rules import Operators, assembled, read_rules
from fis_tools.formats.exchange.foreign import Block, Extent, Table
from fis_tools.formats.exchange.vocabulary import (
    AGGREGATIONS,
    AND,
    DEFUZZIFIERS,
    NORMALIZED_SUMS,
    OR,
    meanings,
)
from fis_tools.formats.exchange.writing import term_words, written
from fis_tools.formats.serialize import Reading, Written
from fis_tools.model.operators import WEIGHING
from fis_tools.model.variables import sample

DIALECT = Dialect(
    title="an FCL file", is_nested=True, hedges="fcl", most_words=99, concludes_hedged=True, is_read=False
)


def write(controller: model.FuzzyController) -> Written:
    """Write a controller with one system; see `fis_tools.formats.exchange.writing.written`.

    Nothing is carried in comments, because nothing reads them back.
    """
    return written(controller, DIALECT, "fcl.jinja", _facts)


def _facts(expressed: Expressed) -> dict[str, Any]:
    system, source = expressed.system, expressed.source
    return {
        "inputs": list(zip(system.inputs, source.inputs, strict=True)),
        "outputs": list(zip(system.outputs, source.outputs, strict=True)),
        "points": lambda variable, term: " ".join(f"({x!r}, {y!r})" for x, y in _points(variable, term)),
        "number": _number_words,
        "rule_words": foreign.rule_words,
    }


def _number_words(output: model.Variable, term: model.Term) -> str:
    """Say what is concluded on an output that is weighed: a number as it is, else in fuzzylite's words."""
    word, values = term_words(output, term, "fll")
    return " ".join(values if isinstance(term.membership, model.Constant) else [word, *values])


def _points(variable: model.Variable, term: model.Term) -> list[tuple[float, float]]:
    """Return points between which the membership function is straight, level beyond them."""
    shape, values = term.membership, sample(variable, term)
    x = variable.universe
    if isinstance(shape, model.Triangular | model.Trapezoidal):
        corners = np.unique(shape.corners)
        heights = shape.at(corners)
        is_foot = heights[[0, -1]] == 0.0
        is_end = [corners[0] <= variable.minimum, corners[-1] >= variable.maximum]
        if (is_foot | is_end).all():  # no wall stands inside the range
            x, values = corners, heights
    return list(zip(x.tolist(), values.tolist(), strict=True))


_BLOCKS = ("VAR_INPUT", "VAR_OUTPUT", "FUZZIFY", "DEFUZZIFY", "RULEBLOCK")
#: What each block may say besides terms, rules and variables.
_SETTINGS = ("RANGE", "METHOD", "ACCU", "DEFAULT", "AND", "OR", "ACT", "ENABLED", "LOCK")
#: jFuzzyLogic's names of shapes, and the order of their numbers where it is another.
_JFUZZYLOGIC = {
    "TRIAN": ("Triangle", (0, 1, 2)),
    "TRAPE": ("Trapezoid", (0, 1, 2, 3)),
    "GAUSS": ("Gaussian", (0, 1)),
    "GBELL": ("Bell", (2, 0, 1)),
    "SIGM": ("Sigmoid", (1, 0)),
}
_WORDS = replace(foreign.FUZZYLITES, weighed="the METHOD COGS")
_Method = TypeVar("_Method")
_RULE_WORDS = ("if", "is", "and", "or", "not", "then", "with")


def read(text: str) -> Reading:
    """Read an `.fcl` file.

    Raises
    ------
    ControllerFileError
        If it is damaged or says what a fuzzy system of ours cannot; with the line.
    """
    name, blocks = _blocks(text)
    reading = understand(_system(name, blocks), [], DIALECT)
    kept = (foreign.kept_words(block.name) for block in blocks if _keeps_last(block))
    return Reading(reading.controller, (*reading.assumptions, *kept))


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Yield statements without remarks, each with the line where it begins."""
    plain = re.sub(r"\(\*.*?\*\)|/\*.*?\*/", lambda found: "\n" * found[0].count("\n"), text, flags=re.DOTALL)
    waiting: tuple[int, str] | None = None
    for line, raw in enumerate(plain.splitlines(), start=1):
        content = re.split(r"//|#", raw)[0].strip()
        if content.startswith("%"):
            content = ""
        if waiting is not None and re.match(r"(AND|OR|THEN|WITH)\b(?!\s*:)", content, re.IGNORECASE):
            content, line = f"{waiting[1]} {content}", waiting[0]  # noqa: PLW2901 - it began there
        elif waiting is not None:
            yield waiting
        *whole, rest = content.split(";")
        yield from ((line, part.strip()) for part in whole if part.strip())
        waiting = (line, rest.strip()) if rest.strip() else None
    if waiting is not None:
        yield waiting


def _blocks(text: str) -> tuple[str, list[Block]]:
    names: list[str] = []
    blocks: list[Block] = []
    is_open = False
    for line, content in _statements(text):
        word, rest = [*content.split(maxsplit=1), ""][:2]
        key = word.upper().rstrip(":")
        if key == "FUNCTION_BLOCK":
            names.append(rest)
        elif key in _BLOCKS and not is_open:
            is_list = key.startswith("VAR_")  # its first variable may stand in the same line
            blocks.append(Block(key, "" if is_list else rest, line))
            blocks[-1].listed += [(line, rest)] if is_list and rest else []
            is_open = True
        elif key.startswith("END_"):
            is_open = False
        elif not is_open:
            raise ControllerFileError(
                f"line {line}: {content[:40]!r} stands in no block; is this an .fcl file?"
            )
        elif key in _SETTINGS:
            blocks[-1].settings[key] = (line, content[len(word) :].lstrip(" :=").strip())
        else:
            blocks[-1].listed.append((line, content))
    if len(names) != 1:
        raise ControllerFileError(
            f"the file has {len(names)} function blocks; expected one, FUNCTION_BLOCK name"
        )
    return names[0], blocks


def _system(name: str, blocks: Sequence[Block]) -> model.FuzzySystem:
    declared = {
        kind: [
            re.split(r"[:\s]", content)[0]
            for block in blocks
            if block.kind == kind
            for _, content in block.listed
        ]
        for kind in ("VAR_INPUT", "VAR_OUTPUT")
    }
    described = {block.name: block for block in blocks if block.kind in {"FUZZIFY", "DEFUZZIFY"}}
    variables = {}
    for kind, names in declared.items():
        for variable in names:
            if variable not in described:
                raise ControllerFileError(f"{kind} {variable[:40]!r} has no terms; add FUZZIFY or DEFUZZIFY")
            variables[variable] = _variable(
                described[variable], declared["VAR_INPUT"], is_output=kind == "VAR_OUTPUT"
            )
    inputs, outputs = (tuple(variables[name] for name in declared[k]) for k in ("VAR_INPUT", "VAR_OUTPUT"))
    return assembled(
        name,
        inputs,
        outputs,
        [(block, list(_rules(block))) for block in blocks if block.kind == "RULEBLOCK"],
        lambda block: _method(block, "ACT", "MIN", meanings(AND, "fcl")),
    )


def _keeps_last(block: Block) -> bool:
    """Return whether an output keeps its last value where no rule fires."""
    ways = block.settings.get("DEFAULT", (0, ""))[1].partition("|")
    is_kept = "NC" in {way.strip().upper() for way in ways}
    return is_kept or "PREVIOUS" in block.settings.get("LOCK", (0, ""))[1].upper()


def _method(block: Block, key: str, usual: str, known: Mapping[str, _Method]) -> _Method:
    """Return the method that a setting names, in capitals or not."""
    where, found = block.entry(key, usual)
    in_capitals = {name.upper(): method for name, method in known.items()}
    return foreign.choice({"NONE": in_capitals[usual], **in_capitals}, found.upper(), where)


def _rules(block: Block) -> Iterator[model.Rule]:
    """Read the rules of a block."""
    conjunction = _method(block, "AND", "MIN", meanings(AND, "fcl"))
    disjunction = _method(block, "OR", "MAX", {**meanings(OR, "fcl"), **NORMALIZED_SUMS})
    operators: Operators = (conjunction, disjunction)
    for line, content in block.listed:
        rule = re.fullmatch(r"RULE\b[^:]*:?\s*(.*)", content, re.IGNORECASE | re.DOTALL)
        if rule is None:
            raise ControllerFileError(
                f"line {line}: {content[:40]!r} is not RULE number : IF … THEN …; correct it"
            )
        words = (w.lower() if w.lower() in _RULE_WORDS else w for w in re.findall(r"[()]|[^\s()]+", rule[1]))
        for read in read_rules(line, " ".join(words), operators):
            yield replace(read, and_operator=conjunction, or_operator=disjunction)


def _variable(block: Block, inputs: Sequence[str], *, is_output: bool) -> model.Variable:
    terms = [_named_term(line, content) for line, content in block.listed]
    extent = _extent(block, terms)
    if not is_output:
        found = [(name, _term(line, words, extent, None)) for line, name, words in terms]
        return foreign.variable(block.name, extent, found, is_output=False)
    defuzzifier = _method(block, "METHOD", "COG", meanings(DEFUZZIFIERS, "fcl"))
    aggregation = _method(block, "ACCU", "MAX", {**meanings(AGGREGATIONS, "fcl"), **NORMALIZED_SUMS})
    line, default = block.settings.get("DEFAULT", (block.line, "nan"))
    default = default.partition("|")[0].strip()
    is_weighed = defuzzifier in WEIGHING
    return foreign.variable(
        block.name,
        extent,
        [(name, _term(line, words, extent, inputs if is_weighed else None)) for line, name, words in terms],
        is_output=True,
        default=None
        if default.lower() in {"nan", "nc"}
        else foreign.number(default, f"line {line}: DEFAULT"),
        defuzzifier=defuzzifier,
        aggregation="unbounded_sum" if is_weighed else aggregation,
    )


def _named_term(line: int, content: str) -> tuple[int, str, str]:
    term = re.fullmatch(r"TERM\s+(\S+)\s*:=\s*(\S.*)", content, re.IGNORECASE | re.DOTALL)
    if term is None:
        raise ControllerFileError(
            f"line {line}: {content[:40]!r} is not TERM name := (0, 0) (1, 1); correct it"
        )
    return line, term[1], term[2].strip()


def _extent(block: Block, terms: Sequence[tuple[int, str, str]]) -> Extent:
    """Return the range that a block states; else from the first to the last point of its terms."""
    if "RANGE" in block.settings:
        return block.extent("RANGE", lambda words, _: re.sub(r"[()]|\.\.", " ", words).split())
    points = [x for line, _, words in terms if words.startswith("(") for x in _table(line, words).x]
    if not points or not all(words.startswith("(") for _, _, words in terms):
        raise ControllerFileError(
            f"line {block.line}: {block.name[:40]} has no RANGE; add RANGE := (0 .. 10)"
        )
    return Extent(min(points), max(points))


def _table(line: int, words: str) -> Table:
    return foreign.table(
        foreign.numbers(re.sub(r"[(),]", " ", words).split(), f"line {line}"), f"line {line}"
    )


def _term(
    line: int, words: str, extent: Extent, inputs: Sequence[str] | None
) -> model.MembershipFunction | Table:
    """Read what follows a term's name; `inputs` are those of an output that is weighed."""
    if words.startswith("(") and inputs is None:
        return _table(line, words)
    word, *values = words.split() if not re.fullmatch(r"[-+.\d]\S*", words) else ("Constant", words)
    if word.upper() in _JFUZZYLOGIC and inputs is None:
        word, order = _JFUZZYLOGIC[word.upper()]
        values = [values[place] for place in order] if len(values) == len(order) else values
    return _WORDS.read(word, values, extent, inputs, f"line {line}")
