"""The file of requirements: what ships, and mistakes."""

import copy

import pytest
import yaml

from pipeline.evaluation.assurance.requirements import METHODS, Question, RequirementError, needs, read
from pipeline.settings.places import requirements_path

SHIPPED = requirements_path("inspection").read_text(encoding="utf-8")


def test_what_ships_can_be_read_and_uses_every_way_of_verification():
    found = read(SHIPPED, "inspection")
    assert found.name == "inspection"
    assert [one.id for one in found.requirements] == [f"R{number}" for number in range(1, 9)]
    assert all(needs(found.requirements, method) for method in METHODS)
    keep_out, thrust = found.requirements[0], found.requirements[-1]
    assert (keep_out.unit, keep_out.probability, keep_out.confidence) == ("m", 0.99865, 0.9)
    assert found.requirements[5].unit == "mixed"
    assert thrust.formula is None
    assert thrust.questions[0] == Question("force_x > 0.05")


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
        ("schema: requirements\nschema_version: 1", "must be a list of at least one"),
        (changed(0, id="R2"), "R2 is the id of two requirements"),
        (changed(0, id="../x"), "requirement 1: its id is '../x'; it names files"),
        (changed(0, title=" "), "R1: title is missing"),
        (changed(0, probability=1), "R1: probability is 1; it must be above 0 and below 1"),
        (changed(0, confidence=None), "R1: confidence is None"),
        (changed(0, propability=0.9), "there is no key propability; did you mean probability?"),
        (changed(0, verified_by=["cases", "serch"]), "R1: verified_by has 'serch'; did you mean search?"),
        (changed(0, verified_by="cases"), "R1: verified_by must be a list of cases, search"),
        (changed(0, formula="always (distance >= 15 kg)"), "R1, its formula:\nalways (distance >= 15 kg)\n"),
        (changed(7, bounds=[{"asks": "force_x > 1"}]), "R8: bounds must be a list of questions"),
    ],
)
def test_mistakes_name_the_requirement_and_the_cure(text, words):
    with pytest.raises(RequirementError) as caught:
        read(text, "mine")
    assert words in str(caught.value)


def test_requirements_that_are_not_there_are_told_with_those_that_ship(tmp_path):
    with pytest.raises(FileNotFoundError, match="name those that ship \\(inspection\\)"):
        requirements_path(str(tmp_path / "none.yaml"))
