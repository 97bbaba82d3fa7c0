"""Systems to exchange: what the formats can say, everything of it."""

from dataclasses import replace
from pathlib import Path
from types import ModuleType

from fis_tools.formats.serialize import load
from fis_tools.model import And, Consequent, FuzzyController, FuzzySystem, Is, Not, Or, Rule, with_variables

#: every shape; weights, not, or, partial antecedents, two outputs; nothing nested
(FLAT,) = load(Path(__file__).parent / "climate.yaml").systems


_MORE = (
    Rule(
        And((Is("temperature", "cold"), Not(Is("wind", "calm")))),
        (Consequent("heat", "much", 0.8), Consequent("flap", "shut")),
        label="keep warm",
    ),
    Rule(
        Not(And((Is("temperature", "freezing"), Is("wind", "storm")))),
        (Consequent("heat", "some", 0.3), Consequent("heat", "none", 0.3)),
        label="everyday",
    ),
)
#: the same with a conjunction denied, weights that differ, labels, two conclusions on one output
DENIED = replace(FLAT, rules=(*_MORE, *FLAT.rules))
_NESTED = And((Is("temperature", "cold"), Or((Is("wind", "strong"), Not(Is("wind", "calm"))))))
#: the same with a rule that nests
NESTED = replace(DENIED, rules=(replace(_MORE[0], antecedent=_NESTED), *DENIED.rules[1:]))


def fine(system: FuzzySystem, num_points: int) -> FuzzySystem:
    """The same system on universes of so many points."""
    return with_variables(system, lambda variable: replace(variable, num_points=num_points))


def without_comment(text: str) -> str:
    """A file as other programs see it."""
    return "\n".join(line for line in text.splitlines() if "fis_tools carries" not in line) + "\n"


def written(folder: Path, system: FuzzySystem, form: ModuleType) -> Path:
    """Write a system in a form, to a file of its ending."""
    path = folder / f"{system.name}.{form.__name__.rpartition('.')[2]}"
    path.write_text(form.write(alone(system)).text, encoding="utf-8")
    return path


def alone(system: FuzzySystem) -> FuzzyController:
    """A controller with one system and facts of its own."""
    attributes = (("axis", "x"), ("note", "a -- b */ <c> & 'd' # e"))
    return FuzzyController("exchanged", (system,), attributes, (("made_by", "hand"),))
