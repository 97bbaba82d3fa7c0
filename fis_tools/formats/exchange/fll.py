"""FuzzyLite Language files (`.fll`): read and written; Mamdani, Takagi-Sugeno, Tsukamoto and mixed systems.

The form is that of fuzzylite 6 and its Python and Java siblings: blocks of ``key: value`` lines. The number
after a defuzzifier counts the intervals that an output's range is cut into, one less than the points of a
universe. Rules are sentences, ``if a is low and (b is high or c is not low) then d is up with 0.5``.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from fis_tools import model
from fis_tools.errors import ControllerFileError, raised_as
from fis_tools.formats.exchange import foreign, vocabulary
from fis_tools.formats.exchange.antecedents import with_any
from fis_tools.formats.exchange.dialect import Dialect
from fis_tools.formats.exchange.fll_rules import read_rules
from fis_tools.formats.exchange.foreign import FileBlock
from fis_tools.formats.exchange.vocabulary import AGGREGATIONS, AND, DEFUZZIFIERS, OR, meanings
from fis_tools.formats.exchange.writing import MARK, term_words, understand, written
from fis_tools.formats.mapping import MOST_POINTS
from fis_tools.formats.serialize import Reading, Written
from fis_tools.model import FuzzySystem, Rule, Variable
from fis_tools.model.chains import Named, NotResolvable, unchained
from fis_tools.model.membership import words_of
from fis_tools.model.operators import WEIGHING
from fis_tools.model.systems import with_joint_operators

#: Intervals where a defuzzifier states none: fuzzylite leaves its own number out, this one since version 8.
RESOLUTION = 1000

DIALECT = Dialect(
    title="an .fll file",
    semantics="fuzzylite",
    words="fll",
    holds_descriptions=True,
    holds_clipping=True,
    resolution=RESOLUTION,
    is_nested=True,
    has_hedges=True,
)

#: The last line of a file of ours: a copy that was cut is told by it from a whole one.
END = "end of file"


def write(controller: model.FuzzyController) -> Written:
    """Write a controller with one system; see `fis_tools.formats.exchange.writing.written`."""
    facts = {"words": term_words, "rule_words": foreign.rule_words, "end": END}
    return written(controller, DIALECT, "fll.jinja", lambda _: facts)


# Reading.


_AND: dict[str, model.AndOperator | None] = {"none": None, "": None, **meanings(AND, "fll")}
_OR: dict[str, model.OrOperator | None] = {
    "none": None,
    "": None,
    **meanings(OR, "fll"),
    **vocabulary.NORMALIZED_SUMS,
}
_AGGREGATIONS: dict[str, model.Aggregation] = {**meanings(AGGREGATIONS, "fll"), **vocabulary.NORMALIZED_SUMS}

#: The keys of each block; the last may stand in many lines.
_KEYS = {
    "Engine": ("description", ""),
    "InputVariable": ("description", "enabled", "range", "lock-range", "term"),
    "OutputVariable": (
        *("description", "enabled", "range", "lock-range", "aggregation", "accumulation", "defuzzifier"),
        *("default", "lock-previous", "lock-valid", "term"),
    ),
    "RuleBlock": (
        *("description", "enabled", "conjunction", "disjunction", "implication", "activation"),
        "rule",
    ),
}


#: Keys that make an output keep its last value where no rule fires; version 5 called it lock-valid.
_KEPT = ("lock-previous", "lock-valid")


def read(text: str) -> Reading:
    """Read an `.fll` file.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If it is damaged or says what a fuzzy system of ours cannot; with the line.
    """
    foreign.require_short_words(text)
    comments: list[tuple[int, str]] = []
    blocks: list[FileBlock] = []
    for line, raw in enumerate(text.splitlines(), start=1):
        content, sign, remark = raw.partition("#")
        if sign:
            comments.append((line, remark.strip()))
        if content.strip():
            _take(blocks, line, content.strip())
    if any(remark.startswith(MARK) for _, remark in comments) and comments[-1][1] != END:
        raise ControllerFileError(
            f"the last line '# {END}' is missing, so the file may be cut; get a whole copy, or add the line "
            "if it is whole"
        )
    system = _system(blocks)
    reading = understand(system, comments, DIALECT)
    kept = (
        block.name for block in blocks if any(block.settings.get(key, (0, ""))[1] == "true" for key in _KEPT)
    )
    notes = (*map(foreign.kept_words, kept), *_inverted_words(system))
    return replace(reading, assumptions=(*reading.assumptions, *notes))


def _inverted_words(system: FuzzySystem) -> Iterator[str]:
    """Yield notes on what fuzzylite 6 concludes otherwise than fuzzylite 8, which is followed here."""
    for output in system.weighed:
        kinds = {term.membership.entry.name for term in output.terms}
        for name in sorted(kinds & {"s_shape", "z_shape", "concave"}):
            yield (
                f"{output.name}: where a {name} has the strength of a rule is that of fuzzylite 8; version 6 "
                "misplaces it"
            )


def _take(blocks: list[FileBlock], line: int, content: str) -> None:
    """Add a line to the current block, or begin a new one."""
    key, colon, value = (part.strip() for part in content.partition(":"))
    if not colon:
        raise ControllerFileError(f"line {line}: {content[:40]!r} is not 'key: value'; correct it")
    if key in _KEYS:
        blocks.append(FileBlock(key, value, line))
        return
    if not blocks:
        raise ControllerFileError(f"line {line}: {key[:40]!r} stands before 'Engine:'; is this an .fll file?")
    block = blocks[-1]
    known = _KEYS[block.kind]
    foreign.choice(dict.fromkeys(known), key, f"line {line}: in {block.kind} the key")
    if key == known[-1]:
        block.add(line, value)
    elif key in block.settings:
        raise ControllerFileError(f"line {line}: {key} appears twice in one {block.kind}; keep one of them")
    else:
        block.set(line, key, value)


def _system(blocks: Sequence[FileBlock]) -> FuzzySystem:
    """Build the system that the blocks of an `.fll` file describe."""
    engines = [block for block in blocks if block.kind == "Engine"]
    if len(engines) != 1 or blocks[0] is not engines[0]:
        raise ControllerFileError(
            f"the file has {len(engines)} engines; it must begin with one, 'Engine: name'"
        )
    for block in blocks:
        block.expect("enabled", "true")
    inputs = tuple(_variable(block) for block in blocks if block.kind == "InputVariable")
    names = tuple(variable.name for variable in inputs)
    outputs = tuple(_output(block, names) for block in blocks if block.kind == "OutputVariable")
    rule_blocks = [block for block in blocks if block.kind == "RuleBlock"]
    for block in rule_blocks:
        if block.entry("activation", "none")[1] not in _AND:  # version 5 writes the implication here
            block.expect("activation", "general", "none")
    operators = [
        (block.chosen(_AND, "conjunction", "none"), block.chosen(_OR, "disjunction", "none"))
        for block in rule_blocks
    ]
    and_operator, or_operator = next(iter(operators), (None, None))
    groups: list[tuple[FileBlock, list[Rule]]] = []
    for block, operator_names in zip(rule_blocks, operators, strict=True):
        read = (read_rules(f"line {line}", words, operator_names) for line, words in block.listed)
        groups.append(
            (
                block,
                [
                    replace(r, and_operator=operator_names[0], or_operator=operator_names[1])
                    for r in chain(*read)
                ],
            )
        )
    rules = [rule for _, group in groups for rule in group]
    parts = {"inputs": inputs, "outputs": outputs, "rules": rules}
    foreign.require_finished(f"the engine {engines[0].name!r}", parts)
    weighed = {output.name for output in outputs if output.defuzzifier in WEIGHING}
    for block in blocks:
        if block.kind == "OutputVariable" and block.name in weighed:
            _refuse_joined(block, rules)
    named = [Named(f"rule {number}", rule) for number, rule in enumerate(rules, start=1)]
    with raised_as(ControllerFileError, NotResolvable):
        resolved = unchained(named, {output.name: output for output in outputs})
    name = engines[0].name or "unnamed"
    operators_of_all = (and_operator or "min", or_operator or "max")
    system = FuzzySystem(name, with_any(inputs, rules), outputs, tuple(resolved), *operators_of_all)
    return with_joint_operators(
        replace(system, implication=_implication(groups, weighed), semantics="fuzzylite")
    )


def _implication(groups: Sequence[tuple[FileBlock, Sequence[Rule]]], weighed: set[str]) -> model.AndOperator:
    """Return the implication of the blocks whose rules conclude fuzzy sets."""
    implications: dict[model.AndOperator, int] = {}
    for block, group in groups:
        if any(consequent.variable not in weighed for rule in group for consequent in rule.consequents):
            key = "implication" if "implication" in block.settings else "activation"
            operator = block.chosen({**_AND, "General": None}, key, "none")
            if operator is not None:
                implications.setdefault(operator, block.line)
    if len(implications) > 1:
        raise ControllerFileError(
            f"line {list(implications.values())[1]}: the blocks imply by {' and '.join(implications)}, and a "
            "system of ours has one implication; give each block a file of its own"
        )
    return next(iter(implications), "min")


def _refuse_joined(block: FileBlock, rules: Sequence[Rule]) -> None:
    """Refuse aggregation of weighted terms: here each rule counts by itself."""
    line, word = block.settings.get("aggregation", block.settings.get("accumulation", (block.line, "none")))
    if word in {"none", "", AGGREGATIONS["unbounded_sum"].fll}:
        return
    concluded = Counter(c.term for rule in rules for c in rule.consequents if c.variable == block.name)
    several = [term for term, count in concluded.items() if count > 1]
    if several:
        raise ControllerFileError(
            f"line {line}: the aggregation {word[:40]!r} joins the rules that conclude {several[0]!r}, but "
            "each counts by itself where an output is a weighted average or sum; write none"
        )


def _variable(block: FileBlock) -> Variable:
    """Return the input that a block describes."""
    extent, (_, about) = block.extent("range"), block.entry("description", "")
    variable = foreign.variable(block.name, extent, _terms(block), is_output=False)
    clips = block.chosen({"true": True, "false": False}, "lock-range", "false")
    return replace(variable, description=about, is_clipped=clips)


def _output(block: FileBlock, inputs: Sequence[str]) -> Variable:
    """Return the output that a block describes."""
    extent = block.extent("range")
    for key in _KEPT:
        block.expect(key, "false", "true")
    where, words = block.entry("defuzzifier")
    word, _, parameter = words.partition(" ")
    defuzzifier = foreign.choice(meanings(DEFUZZIFIERS, "fll"), word, where)
    aggregation: model.Aggregation = "unbounded_sum"
    if defuzzifier in WEIGHING:
        block.expect("lock-range", "false")
        terms, num_points = _terms(block, inputs), None
        _refuse_other_kind(block, parameter.strip(), terms)
    else:
        terms, num_points = _terms(block), RESOLUTION + 1
        if parameter.strip():
            num_points = foreign.count(parameter, f"{where}: the resolution", MOST_POINTS - 1) + 1
        # versions before 6 called it accumulation
        key = "aggregation" if "aggregation" in block.settings else "accumulation"
        aggregation = block.chosen(_AGGREGATIONS, key, "Maximum")
    return replace(
        foreign.variable(block.name, extent, terms, is_output=True, num_points=num_points),
        default=None if block.entry("default", "nan")[1] == "nan" else block.number("default"),
        description=block.entry("description", "")[1],
        defuzzifier=defuzzifier,
        aggregation=aggregation,
    )


def _refuse_other_kind(block: FileBlock, parameter: str, terms: Sequence[foreign.Named]) -> None:
    """Refuse terms of a kind that the output's defuzzifier does not take."""
    for (line, words), (name, shape) in zip(block.listed, terms, strict=True):
        kind = "TakagiSugeno" if isinstance(shape, model.Number) else "Tsukamoto"
        if parameter not in {"", "Automatic", kind}:
            raise ControllerFileError(
                f"line {line}: the output is weighted as {parameter[:40]!r}, but its term {name!r} is "
                f"{words.split()[1]}; write {kind} or Automatic"
            )


def _terms(block: FileBlock, inputs: Sequence[str] | None = None) -> list[foreign.Named]:
    """Read the terms of a variable; `inputs` are given for a weighted output."""
    terms: list[foreign.Named] = []
    for line, words in block.listed:
        if len(words.split()) < 2:
            raise ControllerFileError(
                f"line {line}: {words[:40]!r} is not a term; expected a name, a shape and its numbers"
            )
        name, word, *values = words.split()
        if inputs is None:
            values = _without_height(word, values, f"line {line}")
        terms.append((name, foreign.FUZZYLITES.read(word, values, inputs, f"line {line}")))
    return terms


def _without_height(word: str, values: list[str], where: str) -> list[str]:
    """Drop a term's optional height, which must be one."""
    kind, order = words_of("fll").get(word, (model.Ramp, ("start", "end")))
    if issubclass(kind, model.Number) or word == foreign.TABLES["fll"] or len(values) != len(order) + 1:
        return values
    height = foreign.number(values[-1], where)
    if height != 1.0:
        raise ControllerFileError(f"{where}: the term has the height {height:g}; only 1 can be read")
    return values[:-1]
