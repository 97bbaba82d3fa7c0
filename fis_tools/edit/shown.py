"""Variables and rules as plain data, as the scripts of the page take them."""

from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from typing import Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.edit.touches import numbers_of, with_sentence
from fis_tools.model import (
    And,
    Between,
    Consequent,
    FuzzySystem,
    Is,
    MembershipFunction,
    Rule,
    Term,
    Variable,
)
from fis_tools.model.intervals import sampled_bounds
from fis_tools.model.membership import SHAPES
from fis_tools.model.variables import shape_values
from fis_tools.words import text

#: what a row of a table shows
Cells = list[dict[str, Any]]
#: from the lowest term over the middle one to the highest
LOW, MIDDLE, HIGH = "var(--low)", "var(--middle)", "var(--high)"
#: shapes that any term of a set may take
SETS = [name for name, kind in SHAPES.items() if kind.entry.kinds and name not in ("constant", "linear")]


def colours(count: int) -> list[str]:
    """Return a colour for each of some ordered terms."""
    positions = np.linspace(-1.0, 1.0, count) if count > 1 else [0.0]
    return [
        f"color-mix(in srgb, {LOW if position < 0 else HIGH} {100 * abs(position):.0f}%, {MIDDLE})"
        for position in positions
    ]


@lru_cache(maxsize=64)
def variable(shown: Variable) -> dict[str, Any]:
    """Return a variable, its terms as paths in a box of 1000 by 100, and their handles."""
    pairs = zip(shown.terms, colours(len(shown.terms)), strict=True)
    terms = [_term(shown, term, colour) for term, colour in pairs]
    properties = {
        name: getattr(shown, name) for name in ("name", "unit", "description", "minimum", "maximum")
    }
    return properties | {"has_sets": shown.has_sets, "shapes": SETS, "terms": terms}


def _term(shown: Variable, term: Term, colour: str) -> dict[str, Any]:
    """Return a term as the page draws it: its path, colour, numbers and handles."""
    shape, numbers = term.membership, numbers_of(term.membership)
    properties = {
        "name": term.name,
        "shape": shape.entry.name,
        "colour": colour,
        "numbers": [{"key": key, "value": value} for key, value in numbers.items()],
    }
    if not shown.has_sets:
        constant = getattr(shape, "value", getattr(shape, "constant", 0.0))
        return properties | {"middle": constant, "path": "", "handles": []}
    lower, values = sampled_bounds(shown, term)
    x = 1000.0 * (shown.universe - shown.minimum) / shown.span
    path = f"M{_points(x, values)}"
    handles = [] if isinstance(shape, Between) else list(_handles(shape))
    if isinstance(shape, Between):  # the band between both
        path += f" L{_points(x[::-1], lower[::-1])} Z"
    middle = shown.universe[np.flatnonzero(values == values.max())[[0, -1]]].mean()
    return properties | {"middle": float(middle), "path": path, "handles": handles}


def _points(x: Floats, values: Floats) -> str:
    return " L".join(f"{a:.5g} {100 - 100 * b:.4g}" for a, b in zip(x, values, strict=True))


def _handles(shape: MembershipFunction) -> Iterator[dict[str, Any]]:
    """Yield the handles of a term: its places, and its widths, to the right of their places."""
    kinds = shape.entry.kinds
    first = next((getattr(shape, key) for key, kind in kinds.items() if kind == "location"), 0.0)
    for key, kind in kinds.items():
        if kind != "location" and (kind not in ("width", "deviation") or key.startswith("left_")):
            continue
        of = key.removesuffix("standard_deviation") + "mean"
        origin, value = 0.0 if kind == "location" else getattr(shape, of, first), getattr(shape, key)
        x = origin + value
        height = float(shape_values(np.array([x]), shape)[0])
        yield {"key": key, "x": x, "y": height, "value": value, "origin": origin}


def rules(system: FuzzySystem, original: FuzzySystem | None, as_list: bool) -> list[dict[str, Any]]:
    """Return the rules as tables whose cells change at a click: a full table, or a list of rules."""
    inputs = tuple(entry.name for entry in system.inputs)
    terms = [(entry.name, [term.name for term in entry.terms]) for entry in system.outputs]
    tones = tuple((name, tuple(zip(held, colours(len(held)), strict=True))) for name, held in terms)
    before = original.rules if original is not None else ()
    rows = [
        _row(inputs, tones, rule, index, before[index : index + 1] != (rule,))
        for index, rule in enumerate(system.rules)
    ]
    rule_tables = None if as_list else text.rule_tables(system)
    if rule_tables is None:
        heads = ["rule", *(breakable(entry.name) for entry in system.variables)]
        entries = [{"head": f"rule {n + 1}", "rule": n, "cells": row} for n, row in enumerate(rows)]
        return [{"kind": "list", "heads": heads, "rows": entries}]
    concluded = (row[-1] for row in rows)
    tables = []
    for title, (heads, *held) in rule_tables:
        cells = [{"head": breakable(head), "cells": [next(concluded) for _ in row]} for head, *row in held]
        tables.append({"kind": "matrix", "title": title, "heads": [*map(breakable, heads)], "rows": cells})
    return tables


def breakable(name: str) -> str:
    """Return a name in which a line may break after underscores."""
    return name.replace("_", "_\u200b")


@lru_cache(maxsize=4096)
def _row(inputs: tuple[str, ...], tones: tuple[Any, ...], rule: Rule, index: int, is_changed: bool) -> Cells:
    """Return a cell for each input, or one in words for what is no conjunction, then for each output."""
    words = text.antecedent_words(rule.antecedent)
    changed = "changed" if is_changed else ""

    def shown(side: str, n: int, part: Is | Consequent, text: str, **more: str) -> dict[str, Any]:
        label = f"rule {index + 1}: {words}; {part.variable} is {part.term}{changed and ', changed'}; turn"
        return {"rule": index, "side": side, "index": n, "words": breakable(text), "label": label} | more

    parts = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
    questions = {}
    for n, part in enumerate(parts):
        hedges, inside = text.before(part)
        if isinstance(inside, Is):
            questions[inside.variable] = shown("if", n, inside, " ".join([*hedges, inside.term]), kind="if")
    cells: Cells = [{"words": words, "span": len(inputs)}]
    if len(questions) == len(parts):
        cells = [{"terms": [questions[name]] if name in questions else []} for name in inputs]
    for output, colour in tones:
        terms = [
            shown(
                "then",
                n,
                consequent,
                text.weighted(consequent.term, consequent.weight),
                kind=changed,
                tone=dict(colour)[consequent.term],
            )
            for n, consequent in enumerate(rule.consequents)
            if consequent.variable == output
        ]
        cells.append({"terms": terms})
    return cells


def sentence(system: FuzzySystem, rule: int) -> str | None:
    """Return a rule as a sentence to be changed; None for one that does not read back."""
    edited = system.rules[rule]
    weight = edited.consequents[0].weight
    concluded = " and ".join(
        f"{consequent.variable} is {consequent.term}" for consequent in edited.consequents
    )
    words = f"If {text.antecedent_words(edited.antecedent)} then {concluded}"
    words += "" if weight == 1.0 else f" with {weight:.12g}"
    with suppress(ValueError):
        if with_sentence(system, rule, words) == system:
            return words
    return None
