"""A controller that is no longer the one that its provenance tells of."""

from dataclasses import replace
from pathlib import Path

import pytest

from fis_tools.errors import ControllerFileError
from fis_tools.findings.audit import audit
from fis_tools.findings.simplification import simplify
from fis_tools.formats import serialize
from fis_tools.formats.serialize import content_hash, described, edited
from fis_tools.source import named, read_controller
from tests.fis_tools.sample_controllers import paper_like_controller
from tests.places import PROJECT

CHAMPION = PROJECT / "conf" / "controller" / "champion_27.yaml"
SLIP = ("negative_large, negative_small, zero, ", "negative_large, negative_small, positive_large, ")


def test_every_shipped_champion_is_the_one_its_provenance_tells_of() -> None:
    told = [
        serialize.load(path) for path in sorted((PROJECT / "conf" / "controller").glob("*champion*.yaml"))
    ]
    assert len(told) > 7
    for controller in told:
        assert dict(controller.provenance)["controller_hash"] == content_hash(controller)
        assert edited(controller) is None


@pytest.mark.parametrize(
    "changed",
    [
        lambda text: text.replace(*SLIP, 1),
        lambda text: text.replace("decision_period_s: 30.0", "decision_period_s: 40.0"),
        lambda text: text.replace("peak: 0.053, right: 0.106}", "peak: 0.052, right: 0.106}"),
    ],
)
def test_a_controller_edited_by_hand_says_so(changed, tmp_path: Path) -> None:
    text = CHAMPION.read_text()
    assert changed(text) != text
    path = tmp_path / "champion.yaml"
    path.write_text(changed(text))
    original = dict(serialize.load(CHAMPION).provenance)["controller_hash"]
    words = f"by hand after training; fitness and figures are of hash {original}"
    controller = serialize.load(path)
    assert edited(controller) == words
    assert edited(serialize.loads(serialize.dump_json(controller), "json")) == words
    (finding,) = [found for found in audit(controller).findings if found.id == "edited"]
    assert finding.sentence == f"champion_27 was edited {words}."


@pytest.mark.parametrize(
    "same",
    [
        lambda text: text.replace("decision_period_s: 30.0", "decision_period_s: 30"),
        lambda text: text.replace("description: force along Hill i", "description: up or down"),
        lambda text: text.replace("name: champion_27\n", "name: other\n"),
    ],
)
def test_other_words_for_the_same_are_no_edit(same) -> None:
    text = CHAMPION.read_text()
    assert same(text) != text
    assert edited(serialize.loads(same(text), "yaml")) is None


def test_what_was_simplified_is_told_apart_from_what_a_hand_did() -> None:
    trained = described(paper_like_controller(), {"training_fitness": "0.5"})
    simpler = simplify(trained).controller
    assert content_hash(simpler) != content_hash(trained)
    again = serialize.loads(serialize.dump_json(simpler), "json")
    assert str(edited(again)).startswith("by simplify after training; ")
    assert edited(replace(again, provenance=())) is None


def test_a_slip_in_a_symmetric_table_is_found() -> None:
    def found(text: str) -> list[tuple[int, ...]]:
        report = audit(serialize.loads(text, "yaml"))
        return [finding.rules for finding in report.findings if finding.id == "broken-symmetry"]

    text = CHAMPION.read_text()
    assert found(text) == []
    assert found(text.replace(*SLIP, 1)) == [(3, 7)]
    # the middle of an odd table is its own mirror
    middle = (
        "negative_small, zero,           positive_small,  # aim_r",
        "negative_small, positive_small, positive_small,  # aim_r",
    )
    assert found(text.replace(*middle, 1)) == [(5,)]


def test_a_project_says_where_its_controllers_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "mine"
    (folder / "below").mkdir(parents=True)
    (folder / "fan.yaml").write_text(CHAMPION.read_text())
    monkeypatch.chdir(folder / "below")
    with pytest.raises(ControllerFileError, match="no controller of that name; give the path"):
        read_controller("fan")
    (tmp_path / "pyproject.toml").write_text('[tool.fis_tools]\ncontrollers = ["mine"]\n')
    assert named("fan") == folder / "fan.yaml"
    assert read_controller("fan") == serialize.load(CHAMPION)
    with pytest.raises(ControllerFileError, match="did you mean 'fan'"):
        read_controller("fam")
    (folder / "fan.json").write_text(serialize.dump_json(serialize.load(CHAMPION)))
    with pytest.raises(ControllerFileError, match=r"fan may be .*fan\.json or .*fan\.yaml"):
        read_controller("fan")
