"""Whether a controller still is the one that its provenance tells of.

Who makes a controller stores the hash of its content beside what is told of it, such as its fitness. A
reader that finds another content says so, as one more fact: wherever provenance is shown, it is seen.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from fis_tools.formats.mapping import to_mapping
from fis_tools.model import FuzzyController

#: the fact that holds the hash of the content that the others are about
CONTENT_HASH: Final = "controller_hash"
#: the fact that tells of a later change
EDITED: Final = "edited"
#: the fact that tells of a change by `fis_tools.findings.simplification`
SIMPLIFIED: Final = "simplified_from"


def content_hash(controller: FuzzyController) -> str:
    """Return the SHA-256 of what a controller does: its attributes and systems without descriptions."""
    mapping = to_mapping(controller)
    content = {
        "attributes": {name: _as_number(text) for name, text in controller.attributes},
        "systems": _without_descriptions(mapping["systems"]),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def described(controller: FuzzyController, facts: Mapping[str, str]) -> FuzzyController:
    """Return a controller with facts about it as its provenance, and the hash of what they are about."""
    told = {**facts, CONTENT_HASH: content_hash(controller)}
    return replace(controller, provenance=tuple(sorted(told.items())))


def checked(controller: FuzzyController) -> FuzzyController:
    """Return a controller that was read; where its provenance is of another, that says so."""
    told = dict(controller.provenance)
    expected = told.get(CONTENT_HASH)
    if expected is None or expected == content_hash(controller):
        return controller
    who = "by simplify" if SIMPLIFIED in told else "by hand"
    told[EDITED] = f"{who} after training; fitness and figures are of hash {expected}"
    return replace(controller, provenance=tuple(sorted(told.items())))


def edited(controller: FuzzyController) -> str | None:
    """Return what is told of a later change; None where nothing is."""
    return dict(controller.provenance).get(EDITED)


def _as_number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _without_descriptions(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_descriptions(one) for key, one in value.items() if key != "description"}
    return [_without_descriptions(one) for one in value] if isinstance(value, list) else value
