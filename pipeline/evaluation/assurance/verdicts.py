"""The verdict of all evidence for a requirement."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipeline.evaluation.assurance.campaign import WorstCaseSearch
from pipeline.evaluation.assurance.certificates import Certificate
from pipeline.evaluation.assurance.judgements import ORDER, Judgement, Verdict, needed_by
from pipeline.evaluation.assurance.proofs import SafetyProof
from pipeline.evaluation.assurance.requirements import (
    BOUNDS,
    CASES,
    SAFETY_LAYER,
    SEARCH,
    SPLITTING,
    TUBE,
    Requirement,
)
from pipeline.evaluation.assurance.tube import TubeProof
from pipeline.evaluation.splitting import RareShare

#: of a proof whose certificate nobody checked, and how to check it
UNCHECKED = "stated by the run, not checked"
CHECKER = "to check it, install python-flint (the extra proof) and repeat the stage assure"
#: methods that prove; a run is told of those that were asked for in vain
PROOFS = (BOUNDS, SAFETY_LAYER, TUBE)


class MethodResult(NamedTuple):
    """The result of a method of verification.

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
    is_continuous : bool
        Whether it holds at all times and not at samples alone.
    """

    verdict: Verdict
    word: str
    why: str
    is_proof: bool = False
    probability: float = 1.0
    assumed: tuple[str, ...] = ()
    is_continuous: bool = False


@dataclass(frozen=True)
class Evidence:
    """All evidence for a requirement.

    Parameters
    ----------
    requirement : Requirement
    judgement : Judgement, optional
        Of its cases.
    searches : tuple of WorstCaseSearch
    certificates : tuple of Certificate
    proof : SafetyProof, optional
    tube : TubeProof, optional
    duration_s, period_s : float
        Of the flights, and between their samples.
    worst_unit : str
        The unit of the least margin of all flights.
    rare : RareShare, optional
        The share of failures by splitting, whose ends are one-sided bounds.
    """

    requirement: Requirement
    judgement: Judgement | None = None
    searches: tuple[WorstCaseSearch, ...] = ()
    certificates: tuple[Certificate, ...] = ()
    proof: SafetyProof | None = None
    tube: TubeProof | None = None
    duration_s: float = 0.0
    period_s: float = 0.0
    worst_unit: str = ""
    rare: RareShare | None = None


def results_by_method(evidence: Evidence) -> dict[str, MethodResult]:
    """Return the result of each method of verification, by its name."""
    judged: dict[str, MethodResult] = {}
    if evidence.judgement is not None:
        judged[CASES] = _of_cases(evidence.requirement, evidence.judgement)
    if evidence.rare is not None:
        judged[SPLITTING] = _of_splitting(evidence.requirement, evidence.rare)
    if evidence.searches:
        judged[SEARCH] = _of_searches(evidence.searches)
    if BOUNDS in evidence.requirement.verified_by:
        judged[BOUNDS] = _of_bounds(evidence.certificates)
    if evidence.proof is not None:
        judged[SAFETY_LAYER] = _of_the_layer(evidence.requirement, evidence.proof)
    if evidence.tube is not None:
        judged[TUBE] = _of_a_tube(evidence.requirement, evidence.tube)
    return judged


def verdict(evidence: Evidence) -> MethodResult:
    """Return the combined verdict.

    For a claim about a share of the cases the cases are decisive: single failures found by a search do
    not refute it. They do where all cases must meet the requirement. A proof for all cases shows a
    requirement for any share, unless a flight contradicts it. A proof for fewer cases than the requirement
    asks for shows it in part, and a flight that fails leaves the verdict to the cases.
    """
    judged = results_by_method(evidence)
    failed = any(search.first_failed is not None for search in evidence.searches)
    judgement = evidence.judgement
    failed = failed or (evidence.rare is not None and bool(evidence.rare.share))
    has_failed = failed or (judgement is not None and judgement.num_failed + judgement.num_known_failed > 0)
    for method, what in ((SAFETY_LAYER, "of the safety layer"), (TUBE, "by a tube of all starts")):
        proof = judged.get(method)
        if proof is not None and proof.is_proof:
            if not has_failed:
                return proof._replace(word=proof.verdict)
            if proof.probability == 1.0:
                return MethodResult("refuted", "refuted", f"flights contradict the proof {what}")
    if failed and evidence.requirement.probability == 1.0 and {CASES, SPLITTING} & judged.keys():
        method = SEARCH if SEARCH in judged and judged[SEARCH].verdict == "refuted" else SPLITTING
        return judged[method]._replace(word="refuted")
    decisive = [judged[name] for name in (CASES, SPLITTING, BOUNDS) if name in judged]
    worst = max(decisive or judged.values(), key=lambda result: ORDER.index(result.verdict))
    return worst._replace(word=worst.verdict)


def _of_cases(requirement: Requirement, judgement: Judgement) -> MethodResult:
    """Judge a requirement by its random flights; return the verdict, with the reason in words."""
    sure = f"with {percent(requirement.confidence)} confidence"
    claim = f"{percent(requirement.probability)} {sure}"
    noun = "new cases" if judgement.num_tries else "cases"
    failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} {noun} fail"
    if judgement.num_tries and not judgement.refuted_by:
        count = "1 earlier try" if judgement.num_tries == 1 else f"{judgement.num_tries} earlier tries"
        claim += f" after {count}, which leaves a confidence of {percent(judgement.confidence)} to reach"
    if judgement.refuted_by:
        why = f"another try refuted it, {judgement.refuted_by}"
    elif judgement.idle_premises and not judgement.num_failed:
        idle = " and ".join(judgement.idle_premises)
        failed = f"premise in 0 of {judgement.num_cases:,}"
        why = f"the premise {idle} occurred in none of {judgement.num_cases:,} flights, so they show nothing"
    elif requirement.probability == 1.0:
        why = f"{sure} at least {percent(judgement.low)} of such cases meet it; only a proof shows it of all"
    elif judgement.verdict == "shown":
        why = f"at most {judgement.num_allowed:,} may fail, to show {claim}"
    elif judgement.verdict == "refuted":
        why = f"{sure} at most {percent(judgement.high)} of such cases meet it"
    elif judgement.num_allowed < 0:
        needed = needed_by(judgement, requirement.probability)
        why = f"{claim} needs {needed:,} {noun} without a failure"
    else:
        why = f"at most {judgement.num_allowed:,} may fail, to show {claim}"
    return MethodResult(judgement.verdict, failed, why)


def _of_splitting(requirement: Requirement, rare: RareShare) -> MethodResult:
    """Judge a requirement by splitting; return the verdict, with the reason in words.

    It shows a requirement in part at most: populations that all miss a way of failing agree on too small a
    share, and nothing in their spread tells of it.
    """
    if rare.share is None or rare.high is None:
        return MethodResult("not shown", "no estimate", rare.sentence)
    allowed, sure = 1.0 - requirement.probability, f"with {percent(requirement.confidence)} confidence"
    word = f"{rare.share:.2g} fail"
    at_most, at_least = f"{sure} at most {rare.high:.3g} of such cases", f"{sure} at least {rare.low:.3g}"
    if rare.high <= allowed:
        proviso = "provided that some population has found each way of failing"
        return MethodResult("shown in part", word, f"{at_most} fail it, {proviso}, and {allowed:.3g} may")
    if rare.low > allowed or requirement.probability == 1.0:
        return MethodResult("refuted", word, f"{at_least} of such cases fail it, and {allowed:.3g} may")
    return MethodResult("not shown", word, f"{at_most} fail it, {at_least}, and {allowed:.3g} may")


def _of_searches(searches: Sequence[WorstCaseSearch]) -> MethodResult:
    """Judge a requirement by searches for its worst case; return the verdict, with the reason in words."""
    flights = f"{sum(len(search.scenarios) for search in searches):,} flights"
    if failed := sum(search.first_failed is not None for search in searches):
        why = f"{failed} of {len(searches)} searches find a case that fails, in {flights}"
        return MethodResult("refuted", "failure found", why)
    noun = "search finds" if len(searches) == 1 else "searches find"
    why = f"{len(searches)} {noun} no case that fails, in {flights}"
    return MethodResult("not shown", "none found", why)


def _of_bounds(certificates: Sequence[Certificate]) -> MethodResult:
    """Judge a requirement by bounds of the fuzzy systems; return the verdict, with the reason in words."""
    if not certificates:
        return MethodResult(
            "not shown", "nothing to bound", "the controller has no system that is asked about"
        )
    for certificate in certificates:
        if certificate.verdict == "yes":
            return MethodResult("refuted", "refuted", certificate.sentence.rstrip("."))
    for certificate in certificates:
        if certificate.verdict != "no":
            return MethodResult("not shown", certificate.verdict, certificate.sentence.rstrip("."))
    boxes = sum(len(certificate.low) for certificate in certificates)
    why = f"no for all inputs: {boxes:,} boxes prove the answers to {len(certificates)} questions"
    return MethodResult("shown", "proved", why, is_proof=True)


def _of_the_layer(requirement: Requirement, proof: SafetyProof) -> MethodResult:
    """Judge a requirement by the safety layer's proof; return the verdict, with the reason in words."""
    kept = proof.words()
    such = f", such as one {proof.exception}," if proof.exception else ""
    state = "safe states, from which the proof begins"
    if proof.stays:
        state = "states with a way out, from which the proof begins; lower monte_carlo.max_distance_m"
        state += ", or raise safety.delta_v_limit_m_s" if proof.delta_v_m_s is not None else ""
    if not proof.is_on:
        why = "the safety layer was off: its proof says nothing about these flights"
    elif proof.failing:
        why = f"premises of the safety layer's proof fail: {'; '.join(proof.failing)}"
    elif proof.num_safe < proof.num_starts:
        starts = f"{proof.num_starts - proof.num_safe:,} of {proof.num_starts:,} starts"
        why = f"{starts}{such} are not {state}"
    elif not proof.are_all_safe:
        why = f"starts {proof.starts}{such} need not be {state}"
    elif requirement.formula is None or not proof.proves(requirement.formula):
        why = f"the safety layer keeps {kept}, from which this does not follow"
    else:
        why = f"the safety layer keeps {kept}, from all starts {proof.starts}"
        if proof.probability < 1.0:
            why += f", while errors are within their bounds, as in {percent(proof.probability)} of flights"
        why += f", provided that {' and '.join(proof.assumed)}" if proof.assumed else ""
        is_whole = proof.probability >= requirement.probability
        verdict: Verdict = "shown" if is_whole else "shown in part"
        word = "proved" if is_whole else f"proved for {percent(proof.probability)}"
        return MethodResult(
            verdict,
            word,
            why,
            is_proof=True,
            probability=proof.probability,
            assumed=proof.assumed,
            is_continuous=proof.is_continuous(requirement.formula),
        )
    return MethodResult("not shown", "does not apply", why)


def _of_a_tube(requirement: Requirement, tube: TubeProof) -> MethodResult:
    """Judge a requirement by a tube of all starts; return the verdict, with the reason in words."""
    if tube.fault:
        return MethodResult("not shown", "does not apply", tube.fault)
    kept = f"a tube holds {tube.starts}, keeps the limit, and is at the goal after {tube.end_s:g} s"
    if requirement.formula is None or not tube.proves(requirement.formula):
        return MethodResult("not shown", "does not apply", f"{kept}, from which this does not follow")
    if not tube.is_checked:
        return MethodResult("not shown", UNCHECKED, f"the proof is {UNCHECKED}: {kept}; {CHECKER}")
    return MethodResult("shown", "proved", f"{kept}; the checker agrees", is_proof=True, is_continuous=True)


def percent(fraction: float) -> str:
    """Return a share in per cent with its digits, at most five significant ones."""
    return f"{100.0 * fraction:.5g} %"


def unproved(evidence: Evidence) -> tuple[str, ...]:
    """Return the methods of proof that a requirement asks for and that prove nothing of it."""
    return tuple(
        name for name, result in results_by_method(evidence).items() if name in PROOFS and not result.is_proof
    )


def joint_confidence(confidences: Sequence[float]) -> float:
    """Return a lower bound of the confidence that several claims hold at once, by Bonferroni's inequality.

    The risks of claims that were shown add up at most, however their flights depend on one another.
    """
    return max(0.0, 1.0 - sum(1.0 - confidence for confidence in confidences))
