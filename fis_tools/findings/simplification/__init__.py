"""Simplification: rules, terms and digits are removed while the outputs stay within a budget."""

from collections.abc import Mapping
from dataclasses import replace

from fis_tools.array_types import Floats
from fis_tools.findings.simplification.budget import Budget, Change, bench_for
from fis_tools.findings.simplification.draft import Draft
from fis_tools.findings.simplification.report import Simplification, SimplifiedSystem, Step, budget_words
from fis_tools.findings.simplification.search import CAREFUL_DIGITS, Progress, Search
from fis_tools.formats.provenance import SIMPLIFIED, checked
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.systems import require_mamdani
from fis_tools.model.validate import nearest, validate

__all__ = ["Budget", "Change", "Simplification", "SimplifiedSystem", "Step", "simplify"]


def simplify(
    controller: FuzzyController | FuzzySystem,
    samples: Mapping[str, Floats] | None = None,
    budget: Budget | None = None,
    progress: Progress | None = None,
) -> Simplification:
    """Simplify a controller while its outputs stay near those of the original.

    Inputs that hardly matter are left out first. Then a step drops a rule, merges two similar terms, or
    rounds all numbers to one digit less; unused terms are removed. Of all steps the one that keeps the
    outputs nearest to the original's is taken, until none fits the budget; then numbers are rounded
    further, all or some. Each step is measured on all samples.

    Parameters
    ----------
    controller : FuzzyController or FuzzySystem
    samples : mapping of str to (n, num_inputs), optional
        Inputs by the system's name, such as `fis_tools.analysis.flights.inputs_along` returns. The budget
        holds there and over samples of the whole ranges of the inputs.
    budget : Budget, optional
    progress : callable, optional
        Called now and then with the progress in a few words.

    Raises
    ------
    InvalidSystem
        If a system has problems, with one line for each.
    NotMamdani
        If an output is a weighted average or sum.
    ValueError
        If samples are for a system that there is not, or do not fit its inputs.
    """
    if isinstance(controller, FuzzySystem):
        controller = FuzzyController(controller.name, (controller,))
    require_mamdani(controller.systems, "simplification")
    budget, samples = budget or Budget(), samples or {}
    names = [system.name for system in controller.systems]
    for name in samples:
        if name not in names:
            raise ValueError(f"samples are given for {name!r}; {nearest(name, names)}")
    found = []
    for system in controller.systems:
        validate(system)
        found.append(_simplified(system, samples.get(system.name), budget, progress))
    simpler = replace(
        controller,
        systems=tuple(system.simplified for system in found),
        provenance=_provenance(controller, budget, found),
    )
    return Simplification(controller, checked(simpler), budget, tuple(found))


def _provenance(
    controller: FuzzyController, budget: Budget, found: list[SimplifiedSystem]
) -> tuple[tuple[str, str], ...]:
    num_flown = sum(system.num_flown for system in found)
    along = f" ({num_flown} inferences)" if num_flown else ""
    facts = dict(controller.provenance)
    facts[SIMPLIFIED] = controller.name
    facts["simplified_within"] = budget_words(budget, flown=num_flown > 0) + along
    return tuple(sorted(facts.items()))


def _simplified(
    system: FuzzySystem, flown: Floats | None, budget: Budget, progress: Progress | None
) -> SimplifiedSystem:
    bench = bench_for(system, flown, budget)
    search = Search(bench, Draft(system, tuple(range(1, len(system.rules) + 1))), progress)
    search.drop_unused_terms()
    search.leave_out_inputs()
    search.go_greedily(CAREFUL_DIGITS)
    search.go_greedily(1)
    search.round_one_by_one()
    return SimplifiedSystem(
        system,
        search.draft.system,
        0 if flown is None else len(flown),
        tuple(search.steps),
        search.bench.measure(search.draft.system),
    )
