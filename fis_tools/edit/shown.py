"""What the parts of the page are given: variables as curves, rules as cells, as plain data."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from fis_tools.edit.touches import numbers_of, said
from fis_tools.model import And, Consequent, FuzzySystem, Is, MembershipFunction, Term, Variable
from fis_tools.model.shape import SHAPES
from fis_tools.model.systems import has_sets
from fis_tools.model.variables import sample, shape_values
from fis_tools.words import text

#: from the lowest term over the middle one to the highest
LOW, MIDDLE, HIGH = "#1f5fa8", "#626973", "#be5014"
#: shapes that any term of a set may take
SETS = [name for name, kind in SHAPES.items() if kind.entry.kinds and name not in ("constant", "linear")]


def colours(count: int) -> list[str]:
    """Return a colour for each of some ordered terms."""
    places = np.linspace(-1.0, 1.0, count) if count > 1 else [0.0]
    return [
        f"color-mix(in srgb, {LOW if place < 0 else HIGH} {100 * abs(place):.0f}%, {MIDDLE})"
        for place in places
    ]


def variable(shown: Variable) -> dict[str, Any]:
    """Return a variable, its terms as paths in a box of 1000 by 100, and their handles."""
    told = zip(shown.terms, colours(len(shown.terms)), strict=True)
    return {
        "name": shown.name,
        "unit": shown.unit,
        "description": shown.description,
        "minimum": shown.minimum,
        "maximum": shown.maximum,
        "has_sets": has_sets(shown),
        "shapes": SETS,
        "terms": [_term(shown, term, colour) for term, colour in told],
    }


def _term(shown: Variable, term: Term, colour: str) -> dict[str, Any]:
    shape, numbers = term.membership, numbers_of(term.membership)
    found = {
        "name": term.name,
        "shape": shape.entry.name,
        "colour": colour,
        "numbers": [{"key": key, "label": _label(key), "value": value} for key, value in numbers.items()],
    }
    if not has_sets(shown):
        constant = getattr(shape, "value", getattr(shape, "constant", 0.0))
        return found | {"middle": constant, "path": "", "handles": []}
    values = sample(shown, term)
    x = 1000.0 * (shown.universe - shown.minimum) / (shown.maximum - shown.minimum)
    points = " L".join(f"{a:.5g} {100 - 100 * b:.4g}" for a, b in zip(x, values, strict=True))
    middle = shown.universe[np.flatnonzero(values == values.max())[[0, -1]]].mean()
    return found | {"middle": float(middle), "path": f"M{points}", "handles": list(_handles(shape))}


def _label(key: str) -> str:
    return key.replace("_", " ")


def _handles(shape: MembershipFunction) -> Iterator[dict[str, Any]]:
    """Yield what can be dragged: the places, and the widths that grow to the right of theirs."""
    kinds = shape.entry.kinds
    first = next((getattr(shape, key) for key, kind in kinds.items() if kind == "place"), 0.0)
    for key, kind in kinds.items():
        if kind != "place" and (kind not in ("width", "deviation") or key.startswith("left_")):
            continue
        of = key.removesuffix("standard_deviation") + "mean"
        origin, value = 0.0 if kind == "place" else getattr(shape, of, first), getattr(shape, key)
        x = origin + value
        height = float(shape_values(np.array([x]), shape)[0])
        yield {"key": key, "label": _label(key), "x": x, "y": height, "value": value, "origin": origin}


def rules(system: FuzzySystem, original: FuzzySystem | None, as_list: bool) -> list[dict[str, Any]]:
    """Return the rules as tables of terms that a press turns: a full table as such, others as a list."""
    names = [one.name for one in system.outputs]
    tones = {
        Is(output.name, term.name): colour
        for output in system.outputs
        for term, colour in zip(output.terms, colours(len(output.terms)), strict=True)
    }
    before = original.rules if original is not None else ()
    told = [
        _RuleShown(system, place, before[place : place + 1] != (rule,), tones)
        for place, rule in enumerate(system.rules)
    ]
    found = None if as_list else text.rule_tables(system)
    if found is None:
        rows = [
            {"head": f"rule {one.place + 1}", "rule": one.place}
            | {"cells": [*one.asked(), *map(one.concluded, names)]}
            for one in told
        ]
        heads = ["rule", *(breakable(one.name) for one in (*system.inputs, *system.outputs))]
        return [{"kind": "list", "heads": heads, "rows": rows}]
    following = iter(told)
    return [
        {
            "kind": "matrix",
            "title": title,
            "heads": list(map(breakable, heads)),
            "rows": [
                {"head": breakable(head), "cells": [next(following).concluded(names[0]) for _ in cells]}
                for head, *cells in rows
            ],
        }
        for title, (heads, *rows) in found
    ]


def breakable(name: str) -> str:
    """Return a name that a line may break after an underscore of."""
    return name.replace("_", "_\u200b")


class _RuleShown:
    """A rule, as cells of a table."""

    def __init__(self, system: FuzzySystem, place: int, is_changed: bool, tones: dict[Is, str]) -> None:
        self._system, self.place, self._is_changed, self._tones = system, place, is_changed, tones
        self._rule = system.rules[place]
        self._words = text.antecedent_words(self._rule.antecedent)

    def _term(self, side: str, place: int, one: Is | Consequent, words: str, **more: str) -> dict[str, Any]:
        changed = ", changed" if self._is_changed else ""
        return {
            "rule": self.place,
            "side": side,
            "place": place,
            "words": breakable(words),
            "kind": f"{side}{' changed' if self._is_changed and side == 'then' else ''}",
            "label": f"rule {self.place + 1}: {self._words}; {one.variable} is {one.term}{changed}; turn",
        } | more

    def concluded(self, output: str) -> dict[str, Any]:
        """Return what it concludes of an output."""
        return {
            "terms": [
                self._term("then", n, one, _weighted(one), tone=self._tones[Is(output, one.term)])
                for n, one in enumerate(self._rule.consequents)
                if one.variable == output
            ]
        }

    def asked(self) -> list[dict[str, Any]]:
        """Return what it asks of each input; in words alone unless it is a conjunction."""
        antecedent, inputs = self._rule.antecedent, self._system.inputs
        parts = antecedent.operands if isinstance(antecedent, And) else (antecedent,)
        found: dict[str, dict[str, Any]] = {}
        for place, part in enumerate(parts):
            words, inside = text.before(part)
            if not isinstance(inside, Is) or inside.variable in found:
                return [{"words": self._words, "span": len(inputs)}]
            found[inside.variable] = self._term("if", place, inside, " ".join([*words, inside.term]))
        return [{"terms": [found[one.name]] if one.name in found else []} for one in inputs]


def _weighted(one: Consequent) -> str:
    return one.term if one.weight == 1.0 else f"{one.term} × {one.weight:g}"


def sentence(system: FuzzySystem, rule: int) -> str | None:
    """Return a rule as a sentence to be changed; None for one that does not read back."""
    held = system.rules[rule]
    weight = held.consequents[0].weight
    concluded = " and ".join(f"{one.variable} is {one.term}" for one in held.consequents)
    words = f"If {text.antecedent_words(held.antecedent)} then {concluded}"
    words += "" if weight == 1.0 else f" with {weight:.12g}"
    with suppress(ValueError):
        if said(system, rule, words) == system:
            return words
    return None
