"""Evidence for fleets in miniature: its files agree with one another, and tell of the deputies."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts
from telemetry.file import reader
from telemetry.file.topics import DEPUTY_STATE
from tests.browser import LOOKS, serious_violations

pytestmark = pytest.mark.slow
READY = "() => globalThis.player?.sides?.every(side => side.flight)"
#: where each side's deputy is at a sample of a case that is opened
AT = """async ([row, k]) => {
    await player.open(row);
    return player.sides.map(({ flight }) => flight.position(k));
}"""


@pytest.fixture(scope="module")
def assured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("assured") / "run"
    words = ("controller=champion_27", "sun=random", "fleet.lost_percent=20", "assurance.num_cases=24")
    words += ("assurance.searches=2", "assurance.search_starts=8", "assurance.search_generations=2")
    assert main(["+experiment=assure_fleet", *words, f"hydra.run.dir={folder}"]) == 0
    return folder


def test_the_worst_fleets_are_recorded_deputy_by_deputy(assured):
    evidence = artifacts.read_json(assured, artifacts.EVIDENCE)
    table = pq.read_table(assured / artifacts.ASSURED_CASES).to_pydict()
    searched = pq.read_table(assured / artifacts.SEARCHED).to_pylist()
    assert {row["requirement"] for row in searched} == {"R3", "R4", "R5"}
    entries = {entry["id"]: entry for entry in evidence["requirements"]}
    for name, entry in entries.items():
        worst, margins = entry["worst"], table[f"{name}_margin"]
        case = int(np.argmin(margins))
        worse = [row for row in searched if row["requirement"] == name and row["margin"] < margins[case]]
        start = (
            min(worse, key=lambda row: row["margin"])
            if worse
            else {key: column[case] for key, column in table.items()} | {"margin": margins[case]}
        )
        assert worst["margin"] == pytest.approx(start["margin"])
        assert ("search, flight" in worst["found_by"]) == bool(worse)
        assert worst["recordings"] == [
            f"assure/flights/{name}-worst-deputy-{deputy}.mcap" for deputy in (1, 2)
        ]
        assert worst["recording"] == worst["recordings"][worst["deputy"] - 1]
        paths = [
            np.asarray(reader.read(assured / file, (DEPUTY_STATE,))[DEPUTY_STATE]["position_m"], np.float64)
            for file in worst["recordings"]
        ]
        starts = [[start[f"position_{axis}_m{suffix}"] for axis in "xyz"] for suffix in ("", "_of_deputy_2")]
        np.testing.assert_allclose([path[0] for path in paths], starts, atol=1e-4)
        np.testing.assert_allclose(worst["position_m"], starts[worst["deputy"] - 1], atol=1e-9)
        nearest = [np.linalg.norm(path, axis=1).min() for path in paths]
        if name == "R1":
            assert worst["margin"] == pytest.approx(min(nearest) - 15.0, abs=1e-3)
            assert worst["deputy"] == 1 + int(np.argmin(nearest))
        if name == "R5":
            assert worst["margin"] == pytest.approx(
                np.linalg.norm(paths[0] - paths[1], axis=1).min() - 10.0, abs=1e-3
            )


def test_the_page_opens_the_worst_fleets_as_they_are_recorded(opened, assured):
    """Also where messages are lost, on which flights depend."""
    entries = artifacts.read_json(assured, artifacts.EVIDENCE)["requirements"]
    page = opened((assured / artifacts.EVIDENCE_PAGE).read_text("utf-8"), 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert len(entries) > 4
    for row, entry in enumerate(entries):
        for k in (40, 200, 359):
            sides = page.evaluate(AT, [row, k])
            for side, name in zip(sides, entry["worst"]["recordings"], strict=True):
                flown = reader.read(assured / name, (DEPUTY_STATE,))[DEPUTY_STATE]["position_m"][k]
                np.testing.assert_allclose(side, flown, rtol=1e-6)


@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_the_page_of_worst_fleets_fits(opened, axe, assured, width, scheme):
    text = (assured / artifacts.EVIDENCE_PAGE).read_text("utf-8")
    page = opened(text, width, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_proofs_and_pages_tell_of_deputies(assured):
    evidence = artifacts.read_json(assured, artifacts.EVIDENCE)
    proved = {entry["id"] for entry in evidence["requirements"] if entry["share"].startswith("all cases")}
    assert {"R1", "R2", "R5"} <= proved
    assert evidence["domain"] is None
    assert evidence["conditions"]["deputies"] == 2
    page, board = ((assured / file).read_text() for file in (artifacts.EVIDENCE_PAGE, artifacts.BOARD_PAGE))
    assert "24 cases of 2 deputies, seed" in page
    assert "of each of 2 deputies" in board
    assert "what a deputy senses depends on what the others tell it" in page
    assert "deputies 10 m apart that start 10" in page
    assert "Each deputy; bold" in board
