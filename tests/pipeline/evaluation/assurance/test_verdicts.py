"""What flights and proofs demonstrate, and what all evidence comes to."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from fis_tools.compiled.three import Three
from fis_tools.formats import serialize
from pipeline.evaluation.assurance import proofs, verdicts
from pipeline.evaluation.assurance.campaign import FormulaResult, WorstCaseSearch
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.proofs import Certificate, are_safe, safety_proof
from pipeline.evaluation.assurance.quantities import UNITS
from pipeline.evaluation.assurance.requirements import (
    Question,
    Requirement,
    RequirementError,
    load_requirements,
)
from pipeline.evaluation.assurance.sentences import sentence
from pipeline.evaluation.assurance.verdicts import Evidence, verdict
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.period.act.safety import most_exceeded
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.bounds import bounds_of
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission
from tests.fis_tools import step_by_step
from tests.pipeline.evaluation.assurance.cases import champion, experiment, scenarios
from tests.places import PROJECT


@pytest.mark.parametrize(
    ("probability", "cases"),
    [
        (0.99, (230, 388, 531, 667)),
        (0.9973, (852, 1440, 1970, 2473)),
        (0.99865, (1705, 2880, 3941, 4947)),
        (0.9999, (23025, 38896)),
    ],
)
def test_cases_needed_are_those_of_hanson_and_beard(probability, cases):
    """NASA/TP-2010-216447, with a consumer's risk of 10 %."""
    assert tuple(verdicts.cases_needed(probability, 0.9, failed) for failed in range(len(cases))) == cases
    for failed, number in enumerate(cases):
        assert verdicts.failures_allowed(number, probability, 0.9) == failed
        assert verdicts.failures_allowed(number - 1, probability, 0.9) == failed - 1


@pytest.mark.parametrize(("met", "cases"), [(0, 10), (10, 10), (7, 10), (993, 1000), (9993, 10000)])
def test_bounds_are_those_of_scipy(met, cases):
    for confidence in (0.8, 0.9, 0.95):
        low, high = verdicts.share_bounds(met, cases, confidence)
        greater, less = (binomtest(met, cases, alternative=side) for side in ("greater", "less"))
        assert low == pytest.approx(greater.proportion_ci(confidence).low, abs=1e-12)
        assert high == pytest.approx(less.proportion_ci(confidence).high, abs=1e-12)


def cases(num_failed: int, num_cases: int = 1000, probability: float = 0.99):
    margins = np.r_[-np.ones(num_failed), np.ones(num_cases - num_failed)]
    return verdicts.judge(margins, margins > 0, probability, 0.9)


@pytest.mark.parametrize(
    ("verdict", "counts"),
    [
        ("shown", [(0, 1000), (5, 1000), (0, 230)]),
        ("not shown", [(6, 1000), (12, 1000), (0, 229)]),
        ("refuted", [(15, 1000), (16, 1000)]),
    ],
)
def test_verdicts(verdict, counts):
    assert {cases(*count).verdict for count in counts} == {verdict}


def test_margins_by_order_statistics():
    margins = np.random.default_rng(1).permutation(np.arange(1000.0))
    judgement = verdicts.judge(margins, margins >= 3, 0.99, 0.9)
    # P(at most 5 of 1000 below the 1 % quantile) is at most 10 %, of 6 it is more
    assert binom.cdf(5, 1000, 0.01) <= 0.1 < binom.cdf(6, 1000, 0.01)
    assert (judgement.margin, judgement.worst_margin, judgement.median_margin) == (5.0, 0.0, 499.5)
    assert verdicts.judge(margins[:50], margins[:50] >= 3, 0.99, 0.9).margin is None


def asking(*questions: tuple[str, ...]) -> Requirement:
    words = ["R8", "thrust", *["words"] * 5]
    return Requirement(*words, ("bounds",), questions=tuple(Question(*question) for question in questions))


def certified(*question: str) -> tuple[Certificate, ...]:
    return proofs.certificates(asking(question), champion())


def test_boxes_cover_the_region_and_rule_the_answer_out_everywhere():
    (proof,) = certified("force_x > 0.03", "predicted_centre_along_track < -150")
    assert (proof.system, proof.verdict) == ("force_x", "no")
    system = champion().systems[0]
    low = np.array([variable.minimum for variable in system.inputs])
    high = np.array([variable.maximum for variable in system.inputs])
    high[proof.inputs.index("predicted_centre_along_track")] = -150.0
    assert np.all(proof.low >= low)
    assert np.all(proof.high <= high)
    # halves of halves: they do not overlap, so that their volumes tell whether they cover all
    assert np.prod(proof.high - proof.low, axis=1).sum() == pytest.approx(np.prod(high - low), rel=1e-9)
    draws = np.random.default_rng(1).random((20, *proof.low.shape))
    inputs = (proof.low + draws * (proof.high - proof.low)).reshape(-1, 3)
    assert np.max(step_by_step.evaluate(system, inputs)) <= 0.03


def test_what_an_example_answers_with_yes_is_no_proof_and_only_the_systems_asked_about_are_bounded():
    (answer,) = certified("force_x > 0")
    assert (answer.verdict, len(answer.low)) == ("yes", 0)
    with pytest.raises(RequirementError, match="R8, its bounds 'force_x is big'"):
        certified("force_x is big")


@pytest.mark.parametrize(
    ("questions", "fault"),
    [
        ([("force_x > 1",), ("force_Y > 0.01",)], r"'force_Y > 0.01': no system .* did you mean force_y\?"),
        ([("1 > 2",)], "no system of .* has this output; the outputs are force_x, force_y, force_z"),
        ([("force_x > 1, force_Y > 0.01",)], "its bounds 'force_x > 1, force_Y > 0.01'"),
        ([("force_x > 1, force_y > 1",)], "its bounds"),  # of two systems: no one answers
        ([("force_x > 1", "predicted_centre > 3")], "its bounds 'force_x > 1'"),
        ([("force_x is big",)], "its bounds 'force_x is big'"),
    ],
)
def test_a_question_that_no_system_answers_is_refused(questions, fault):
    with pytest.raises(RequirementError, match=fault):
        proofs.check_questions([asking(*questions)], champion())


def test_questions_of_all_shipped_requirements_are_answered_by_all_shipped_rules():
    shipped = [
        path for path in (PROJECT / "conf/controller").glob("*.yaml") if "systems:" in path.read_text()
    ]
    controllers = [from_fuzzy(serialize.load(path)) for path in shipped]
    assert controllers
    for path in (PROJECT / "conf/requirements").glob("*.yaml"):
        for controller in controllers:
            proofs.check_questions(load_requirements(path.stem, Mission()), controller)


KEPT = "always (distance >= 15 m)"
#: of the starts that a mission has if nothing else is asked for: distances, m, and speed, m/s
SHELL = 50.0, 100.0, 0.0
LAYOUT = experiment("actuators=layout").mission.actuators.thrusters
ROBUST = "safety=robust", "actuators=real"
WEAKER = f"actuators.thrusters={[[*row[:6], 0.2] for row in LAYOUT]}"
HEAVIER = "+dispersions.deputy.mass_kg={kind:uniform,low:11.0,high:13.0}"


@pytest.mark.slow
def test_the_layer_proves_what_follows_from_its_spheres():
    proof = safety_proof(experiment("safety=filter").mission, scenarios(20), SHELL)
    assert (proof.num_safe, proof.keep_out_m, proof.keep_in_m) == (20, 16.0, 198.0)
    claims = {
        KEPT: True,
        "always[0:600] (distance <= 200 m) and always (distance > 15.5 m)": True,
        "always (distance >= 17 m)": False,
        "always (distance <= 198 m)": False,  # rounding: nothing is kept to spare
        "always (speed <= 10 m/s)": False,
        "eventually (distance >= 15 m)": False,
    }
    assert {text: proof.proves(parse(text, UNITS)) for text in claims} == claims
    assert not replace(proof, is_on=False).proves(parse(KEPT, UNITS))
    # faster than the layer allows at 50 m, which few drawn starts are
    fast = safety_proof(experiment("safety=filter").mission, scenarios(20), (50.0, 100.0, 0.5))
    assert (fast.num_safe, fast.are_all_safe) == (20, False)
    assert not fast.proves(parse(KEPT, UNITS))
    why = verdicts.results_by_method(Evidence(REQUIREMENT, proof=fast))["safety_layer"].why
    assert why.startswith("starts at 50 to 100 m and up to 0.5 m/s need not be safe states")


@pytest.mark.slow
@pytest.mark.parametrize("overrides", [(), ("world=rso",), ("world=afrl",), ("safety=robust", "world=leo")])
def test_a_shell_is_safe_only_if_all_states_in_it_are(overrides):
    world, generator = pack_world(experiment("safety=filter", *overrides).mission), np.random.default_rng(1)
    verdicts_of_shells = []
    for near, width, speed in generator.uniform((10.0, 1.0, 0.0), (250.0, 150.0, 0.8), (200, 3)):
        verdicts_of_shells.append(are_safe(world.guard, near, near + width, speed))
        if verdicts_of_shells[-1]:
            drawn = generator.normal(size=(2, 40, 3))
            ways, moving = drawn / np.linalg.norm(drawn, axis=2, keepdims=True)
            ways[:20] *= near
            ways[20:] *= near + width
            states = zip(ways, speed * moving, strict=True)
            assert all(most_exceeded(world, (Three(*r), Three(*v)), 2)[2] <= 0.0 for r, v in states)
    assert any(verdicts_of_shells)
    assert not all(verdicts_of_shells)


@pytest.mark.parametrize(
    ("overrides", "num_assumed"),
    [
        (("world=leo",), 2),
        (("dynamics=low_orbit",), 1),
        (("actuators=real",), 0),
        (("navigation=range_bearing",), 2),
        (("world=leo", "actuators=layout"), 2),
        (("actuators=layout", "actuators.specific_impulse_s=220.0", "duration_s=600"), 0),
    ],
)
def test_with_bounds_the_layer_proves_its_limits_where_nothing_is_exact(overrides, num_assumed: int):
    proof = safety_proof(experiment("safety=robust", *overrides).mission, scenarios(2), SHELL)
    assert (proof.failing, len(proof.assumed), proof.probability) == ((), num_assumed, 0.999)
    assert proof.proves(parse("always (distance >= 15 m) and always (distance <= 200 m)", UNITS))
    assert not proof.proves(parse("always (distance >= 16.1 m)", UNITS))
    shown = verdict(Evidence(replace(REQUIREMENT, probability=0.999), proof=proof))
    assert (shown.verdict, shown.is_proof) == ("shown", True)
    assert "in 99.9 % of flights" in shown.why
    assert all(premise in sentence(Evidence(REQUIREMENT, proof=proof), shown) for premise in proof.assumed)
    # a claim about all flights is more than the bounds hold for
    everywhere = Evidence(replace(REQUIREMENT, probability=1.0), proof=proof)
    part = verdict(everywhere)
    assert (part.verdict, part.is_proof) == ("shown in part", True)
    assert sentence(everywhere, part).startswith("Shown in part for 99.9 % of cases or more (proved")


@pytest.mark.parametrize(
    ("overrides", "premise"),
    [
        (("safety=filter", "navigation=fixes"), "no bounds are asked for (safety.probability)"),
        (("safety=filter", "actuators=real"), "no bounds are asked for (safety.probability)"),
        (("safety=filter", "dynamics=two_body"), "no bounds are asked for (safety.probability)"),
        (("safety=filter", HEAVIER), "no bounds are asked for (safety.probability)"),
        ((*ROBUST, "actuators.delay_s=10.0"), "commands are late"),
        ((*ROBUST, "actuators=layout", WEAKER), "in its weakest direction the layout gives 0.4 N"),
        ((*ROBUST, "actuators.scale_error=0.2"), "the thrusters cannot make good"),
        ((*ROBUST, "actuators.specific_impulse_s=220.0"), "specific_impulse_s=354 would do"),
        ((*ROBUST, HEAVIER), "settings are dispersed"),
    ],
)
def test_each_premise_that_fails_is_named_and_nothing_is_proved(overrides, premise: str):
    proof = safety_proof(experiment(*overrides).mission, scenarios(2), SHELL)
    assert premise in proof.failing[0]
    if "safety=robust" in overrides:
        assert len(proof.failing) == 1
    assert not proof.proves(parse(KEPT, UNITS))


def test_thrusters_too_weak_for_a_heavy_deputy_are_told_with_the_force_needed_and_a_cure_that_works():
    heavy = "world=leo", "safety=robust", "deputy.mass_kg=25"
    mission = experiment(*heavy).mission
    (premise,) = proofs.premises(mission, bounds_of(mission))[0]
    assert "for 25 kg that may take 1.0" in premise
    assert "deputy.max_force_n is 1; raise it, or lower safety.planned_force_n (0.085)" in premise
    lower = experiment(*heavy, "safety.planned_force_n=0.08").mission
    assert proofs.premises(lower, bounds_of(lower))[0] == ()


def test_starts_that_are_not_safe_states_are_told():
    states = (60.0, 0.0), (15.5, 0.0), (60.0, 0.9)  # also one in the margin, one too fast to be stopped
    starts = [Scenario(np.array([x, 0.0, 0.0]), np.array([0.0, speed, 0.0]), 0.0) for x, speed in states]
    proof = safety_proof(experiment("safety=filter").mission, starts, SHELL)
    assert (proof.num_starts, proof.num_safe) == (3, 1)
    assert not proof.proves(parse(KEPT, UNITS))
    assert safety_proof(experiment().mission, starts, SHELL).num_safe == 0


REQUIREMENT = Requirement(
    *("R1", "keep out", "The deputy stays away.", "a collision", "critical", "because", "nobody"),
    *(("cases", "search", "safety_layer"), "always distance >= 15"),
    parse("always distance >= 15", UNITS),
    0.99,
    0.9,
)
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
    tube = proofs.TubeProof("", True, end_s=900.0, limit=(0.2, 0.002, 0.0), goal=(0.5, 0.2))
    assert tube.proves(parse(text, UNITS)) is follows


def test_a_proof_that_is_not_checked_shows_nothing():
    tube = proofs.TubeProof(
        "", True, "every start of a box", end_s=900.0, limit=(0.2, 0.002, 0.0), goal=(0.5, 0.2)
    )
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
    tube = proofs.TubeProof("", True, end_s=900.0, limit=(0.2, 0.002, 0.0), goal=(0.5, 0.2))
    docking = Evidence(
        replace(REQUIREMENT, formula=parse(f"{LIMIT} until {GOAL}", UNITS)), tube=tube, **FLOWN
    )
    assert "(proved), at all times in flights of 3,600 s: " in sentence(docking, verdict(docking))


def test_a_premise_that_never_occurred_shows_nothing():
    margins, fast = np.ones(1000), "distance < 30 m"
    for count, word in ((0, "not shown"), (1, "shown")):
        judgement = verdicts.judge(margins, margins > 0, 0.99, 0.9, {fast: count})
        flown = gathered(judgement=judgement)
        assert judgement.verdict == verdict(flown).verdict == word
        phrase = f"The premise {fast} occurred in {count or 'none'} of 1,000 flights"
        assert phrase in sentence(flown, verdict(flown))
    idle = gathered(judgement=verdicts.judge(margins, margins > 0, 0.99, 0.9, {fast: 0}))
    assert "so they show nothing" in sentence(idle, verdict(idle))
    # one flight that fails has met it
    failing = np.r_[-np.ones(40), np.ones(960)]
    assert verdicts.judge(failing, failing > 0, 0.99, 0.9, {fast: 40}).verdict == "refuted"


def test_claims_at_once_have_the_confidence_that_bonferroni_leaves():
    assert verdicts.joint_confidence([0.9, 0.95]) == pytest.approx(0.85)
    assert verdicts.joint_confidence([0.8] * 6) == 0.0
    # claims that are wrong, each judged by flights of its own: how often any of them is called shown
    generator, confidences = np.random.default_rng(1), (0.9, 0.95, 0.8)
    failures = generator.binomial(1000, 0.01 + 1e-9, (20_000, 3))
    allowed = [verdicts.failures_allowed(1000, 0.99, confidence) for confidence in confidences]
    wrong = np.any(failures <= allowed, axis=1).mean()
    assert 0.1 < wrong <= 1.0 - verdicts.joint_confidence(confidences)
