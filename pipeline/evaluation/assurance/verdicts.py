"""The verdict of all evidence for a requirement, and its sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipeline.evaluation.assurance.campaign import Search
from pipeline.evaluation.assurance.formula import Always, Comparison, Eventually
from pipeline.evaluation.assurance.judgement import Judgement, Verdict, cases_needed
from pipeline.evaluation.assurance.proofs import Certificate, SafetyProof, TubeProof
from pipeline.evaluation.assurance.quantities import EXTREMES, UNITS
from pipeline.evaluation.assurance.requirements import BOUNDS, CASES, SAFETY_LAYER, SEARCH, TUBE, Requirement

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
    probability : float
        Of a case, that the bounds hold on which a proof stands.
    assumed : tuple of str
        What a proof takes for granted.
    """

    verdict: Verdict
    word: str
    why: str
    is_proof: bool = False
    probability: float = 1.0
    assumed: tuple[str, ...] = ()


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
    tube : TubeProof, optional
    """

    requirement: Requirement
    judgement: Judgement | None = None
    searches: tuple[Search, ...] = ()
    certificates: tuple[Certificate, ...] = ()
    proof: SafetyProof | None = None
    tube: TubeProof | None = None


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
    if found.tube is not None:
        judged[TUBE] = _of_a_tube(found.requirement, found.tube)
    return judged


def verdict(found: Found) -> Outcome:
    """Return the combined verdict.

    For a claim about a share of the cases the cases are decisive: single failures found by a search do
    not refute it. They do where all cases must meet the requirement. A proof shows a requirement for any
    share, unless a flight contradicts it.
    """
    judged = outcomes(found)
    failed = any(one.first_failed is not None for one in found.searches)
    for method, what in ((SAFETY_LAYER, "of the safety layer"), (TUBE, "by a tube of all starts")):
        proof = judged.get(method)
        if proof is not None and proof.verdict == "shown":
            if failed or (found.judgement and found.judgement.num_failed):
                return Outcome("refuted", WORDS["refuted"], f"flights contradict the proof {what}")
            return proof._replace(word=WORDS["shown"])
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
    times = "all samples" if proof.probability == 1.0 else "flights at all times"
    spheres = f"{times} from {proof.keep_out_m:g} to {proof.keep_in_m:g} m"
    if not proof.is_on:
        why = "the safety layer was off: its proof says nothing about these flights"
    elif proof.failing:
        why = f"premises of the safety layer's proof fail: {'; '.join(proof.failing)}"
    elif proof.num_safe < proof.num_starts:
        starts = f"{proof.num_starts - proof.num_safe:,} of {proof.num_starts:,} starts"
        why = f"{starts} are not safe states, from which the proof begins"
    elif requirement.formula is None or not proof.proves(requirement.formula):
        why = f"the safety layer keeps {spheres}, from which this does not follow"
    else:
        why = f"the safety layer keeps {spheres}, from all {proof.num_starts:,} starts"
        if proof.probability < 1.0:
            why += f", while errors are within their bounds, as in {percent(proof.probability)} of flights"
        why += "".join(f", provided that {one}" for one in proof.assumed)
        if proof.probability < requirement.probability:
            return Outcome("open", f"proved for {percent(proof.probability)}", why)
        return Outcome("shown", "proved", why, True, proof.probability, proof.assumed)
    return Outcome("open", "does not apply", why)


def _of_a_tube(requirement: Requirement, tube: TubeProof) -> Outcome:
    if tube.fault:
        return Outcome("open", "does not apply", tube.fault)
    kept = f"a tube holds all starts, keeps the limit, and is at the goal after {tube.end_s:g} s"
    if requirement.formula is None or not tube.proves(requirement.formula):
        return Outcome("open", "does not apply", f"{kept}, from which this does not follow")
    return Outcome("shown", "proved", kept, is_proof=True)


def percent(share: float) -> str:
    """Return a share in per cent with its digits, at most five significant ones."""
    return f"{100.0 * share:.5g} %"


def share(requirement: Requirement, judged: Outcome) -> str:
    """Say for what share of the cases, and how surely, a requirement is claimed or proved."""
    if judged.is_proof:
        if judged.probability < 1.0:
            given = "".join(f", if {one}" for one in judged.assumed)
            return f"{percent(judged.probability)} of cases or more (proved{given})"
        return "all cases (proved)" if requirement.formula else "all inputs (proved)"
    if requirement.formula is None:
        return "all inputs"
    if requirement.probability == 1.0:
        return "all cases"
    return (
        f"{percent(requirement.probability)} of cases or more ({percent(requirement.confidence)} confidence)"
    )


def sentence(found: Found, judged: Outcome) -> str:
    """Say what became of a requirement, in a sentence or two.

    Parameters
    ----------
    found : Found
    judged : Outcome
        The verdict of all evidence together.
    """
    requirement = found.requirement
    text = requirement.text[0].lower() + requirement.text[1:].rstrip(".")
    claim = f"{judged.word.capitalize()}: in {share(requirement, judged)} {text}".replace(
        ": in all inputs", ": for all inputs"
    )
    words = (
        f"{claim}; {_flown(found)}."
        if found.judgement or found.searches
        else (f"{claim}; failing means {requirement.consequence}.")
    )
    return words if judged.verdict == "shown" else f"{words} {judged.why[0].upper()}{judged.why[1:]}."


def _flown(found: Found) -> str:
    """Say how many flights failed, how far the worst went, and what that means."""
    judgement, searches = found.judgement, found.searches
    margins = [float(one.outcome.margins.min()) for one in searches]
    parts, num_found = [], sum(one.first_failed is not None for one in searches)
    if judgement:
        margins.append(judgement.worst_margin)
        failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} did not"
        parts.append(failed if judgement.num_failed else f"all {judgement.num_cases:,} did")
    if num_found:
        parts.append(f"{num_found} of {len(searches)} searches found a flight that did not")
    elif searches:
        parts.append(f"all {sum(len(one.scenarios) for one in searches):,} flights of searches did")
    worst = worst_words(found.requirement, min(margins))
    has_failed = num_found or (judgement and judgement.num_failed)
    consequence = found.requirement.consequence
    return f"{' and '.join(parts)}, {worst}" + (
        f": {consequence}" if has_failed else f"; failing means {consequence}"
    )


def worst_words(requirement: Requirement, margin: float) -> str:
    """Say how far the flight with the least margin went."""
    match requirement.formula:
        case Always(_, Comparison(((name, factor),), constant)) | Eventually(
            _, Comparison(((name, factor),), constant)
        ):
            if name in EXTREMES:
                value = f"{(margin - constant) / factor:.4g} {UNITS[name]}"
                return EXTREMES[name][factor < 0.0].format(value)
    unit = " in units of its formula" if requirement.unit == "mixed" else f" {requirement.unit}"
    return f"the worst by {-margin:.4g}{unit}" if margin < 0.0 else f"the least margin {margin:.4g}{unit}"
