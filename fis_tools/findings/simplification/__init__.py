"""Simplification: rules, terms and digits are removed while the outputs stay within a budget.

The search takes the cheapest step first, while the budget lasts.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from fis_tools.analysis.arrays import check_samples
from fis_tools.array_types import Floats
from fis_tools.findings.simplification import draft as drafts
from fis_tools.findings.simplification import report
from fis_tools.findings.simplification.draft import Draft, Proposal
from fis_tools.findings.simplification.report import (
    Bench,
    Budget,
    Simplification,
    SimplificationStep,
    SimplifiedSystem,
)
from fis_tools.formats.serialize import SIMPLIFIED, checked
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.intervals import require_type_1
from fis_tools.model.systems import require_mamdani
from fis_tools.model.trees import require_unwired
from fis_tools.model.validate import validate
from fis_tools.source import as_controller
from fis_tools.words.text import listed

__all__ = ["Budget", "Simplification", "SimplifiedSystem", "simplify"]

#: All numbers are rounded to this many digits together, then to one less, and so on: down to so many while
#: rules and terms can still go, which matter more to a reader than digits do.
FIRST_DIGITS, CAREFUL_DIGITS = 4, 3

Progress = Callable[[str], None]


class Search:
    """A greedy search: the present draft and the steps that led to it.

    Parameters
    ----------
    bench : Bench
        The outputs of the original.
    draft : Draft
        The original.
    progress : callable, optional
        Called now and then with the progress in a few words.
    """

    def __init__(self, bench: Bench, draft: Draft, progress: Progress | None) -> None:
        self.bench = bench
        self.ranking = bench.thinned()
        self.draft = draft
        self.steps: list[SimplificationStep] = []
        self.digits = FIRST_DIGITS
        self._progress = progress
        self._refused: set[tuple[str, ...]] = set()
        self._last_changed = True

    def leave_out_inputs(self) -> None:
        """Leave out inputs that hardly matter, as though they always were one of their terms."""
        while trials := list(self._shorter()):
            cost, bench, draft, words = min(trials, key=lambda trial: trial[0])
            if cost > 1.0:
                return
            before, self.bench, self.ranking, self.draft = self.draft, bench, bench.thinned(), draft
            self._record("input", words, before)

    def _shorter(self) -> Iterator[tuple[float, Bench, Draft, str]]:
        """Yield each system without one input: its cost, its bench, itself, and the step in words."""
        system = self.draft.exact
        for index, variable in enumerate(system.inputs):
            bench = self.bench.without_input(index)
            for term in variable.terms:
                self._report_progress()
                shorter = drafts.without_input(system, variable.name, term.name)
                if shorter is not None:
                    numbers = tuple(self.draft.numbers[rule] for rule in shorter[1])
                    words = f"leave out {variable.name}, as though it always were {term.name}"
                    yield bench.cost(bench.measure(shorter[0])), bench, Draft(shorter[0], numbers), words

    def drop_unused_terms(self) -> None:
        """Remove unused terms, which changes nothing."""
        clean = drafts.cleaned(self.draft)
        removed = drafts.unused_words(self.draft.exact, clean.exact)
        if removed:
            self._try(Proposal(("terms",), "terms", f"drop {removed}, which no rule uses", clean))

    def go_greedily(self, least_digits: int) -> None:
        """Take the cheapest step that fits the budget, until none does."""
        while any(self._try(proposal) for proposal in self._next(least_digits)):
            pass

    def _next(self, least_digits: int) -> list[Proposal]:
        """Return the steps to try, the cheapest first, without those refused before."""
        proposals = drafts.proposals(self.draft, self.ranking)
        if self.digits >= least_digits:
            coarser = drafts.rounded_draft(self.draft, self.digits)
            words = f"round all numbers to {self.digits} digit{'s' if self.digits > 1 else ''}"
            rounding = Proposal(("round", str(self.digits)), "round", words, coarser)
            proposals.append((self.ranking.cost(self.ranking.measure(coarser.system)), rounding))
            proposals.sort(key=lambda entry: entry[0])
        return [proposal for _, proposal in proposals if proposal.key not in self._refused]

    def round_one_by_one(self) -> None:
        """Round the numbers that can still be rounded, a term at a time, the finest first."""
        before = self.draft
        for digits in range(drafts.MOST_DIGITS, 0, -1):
            trials = []
            for unit in drafts.units(self.draft.exact):
                draft = drafts.rounded_draft(self.draft, digits, unit)
                if draft.system != self.draft.system:
                    trials.append((self.ranking.cost(self.ranking.measure(draft.system)), unit))
            for _, unit in sorted(trials, key=lambda trial: trial[0]):
                draft = drafts.rounded_draft(self.draft, digits, unit)
                if self.bench.cost(self.bench.measure(draft.system)) <= 1.0:
                    self.draft = draft
            self._report_progress()
        if self.draft.system != before.system:
            now = [d for unit, d in self.draft.digits.items() if before.digits.get(unit) != d]
            roundings = [
                f"{now.count(digits)} to {digits} digit{'s' if digits > 1 else ''}"
                for digits in sorted(set(now), reverse=True)
            ]
            count = len(drafts.units(self.draft.exact))
            words = f"of {count} terms and ranges round {listed(roundings, len(roundings))}"
            self._record("round", words, before)

    def _try(self, proposal: Proposal) -> bool:
        """Take a step if it fits the budget."""
        self._report_progress()
        if self.bench.cost(self.bench.measure(proposal.draft.system)) > 1.0:
            self._refused.add(proposal.key)
            return False
        before, self.draft = self.draft, proposal.draft
        if proposal.kind == "round":
            self.digits -= 1
            if self.draft.system == before.system:
                return True
        self._record(proposal.kind, proposal.words, before)
        return True

    def _record(self, kind: report.Kind, words: str, before: Draft) -> None:
        """Record a step in words; successive drops that change nothing become one step."""
        after = self.draft
        rules = tuple(number for number in before.numbers if number not in after.numbers)
        if kind == "drop" and (removed := drafts.unused_words(before.exact, after.exact)):
            words += f"; {removed} {'goes' if ' and ' not in removed else 'go'} with it"
        changes = self.bench.measure(after.system)
        step = SimplificationStep(
            kind, words, rules, len(after.numbers), report.num_terms(after.system), changes
        )
        changed = self._changes_more(step)
        last = self.steps[-1] if self.steps else None
        if last is not None and kind == last.kind == "drop" and not (changed or self._last_changed):
            self.steps.pop()
            rules = (*last.rules, *rules)
            numbers = [str(number) for number in sorted(rules)]
            where = " along the logs" if self.bench.governing == (report.FLOWN,) else ""
            words = f"drop rules {listed(numbers, len(numbers))}, without which nothing changes{where}"
            step = replace(step, sentence=words, rules=rules)
        self._last_changed = changed
        self.steps.append(step)

    def _changes_more(self, step: SimplificationStep) -> bool:
        """Return whether a step changes the deviations at the samples of the budget."""
        for name in self.bench.governing:
            now = (*step.changes[name].largest, *step.changes[name].mean)
            last = self.steps[-1].changes[name] if self.steps else None
            then = (*last.largest, *last.mean) if last is not None else (0.0,) * len(now)
            if any(abs(a - b) > report.ROUNDING_ERROR for a, b in zip(now, then, strict=True)):
                return True
        return False

    def _report_progress(self) -> None:
        if self._progress is not None:
            system = self.draft.exact
            self._progress(f"{system.name}: {len(system.rules)} rules, {report.num_terms(system)} terms")


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
    Mistake
        If an output is a weighted average or sum.
    ValueError
        If samples are for a system that there is not, or do not fit its inputs.
    """
    controller = as_controller(controller)
    require_mamdani(controller.systems, "simplification")
    require_type_1(controller.systems, "simplification")
    require_unwired([controller], "simplification")
    budget, samples = budget or Budget(), samples or {}
    check_samples(controller.systems, samples)
    results = []
    for system in controller.systems:
        validate(system)
        results.append(_simplified(system, samples.get(system.name), budget, progress))
    systems = tuple(result.simplified for result in results)
    simpler = replace(controller, systems=systems).with_provenance(_facts(controller, budget, results))
    return Simplification(controller, checked(simpler), budget, tuple(results))


def _facts(controller: FuzzyController, budget: Budget, results: list[SimplifiedSystem]) -> dict[str, str]:
    """Return the facts for the provenance: what was simplified, and within which budget."""
    num_flown = sum(system.num_flown for system in results)
    along = f" ({num_flown} inferences)" if num_flown else ""
    within = report.budget_words(budget, flown=num_flown > 0) + along
    return {SIMPLIFIED: controller.name, "simplified_within": within}


def _simplified(
    system: FuzzySystem, flown: Floats | None, budget: Budget, progress: Progress | None
) -> SimplifiedSystem:
    """Simplify one system of a controller within the budget."""
    bench = report.bench_for(system, flown, budget)
    search = Search(bench, Draft(system, tuple(range(1, len(system.rules) + 1))), progress)
    search.drop_unused_terms()
    search.leave_out_inputs()
    search.go_greedily(CAREFUL_DIGITS)
    search.go_greedily(1)
    search.round_one_by_one()
    simpler, num_flown = search.draft.system, 0 if flown is None else len(flown)
    nums = (num_flown, len(bench.samples[report.SPREAD]))
    return SimplifiedSystem(system, simpler, *nums, tuple(search.steps), search.bench.measure(simpler))
