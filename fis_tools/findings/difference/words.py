"""A difference in words: for a terminal, and for programs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

from fis_tools.findings.difference.change import (
    Fact,
    OutputChange,
    RuleChange,
    Source,
    SystemDifference,
    TermChange,
    VariableChange,
)
from fis_tools.findings.difference.comparison import new_names, renamed
from fis_tools.model import Formula, Sampled, Term
from fis_tools.words.text import (
    NEGLIGIBLE,
    aligned,
    antecedent_words,
    consequent_words,
    number,
    quantity,
    rule_tables,
    sentence,
    shape_words,
    summary,
    with_unit,
)

#: Between the old and the new value.
TO = "→"
#: Tables wider than this are listed cell by cell.
WIDEST = 120
#: Of a universe with more points than this only the first few and the last are shown.
MOST_POINTS = 12


@dataclass(frozen=True)
class Cell:
    """A cell of a rule table: its term before and after."""

    before: str
    after: str


def title(sources: tuple[Source, Source]) -> str:
    """Return the names of both controllers."""
    return f" {TO} ".join(source.name for source in sources)


def source_rows(sources: tuple[Source, Source]) -> list[list[str]]:
    """Return for both controllers where they were read from, and their hashes."""
    rows = zip(("before", "after"), sources, strict=True)
    return [[word, source.file or source.name, f"SHA-256 {source.sha256}"] for word, source in rows]


def write(sources: tuple[Source, Source], facts: Sequence[Fact], systems: Sequence[SystemDifference]) -> str:
    """Describe the differences between two controllers, for a terminal."""
    lines = [title(sources), *aligned(source_rows(sources), 2), *_fact_lines(facts, 2)]
    if not facts and all(system.is_empty for system in systems):
        lines.append("  nothing changed")
    for system in systems:
        lines += ["", *_system_lines(system)]
    return "\n".join(lines) + "\n"


def _fact_lines(facts: Sequence[Fact], indent: int) -> list[str]:
    rows = [[f"{fact.what}:", f" {TO} ".join(fact_words(fact))] for fact in facts]
    return aligned(rows, indent)


def fact_words(fact: Fact) -> tuple[str, str]:
    """Return the old and the new value in words; of many points of a universe only a few."""
    if fact.what != "points":
        return fact.before, fact.after
    return _few_points(fact.before), _few_points(fact.after)


def _few_points(words: str) -> str:
    points = words.split(", ")
    return words if len(points) <= MOST_POINTS else f"{', '.join(points[:3])}, … {points[-1]}"


def _system_lines(system: SystemDifference) -> list[str]:
    if system.before is None or system.after is None:
        return [f"{system.name}: {presence(system)}"]
    if system.is_empty:
        return [f"{system.name}: nothing changed"]
    lines = [f"{system.name}: {headline(system)}", *_fact_lines(system.facts, 2)]
    lines += [f"  {output_words(change)}" for change in system.outputs]
    for change in system.variables:
        lines += ["", *_variable_lines(change)]
    if system.rules:
        lines += ["", *_rule_lines(system)]
    return lines


def presence(system: SystemDifference) -> str:
    """Return in words that a system was added or removed."""
    if system.before is None and system.after is not None:
        return f"added; {summary(system.after)}"
    return f"removed; it had {summary(system.before)}" if system.before is not None else ""


def headline(system: SystemDifference) -> str:
    """Count what changed in a system: ``3 terms changed; 12 of 25 rules changed, 1 added``."""
    terms = [term for change in system.variables for term in change.terms]
    parts = [
        _counts(changes, noun, total)
        for changes, noun, total in (
            ([c for c in system.variables if c.before is None or c.after is None], "variable", None),
            (terms, "term", None),
            (system.rules, "rule", None if system.before is None else len(system.before.rules)),
        )
        if changes
    ]
    return "; ".join(parts) or "what follows changed"


def _counts(
    changes: Sequence[VariableChange] | Sequence[TermChange] | Sequence[RuleChange],
    noun: str,
    total: int | None,
) -> str:
    """Count changes by their kind."""
    states = [_state(change.before, change.after) for change in changes]
    counts = {state: states.count(state) for state in ("changed", "added", "removed") if state in states}
    (first, count), *others = counts.items()
    of = f" of {total}" if total is not None and first != "added" else ""
    head = f"{count}{of} {noun if count == 1 and not of else f'{noun}s'} {first}"
    return ", ".join([head, *(f"{number} {state}" for state, number in others)])


def output_words(change: OutputChange) -> str:
    """Describe how far an output changed."""
    output = change.output
    samples = f"{change.num_samples} inputs " + (
        "spread over the ranges" if change.where == "the ranges" else "along the logs"
    )
    if change.largest == 0.0:
        return f"{output.name} is the same at {samples}"
    return (
        f"{output.name} moves by {quantity(output, change.mean)} on average "
        f"({percent(change.mean_share)} of its range) over {samples},\n"
        f"      by {quantity(output, change.largest)} at most ({percent(change.largest_share)}): "
        f"{largest_words(change)}"
    )


def largest_words(change: OutputChange) -> str:
    """Describe where an output changed most, with both values."""
    output = change.output
    noise = 1e-12 * (output.maximum - output.minimum)
    before, after = (value if abs(value) > noise else 0.0 for value in (change.before, change.after))
    at = ", ".join(f"{name} = {number(value)}" for name, value in change.inputs.items())
    return f"from {number(before)} to {quantity(output, after)} at {at}"


def percent(share: float) -> str:
    """Write a share: ``12.3 %``."""
    return f"{100.0 * share:.3g} %"


def _variable_lines(change: VariableChange) -> list[str]:
    head = f"  {change.kind} {with_unit(change.variable)}"
    if change.before is None or change.after is None:
        terms = ", ".join(term.name for term in change.variable.terms)
        return [f"{head}: {'added' if change.before is None else 'removed'}, with the terms {terms}"]
    lines = [head, *_fact_lines(change.facts, 4)]
    rows = [[term_name(term), *term_words(change, term)] for term in change.terms]
    return [*lines, *aligned(rows, 4)]


def term_name(change: TermChange) -> str:
    """Name a term: ``near``, or ``near → close`` where it was renamed."""
    names = [term.name for term in (change.before, change.after) if term is not None]
    return f" {TO} ".join(dict.fromkeys(names))


def term_words(variable: VariableChange, change: TermChange) -> tuple[str, str]:
    """Describe a term before and after, and how far it moved."""
    if change.before is None or change.after is None:
        term, word = (change.after, "added") if change.before is None else (change.before, "removed")
        return shape_words(term) if term is not None else "", word
    far = f"moved by {quantity(variable.variable, change.moved)} ({percent(change.share)})"
    return shape_change(change.before, change.after), (
        f"{far if change.share > NEGLIGIBLE else 'stays'}, {percent(change.similarity)} alike"
    )


def shape_change(before: Term, after: Term) -> str:
    """Describe how a membership function changed: ``mean 40 → 44``.

    Numbers equal to six digits are left out, or shown in full if nothing else changed.
    """
    old, new = before.membership, after.membership
    if type(old) is not type(new) or isinstance(old, Formula | Sampled):
        return f" {TO} ".join(dict.fromkeys(shape_words(term) for term in (before, after)))
    changed = {
        field.name.replace("_", " "): (getattr(old, field.name), getattr(new, field.name))
        for field in fields(old)
        if getattr(old, field.name) != getattr(new, field.name)
    }
    seen = {name: values for name, values in changed.items() if number(values[0]) != number(values[1])}
    write = number if seen else repr
    told = [f"{name} {f' {TO} '.join(map(write, values))}" for name, values in (seen or changed).items()]
    return ", ".join(told) or shape_words(after)


def changed_tables(
    system: SystemDifference,
) -> list[tuple[str, list[str], list[tuple[str, list[Cell]]]]] | None:
    """Superimpose the rules of two full tables of the same terms.

    Returns
    -------
    list of (title, heads, rows) or None
        One for each table in which something changed, as `fis_tools.words.text.rule_tables` has them; a row
        is its head and its cells. None where the rules are not such tables, or weights or labels changed.
    """
    if system.before is None or system.after is None:
        return None
    names = new_names(system.variables)
    old, new = rule_tables(system.before), rule_tables(system.after)
    if (
        old is None
        or new is None
        or any(change.before is None or change.after is None for change in system.rules)
    ):
        return None
    concluded = {
        antecedent_words(rule.antecedent): consequent_words(rule.consequents)
        for rule in (renamed(rule, names) for rule in system.before.rules)
    }
    is_same_table = all(antecedent_words(rule.antecedent) in concluded for rule in system.after.rules)
    if not is_same_table or len(system.before.rules) != len(system.after.rules):
        return None
    output = system.after.outputs[0].name
    before = iter(concluded[antecedent_words(rule.antecedent)] for rule in system.after.rules)
    tables = []
    for title, (heads, *rows) in new:
        cells = [
            (head, [Cell(next(before).removeprefix(f"{output} is "), after) for after in row])
            for head, *row in rows
        ]
        if any(cell.before != cell.after for _, row in cells for cell in row):
            tables.append((title, heads, cells))
    return tables


def _rule_lines(system: SystemDifference) -> list[str]:
    tables = changed_tables(system)
    if tables is None:
        return [
            "  rules",
            *(
                f"    {sign} {change.number:3d}. {told}"
                for change in system.rules
                for sign, told in rule_words(change)
            ),
        ]
    lines: list[str] = []
    has_points = False
    for title, heads, rows in tables:
        indent = 6 if title else 4
        table = _table_lines(heads, rows, indent)
        fits = max(map(len, table)) <= WIDEST
        has_points |= fits
        lines += [f"    where {title}"] if title else []
        lines += table if fits else _cell_lines(heads, rows, indent)
    return ["  rules that changed" + ("; a point stands for one that did not" if has_points else ""), *lines]


def _table_lines(heads: list[str], rows: list[tuple[str, list[Cell]]], indent: int) -> list[str]:
    told = [
        [head, *(f"{c.before} {TO} {c.after}" if c.before != c.after else "·" for c in cells)]
        for head, cells in rows
    ]
    return aligned([heads, *told], indent)


def _cell_lines(heads: list[str], rows: list[tuple[str, list[Cell]]], indent: int) -> list[str]:
    told = [
        [head, column, f"{cell.before} {TO} {cell.after}"]
        for head, cells in rows
        for column, cell in zip(heads[1:], cells, strict=True)
        if cell.before != cell.after
    ]
    return [" " * indent + heads[0], *aligned(told, indent)]


def rule_words(change: RuleChange) -> Iterator[tuple[str, str]]:
    """Return the old rule with a minus, and the new one with a plus."""
    for sign, rule in (("-", change.before), ("+", change.after)):
        if rule is not None:
            yield sign, (f"[{rule.label}] " if rule.label else "") + sentence(rule)


def plain(
    sources: tuple[Source, Source], facts: Sequence[Fact], systems: Sequence[SystemDifference]
) -> dict[str, object]:
    """Return a difference as plain data, for JSON (schema fuzzy-difference, version 1)."""
    return {
        "schema": "fuzzy-difference",
        "schema_version": 1,
        "before": sources[0]._asdict(),
        "after": sources[1]._asdict(),
        "facts": [_plain_fact(fact) for fact in facts],
        "systems": [_plain_system(system) for system in systems],
    }


def _plain_fact(fact: Fact) -> dict[str, object]:
    return {"what": fact.what, "before": fact.before, "after": fact.after}


def _plain_system(system: SystemDifference) -> dict[str, object]:
    return {
        "name": system.name,
        "state": _state(system.before, system.after, is_empty=system.is_empty),
        "facts": [_plain_fact(fact) for fact in system.facts],
        "variables": [_plain_variable(change) for change in system.variables],
        "rules": [
            {
                "number": change.number,
                "state": _state(change.before, change.after),
                "before": None if change.before is None else sentence(change.before),
                "after": None if change.after is None else sentence(change.after),
            }
            for change in system.rules
        ],
        "outputs": [
            {
                "name": change.output.name,
                "unit": change.output.unit,
                "where": change.where,
                "num_samples": change.num_samples,
                "mean": change.mean,
                "largest": change.largest,
                "mean_share": change.mean_share,
                "largest_share": change.largest_share,
                "largest_at": change.inputs,
                "before": change.before,
                "after": change.after,
            }
            for change in system.outputs
        ],
    }


def _plain_variable(change: VariableChange) -> dict[str, object]:
    return {
        "name": change.variable.name,
        "kind": change.kind,
        "state": _state(change.before, change.after),
        "facts": [_plain_fact(fact) for fact in change.facts],
        "terms": [
            {
                "before": None if term.before is None else term.before.name,
                "after": None if term.after is None else term.after.name,
                "state": _state(term.before, term.after),
                "moved": term.moved,
                "share": term.share,
                "similarity": term.similarity,
            }
            for term in change.terms
        ],
    }


def _state(before: object, after: object, *, is_empty: bool = False) -> str:
    if before is None:
        return "added"
    return "removed" if after is None else "same" if is_empty else "changed"
