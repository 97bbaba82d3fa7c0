"""What the parts of the page are given: variables as curves, rules as cells, as plain data."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from fis_tools.edit.touches import numbers_of, said
from fis_tools.model import And, FuzzySystem, Is, MembershipFunction, Rule, Sampled, Term, Variable
from fis_tools.model.shape import SHAPES
from fis_tools.model.systems import has_sets
from fis_tools.model.variables import sample, shape_values
from fis_tools.words import text

#: from the lowest term over the middle one to the highest, as lines and as grounds of letters
LOW, MIDDLE, HIGH = (31, 95, 168), (98, 105, 115), (190, 80, 20)
TINT = 0.16


def colours(count: int) -> list[str]:
    """Return a colour for each of some ordered terms."""
    places = np.linspace(-1.0, 1.0, count) if count > 1 else [0.0]
    found = []
    for place in places:
        end, share = np.array(LOW if place < 0 else HIGH), abs(place)
        found.append(
            "rgb({} {} {})".format(*(round(c) for c in share * end + (1 - share) * np.array(MIDDLE)))
        )
    return found


def tint(colour: str) -> str:
    """Return a light ground of a colour."""
    return f"color-mix(in srgb, {colour} {100 * TINT:.0f}%, white)"


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
        "shapes": [
            name for name, kind in SHAPES.items() if kind.entry.kinds and name not in ("constant", "linear")
        ],
        "terms": [_term(shown, term, colour) for term, colour in told],
    }


def _term(shown: Variable, term: Term, colour: str) -> dict[str, Any]:
    shape, told = term.membership, numbers_of(term.membership)
    numbers = [
        {
            "key": key,
            "label": key.replace("_", " "),
            "value": value if isinstance(value, str) else f"{value:.12g}",
        }
        for key, value in told.items()
    ]
    found = {
        "name": term.name,
        "shape": shape.entry.name if type(shape) in SHAPES.values() else "formula",
        "colour": colour,
        "numbers": numbers,
    }
    if not has_sets(shown):
        constant = told.get("value", told.get("constant", 0.0))
        return found | {"middle": constant if isinstance(constant, float) else 0.0, "path": "", "handles": []}
    values = sample(shown, term)
    x = 1000.0 * (shown.universe - shown.minimum) / (shown.maximum - shown.minimum)
    points = " L".join(f"{a:.5g} {100 - 100 * b:.4g}" for a, b in zip(x, values, strict=True))
    middle = shown.universe[np.flatnonzero(values == values.max())[[0, -1]]].mean()
    handles = [] if isinstance(shape, Sampled) else _handles(shape)
    return found | {"middle": float(middle), "path": f"M{points}", "handles": handles}


def _handles(shape: MembershipFunction) -> list[dict[str, Any]]:
    """Return what can be dragged: the places, and the widths at their distance from the first place."""
    kinds = shape.entry.kinds
    places = [getattr(shape, key) for key, kind in kinds.items() if kind == "place"]
    found = []
    for key, kind in kinds.items():
        if kind not in ("place", "width", "deviation"):
            continue
        value = getattr(shape, key)
        side = key.removesuffix("standard_deviation") + "mean"
        origin = getattr(shape, side, places[0] if places else 0.0)
        x = value if kind == "place" else origin + value * (-1.0 if key.startswith("left_") else 1.0)
        if key.startswith("left_") and kind != "place":
            continue  # a number that grows to the left is typed
        height = float(shape_values(np.array([x]), shape)[0])
        found.append({"key": key, "label": key.replace("_", " "), "x": x, "y": height, "value": value})
    return found


def rules(system: FuzzySystem, original: FuzzySystem | None) -> list[dict[str, Any]]:
    """Return the rules with the cells that a press turns; one that is no conjunction has words alone."""
    tones = {
        (output.name, term.name): colour
        for output in system.outputs
        for term, colour in zip(output.terms, colours(len(output.terms)), strict=True)
    }
    before = original.rules if original is not None else ()
    return [
        {
            "number": place + 1,
            "words": text.antecedent_words(rule.antecedent),
            "cells": _cells(system.inputs, rule),
            "changed": place >= len(before) or before[place] != rule,
            "then": [
                {
                    "place": n,
                    "variable": one.variable,
                    "term": one.term,
                    "weight": one.weight,
                    "colour": (colour := tones[one.variable, one.term]),
                    "tint": tint(colour),
                }
                for n, one in enumerate(rule.consequents)
            ],
        }
        for place, rule in enumerate(system.rules)
    ]


def _cells(inputs: Sequence[Variable], rule: Rule) -> list[dict[str, Any] | None] | None:
    """Return a cell for each input that a conjunction asks for; None for any other antecedent."""
    parts = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
    found: dict[str, dict[str, Any]] = {}
    for place, part in enumerate(parts):
        words, inside = text.before(part)
        if not isinstance(inside, Is) or inside.variable in found:
            return None
        told = {"place": place, "variable": inside.variable, "term": inside.term}
        found[inside.variable] = told | {"before": " ".join(words)}
    return [found.get(one.name) for one in inputs]


def tables(system: FuzzySystem) -> list[dict[str, Any]] | None:
    """Return a full rule table as tables of the places of rules; None for any other rule base."""
    found = text.rule_tables(system)
    if found is None:
        return None
    shown, place = [], 0
    for title, ((corner, *heads), *rows) in found:
        told = []
        for head, *cells in rows:
            told.append({"head": head, "rules": list(range(place, place + len(cells)))})
            place += len(cells)
        shown.append({"title": title, "corner": corner, "heads": heads, "rows": told})
    return shown


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
