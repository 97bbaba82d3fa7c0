"""The differences between two fuzzy controllers: variables, terms, rules, and outputs."""

from collections.abc import Mapping

from fis_tools.array_types import Floats
from fis_tools.findings.difference import comparison
from fis_tools.findings.difference.comparison import Fact, Source, SystemDifference
from fis_tools.findings.difference.report import Difference
from fis_tools.formats.serialize import fingerprint
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.validate import validate

__all__ = ["Difference", "SystemDifference", "difference"]


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
    return Difference(_source(before, files[0]), _source(after, files[1]), facts, (*compared, *gone))


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
    variables = comparison.compare_variables(before, after)
    rules = comparison.compare_rules(before, after, comparison.new_names(variables))
    outputs = comparison.compare_outputs(before, after, None if samples is None else samples.get(after.name))
    return SystemDifference(before, after, comparison.system_facts(before, after), variables, rules, outputs)
