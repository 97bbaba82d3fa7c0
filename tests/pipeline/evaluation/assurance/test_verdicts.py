"""What all evidence comes to, by hand-made findings."""

from dataclasses import replace

import numpy as np

from pipeline.evaluation.assurance.campaign import Outcome
from pipeline.evaluation.assurance.claims import judge
from pipeline.evaluation.assurance.parser import parse
from pipeline.evaluation.assurance.proofs import Certificate, SafetyProof
from pipeline.evaluation.assurance.quantities import UNITS
from pipeline.evaluation.assurance.requirements import Question, Requirement
from pipeline.evaluation.assurance.search import Search
from pipeline.evaluation.assurance.verdicts import Found, outcomes, verdict

REQUIREMENT = Requirement(
    *("R1", "keep out", "keep out", ("cases", "search", "safety_layer"), "always distance >= 15"),
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
    assert verdict(found).why == "3 of 1,000 cases fail; up to 5 show 99 % with 90 % confidence"
    words = {name: one.word for name, one in outcomes(found).items()}
    assert words == {"cases": "shown", "search": "failure found", "safety_layer": "does not apply"}


def test_too_many_failures_and_too_few_cases():
    assert verdict(Found(REQUIREMENT, cases(9), proof=OFF)).word == "not shown"
    assert verdict(Found(REQUIREMENT, cases(40), proof=OFF)).word == "refuted"
    few = verdict(Found(REQUIREMENT, cases(0, 50), proof=OFF))
    assert (few.word, few.why) == (
        "not shown",
        "0 of 50 cases fail; 99 % with 90 % confidence needs 230 cases without a failure",
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
