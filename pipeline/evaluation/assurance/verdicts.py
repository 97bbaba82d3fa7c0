"""The verdict of all evidence for a requirement: shown, not shown or refuted, and why."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipeline.evaluation.assurance.claims import Judgement, Verdict, cases_needed
from pipeline.evaluation.assurance.proofs import Certificate, SafetyProof
from pipeline.evaluation.assurance.requirements import BOUNDS, CASES, SAFETY_LAYER, SEARCH, Requirement
from pipeline.evaluation.assurance.search import Search

#: from the best to the worst, and in words
WORDS: Mapping[Verdict, str] = {"shown": "shown", "open": "not shown", "refuted": "refuted"}
ORDER = list(WORDS)


class Outcome(NamedTuple):
    """The result of one method of verification.

    Attributes
    ----------
    verdict : str
        Of the requirement, from this method alone.
    word : str
        The finding, in a word or two.
    why : str
        The reason, in a sentence without its full stop.
    is_proof : bool
        Whether it holds for all cases and not for a share.
    """

    verdict: Verdict
    word: str
    why: str
    is_proof: bool = False


@dataclass(frozen=True)
class Found:
    """All evidence found for a requirement.

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
    """Return the result of each method of verification, by its name."""
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
    """Return the combined verdict.

    For a claim about a share of the cases the cases are decisive: single failures found by a search do
    not refute it. They do where all cases must meet the requirement. A proof shows a requirement for any
    share, unless a flight contradicts it.
    """
    judged = outcomes(found)
    failed = any(one.first_failed is not None for one in found.searches)
    layer = judged.get(SAFETY_LAYER)
    if layer is not None and layer.verdict == "shown":
        if failed or (found.judgement and found.judgement.num_failed):
            return Outcome("refuted", WORDS["refuted"], "flights contradict the proof of the safety layer")
        return layer._replace(word=WORDS["shown"])
    if failed and found.requirement.probability == 1.0 and CASES in judged:
        return judged[SEARCH]._replace(word=WORDS["refuted"])
    decisive = [judged[name] for name in (CASES, BOUNDS) if name in judged] or list(judged.values())
    worst = max(decisive, key=lambda one: ORDER.index(one.verdict))
    return worst._replace(word=WORDS[worst.verdict])


def _of_cases(requirement: Requirement, judgement: Judgement) -> Outcome:
    confidence = percent(requirement.confidence)
    claim = f"{percent(requirement.probability)} with {confidence} confidence"
    failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} cases fail"
    if requirement.probability == 1.0:
        low = percent(judgement.low)
        why = (
            f"with {confidence} confidence at least {low} of such cases meet it; only a proof shows it of all"
        )
    elif judgement.verdict == "shown":
        why = f"up to {judgement.num_allowed:,} failures show {claim}"
    elif judgement.verdict == "refuted":
        why = f"with {confidence} confidence at most {percent(judgement.high)} of such cases meet it"
    elif judgement.num_allowed < 0:
        needed = cases_needed(requirement.probability, requirement.confidence)
        why = f"{claim} needs {needed:,} cases without a failure"
    else:
        why = f"only up to {judgement.num_allowed:,} failures show {claim}"
    return Outcome(judgement.verdict, failed, why)


def _of_searches(searches: Sequence[Search]) -> Outcome:
    flights = f"{sum(len(one.scenarios) for one in searches):,} flights"
    if failed := sum(one.first_failed is not None for one in searches):
        why = f"{failed} of {len(searches)} searches find a case that fails, in {flights}"
        return Outcome("refuted", "failure found", why)
    return Outcome("open", "none found", f"{len(searches)} searches find no case that fails, in {flights}")


def _of_bounds(certificates: Sequence[Certificate]) -> Outcome:
    if not certificates:
        return Outcome("open", "nothing to bound", "the controller has no system that is asked about")
    for one in certificates:
        if one.verdict == "yes":
            return Outcome("refuted", WORDS["refuted"], one.sentence.rstrip("."))
    for one in certificates:
        if one.verdict != "no":
            return Outcome("open", one.verdict, one.sentence.rstrip("."))
    boxes = sum(len(one.low) for one in certificates)
    why = f"no for all inputs: {boxes:,} boxes prove the answers to {len(certificates)} questions"
    return Outcome("shown", "proved", why, is_proof=True)


def _of_the_layer(requirement: Requirement, proof: SafetyProof) -> Outcome:
    spheres = f"all samples from {proof.keep_out_m:g} to {proof.keep_in_m:g} m"
    if not proof.is_on:
        why = "the safety layer was off: its proof says nothing about these flights"
    elif not proof.is_exact:
        why = "the safety layer's proof is of places, forces and motion known exactly, and these are not"
    elif proof.num_safe < proof.num_starts:
        starts = f"{proof.num_starts - proof.num_safe:,} of {proof.num_starts:,} starts"
        why = f"{starts} are not safe states, from which the proof begins"
    elif requirement.formula is None or not proof.proves(requirement.formula):
        why = f"the safety layer keeps {spheres}, from which this does not follow"
    else:
        why = f"the safety layer keeps {spheres}, from all {proof.num_starts:,} starts"
        return Outcome("shown", "proved", why, is_proof=True)
    return Outcome("open", "does not apply", why)


def percent(share: float) -> str:
    """Return a share in per cent with its digits, at most five significant ones."""
    return f"{100.0 * share:.5g} %"
