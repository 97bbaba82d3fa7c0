"""What interval arithmetic and the safety layer prove of a requirement."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.compiled.three import Three
from fis_tools.formats import serialize
from pipeline.evaluation.assurance import proofs, verdicts
from pipeline.evaluation.assurance.certificates import Certificate, certificates, check_questions
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.proofs import are_safe, safety_proof
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
from tests.pipeline.evaluation.assurance.cases import REQUIREMENT, champion, experiment, scenarios
from tests.places import PROJECT


def asking(*questions: tuple[str, ...]) -> Requirement:
    words = ["R8", "thrust", *["words"] * 5]
    return Requirement(*words, ("bounds",), questions=tuple(Question(*question) for question in questions))


def certified(*question: str) -> tuple[Certificate, ...]:
    return certificates(asking(question), champion())


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
        check_questions([asking(*questions)], champion())


def test_questions_of_all_shipped_requirements_are_answered_by_all_shipped_rules():
    shipped = [
        path for path in (PROJECT / "conf/controller").glob("*.yaml") if "systems:" in path.read_text()
    ]
    controllers = [from_fuzzy(serialize.load(path)) for path in shipped]
    assert controllers
    for path in (PROJECT / "conf/requirements").glob("*.yaml"):
        for controller in controllers:
            check_questions(load_requirements(path.stem, Mission()), controller)


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


STAYS = "eventually always (coasting_farthest <= 200 m and coasting_distance >= 15 m)"


@pytest.mark.slow
def test_the_layer_proves_that_flights_stay_where_it_keeps_a_way_out():
    kept = experiment("safety=filter", "safety.keep_way_out=true").mission
    starts = [replace(start, position_m=0.9 * start.position_m) for start in scenarios(20)]
    proof = safety_proof(kept, starts, (50.0, 94.0, 0.0))
    assert (proof.num_safe, proof.are_all_safe, proof.stays) == (20, True, True)
    claims = {
        STAYS: True,
        KEPT: True,
        "eventually always (coasting_distance[86400] >= 15.5 m)": True,
        "eventually always (coasting_farthest <= 198 m)": False,  # rounding
        "eventually[0:600] always (coasting_farthest <= 200 m)": False,
        "always (coasting_distance >= 15 m)": False,  # a way out is a push
        "eventually always (speed <= 10 m/s)": False,
    }
    assert {text: proof.proves(parse(text, UNITS)) for text in claims} == claims
    bare = safety_proof(experiment("safety=filter").mission, starts, (50.0, 94.0, 0.0))
    assert bare.proves(parse(KEPT, UNITS))
    assert not bare.proves(parse(STAYS, UNITS))
    # twice as far along the track as high: starts far above the chief have no way out
    higher = safety_proof(kept, [replace(starts[0], position_m=np.array([99.5, 0.0, 0.0]))], SHELL)
    assert (higher.num_safe, higher.are_all_safe) == (0, False)
    why = verdicts.results_by_method(Evidence(REQUIREMENT, proof=replace(higher, num_safe=1)))["safety_layer"]
    assert why.why.startswith("starts at 50 to 100 m and at rest, such as one near (94.25, ")
    none = verdicts.results_by_method(Evidence(REQUIREMENT, proof=higher))["safety_layer"].why
    assert none.startswith("1 of 1 starts, such as one near (94.25, ")
    assert none.endswith(
        "not states with a way out, from which the proof begins; lower monte_carlo.max_distance_m"
    )


def test_the_layer_proves_that_no_axis_is_faster_than_its_limit():
    words = "safety=filter", "safety.axis_speed_limit_m_s=0.05"
    proof = safety_proof(experiment(*words).mission, scenarios(20), SHELL)
    claims = {
        "always (velocity_radial <= 0.0501 m/s)": True,
        "always (velocity_cross_track >= -0.0501 m/s)": True,
        "always (velocity_along_track <= 0.05 m/s)": False,  # rounding
        "always (velocity_radial <= 0.04 m/s)": False,
        "always (delta_v <= 5.62 m/s)": False,
        KEPT: True,
    }
    assert {text: proof.proves(parse(text, UNITS)) for text in claims} == claims
    assert proof.words() == "all samples from 16 to 198 m and at most 0.05 m/s fast along each axis"
    # errors are bounded for distances alone, and the way out has the last word
    for more in (("safety=robust", "world=leo"), ("safety.keep_way_out=true",)):
        assert safety_proof(experiment(*words, *more).mission, [], (50.0, 51.0, 0.0)).axis_speed_m_s is None


def test_the_layer_proves_what_flights_spend_where_they_keep_a_way_out():
    words = "safety=filter", "safety.keep_way_out=true"
    limited = experiment(*words, "safety.delta_v_limit_m_s=0.5").mission
    starts = [replace(start, position_m=0.8 * start.position_m) for start in scenarios(20)]
    proof = safety_proof(limited, starts, (50.0, 80.0, 0.0))
    assert (proof.num_safe, proof.are_all_safe) == (20, True)
    claims = {
        "always (delta_v <= 5.62 m/s)": True,
        "always (delta_v < 0.5001 m/s)": True,
        "always (delta_v <= 0.4 m/s)": False,
        STAYS: True,
        KEPT: True,
    }
    assert {text: proof.proves(parse(text, UNITS)) for text in claims} == claims
    assert proof.words().endswith("m, and ends on an ellipse between them for 0.5 m/s at most")
    # what no start can pay has no proof
    scarce = experiment(*words, "safety.delta_v_limit_m_s=0.01").mission
    poor = safety_proof(scarce, starts, (50.0, 80.0, 0.0))
    assert not poor.are_all_safe
    assert poor.num_safe < 20
    assert not poor.proves(parse(KEPT, UNITS))
    why = verdicts.results_by_method(Evidence(REQUIREMENT, proof=poor))["safety_layer"].why
    assert why.endswith("lower monte_carlo.max_distance_m, or raise safety.delta_v_limit_m_s")


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
            assert all(most_exceeded(world, 0, (Three(*r), Three(*v)), 2)[2] <= 0.0 for r, v in states)
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
