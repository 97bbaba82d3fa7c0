"""Fuzzy systems in words: sentences, rule tables, values and shares, inferences, whole controllers."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from types import MappingProxyType

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats
from fis_tools.engines.inference import Inference, OutputInference
from fis_tools.model import (
    TOOLS,
    Consequent,
    Expression,
    FuzzyController,
    FuzzySystem,
    Rule,
    Semantics,
    Term,
    Variable,
)
from fis_tools.model.intervals import has_intervals
from fis_tools.model.trees import tree
from plain_files.document import Block, Document, Heading, Items, Paragraph, Table
from plain_files.document.text import aligned

BAR_LENGTH = 20
#: Memberships and firing strengths below this are left out.
SHOWN_FROM = 0.005


def number(value: float) -> str:
    """Format a number with six significant digits, and zero without a minus sign."""
    return f"{value + 0.0:.6g}"


def with_unit(variable: Variable) -> str:
    """Name a variable with its unit, as ``distance (m)``."""
    return f"{variable.name} ({variable.unit})" if variable.unit else variable.name


def antecedent_words(expression: Expression, hedges: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return an antecedent in words: ``distance is not very near and not (wind is calm or heat is low)``.

    Parameters
    ----------
    expression : Expression
        Any antecedent.
    hedges : mapping
        Other words for some hedges.
    """
    words, inside = before(expression)
    prefix = [hedges.get(word, word) for word in words]
    match inside:
        case model.Is(variable, term):
            return " ".join([variable, "is", *prefix, term])
        case _ if prefix:
            return f"{' '.join(prefix)} ({antecedent_words(inside, hedges)})"
        case model.And(operands) | model.Or(operands):
            return f" {inside.word} ".join(_inside(operand, type(inside), hedges) for operand in operands)
    raise TypeError(f"{inside!r} is no antecedent")


def before(expression: Expression) -> tuple[list[str], Expression]:
    """Return the `not` and the hedges in front of a statement, and the statement."""
    match expression:
        case model.Not(operand):
            words, inside = before(operand)
            return ["not", *words], inside
        case model.Hedged(hedge, operand):
            words, inside = before(operand)
            return [hedge, *words], inside
    return [], expression


def _inside(expression: Expression, joined_by: type[model.And | model.Or], hedges: Mapping[str, str]) -> str:
    words = antecedent_words(expression, hedges)
    is_joined = isinstance(expression, model.And | model.Or) and len(expression.operands) > 1
    return f"({words})" if is_joined and not isinstance(expression, joined_by) else words


def consequent_words(consequents: Sequence[Consequent]) -> str:
    """Return a rule's conclusions in words, with weights other than one."""
    return " and ".join(
        f"{c.variable} is {c.term}" + ("" if c.weight == 1.0 else f" (weight {number(c.weight)})")
        for c in consequents
    )


def rule_words(rule: Rule) -> str:
    """Return a rule as a clause: ``if distance is near then force is PS``."""
    return f"if {antecedent_words(rule.antecedent)} then {consequent_words(rule.consequents)}"


def sentence(rule: Rule) -> str:
    """Return a rule in words: ``If distance is near and velocity is still then force is PS``.

    Its own operators stand before the conclusion: ``If ... (and: product) then ...``.
    """
    named = (("and", rule.and_operator), ("or", rule.or_operator))
    operator_words = ", ".join(f"{word}: {operator}" for word, operator in named if operator)
    note = f" ({operator_words})" if operator_words else ""
    return f"If {antecedent_words(rule.antecedent)}{note} then {consequent_words(rule.consequents)}"


def labelled(rule: Rule) -> str:
    """Return a rule in words after its label, if it has one, in square brackets."""
    return (f"[{rule.label}] " if rule.label else "") + sentence(rule)


def sentences(system: FuzzySystem) -> list[str]:
    """Return every rule of a system in words, in order, as `labelled` does."""
    return [labelled(rule) for rule in system.rules]


def weighted(term: str, weight: float) -> str:
    """Return a consequent's term, with a weight other than one: ``PS × 0.5``."""
    return term if weight == 1.0 else f"{term} × {number(weight)}"


def shape_words(term: Term) -> str:
    """Return a term's membership function in words: ``Gaussian, mean 0, standard deviation 25``."""
    shape = term.membership
    if isinstance(shape, model.Sampled):
        return f"sampled at {len(shape.values)} points"
    if isinstance(shape, model.Formula):
        return shape.text
    if isinstance(shape, model.Between):
        lower, upper = (shape_words(model.Term(term.name, bound)) for bound in (shape.lower, shape.upper))
        return f"interval type-2, between {lower} and {upper}"
    if isinstance(shape, model.Linear):
        factors = ", ".join(map(number, shape.coefficients))
        return f"({factors}) times the inputs, plus {number(shape.constant)}"
    return shape.entry.phrase.format(**{name: number(getattr(shape, name)) for name in shape.entry.kinds})


def rule_tables(system: FuzzySystem) -> list[tuple[str, list[list[str]]]] | None:
    """Arrange a full rule table in two dimensions, one table for each combination of the outer inputs' terms.

    Rows are the terms of the last input but one, columns those of the last.

    Returns
    -------
    list of (title, rows) or None
        The title says which terms of the outer inputs a table is for (empty for two inputs). The first row
        and the first column hold the terms. None where the rule base is not a full table.
    """
    table = model.rule_table(system)
    if table is None:
        return None
    *outer, last = system.inputs
    across = [term.name for term in last.terms]
    down = [term.name for term in outer[-1].terms] if outer else [""]
    corner = f"{outer[-1].name} \\ {last.name}" if outer else last.name
    words = np.array([term.name for term in system.outputs[0].terms], dtype=object)[table]
    blocks = words.reshape(-1, len(down), len(across))
    heads = product(*([f"{v.name} is {term.name}" for term in v.terms] for v in outer[:-1]))
    tables = []
    for head, block in zip(heads, blocks, strict=True):
        rows = [[row, *cells] for row, cells in zip(down, block, strict=True)]
        tables.append((" and ".join(head), [[corner, *across], *rows]))
    return tables


def summary(system: FuzzySystem) -> str:
    """Summarise a system in one line."""
    inputs = ", ".join(with_unit(variable) for variable in system.inputs)
    outputs = ", ".join(with_unit(variable) for variable in system.outputs)
    exceptions = [f", {v.name} by {v.defuzzifier}" for v in system.outputs if v.defuzzifier]
    exceptions += [
        f", {v.name} aggregated by {v.aggregation}" for v in system.outputs if v.aggregation != "max"
    ]
    exceptions += [f", implication: {system.implication}"] if system.implication != "min" else []
    exceptions += [
        f", {v.name} accumulated by {v.accumulation}" for v in system.outputs if v.accumulation != "max"
    ]
    exceptions.append(inferred_as(system.semantics))
    if has_intervals(system):
        exceptions.append(f", interval type-2, reduced by {system.type_reduction.title()}")
    return (
        f"{len(system.rules)} rules from {inputs} to {outputs}; and: {system.and_operator}, "
        f"or: {system.or_operator}, defuzzifier: {system.defuzzifier}{''.join(exceptions)}"
    )


def explain(inference: Inference, most_rules: int = 8) -> str:
    """Explain an inference step by step: memberships, the strongest rules, what is concluded, the output.

    Parameters
    ----------
    inference : Inference
        What `fis_tools.engines.inference.infer` returns.
    most_rules : int
        The most rules to list.
    """
    system = inference.system
    lines = [
        f"{system.name}: {summary(system)}",
        "",
        "1. The degree of membership of each input in its terms",
    ]
    steps = zip(system.inputs, inference.inputs, inference.clipped, inference.memberships, strict=True)
    for variable, given, clipped, memberships in steps:
        note = f", taken as {quantity(variable, clipped)}, the end of its range" if given != clipped else ""
        lines.append(f"   {variable.name} = {quantity(variable, given)}{note}")
        lines += _bars([(term.name, mu) for term, mu in zip(variable.terms, memberships, strict=True)])
    lines += ["", "2. How strongly the rules fire", *_firing_lines(inference, most_rules)]
    lines += ["", "3. What they conclude"]
    for output in inference.outputs:
        lines += _output_lines(output, system)
    return "\n".join(lines) + "\n"


def quantity(variable: Variable, value: float) -> str:
    """Write a value of a variable with its unit, as ``0.05 m/s``."""
    return f"{number(value)} {variable.unit}".rstrip()


def _bars(entries: Sequence[tuple[str, float]]) -> list[str]:
    shown = [(name, value) for name, value in entries if value >= SHOWN_FROM]
    rows = [[name, f"{value:.2f}", "█" * max(1, round(value * BAR_LENGTH))] for name, value in shown]
    return _indented(rows) or ["      none"]


def _indented(rows: list[list[str]]) -> list[str]:
    return [f"      {line}".rstrip() for line in aligned(rows)]


def _firing_lines(inference: Inference, most_rules: int) -> list[str]:
    """Return a line for each of the strongest rules, and how many more fire."""
    strengths = inference.firing_strengths
    strongest = np.argsort(-strengths, kind="stable")
    firing = [index for index in strongest if strengths[index] >= SHOWN_FROM]
    lines = [
        f"   {strengths[index]:.2f}  rule {index + 1}: {sentence(inference.system.rules[index])}"
        for index in firing[:most_rules]
    ]
    left = np.count_nonzero(strengths) - len(lines)
    if left:
        lines.append(f"   and {left} more fire less strongly" if lines else f"   {left} fire, but hardly")
    return lines or ["   no rule fires"]


def why_default(output: OutputInference) -> str:
    """Return why an output is its default."""
    if output.aggregated.any():
        return "its defuzzifier finds no number in what the rules that fire conclude"
    return "no rule that concludes on it fires"


def _output_lines(output: OutputInference, system: FuzzySystem) -> list[str]:
    """Return an output's inference as lines: its cut terms or numbers, and its value."""
    variable = output.variable
    cuts = [(term.name, cut) for term, cut in zip(variable.terms, output.cuts, strict=True) if cut > 0]
    result = f"   {variable.name} = {quantity(variable, output.value)}"
    if output.is_default:
        return [f"{result}, its default: {why_default(output)}"]
    if output.weighing is not None:
        method = METHODS[system.defuzzifier_of(variable)]
        numbers = zip(output.weighing.rules, output.weighing.strengths, output.weighing.numbers, strict=True)
        rows = [[f"{w:.2f}", f"rule {rule + 1}", quantity(variable, z)] for rule, w, z in numbers if w > 0.0]
        return [f"   {variable.name}", *_indented(rows), f"{result}, the {method}"]
    return [
        f"   {variable.name}",
        *_bars(cuts),
        f"{result}, the {METHODS[system.defuzzifier_of(variable)]} of these terms",
    ]


#: What a defuzzifier gives, in words.
METHODS = {
    "centroid": "centre of area",
    "bisector": "bisector of the area",
    "mom": "mean of the highest points",
    "som": "lowest of the highest points",
    "lom": "greatest of the highest points",
    "weighted_average": "average of what the rules conclude, by their strengths",
    "weighted_sum": "sum of what the rules conclude, by their strengths",
}


#: A change below this fraction of a range is a rounding error.
NEGLIGIBLE = 1e-9


def amount(variable: Variable, value: float) -> str:
    """Format a value of a variable with four significant digits and its unit; rounding errors become 0."""
    value = 0.0 if abs(value) < NEGLIGIBLE * variable.span else value
    return f"{number(float(f'{value:.4g}'))} {variable.unit}".rstrip()


def signed(variable: Variable, value: float) -> str:
    """Format a value of a variable as `amount` does, with a plus before what is above zero."""
    words = amount(variable, value)
    return words if words.startswith(("-", "0 ")) or words == "0" else f"+{words}"


def two_decimals(value: float) -> str:
    """Format an index from 0 to 1, which may have no value."""
    return "no value" if np.isnan(value) else f"{value:.2f}"


def percent(fraction: float) -> str:
    """Format a fraction in percent; values near 0 and 100 % keep apart from them."""
    for digits in (0, 1, 2):
        words = f"{100 * fraction:.{digits}f}"
        if (float(words) > 0 or fraction == 0) and (float(words) < 100 or fraction == 1):
            return f"{words} %"
    return "under 0.01 %" if fraction < 0.5 else "over 99.99 %"


def point_words(system: FuzzySystem, point: Floats) -> str:
    """Format a point of a system's inputs: ``distance = 80 m, velocity = 0.1 m/s``."""
    values = zip(system.inputs, point, strict=True)
    return ", ".join(f"{variable.name} = {amount(variable, value)}" for variable, value in values)


def listed(words: list[str], most: int = 3) -> str:
    """Join words with commas and "and"; of many, only the first few."""
    shown = words[:most]
    if len(words) > most:
        return f"{', '.join(shown)} and {len(words) - most} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def outline(controller: FuzzyController) -> Document:
    """Describe a controller: its facts, and of each system variables, terms and rules.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    """
    blocks: list[Block] = [Heading(controller.name, 1)]
    blocks += [Paragraph(_on_one_line(controller.purpose))] if controller.purpose else []
    facts = [[key, _on_one_line(value)] for key, value in (*controller.attributes, *controller.provenance)]
    blocks += [Table([], facts)] if facts else []
    blocks += [Heading("Wires"), Items([*wires_in_words(controller)])] if controller.wires else []
    for system in controller.systems:
        blocks += [Heading(system.name), Paragraph(f"{summary(system)}.")]
        for kind, variables in (("Input", system.inputs), ("Output", system.outputs)):
            for variable in variables:
                blocks += _variable(kind, variable)
        blocks += _rules(system)
    return Document(blocks)


def inferred_as(*semantics: Semantics) -> str:
    """Return the end of a sentence that says whose numbers it is about; empty for scikit-fuzzy's."""
    titles = [TOOLS[each].title for each in dict.fromkeys(semantics) if each != "scikit-fuzzy"]
    return f", inferred as {listed(titles)} {'does' if len(titles) == 1 else 'do'}" if titles else ""


def wires_in_words(controller: FuzzyController) -> Iterator[str]:
    """Yield each wire of a controller in words, and the inputs and outputs of the whole."""
    if not controller.wires:
        return
    whole = tree(controller)
    carried = {
        f"{system.name}/{variable.name}": (system, variable)
        for system in controller.systems
        for variable in system.variables
    }
    for wire in controller.wires:
        (_, source), (system, target) = carried[wire.source], carried[wire.target]
        words = f"{wire.source} feeds {wire.target}"
        if source.minimum < target.minimum or source.maximum > target.maximum:
            is_clipped = np.isfinite(system.limits_of(target)).all()
            words += (
                f", defined from {number(target.minimum)} to {quantity(target, target.maximum)}; what lies "
                f"beyond is {'taken as the end' if is_clipped else 'used as it is'}"
            )
        yield words
    names = [listed([with_unit(variable) for variable in side], 64) for side in (whole.inputs, whole.outputs)]
    yield f"the whole takes {names[0]} and gives {names[1]}"


def rule_list(controller: FuzzyController) -> Document:
    """List the rules of a controller as sentences."""
    blocks: list[Block] = []
    for system in controller.systems:
        blocks += [Heading(system.name), Paragraph(f"{summary(system)}."), _listed(system)]
    return Document(blocks)


def _variable(kind: str, variable: Variable) -> list[Block]:
    """Return a variable as blocks: its range, meaning and terms."""
    default = "" if variable.default is None else f"; {number(variable.default)} when no rule fires"
    points = f"{variable.num_points} {'uneven ' if variable.points is not None else ''}points"
    extent = f"{number(variable.minimum)} to {number(variable.maximum)}, {points}"
    meaning = _on_one_line(variable.description)
    about = f"From {extent}{default}{f': {meaning}' if meaning else '.'}"
    rows = [[term.name, shape_words(term)] for term in variable.terms]
    terms = [Table(["term", "membership function"], rows)] if rows else []
    return [Heading(f"{kind} {with_unit(variable)}", 3), Paragraph(about), *terms]


def _rules(system: FuzzySystem) -> Iterator[Block]:
    """Yield the rules as tables, or as a list."""
    tables = rule_tables(system) or []
    yield Heading(f"Rules for {system.outputs[0].name}" if tables else "Rules", 3)
    for title, (heads, *rows) in tables:
        if title:
            yield Paragraph(f"Where {title}:")
        yield Table(heads, rows, across=system.inputs[-1].name)
    if not tables:
        yield _listed(system)


def _listed(system: FuzzySystem) -> Table:
    rows = [[str(number), f"{line}."] for number, line in enumerate(sentences(system), start=1)]
    return Table(["rule", "sentence"], rows, numbers=(0,))


def _on_one_line(text: str) -> str:
    return " ".join(text.split())
