"""What all evidence comes to, by hand-made findings."""

from dataclasses import replace

import numpy as np

from pipeline.evaluation.assurance.campaign import Outcome, Search
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.quantities import UNITS
from pipeline.evaluation.assurance.requirements import Question, Requirement
from pipeline.evaluation.assurance.verdicts import (
    Certificate,
    Found,
    SafetyProof,
    judge,
    outcomes,
    sentence,
    verdict,
)

REQUIREMENT = Requirement(
    *("R1", "keep out", "The deputy stays away.", "a collision", "critical", "because", "nobody"),
    *(("cases", "search", "safety_layer"), "always distance >= 15"),
    parse("always distance >= 15", UNITS),
    0.99,
    0.9,
)
LAYER = SafetyProof(True, True, 16.0, 198.0, 1000, 1000)
OFF = replace(LAYER, is_on=False)


def cases(num_failed: int, num_cases: int = 1000):
    margins = np.r_[-np.ones(num_failed), np.ones(num_cases - num_failed)]
    return judge(margins, margins > 0, 0.99, 0.9)


def searched(*margins: float) -> Search:
    values = np.array(margins)
    return Search((None,) * len(margins), Outcome(values, values >= 0))


def certificate(answer: str) -> Certificate:
    boxes = np.zeros((4, 1)), np.ones((4, 1))
    return Certificate(Question("force_x > 1"), "force_x", answer, f"force_x > 1: {answer}.", ("a",), *boxes)


def test_a_claim_about_a_share_stands_with_the_cases_whatever_a_search_finds():
    found = Found(REQUIREMENT, cases(3), (searched(1.0, -0.5),), proof=OFF)
    assert verdict(found).verdict == "shown"
    assert verdict(found).why == "up to 5 failures show 99 % with 90 % confidence"
    words = {name: one.word for name, one in outcomes(found).items()}
    assert words == {
        "cases": "3 of 1,000 cases fail",
        "search": "failure found",
        "safety_layer": "does not apply",
    }
    assert sentence(found, verdict(found)) == (
        "Shown: in 99 % of cases or more (90 % confidence) the deputy stays away; 3 of 1,000 did not and 1 "
        "of 1 searches found a flight that did not, the nearest 14 m from its centre: a collision."
    )


def test_too_many_failures_and_too_few_cases():
    assert verdict(Found(REQUIREMENT, cases(9), proof=OFF)).word == "not shown"
    assert verdict(Found(REQUIREMENT, cases(40), proof=OFF)).word == "refuted"
    few = verdict(Found(REQUIREMENT, cases(0, 50), proof=OFF))
    assert (few.word, few.why) == (
        "not shown",
        "99 % with 90 % confidence needs 230 cases without a failure",
    )


def test_what_all_cases_must_meet_is_shown_by_a_proof_alone_and_refuted_by_one_flight():
    everywhere = replace(REQUIREMENT, probability=1.0, severity="catastrophic")

    def cases_of_all(num_failed: int):
        margins = np.r_[-np.ones(num_failed), np.ones(1000 - num_failed)]
        return judge(margins, margins > 0, 1.0, 0.9)

    flown = Found(everywhere, cases_of_all(0), (searched(1.0),), proof=OFF)
    assert verdict(flown).word == "not shown"
    assert "only a proof shows" in sentence(flown, verdict(flown))
    # 0.1^(1/1000), the lower bound after 1,000 cases without a failure
    assert "at least 99.77 % of such cases" in verdict(flown).why
    proved = replace(flown, proof=LAYER)
    assert sentence(proved, verdict(proved)) == (
        "Shown: in all cases (proved) the deputy stays away; all 1,000 did, the nearest 16 m from its "
        "centre; failing means a collision."
    )
    assert verdict(replace(flown, judgement=cases_of_all(1))).word == "refuted"
    found = replace(flown, searches=(searched(-0.5),))
    assert sentence(found, verdict(found)).startswith(
        "Refuted: in all cases the deputy stays away; all 1,000 did and"
    )


def test_a_proof_shows_it_unless_a_flight_contradicts_it():
    assert verdict(Found(REQUIREMENT, cases(0, 50), proof=LAYER)).word == "shown"
    assert verdict(Found(REQUIREMENT, cases(1, 50), proof=LAYER)).word == "refuted"
    assert verdict(Found(REQUIREMENT, cases(0, 50), (searched(-1.0),), proof=LAYER)).word == "refuted"
    unsafe = replace(LAYER, num_safe=999)
    assert "1 of 1,000 starts are not safe" in outcomes(Found(REQUIREMENT, proof=unsafe))["safety_layer"].why


def test_bounds():
    asked = replace(REQUIREMENT, verified_by=("bounds",))
    assert verdict(Found(asked, certificates=(certificate("no"), certificate("no")))).word == "shown"
    assert (
        verdict(Found(asked, certificates=(certificate("no"), certificate("undecided")))).word == "not shown"
    )
    assert (
        verdict(Found(asked, certificates=(certificate("undecided"), certificate("yes")))).word == "refuted"
    )
    assert verdict(Found(asked)).word == "not shown"
    both = replace(asked, verified_by=("cases", "bounds"))
    assert verdict(Found(both, cases(0), certificates=(certificate("yes"),))).word == "refuted"


def test_a_search_alone_refutes_but_never_shows():
    only = replace(REQUIREMENT, verified_by=("search",))
    assert verdict(Found(only, searches=(searched(1.0, 2.0),))).word == "not shown"
    assert verdict(Found(only, searches=(searched(1.0, -2.0),))).word == "refuted"
