"""Proofs that requirements refer to: boxes that an outsider can check, and the premises of the layer's."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.engines import inference
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.quantities import UNITS
from pipeline.evaluation.assurance.requirements import Question, Requirement, RequirementError
from pipeline.evaluation.assurance.verdicts import certificates, safety_proof
from pipeline.flight.state.log import Scenario
from tests.pipeline.evaluation.assurance.cases import champion, experiment, scenarios


def asking(*questions: Question) -> Requirement:
    return Requirement(*("R8", "thrust", *["words"] * 5), ("bounds",), questions=questions)


def test_boxes_cover_the_region_and_rule_the_answer_out_everywhere():
    (found,) = certificates(
        asking(Question("force_x > 0.03", "predicted_centre_along_track < -150")), champion()
    )
    assert (found.system, found.verdict) == ("force_x", "no")
    system = champion().systems[0]
    low = np.array([variable.minimum for variable in system.inputs])
    high = np.array([variable.maximum for variable in system.inputs])
    high[found.inputs.index("predicted_centre_along_track")] = -150.0
    assert np.all(found.low >= low)
    assert np.all(found.high <= high)
    # halves of halves: they do not overlap, so that their volumes tell whether they cover all
    assert np.prod(found.high - found.low, axis=1).sum() == pytest.approx(np.prod(high - low), rel=1e-9)
    draws = np.random.default_rng(1).random((20, *found.low.shape))
    inputs = (found.low + draws * (found.high - found.low)).reshape(-1, 3)
    assert np.max(inference.evaluate(system, inputs)) <= 0.03


def test_what_an_example_answers_with_yes_is_no_proof():
    (found,) = certificates(asking(Question("force_x > 0")), champion())
    assert found.verdict == "yes"
    assert len(found.low) == 0


def test_only_the_systems_asked_about_are_bounded():
    assert certificates(asking(Question("force_w > 1")), champion()) == ()
    with pytest.raises(RequirementError, match="R8, its bounds 'force_x is big'"):
        certificates(asking(Question("force_x is big")), champion())


@pytest.mark.slow
def test_the_layer_proves_what_follows_from_its_spheres():
    mission = experiment("safety=filter").mission
    proof = safety_proof(mission, scenarios(20))
    assert (proof.num_safe, proof.keep_out_m, proof.keep_in_m) == (20, 16.0, 198.0)

    def proves(text: str) -> bool:
        return proof.proves(parse(text, UNITS))

    assert proves("always (distance >= 15 m)")
    assert proves("always[0:600] (distance <= 200 m) and always (distance > 15.5 m)")
    assert not proves("always (distance >= 17 m)")
    assert not proves("always (distance <= 198 m)")  # rounding: nothing is kept to spare
    assert not proves("always (speed <= 10 m/s)")
    assert not proves("eventually (distance >= 15 m)")
    assert not replace(proof, is_on=False).proves(parse("always (distance >= 15 m)", UNITS))


@pytest.mark.parametrize(
    "override",
    [
        "navigation=fixes",
        "actuators=real",
        "dynamics=two_body",
        "+dispersions.deputy.mass_kg={kind:uniform,low:11.0,high:13.0}",
    ],
)
def test_the_layer_proves_nothing_of_flights_with_errors(override: str):
    proof = safety_proof(experiment("safety=filter", override).mission, scenarios(2))
    assert (proof.num_safe, proof.is_exact) == (2, False)
    assert not proof.proves(parse("always (distance >= 15 m)", UNITS))


def test_starts_that_are_not_safe_states_are_told():
    mission = experiment("safety=filter").mission
    at_rest = np.zeros(3)
    starts = [
        Scenario(np.array([60.0, 0.0, 0.0]), at_rest, 0.0),
        Scenario(np.array([15.5, 0.0, 0.0]), at_rest, 0.0),  # in the margin
        Scenario(np.array([60.0, 0.0, 0.0]), np.array([0.0, 0.9, 0.0]), 0.0),  # too fast to be stopped
    ]
    proof = safety_proof(mission, starts)
    assert (proof.num_starts, proof.num_safe) == (3, 1)
    assert not proof.proves(parse("always (distance >= 15 m)", UNITS))
    assert safety_proof(experiment().mission, starts).num_safe == 0
