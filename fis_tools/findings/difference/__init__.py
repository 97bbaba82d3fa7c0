"""The differences between two fuzzy controllers: variables, terms, rules, and outputs."""

from collections.abc import Mapping
from dataclasses import dataclass

from fis_tools.array_types import Floats
from fis_tools.document import Document, Result
from fis_tools.findings.difference import words
from fis_tools.findings.difference.change import (
    Fact,
    OutputChange,
    RuleChange,
    Source,
    SystemDifference,
    TermChange,
    VariableChange,
)
from fis_tools.findings.difference.comparison import compare_rules, compare_variables, new_names, system_facts
from fis_tools.findings.difference.outputs import compare_outputs
from fis_tools.formats.serialize import fingerprint
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.validate import validate

__all__ = [
    "Difference",
    "Fact",
    "OutputChange",
    "RuleChange",
    "Source",
    "SystemDifference",
    "TermChange",
    "VariableChange",
    "difference",
]


@dataclass(frozen=True, repr=False)
class Difference(Result):
    """The differences between two controllers.

    Parameters
    ----------
    before, after : Source
        What was compared.
    facts : tuple of Fact
        Attributes that changed, and the name.
    systems : tuple of SystemDifference
        In their present order, removed systems last; unchanged systems are included.
    """

    before: Source
    after: Source
    facts: tuple[Fact, ...]
    systems: tuple[SystemDifference, ...]

    @property
    def is_empty(self) -> bool:
        """Whether the controllers are the same apart from their provenance."""
        return not self.facts and all(system.is_empty for system in self.systems)

    def document(self, *, pictures: bool = False) -> Document:
        """Say what changed; on demand with pictures of terms and surfaces, for pages."""
        return words.document((self.before, self.after), self.facts, self.systems, pictures=pictures)

    def plain(self) -> dict[str, object]:
        """Return it as plain data, for the schema fuzzy-difference, version 1."""
        return words.plain((self.before, self.after), self.facts, self.systems)

    def html(self) -> str:
        """Write it as a page that needs no other file, with pictures."""
        from fis_tools.document import html  # noqa: PLC0415 - as in `Result`

        return html.page(self.document(pictures=True))

    def _repr_html_(self) -> str:
        from fis_tools.document import html  # noqa: PLC0415 - as in `Result`

        return html.fragment(self.document(pictures=True))


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
    old, new = _systems(before), _systems(after)
    if isinstance(before, FuzzySystem) and isinstance(after, FuzzySystem):
        old = {after.name: before}
    facts = tuple(_facts(before, after))
    for system in (*old.values(), *new.values()):
        validate(system)
    compared = [_compare(old.pop(name, None), system, samples) for name, system in new.items()]
    gone = [SystemDifference(system, None) for system in old.values()]
    sources = [_source(one, file) for one, file in zip((before, after), files, strict=True)]
    return Difference(sources[0], sources[1], facts, (*compared, *gone))


def _source(controller: FuzzyController | FuzzySystem, file: str) -> Source:
    whole = (
        controller
        if isinstance(controller, FuzzyController)
        else FuzzyController(controller.name, (controller,))
    )
    return Source(controller.name, file, fingerprint(whole))


def _systems(controller: FuzzyController | FuzzySystem) -> dict[str, FuzzySystem]:
    systems = (controller,) if isinstance(controller, FuzzySystem) else controller.systems
    return {system.name: system for system in systems}


def _facts(before: FuzzyController | FuzzySystem, after: FuzzyController | FuzzySystem) -> list[Fact]:
    facts = [Fact("name", before.name, after.name)]
    old, new = (dict(c.attributes) if isinstance(c, FuzzyController) else {} for c in (before, after))
    facts += [Fact(key, old.get(key, "none"), new.get(key, "none")) for key in sorted({*old, *new})]
    return [fact for fact in facts if fact.before != fact.after]


def _compare(
    before: FuzzySystem | None, after: FuzzySystem, samples: Mapping[str, Floats] | None
) -> SystemDifference:
    if before is None:
        return SystemDifference(None, after)
    variables = compare_variables(before, after)
    rules = compare_rules(before, after, new_names(variables))
    outputs = compare_outputs(before, after, None if samples is None else samples.get(after.name))
    return SystemDifference(before, after, system_facts(before, after), variables, rules, outputs)
