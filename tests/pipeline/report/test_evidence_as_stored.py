"""Pages of evidence and of a board are as they were when somebody last looked: words, order, drawings."""

from datetime import date
from itertools import cycle

import numpy as np
import pytest

from fis_tools.model import And, Consequent, FuzzySystem, Is, Rule, Term, Triangular, Variable
from pipeline.evaluation.assurance.judgements import ORDER
from pipeline.evaluation.assurance.requirements import METHODS, SEVERITIES
from pipeline.report import board, evidence
from pipeline.report.board_flights import BoardFlights
from pipeline.report.figures.style import Illustration
from tests import stored
from tests.pipeline.report.test_evidence_numbers import CASES, CONDITIONS, WORST, method, requirement
from tests.pipeline.report.test_evidence_numbers import evidence as made_up

SEARCH = {
    **{"num_flights": 4321, "flights_per_find": 617.3, "random_flights_per_find": 23456.7, "ratio": 38.02},
    **{"worst_margin": -2.5, "worst_unit": "m", "random_worst_margin": 0.125, "random_worst_unit": "m/s"},
    **{"num_found": 7, "num_searches": 9, "sentence": "it was quick"},
}
SPLITTING = {
    **{"share": 2.345e-5, "low": 3.1e-6, "high": 7.8e-4, "num_flights": 65432},
    **{"levels": [3.5, 0.765432, -0.25], "populations": [1.1e-5, 2.2e-5, 3.7e-5]},
}
BOUNDS = [
    {"system": "force_x", "sentence": "Never above 0.5 N.", "num_boxes": 1357},
    {"system": "force_y", "sentence": "Never below -0.3 N.", "num_boxes": 24},
]
LEFT = {"system": "force_z", "name": "rate", "unit": "m/s", "value": 1.98765}
LEFT |= {"first_s": 130.0, "last_s": 270.0, "low": -1.25, "high": 1.5}
MIXED = [
    {"unit": "m", "least": -7.5, "edges": [-7.5, -3.0, 0.0, 2.5, 11.0], "counts": [2, 0, 37, 1461]},
    {"unit": "m/s", "least": 0.02, "edges": [0.02, 0.07, 0.19], "counts": [613, 387]},
]
TUBE = {"starts": "every start with x from 3 to 4 m", "model": "motion by equations", "end_s": 640.0}
TUBE |= {"limit": "never above 0.2 m/s", "goal": "1.5 m", "is_checked": True}
PROOF = {
    "tube": TUBE,
    "safety_layer": {"starts": "inside the limits", "assumed": ["no drag", "exact thrusters"]},
}


def judged():
    """Requirements of each verdict, severity and method, no two of which have the same numbers."""
    severities, names = cycle(SEVERITIES), list(METHODS)
    words = ("failure found", "none found", "does not apply", *ORDER)
    for number, verdict in enumerate(ORDER, 1):
        shown = names[: number + 1]
        methods = {name: method(words[(number + k) % len(words)], verdict) for k, name in enumerate(shown)}
        cases = CASES | {"num_failed": 11 * number, "num_allowed": 40 * number, "margin": 0.5 * number}
        parts = {
            "cases": cases,
            "methods": methods,
            "search": SEARCH,
            "splitting": SPLITTING,
            "bounds": BOUNDS,
        }
        parts = {name: part for name, part in parts.items() if name in ("methods", *methods)}
        settings = {"deputy.mass_kg": 11.25 + number, "orbit.mean_motion_rad_s": 0.001}
        worst = WORST | {
            "margin": number - 2.5,
            "recorded_margin": number - 2.50001,
            "left_domain": [LEFT] * number,
        }
        worst |= {
            "velocity_m_s": [0.01, -0.02, 0.03],
            "settings": settings,
            "sun_elevation_rad": 0.1 * number,
        }
        yield requirement(
            number,
            verdict,
            next(severities),
            worst=worst,
            formula=f"always distance >= {14 + number} m",
            **parts,
        )
    mixed = CASES | {"histograms": MIXED, "num_known": 0, "needed_without_failure": None, "num_allowed": -1}
    mixed |= {"is_sequential": True, "margin": None}
    yield requirement(7, "refuted", SEVERITIES[-1], cases=mixed, unit="mixed", accepted="the last one only.")
    proofs = {name: method(is_proof=True) for name in ("cases", "tube", "safety_layer", "bounds")}
    yield requirement(
        8, "shown", methods=proofs, tube=TUBE, safety_layer=PROOF["safety_layer"], bounds=BOUNDS[:1]
    )
    yield requirement(9, "shown", methods={"safety_layer": method(is_proof=True)}, **PROOF)


def whole(every=1, **others):
    settings = {"deputy.max_force_n": 0.75, "sensor.half_angle_deg": 12.5, "guidance": "cross"}
    conditions = CONDITIONS | {"settings": settings, "thrusters": "real"} | others
    joint = {"requirements": ["R1", "R5", "R9"], "confidence": 0.8625}
    tries = {"verdicts": {"R1": "refuted", "R8": "shown"}, "seed": 12, "num_cases": 1750}
    earlier = [tries | {"folder": "../first"}, tries | {"folder": "../second", "seed": 13}]
    hashes = {"config.yaml": "e" * 64, "assure/cases.parquet": "f" * 64}
    return made_up(
        *list(judged())[::every], conditions=conditions, joint=joint, earlier=earlier, sha256=hashes
    )


def graded(name, words):
    """A system with two inputs of three terms, whose output rises with both."""
    shapes = (Triangular(0.0, 0.0, 0.5), Triangular(0.0, 0.5, 1.0), Triangular(0.5, 1.0, 1.0))
    range_of = {
        input_name: Variable(input_name, "m", 0.0, 1.0, terms=tuple(map(Term, words, shapes)))
        for input_name in ("down", "across")
    }
    sides = [(-3.0, -3.0, -1.5), (-3.0, -1.0, 0.5), (-1.0, 0.25, 1.0), (0.5, 1.0, 2.0), (1.5, 2.0, 2.0)]
    terms = tuple(Term(f"t{k}", Triangular(*side)) for k, side in enumerate(sides))
    output = Variable(name, "N", -3.0, 2.0, terms=terms, default=0.0)
    rules = tuple(
        Rule(And((Is("down", down), Is("across", across))), (Consequent(name, f"t{i + j}"),))
        for i, down in enumerate(words)
        for j, across in enumerate(words)
    )
    return FuzzySystem(name, tuple(range_of.values()), (output,), rules)


def flights(count=5, after=True):
    times, then = np.arange(0.0, 5401.0, 60.0), np.arange(0.0, 7201.0, 120.0)
    distances = np.linspace(35.0, 130.0, count)[:, np.newaxis] + 9.0 * np.sin(
        times / 700.0 + np.arange(count)[:, np.newaxis]
    )
    onwards = distances[:, -1:] + 0.013 * np.arange(count)[:, np.newaxis] * then
    return BoardFlights(3 * count, times, distances, *((then, onwards) if after else ()))


OF_FLEET = {"deputies": 3, "sun": None, "safety": "none", "dispersed": [], "thrusters": "ideal"}
PICTURE = Illustration("tube", "What the tube holds.", b"", "<svg></svg>")


@pytest.mark.parametrize("kind", ["alone", "fleet"])
def test_the_page_of_evidence_is_as_it_was(kind, file_regression):
    gathered = whole(2) if kind == "alone" else whole(4, **OF_FLEET) | {"domain": None, "git_revision": ""}
    text = evidence.render_evidence(gathered, PICTURE if kind == "alone" else None)
    file_regression.check(stored.page(text), extension=".txt")


@pytest.mark.parametrize("kind", ["alone", "fleet"])
def test_the_page_of_a_board_is_as_it_was(kind, file_regression):
    is_alone = kind == "alone"
    gathered = whole() if is_alone else whole(3, **OF_FLEET)
    systems = [graded(name, ("NL", "ZE", "PL")) for name in ("force_x", "force_z")] if is_alone else []
    worst = ("R1 Title 1 fails most.", PICTURE) if is_alone else None
    made = flights() if is_alone else flights(2, after=False)
    text = board.render_board(
        gathered, systems, made, worst, date(2026, 3, 4), "hill" if is_alone else "body"
    )
    file_regression.check(stored.page(text), extension=".txt")
