"""The file of requirements: what ships, and mistakes."""

import copy

import pytest
import yaml

from pipeline.evaluation.assurance.requirements import (
    METHODS,
    Question,
    RequirementError,
    needs,
    read,
    require_heard,
)
from pipeline.settings.places import requirements_path

SHIPPED = requirements_path("inspection").read_text(encoding="utf-8")


def test_what_ships_can_be_read_and_uses_every_way_of_verification():
    found = read(SHIPPED, "inspection")
    assert found.name == "inspection"
    assert [one.id for one in found.requirements] == [f"R{number}" for number in range(1, 7)]
    assert all(needs(found.requirements, method) for method in METHODS)
    keep_out, thrust = found.requirements[0], found.requirements[-1]
    assert (keep_out.unit, keep_out.probability, keep_out.confidence) == ("m", 1.0, 0.9)
    assert (keep_out.consequence, keep_out.severity) == ("a collision", "catastrophic")
    assert found.requirements[4].unit == "mixed"
    assert thrust.formula is None
    assert thrust.questions[0] == Question("force_x > 1")


def changed(place: int, **values: object) -> str:
    told = copy.deepcopy(yaml.safe_load(SHIPPED))
    told["requirements"][place] |= values
    return yaml.safe_dump(told)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: [", "mine is no YAML"),
        ("[" * 9999, "mine is no YAML"),
        ("schema: fuzzy-controller", "must say schema: requirements"),
        ("schema: requirements\nschema_version: 1", "version 1 lacked consequence"),
        ("schema: requirements\nschema_version: 2", "must be a list of at least one"),
        (changed(0, consequence=None), "R1: consequence is missing"),
        (changed(1, severity="grave"), "R2: severity is 'grave'"),
        (changed(0, probability=0.999), "R1: accepted is missing; a share of catastrophic failures must be"),
        (changed(1, probability=None), "R2: probability is None"),
        (changed(0, id="R2"), "R2 is the id of two requirements"),
        (changed(0, id="../x"), "requirement 1: its id is '../x'; it names files"),
        (changed(0, title=" "), "R1: title is missing"),
        (changed(1, probability=1), "R2: probability is 1; it must be above 0 and below 1"),
        (changed(0, confidence=None), "R1: confidence is None"),
        (changed(0, propability=0.9), "there is no key propability; did you mean probability?"),
        (changed(0, verified_by=["cases", "serch"]), "R1: verified_by has 'serch'; did you mean search?"),
        (changed(0, verified_by="cases"), "R1: verified_by must be a list of cases, search"),
        (changed(0, formula="always (distance >= 15 kg)"), "R1, its formula:\nalways (distance >= 15 kg)\n"),
        (changed(5, bounds=[{"asks": "force_x > 1"}]), "R6: bounds must be a list of questions"),
    ],
)
def test_mistakes_name_the_requirement_and_the_cure(text, words):
    with pytest.raises(RequirementError) as caught:
        read(text, "mine")
    assert words in str(caught.value)


def test_requirements_that_are_not_there_are_told_with_those_that_ship(tmp_path):
    with pytest.raises(FileNotFoundError, match="name those that ship \\(inspection\\)"):
        requirements_path(str(tmp_path / "none.yaml"))


@pytest.mark.parametrize(
    "formula",
    [
        "always[4000:5000] distance < 1 m and always distance >= 1 m",
        "always distance >= 1 m or eventually[3601:4000] distance < 1 m",
        "not (always[0:60] (distance > 1 m -> always[3700:3800] distance > 1 m))",
        "always[3000:3600] eventually[700:800] distance > 1 m",
        "always[1:9] distance > 1 m",
        "distance > 1 m until[3700:3800] distance > 2 m",
    ],
)
def test_a_part_that_no_sample_reaches_is_refused_wherever_it_stands(formula):
    found = read(changed(0, formula=formula), "mine").requirements
    with pytest.raises(RequirementError, match=r"R1: its part from .* says nothing about a flight of 3600 s"):
        require_heard(found, 3600.0, 10.0)
    require_heard(read(SHIPPED, "").requirements, 3600.0, 10.0)


def test_a_comparison_whose_quantities_cancel_is_refused():
    with pytest.raises(RequirementError, match="compares numbers with one another"):
        read(changed(0, formula="always distance - distance >= 0 m"), "mine")
