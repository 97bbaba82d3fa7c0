"""The report of a difference, in words and as plain data."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from fis_tools.array_types import Floats
from fis_tools.findings.difference import comparison
from fis_tools.findings.difference.comparison import Fact, Pair, Source, SystemDifference, VariableChange
from fis_tools.formats.serialize import fingerprint
from fis_tools.model import (
    Between,
    Formula,
    FuzzyController,
    FuzzySystem,
    Linear,
    Rule,
    Sampled,
    Term,
    with_terms,
)
from fis_tools.model.validate import validate
from fis_tools.source import as_controller
from fis_tools.words import text
from plain_files.document import (
    Block,
    Cell,
    Change,
    Document,
    Figure,
    Heading,
    Paragraph,
    Result,
    Table,
    plain,
)
from plain_files.document.html import fragment, page

#: Between the old and the new value.
TO = "→"
#: Of a universe with more points than this only the first few and the last are shown.
MOST_POINTS = 12


_LEGEND = "In the pictures changed terms are also drawn as they were, dotted."


@dataclass(frozen=True, repr=False)
class Difference(Result):
    """The differences between two controllers.

    Parameters
    ----------
    before, after : Source
        What was compared.
    facts : tuple of Fact
        Attributes and provenance that changed, the name, the purpose, and the order of the systems.
    systems : tuple of SystemDifference
        In their present order, removed systems last; unchanged systems are included.
    """

    before: Source
    after: Source
    facts: tuple[Fact, ...]
    systems: tuple[SystemDifference, ...]

    @property
    def is_empty(self) -> bool:
        """Whether the controllers are the same, apart from the order in which rules are written."""
        return not self.facts and all(system.is_empty for system in self.systems)

    def document(self, *, pictures: bool = False) -> Document:
        """Return the changes as a document; on request with pictures of terms and surfaces, for pages."""
        sides = {"before": self.before.plain(), "after": self.after.plain()}
        rows = [
            [word, side["file"] or side["name"], f"SHA-256 of its content {side['sha256']}"]
            for word, side in sides.items()
        ]
        title = f"{sides['before']['name']} {TO} {sides['after']['name']}"
        return Document([Heading(title, 1), Table([], rows), *self.blocks(pictures)])

    def blocks(self, pictures: bool = False) -> list[Block]:
        """Return the changes, without the names of the controllers."""
        blocks: list[Block] = [*_fact_table(self.facts)]
        if self.is_empty and fingerprint(self.before.controller) == fingerprint(self.after.controller):
            blocks.append(Paragraph("Nothing changed."))
        for system in self.systems:
            blocks += [Heading(system.name), *_system(system, pictures)]
        return blocks

    def plain(self) -> dict[str, object]:
        """Return it as plain data, for the schema fuzzy-difference, version 1."""
        return {
            "before": self.before.plain(),
            "after": self.after.plain(),
            "facts": plain(self.facts),
            "systems": [_plain_system(system) for system in self.systems],
        }

    def html(self) -> str:
        """Render it as a self-contained page, with pictures."""
        return page(self.document(pictures=True))

    def _repr_html_(self) -> str:
        return fragment(self.document(pictures=True))


def _fact_table(facts: Sequence[Fact]) -> list[Table]:
    rows: list[list[Cell]] = [[fact.what, _fact_change(fact)] for fact in facts]
    return [Table([], rows)] if rows else []


def _fact_change(fact: Fact) -> Change:
    """Return the old and the new value; of many points of a universe only a few."""
    if fact.what != "points":
        return Change(fact.before, fact.after)
    return Change(_few_points(fact.before), _few_points(fact.after))


def _few_points(words: str) -> str:
    points = words.split(", ")
    return words if len(points) <= MOST_POINTS else f"{', '.join(points[:3])}, … {points[-1]}"


def _system(system: SystemDifference, pictures: bool) -> Iterator[Block]:
    """Yield what changed in a system: its properties, outputs, variables and rules."""
    if system.before is None or system.after is None:
        had = "it had " if system.state == "removed" else ""
        yield Paragraph(f"{system.state.capitalize()}; {had}{text.summary(system.present)}.")
        return
    if system.is_empty:
        is_same = system.before.rules == system.after.rules
        yield Paragraph("Nothing changed." if is_same else "Only the order of rules or their parts changed.")
        return
    yield Paragraph(f"{headline(system)}{text.inferred_as(system.after.semantics)}.")
    yield from _fact_table(system.facts)
    yield from _outputs(system.outputs)
    if pictures:
        from fis_tools.findings.difference.pictures import draw_surfaces  # noqa: PLC0415 - needs matplotlib

        yield from map(Figure, draw_surfaces(system))
        if any(change.terms for change in system.variables):
            yield Paragraph(_LEGEND)
    for change in system.variables:
        yield from _variable(change, pictures)
    if system.rules:
        yield from _rules(system)


def headline(system: SystemDifference) -> str:
    """Count what changed in a system: ``3 terms changed; 12 of 25 rules changed, 1 added``."""
    terms = [term for change in system.variables for term in change.terms]
    parts = [
        _counts(changes, noun, total)
        for changes, noun, total in (
            ([c for c in system.variables if c.state != "changed"], "variable", None),
            (terms, "term", None),
            (system.rules, "rule", None if system.before is None else len(system.before.rules)),
        )
        if changes
    ]
    return "; ".join(parts) or "what follows changed"


def _counts(changes: Sequence[Pair[Any]], noun: str, total: int | None) -> str:
    """Count changes by their kind."""
    states = [change.state for change in changes]
    counts = {state: states.count(state) for state in ("changed", "added", "removed") if state in states}
    (first, count), *others = counts.items()
    of = f" of {total}" if total is not None and first != "added" else ""
    head = f"{count}{of} {noun if count == 1 and not of else f'{noun}s'} {first}"
    return ", ".join([head, *(f"{number} {state}" for state, number in others)])


def _outputs(changes: Sequence[comparison.OutputChange]) -> Iterator[Table]:
    """Yield a table of how far the outputs moved: in their unit, and as a share of their range."""
    rows = [
        [
            text.with_unit(change.output),
            f"{change.where}, {change.num_samples} inputs",
            f"{text.number(change.mean)} ({percent(change.mean_share)})",
            f"{text.number(change.largest)} ({percent(change.largest_share)})",
            largest_words(change) if change.largest > 0.0 else "nowhere",
        ]
        for change in changes
    ]
    if rows:
        heads = ["output", "over", "moves on average (of its range)", "at most", "where it moves most"]
        yield Table(heads, rows, numbers=(2, 3))


def largest_words(change: comparison.OutputChange) -> str:
    """Describe where an output changed most, with both values."""
    output = change.output
    noise = 1e-12 * output.span
    before, after = (value if abs(value) > noise else 0.0 for value in (change.before, change.after))
    at = ", ".join(f"{name} = {text.number(value)}" for name, value in change.inputs.items())
    return f"from {text.number(before)} to {text.quantity(output, after)} at {at}"


def percent(share: float) -> str:
    """Write a share: ``12.3 %``."""
    return f"{100.0 * share:.3g} %"


def _variable(change: VariableChange, pictures: bool) -> Iterator[Block]:
    """Yield what changed in a variable: its properties and terms."""
    head = f"{change.kind.capitalize()} {text.with_unit(change.present)}"
    if change.before is None or change.after is None:
        yield Heading(f"{head}: {change.state}", 3)
        rows = [[term.name, text.shape_words(term)] for term in change.present.terms]
        yield Table(["term", "membership function"], rows)
        return
    yield Heading(head, 3)
    yield from _fact_table(change.facts)
    if change.terms:
        if pictures and change.before.has_sets and change.after.has_sets:
            from fis_tools.findings.difference.pictures import draw_terms  # noqa: PLC0415 - as above

            yield Figure(draw_terms(change))
        rows = [[term_name(term), *term_words(change, term)] for term in change.terms]
        yield Table(["term", f"membership function, before {TO} after", "how far"], rows)


def term_name(change: comparison.TermChange) -> str:
    """Name a term: ``near``, or ``near → close`` where it was renamed."""
    names = [term.name for term in (change.before, change.after) if term is not None]
    return f" {TO} ".join(dict.fromkeys(names))


def term_words(variable: VariableChange, change: comparison.TermChange) -> tuple[str, str]:
    """Describe a term before and after, and how far it moved."""
    if change.before is None or change.after is None:
        return text.shape_words(change.present), change.state
    how_far = f"moved by {text.quantity(variable.present, change.moved)} ({percent(change.share)})"
    return shape_change(change.before, change.after), (
        f"{how_far if change.share > text.NEGLIGIBLE else 'stays'}, {percent(change.similarity)} alike"
    )


def shape_change(before: Term, after: Term) -> str:
    """Describe how a membership function changed: ``mean 40 → 44``.

    Numbers equal to six digits are left out, or shown in full if nothing else changed.
    """
    old, new = before.membership, after.membership
    if isinstance(old, Between) and isinstance(new, Between):
        pairs = {"lower": (old.lower, new.lower), "upper": (old.upper, new.upper)}
        return "; ".join(
            f"{word}: {shape_change(Term(before.name, shapes[0]), Term(after.name, shapes[1]))}"
            for word, shapes in pairs.items()
            if shapes[0] != shapes[1]
        )
    if type(old) is not type(new) or isinstance(old, Between | Formula | Linear | Sampled):
        return f" {TO} ".join(dict.fromkeys(text.shape_words(term) for term in (before, after)))
    changed = {
        field.name.replace("_", " "): (getattr(old, field.name), getattr(new, field.name))
        for field in fields(old)
        if getattr(old, field.name) != getattr(new, field.name)
    }
    seen = {name: pair for name, pair in changed.items() if len(set(map(text.number, pair))) > 1}
    write = text.number if seen else repr
    changes = [f"{name} {f' {TO} '.join(map(write, values))}" for name, values in (seen or changed).items()]
    return ", ".join(changes) or text.shape_words(after)


def changed_tables(system: SystemDifference) -> list[tuple[str, Table]] | None:
    """Lay the rules of two full tables of the same terms over one another.

    Returns
    -------
    list of (title, table) or None
        One for each table in which something changed, as `fis_tools.words.text.rule_tables` has them. None
        where the rules are not such tables, or weights or labels changed.
    """
    if system.before is None or system.after is None:
        return None
    names = comparison.new_names(system.variables)
    old, new = text.rule_tables(system.before), text.rule_tables(system.after)
    if old is None or new is None or any(change.state != "changed" for change in system.rules):
        return None
    concluded = {
        rule.antecedent: text.consequent_words(rule.consequents)
        for rule in (with_terms(rule, names) for rule in system.before.rules)
    }
    if concluded.keys() != {rule.antecedent for rule in system.after.rules}:
        return None
    output = system.after.outputs[0].name
    before = iter(concluded[rule.antecedent] for rule in system.after.rules)
    across = system.after.inputs[-1].name
    tables = []
    for title, (heads, *rows) in new:
        cells: list[list[Cell]] = [
            [head, *(Change(next(before).removeprefix(f"{output} is "), after) for after in row)]
            for head, *row in rows
        ]
        if any(cell.before != cell.after for row in cells for cell in row if isinstance(cell, Change)):
            tables.append((title, Table(heads, cells, across=across)))
    return tables


def _rules(system: SystemDifference) -> Iterator[Block]:
    """Yield the rules that changed, as tables of the full rule table or as a list."""
    yield Heading("Rules", 3)
    tables = changed_tables(system)
    if tables is None:
        rows = [
            [_rule_words(*pair) for pair in zip(change.numbers, (change.before, change.after), strict=True)]
            for change in system.rules
        ]
        yield Table(["before", "after"], rows)
        return
    for title, table in tables:
        if title:
            yield Paragraph(f"Where {title}:")
        yield table


def _rule_words(number: int | None, rule: Rule | None) -> str:
    return "none" if rule is None else f"{number}. {text.labelled(rule)}"


def _plain_system(system: SystemDifference) -> dict[str, object]:
    """Return what changed in a system as plain data."""
    return {
        "name": system.name,
        "state": "same" if system.is_empty else system.state,
        "facts": plain(system.facts),
        "variables": [
            {
                "name": change.present.name,
                "kind": change.kind,
                "state": change.state,
                "facts": plain(change.facts),
                "terms": [
                    _plain_pair(term, lambda term: str(term.name))
                    | {name: getattr(term, name) for name in ("moved", "share", "similarity")}
                    for term in change.terms
                ],
            }
            for change in system.variables
        ],
        "rules": [_plain_pair(change, text.sentence) | {"number": change.number} for change in system.rules],
        "outputs": [
            {name: getattr(change, name) for name in _OUTPUT_KEYS}
            | {"name": change.output.name, "unit": change.output.unit, "largest_at": change.inputs}
            for change in system.outputs
        ],
    }


_OUTPUT_KEYS = ("where", "num_samples", "mean", "largest", "mean_share", "largest_share", "before", "after")


def _plain_pair(change: Pair[Any], words: Callable[[Any], str]) -> dict[str, object]:
    """Return both sides of a change as words, and its state."""
    sides = {"before": change.before, "after": change.after}
    plain = {side: None if thing is None else words(thing) for side, thing in sides.items()}
    return {"state": change.state, **plain}


def difference(
    before: FuzzyController | FuzzySystem,
    after: FuzzyController | FuzzySystem,
    samples: Mapping[str, Floats] | None = None,
    files: tuple[str, str] = ("", ""),
) -> Difference:
    """Compare two controllers, system by system.

    Parameters
    ----------
    before, after : FuzzyController or FuzzySystem
        Without problems. Two systems are compared whatever their names; systems of controllers by name.
    samples : mapping of str to (n, num_inputs), optional
        Inputs by the system's name, such as `fis_tools.analysis.flights.inputs_along` returns: outputs are
        compared over them too, besides the whole ranges of the inputs.
    files : (str, str)
        Where the two were read from; empty if from no file.

    Raises
    ------
    InvalidSystem
        If a system has problems.
    """
    sides = [as_controller(side) for side in (before, after)]
    old, new = ({system.name: system for system in side.systems} for side in sides)
    if isinstance(before, FuzzySystem) and isinstance(after, FuzzySystem):
        old = {after.name: before}
    for system in (*old.values(), *new.values()):
        validate(system)
    first, other = (Source(*side) for side in zip(sides, files, strict=True))
    compared = [_compare(old.pop(name, None), system, samples) for name, system in new.items()]
    removed = [SystemDifference(system, None) for system in old.values()]
    return Difference(first, other, tuple(_facts(*sides)), (*compared, *removed))


def _facts(before: FuzzyController, after: FuzzyController) -> Iterator[Fact]:
    """Yield the properties of a controller that changed, the order of its systems, and its wires."""
    for old, new in zip(_facts_of(before), _facts_of(after), strict=True):
        for what in sorted({*old, *new}):
            if old.get(what) != new.get(what):
                yield Fact(what, old.get(what, "none"), new.get(what, "none"))
    names = [[system.name for system in side.systems] for side in (before, after)]
    if names[0] != names[1] and set(names[0]) == set(names[1]):
        yield Fact("order of systems", *map(", ".join, names))
    wires = [
        ", ".join(sorted(f"{wire.source} to {wire.target}" for wire in side.wires))
        for side in (before, after)
    ]
    if wires[0] != wires[1]:
        yield Fact("wires", *(words or "none" for words in wires))


def _facts_of(controller: FuzzyController) -> tuple[dict[str, str], ...]:
    """Return a controller's facts besides its systems."""
    facts = {"name": controller.name, "purpose": controller.purpose or "none"}
    origin = {f"provenance {key}": value for key, value in controller.provenance}
    return facts, dict(controller.attributes), origin


def _compare(
    before: FuzzySystem | None, after: FuzzySystem, samples: Mapping[str, Floats] | None
) -> SystemDifference:
    """Compare two systems; None stands for one that did not exist."""
    if before is None:
        return SystemDifference(None, after)
    variables = comparison.compare_variables(before, after)
    rules = comparison.compare_rules(before, after, comparison.new_names(variables))
    outputs = comparison.compare_outputs(before, after, None if samples is None else samples.get(after.name))
    return SystemDifference(before, after, comparison.system_facts(before, after), variables, rules, outputs)
