"""What all evidence for a requirement comes to."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.evaluation.assurance import judgements, proofs, verdicts
from pipeline.evaluation.assurance.campaign import FormulaResult, WorstCaseSearch
from pipeline.evaluation.assurance.certificates import Certificate
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.quantities import UNITS
from pipeline.evaluation.assurance.requirements import Question
from pipeline.evaluation.assurance.sentences import sentence
from pipeline.evaluation.assurance.tube import TubeProof
from pipeline.evaluation.assurance.verdicts import Evidence, verdict
from tests.pipeline.evaluation.assurance.cases import REQUIREMENT, cases

LAYER = proofs.SafetyProof(True, 16.0, 198.0, 1000, 1000)
OFF = replace(LAYER, is_on=False)
BOUNDED = replace(LAYER, probability=0.99)


def searched(*margins: float) -> WorstCaseSearch:
    values = np.array(margins)
    return WorstCaseSearch((None,) * len(margins), FormulaResult(values, values >= 0))


def certificate(answer: str) -> Certificate:
    boxes = np.zeros((4, 1)), np.ones((4, 1))
    return Certificate(Question("force_x > 1"), "force_x", answer, f"force_x > 1: {answer}.", ("a",), *boxes)


def gathered(*verified_by: str, **evidence) -> Evidence:
    ways = {"verified_by": verified_by} if verified_by else {}
    certified = tuple(map(certificate, evidence.pop("bounds", ())))
    return Evidence(replace(REQUIREMENT, **ways), certificates=certified, **evidence)


@pytest.mark.parametrize(
    ("word", "evidence"),
    [
        ("shown", gathered(judgement=cases(3), searches=(searched(1.0, -0.5),), proof=OFF)),
        ("not shown", gathered(judgement=cases(9), proof=OFF)),
        ("refuted", gathered(judgement=cases(40), proof=OFF)),
        ("not shown", gathered(judgement=cases(0, 50), proof=OFF)),
        # a proof shows it unless a flight contradicts it
        ("shown", gathered(judgement=cases(0, 50), proof=LAYER)),
        ("refuted", gathered(judgement=cases(1, 50), proof=LAYER)),
        ("refuted", gathered(judgement=cases(0, 50), searches=(searched(-1.0),), proof=LAYER)),
        # single failures do not contradict a proof for a share: the cases decide
        ("shown", gathered(judgement=cases(0, 50), proof=BOUNDED)),
        ("shown", gathered(judgement=cases(5), proof=BOUNDED)),
        ("not shown", gathered(judgement=cases(6), searches=(searched(-1.0),), proof=BOUNDED)),
        ("refuted", gathered(judgement=cases(40), proof=BOUNDED)),
        ("shown", gathered("bounds", bounds=("no", "no"))),
        ("not shown", gathered("bounds", bounds=("no", "undecided"))),
        ("refuted", gathered("bounds", bounds=("undecided", "yes"))),
        ("not shown", gathered("bounds")),
        ("refuted", gathered("cases", "bounds", judgement=cases(0), bounds=("yes",))),
        # a search alone refutes but never shows
        ("not shown", gathered("search", searches=(searched(1.0, 2.0),))),
        ("refuted", gathered("search", searches=(searched(1.0, -2.0),))),
    ],
)
def test_the_verdict_of_all_evidence(word, evidence):
    assert verdict(evidence).word == word


def test_a_claim_about_a_share_stands_with_the_cases_whatever_a_search_finds():
    three = gathered(judgement=cases(3), searches=(searched(1.0, -0.5),), proof=OFF)
    assert verdict(three).why == "at most 5 may fail, to show 99 % with 90 % confidence"
    words = {name: result.word for name, result in verdicts.results_by_method(three).items()}
    expected = {"cases": "3 of 1,000 cases fail", "search": "failure found", "safety_layer": "does not apply"}
    assert words == expected
    said = sentence(three, verdict(three))
    assert said.startswith('Shown for 99 % of cases or more (90 % confidence): "The deputy stays away."')
    assert "3 of 1,000 did not and 1 of 1 searches found a flight that did not, the nearest 14 m" in said
    few = verdict(gathered(judgement=cases(0, 50), proof=OFF))
    assert few.why == "99 % with 90 % confidence needs 230 cases without a failure"
    unsafe = verdicts.results_by_method(gathered(proof=replace(LAYER, num_safe=999)))
    assert "1 of 1,000 starts are not safe" in unsafe["safety_layer"].why


def test_what_all_cases_must_meet_is_shown_by_a_proof_alone_and_refuted_by_one_flight():
    everywhere = replace(REQUIREMENT, probability=1.0, severity="catastrophic")
    flown = Evidence(everywhere, cases(0, probability=1.0), (searched(2.0, 0.5),), proof=OFF)
    assert verdict(flown).word == "not shown"
    assert "only a proof shows" in sentence(flown, verdict(flown))
    # 0.1^(1/1000), the lower bound after 1,000 cases without a failure
    assert "at least 99.77 % of such cases" in verdict(flown).why
    proved = replace(flown, proof=LAYER)
    said = sentence(proved, verdict(proved))
    assert said.startswith('Shown for all cases (proved): "The deputy stays away." All 1,000 did and all 2')
    assert "the nearest 15.5 m from its centre. Failing means a collision." in said
    bounded = replace(flown, proof=BOUNDED)
    assert verdict(bounded).word == "shown in part"
    assert verdicts.results_by_method(bounded)["safety_layer"].word == "proved for 99 %"
    for proof in (OFF, LAYER, BOUNDED):
        failing = replace(flown, judgement=cases(1, probability=1.0), proof=proof)
        assert verdict(failing).word == "refuted"
    failed = replace(flown, searches=(searched(-0.5),))
    assert sentence(failed, verdict(failed)).startswith(
        'Refuted as a claim for all cases: "The deputy stays away."'
    )


LIMIT = "(speed <= 0.2 m/s + 0.002 per_s * distance)"
GOAL = "(distance <= 0.5 m and speed <= 0.2 m/s)"


@pytest.mark.parametrize(
    ("text", "follows"),
    [
        (f"{LIMIT} until {GOAL}", True),
        (f"{LIMIT} until[0:900] {GOAL}", True),
        (f"{LIMIT} until[0:899] {GOAL}", False),  # too early
        (f"{LIMIT} until[1:900] {GOAL}", False),
        (f"{LIMIT} until distance <= 0.5", True),
        (f"{LIMIT} until distance <= 0.49", False),
        (f"{LIMIT} until speed <= 0.19", False),
        (f"{LIMIT} until (distance <= 0.5 or speed <= 0.2)", False),  # unclear to it
        (f"(speed <= 0.3 + 0.003 per_s * distance) until {GOAL}", True),
        (f"(speed <= 0.19 + 0.002 per_s * distance) until {GOAL}", False),
        (f"(speed <= 0.2 + 0.0019 per_s * distance) until {GOAL}", False),
        (f"(2 * speed <= 0.2 + 0.002 per_s * distance) until {GOAL}", False),
        (f"(speed + velocity_radial <= 0.2 + 0.002 per_s * distance) until {GOAL}", False),
        (f"always {LIMIT}", False),  # the tube ends at the goal
    ],
)
def test_a_tube_proves_its_limit_until_its_goal_and_nothing_else(text, follows):
    tube = TubeProof("", True, end_s=900.0, limit=(0.2, 0.002, 0.0), goal=(0.5, 0.2))
    assert tube.proves(parse(text, UNITS)) is follows


def test_a_proof_that_is_not_checked_shows_nothing():
    tube = TubeProof("", True, "every start of a box", end_s=900.0, limit=(0.2, 0.002, 0.0), goal=(0.5, 0.2))
    docking = replace(REQUIREMENT, formula=parse(f"{LIMIT} until {GOAL}", UNITS), probability=1.0)
    assert verdict(Evidence(docking, tube=tube)).verdict == "shown"
    unchecked = Evidence(docking, tube=replace(tube, is_checked=False))
    assert verdict(unchecked).verdict == "not shown"
    assert "stated by the run, not checked" in sentence(unchecked, verdict(unchecked))
    assert verdicts.unproved(unchecked) == ("tube",)
    # what flights show stands, and the sentence says that nobody checked the proof
    flown = Evidence(replace(docking, probability=0.99), cases(0), tube=unchecked.tube)
    assert verdict(flown).verdict == "shown"
    assert "stated by the run, not checked" in sentence(flown, verdict(flown))


def test_what_was_asked_for_in_vain_is_told_beside_what_is_shown():
    shown = gathered(judgement=cases(3), proof=OFF)
    assert verdict(shown).verdict == "shown"
    assert "the safety layer was off" in sentence(shown, verdict(shown))
    assert verdicts.unproved(shown) == ("safety_layer",)
    assert verdicts.unproved(gathered(judgement=cases(3), proof=LAYER)) == ()


FLOWN = {"duration_s": 3600.0, "period_s": 10.0}


def test_a_claim_names_its_reach():
    by_flights = gathered(judgement=cases(3), **FLOWN)
    said = sentence(by_flights, verdict(by_flights))
    assert said.startswith(
        "Shown for 99 % of cases or more (90 % confidence), at samples 10 s apart in flights"
    )
    assert 'in flights of 3,600 s: "The deputy stays away."' in said
    # the exact layer is proved at samples, the robust one and a tube at all times
    proved = gathered(judgement=cases(0), proof=LAYER, **FLOWN)
    said = sentence(proved, verdict(proved))
    assert said.startswith("Shown for all cases (proved), at samples 10 s apart in flights of 3,600 s: ")
    bounded = gathered(judgement=cases(0), proof=BOUNDED, **FLOWN)
    assert "(proved), at all times in flights of 3,600 s: " in sentence(bounded, verdict(bounded))
    tube = TubeProof("", True, end_s=900.0, limit=(0.2, 0.002, 0.0), goal=(0.5, 0.2))
    docking = Evidence(
        replace(REQUIREMENT, formula=parse(f"{LIMIT} until {GOAL}", UNITS)), tube=tube, **FLOWN
    )
    assert "(proved), at all times in flights of 3,600 s: " in sentence(docking, verdict(docking))


def test_a_premise_that_never_occurred_shows_nothing():
    margins, fast = np.ones(1000), "distance < 30 m"
    for count, word in ((0, "not shown"), (1, "shown")):
        judgement = judgements.judge(margins, margins > 0, 0.99, 0.9, {fast: count})
        flown = gathered(judgement=judgement)
        assert judgement.verdict == verdict(flown).verdict == word
        phrase = f"The premise {fast} occurred in {count or 'none'} of 1,000 flights"
        assert phrase in sentence(flown, verdict(flown))
    idle = gathered(judgement=judgements.judge(margins, margins > 0, 0.99, 0.9, {fast: 0}))
    assert "so they show nothing" in sentence(idle, verdict(idle))
    # one flight that fails has met it
    failing = np.r_[-np.ones(40), np.ones(960)]
    assert judgements.judge(failing, failing > 0, 0.99, 0.9, {fast: 40}).verdict == "refuted"


def test_claims_at_once_have_the_confidence_that_bonferroni_leaves():
    assert verdicts.joint_confidence([0.9, 0.95]) == pytest.approx(0.85)
    assert verdicts.joint_confidence([0.8] * 6) == 0.0
    # claims that are wrong, each judged by flights of its own: how often any of them is called shown
    generator, confidences = np.random.default_rng(1), (0.9, 0.95, 0.8)
    failures = generator.binomial(1000, 0.01 + 1e-9, (20_000, 3))
    allowed = [judgements.failures_allowed(1000, 0.99, confidence) for confidence in confidences]
    wrong = np.any(failures <= allowed, axis=1).mean()
    assert 0.1 < wrong <= 1.0 - verdicts.joint_confidence(confidences)
