"""Rare events of flights: their cases have the evaluation's law, and splitting agrees with plain flights."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ks_2samp

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.assurance.campaign import Campaign
from pipeline.evaluation.assurance.case_space import case_space
from pipeline.evaluation.assurance.rare import FlightLaw, NotMet, OutsideLimits
from pipeline.evaluation.assurance.repeats import Try, splitting_risk
from pipeline.evaluation.assurance.requirements import parse_requirements
from pipeline.evaluation.assurance.verdicts import Evidence, results_by_method, verdict
from pipeline.evaluation.splitting import RareShare
from pipeline.flight.cases.dispersions import drawn
from pipeline.flight.goals.flights import fly_all
from pipeline.scenarios import evaluation_scenarios

WORDS = ("+experiment=evaluate", "controller=lqr", "duration_s=300", "safety=none")
DISPERSED = "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5,low:11.0}"
REQUIREMENTS = """
schema: requirements
schema_version: 2
requirements:
  - id: R1
    title: Away
    text: The deputy stays 60 m away.
    consequence: a look from near
    severity: critical
    reason: ours
    source: ours
    verified_by: [splitting]
    formula: always distance >= 60 m
    probability: 0.999
    confidence: 0.9
"""
REQUIREMENT = parse_requirements(REQUIREMENTS, "requirements.yaml").requirements[0]


@pytest.mark.parametrize(
    "words",
    [
        ("sun=random", DISPERSED),
        ("sun=mixed", "monte_carlo.directions=angles", "monte_carlo.max_speed_m_s=0.3"),
        ("sun=random", "sun.elevation_range_deg=[-20,60]"),
        ("sun=mixed", "monte_carlo.parked=true"),
        ("sun=random", "fleet.deputies=3", "monte_carlo.max_speed_m_s=0.3"),
        ("sun=mixed", "fleet.deputies=2", "monte_carlo.parked=true"),
    ],
    ids=["dispersed", "mixed", "tilted", "parked", "fleets", "parked-fleets"],
)
def test_cases_have_the_law_of_the_evaluation(words):
    number = 3000
    experiment = compose_experiment([*WORDS, *words, f"monte_carlo.num_cases={number}"]).experiment
    space = case_space(experiment, is_exact=True)
    genes = np.random.default_rng(1).random((number, len(space.genes)))
    pair = evaluation_scenarios(experiment), FlightLaw(space, 1).scenarios(genes, np.arange(number))

    def numbers(scenarios):
        return np.array(
            [
                [
                    *(value for each in case.fleet for value in (*each.position_m, *each.velocity_m_s)),
                    *(np.linalg.norm(each.position_m) for each in case.fleet),
                    *(each.sun_angle_rad + each.sun_elevation_rad for each in case.fleet),
                    *(np.linalg.norm(case.position_m - each.position_m) for each in case.others),
                    case.sun_angle_rad,
                    case.sun_elevation_rad,
                    *(value for _, value in drawn(experiment.mission, case)),
                ]
                for case in scenarios
            ]
        )

    for first, second in zip(*(numbers(scenarios).T for scenarios in pair), strict=True):
        assert ks_2samp(first, second).pvalue > 1e-4
    noises = {each.noise for case in pair[1] for each in case.fleet}
    assert len(noises) == number * experiment.mission.fleet.deputies


def test_margins_are_how_far_flights_stay_within_their_limits():
    experiment = compose_experiment([*WORDS, "sun=random", "deputy.min_distance_m=50.0"]).experiment
    controller = load(experiment.controller, experiment.mission)
    law = OutsideLimits(case_space(experiment, is_exact=True), 1, experiment.mission, controller, 1)
    genes, numbers = np.random.default_rng(2).random((60, len(law.is_periodic))), np.arange(60)
    margins = law.margins(genes, numbers)
    outcomes = fly_all(experiment.mission, controller, law.scenarios(genes, numbers))
    assert 0 < np.sum(margins < 0.0) < 60
    assert np.array_equal(margins < 0.0, outcomes.is_violated)
    assert np.allclose(np.minimum(margins, 0.0), np.minimum(outcomes.min_distance_m - 50.0, 0.0))
    met = NotMet(law.space, 1, Campaign(experiment.mission, controller, 1), replace(REQUIREMENT))
    assert np.array_equal(met.margins(genes, numbers) < 0.0, outcomes.min_distance_m < 60.0)


def of_splitting(share, low, high):
    return Evidence(REQUIREMENT, rare=RareShare(share, low, high, 80.0, 1000, (0.0,), (0.0,)))


@pytest.mark.parametrize(
    ("share", "low", "high", "word"),
    [
        (5e-4, 3e-4, 9e-4, "shown in part"),
        (9e-4, 7e-4, 1.1e-3, "not shown"),
        (3e-3, 2e-3, 4e-3, "refuted"),
        (None, 0.0, None, "not shown"),
        (0.0, 0.0, None, "not shown"),
    ],
)
def test_a_claim_is_judged_by_the_bounds_of_the_share_that_fails(share, low, high, word):
    evidence = of_splitting(share, low, high)
    assert verdict(evidence).word == word
    assert results_by_method(evidence)["splitting"].verdict == word


def test_a_claim_about_all_cases_is_refuted_by_a_share_that_fails():
    claim = replace(REQUIREMENT, probability=1.0)
    assert verdict(replace(of_splitting(1e-6, 1e-7, 2e-6), requirement=claim)).word == "refuted"
    assert verdict(replace(of_splitting(0.0, 0.0, None), requirement=claim)).word == "not shown"


def test_all_tries_by_splitting_share_the_risk_of_the_claim():
    formula = REQUIREMENT.formula_text.replace(" ", "")
    tries = [Try("there", seed, 100, {}, {}, {formula: "not shown"}) for seed in (1, 2, 1)]
    risks = [splitting_risk(REQUIREMENT, (seed, 100), tries) for seed in (1, 2, 3)]
    assert risks == pytest.approx([0.05, 0.025, 0.0125])
    assert sum(risks) < 0.1
    # other formulas do not count
    assert splitting_risk(REQUIREMENT, (3, 100), [Try("there", 1, 100, {}, {}, {"x": "shown"})]) == risks[0]
