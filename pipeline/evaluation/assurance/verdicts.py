"""What all evidence for a requirement comes to: shown, not shown or refuted, and why, in a sentence."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pipeline.evaluation.assurance.claims import Judgement, Verdict, cases_needed
from pipeline.evaluation.assurance.proofs import Certificate, SafetyProof
from pipeline.evaluation.assurance.requirements import BOUNDS, CASES, SAFETY_LAYER, SEARCH, Requirement
from pipeline.evaluation.assurance.search import Search

#: from the best to the worst
ORDER: tuple[Verdict, ...] = ("shown", "open", "refuted")
Outcome = tuple[Verdict, str]


@dataclass(frozen=True)
class Found:
    """All evidence that was found for a requirement.

    Parameters
    ----------
    requirement : Requirement
    judgement : Judgement, optional
        Of its cases.
    searches : tuple of Search
    certificates : tuple of Certificate
    proof : SafetyProof, optional
    """

    requirement: Requirement
    judgement: Judgement | None = None
    searches: tuple[Search, ...] = ()
    certificates: tuple[Certificate, ...] = ()
    proof: SafetyProof | None = None


def outcomes(found: Found) -> dict[str, Outcome]:
    """Return what each way of verification says, by its name."""
    judged: dict[str, Outcome] = {}
    if found.judgement is not None:
        judged[CASES] = _of_cases(found.requirement, found.judgement)
    if found.searches:
        judged[SEARCH] = _of_searches(found.searches)
    if BOUNDS in found.requirement.verified_by:
        judged[BOUNDS] = _of_bounds(found.certificates)
    if found.proof is not None:
        judged[SAFETY_LAYER] = _of_the_layer(found.requirement, found.proof)
    return judged


def verdict(found: Found) -> Outcome:
    """Return what all say together.

    A claim about a share of the cases stands or falls with the cases: single failures that a search finds do
    not refute it. A proof shows a requirement whatever the share, unless a flight contradicts it.
    """
    judged = outcomes(found)
    failed = [one for one in found.searches if one.first_failed is not None]
    if judged.get(SAFETY_LAYER, ("open", ""))[0] == "shown":
        if failed or (found.judgement and found.judgement.num_failed):
            return "refuted", "flights contradict the proof of the safety layer"
        return judged[SAFETY_LAYER]
    decisive = [judged[name] for name in (CASES, BOUNDS) if name in judged]
    if not decisive:
        decisive = list(judged.values())
    return max(decisive, key=lambda one: ORDER.index(one[0]))


def _of_cases(requirement: Requirement, judgement: Judgement) -> Outcome:
    claim = f"{percent(requirement.probability)} with {percent(requirement.confidence)} confidence"
    failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} cases fail"
    if judgement.verdict == "shown":
        words = f"{failed}; {claim} is shown with up to {judgement.num_allowed:,}"
    elif judgement.verdict == "refuted":
        surely = f"with {percent(requirement.confidence)} confidence"
        words = f"{failed}; {surely} at most {percent(judgement.high)} meet it"
    elif judgement.num_allowed < 0:
        needed = cases_needed(requirement.probability, requirement.confidence)
        words = f"{failed}; {claim} needs {needed:,} cases without a failure"
    else:
        words = f"{failed}; {claim} allows {judgement.num_allowed:,}"
    return judgement.verdict, words


def _of_searches(searches: Sequence[Search]) -> Outcome:
    flights = sum(len(one.scenarios) for one in searches)
    failed = sum(one.first_failed is not None for one in searches)
    if failed:
        return (
            "refuted",
            f"{failed} of {len(searches)} searches find a case that fails, in {flights:,} flights",
        )
    return "open", f"{len(searches)} searches find no case that fails, in {flights:,} flights"


def _of_bounds(certificates: Sequence[Certificate]) -> Outcome:
    if not certificates:
        return "open", "the controller has no system that is asked about"
    boxes = sum(len(one.low) for one in certificates)
    verdicts = [one.verdict for one in certificates]
    if "yes" in verdicts:
        return "refuted", certificates[verdicts.index("yes")].sentence
    if open_ := [one.sentence for one in certificates if one.verdict != "no"]:
        return "open", open_[0]
    return "shown", f"proved for all inputs, by {boxes:,} boxes that answer {len(certificates)} questions"


def _of_the_layer(requirement: Requirement, proof: SafetyProof) -> Outcome:
    if not proof.is_on:
        return "open", "the safety layer was off, so that its proof says nothing about these flights"
    if proof.num_safe < proof.num_starts:
        unsafe = proof.num_starts - proof.num_safe
        return (
            "open",
            f"{unsafe:,} of {proof.num_starts:,} starts are not safe states, where the proof begins",
        )
    spheres = f"all samples from {proof.keep_out_m:g} to {proof.keep_in_m:g} m"
    if requirement.formula is None or not proof.proves(requirement.formula):
        return "open", f"the safety layer keeps {spheres}, from which this does not follow"
    return "shown", f"the safety layer keeps {spheres}, from all {proof.num_starts:,} starts: proved"


def percent(share: float) -> str:
    """Write a share in per cent with the digits that it has, at most five significant ones."""
    return f"{100.0 * share:.5g} %"


#: a verdict in words
WORDS: dict[Verdict, Literal["shown", "not shown", "refuted"]] = {
    "shown": "shown",
    "open": "not shown",
    "refuted": "refuted",
}
