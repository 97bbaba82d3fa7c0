"""The champions that are made to be read: their audit finds nothing, and every rule means what it says."""

from dataclasses import replace

import pytest

from fis_tools.analysis.measures import measure
from fis_tools.findings.audit import audit
from fis_tools.formats import serialize
from fis_tools.genes.reduction import rounded
from fis_tools.model import FuzzyController
from tests.places import PROJECT


def shipped(name: str) -> FuzzyController:
    return serialize.load(PROJECT / "conf" / "controller" / f"{name}.yaml")


@pytest.mark.parametrize(
    ("name", "num_rules"),
    [("champion_27", 27), ("champion_27_fixed_sun", 27), ("champion_81", 81), ("champion_leo", 15)],
)
def test_their_audit_finds_nothing(name: str, num_rules: int) -> None:
    controller = shipped(name)
    assert sum(len(system.rules) for system in controller.systems) == num_rules
    assert audit(controller).findings == ()
    for system in controller.systems:
        assert measure(system).rule_consistency.index >= 0.8
        assert measure(system).completeness.least >= 0.49  # a half, but between two points of the universe
        for variable in (*system.inputs, *system.outputs):
            assert variable.maximum == rounded(variable.maximum, 2)
    for name_of_constant, value in controller.attributes:
        if name_of_constant != "force_axes":
            assert float(value) == rounded(float(value), 2)


def test_the_rehearsing_champion_is_champion_27_but_for_its_rehearsal() -> None:
    plain, rehearsing = shipped("champion_27"), shipped("champion_27_rehearsed")
    more = {"rehearsal_reach_m_s": "0.15"}
    attributes = tuple(sorted((dict(plain.attributes) | more).items()))
    told = replace(rehearsing, name=plain.name, provenance=plain.provenance)
    assert told == replace(plain, attributes=attributes)
