"""A requirement is shown by the proof of the run that it is judged in, and by no other."""

import json
import re
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from fis_tools.formats import serialize
from fis_tools.review import page as review_page
from pipeline.command_line.cli import main
from tests import night
from tests.pipeline.proof.cases import NEAR

REQUIREMENT = """schema: requirements
schema_version: 2
name: near
requirements:
  - id: R1
    title: Arrive
    text: The deputy arrives, never too fast.
    consequence: a collision
    severity: catastrophic
    reason: No share is accepted.
    source: this test
    verified_by: [cases, tube]
    formula: >-
      (speed <= 0.2 m/s + 0.002054 per_s * distance) until (distance <= 1.5 m and speed <= 0.2 m/s)
    confidence: 0.9
"""


pytest.importorskip("flint", reason="the checker needs python-flint")


@pytest.mark.slow
def test_a_requirement_is_shown_by_the_checked_proof_of_its_run_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, folder = tmp_path / "near.yaml", tmp_path / "run"
    path.write_text(REQUIREMENT)
    few = ("assurance.num_cases=4", "assurance.domain_cases=1")
    words = [*NEAR, *few, f"assurance.requirements={path}", f"hydra.run.dir={folder}"]

    def verdict() -> tuple[str, str]:
        (entry,) = json.loads((folder / "assure" / "evidence.json").read_text())["requirements"]
        return entry["verdict"], entry["methods"]["tube"]["why"]

    def repeated(code: int) -> str:
        """Repeat the stage, which ends with a code, and return its last line on the terminal."""
        assert main([*words, "stages=[assure]"]) == code
        return capsys.readouterr().err.splitlines()[-1]

    missing = "no proof was found, though one was asked for, of R1 (tube)"
    assert main([*words, "stages=[prove,assure]"]) == 0
    assert verdict()[0] == "shown"
    assert "is at the goal after" in verdict()[1]
    page = folder / "assure" / "evidence.html"
    text = page.read_text()
    assert ">tube<" in text
    assert 'id="tube-figure_1"' in text
    controller = serialize.load(folder / "prove" / "controller.json")

    def reviewed() -> str:
        return review_page.write(controller, evidence=folder / "assure" / "evidence.json")

    assert "it is as the manifest of its run says; the checker finds the proof in its run right" in reviewed()
    assert "the proof was checked here, and is right" in reviewed()
    # the page argues from the proved set, not from what flights met
    assert "R1: proved from every start with x from 3 to 3.5 m" in " ".join(
        re.sub("<[^>]*>", " ", text).split()
    )
    for words_of_flights in ("inputs that flights have met", "left the operational domain", "Sun random"):
        assert words_of_flights not in text
    # a proof that nobody checks is none
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "flint", None)
        assert repeated(3) == missing
        assert verdict()[0] == "not shown"
        assert "stated by the run, not checked" in verdict()[1]
        assert "tube-figure_1" not in page.read_text()
    theorem, tube = folder / "prove" / "theorem.json", folder / "prove" / "tube.parquet"
    written, boxes = json.loads(theorem.read_text()), pq.read_table(tube)
    for changes in night.by_day(
        ({"mass_kg": 11.0}, {"limit": [0.3, 0.002054, 0.0]}, {"controller_sha256": "0" * 64}), 2
    ):
        theorem.write_text(json.dumps(written | changes))
        assert repeated(3) == missing
        assert verdict() == ("not shown", "prove/theorem.json is of other flights; repeat the stage prove")
        assert "tube-figure_1" not in page.read_text()
    for changes in night.by_day(
        ({"num_periods": "many"}, {"num_periods": 2}, {"fault": None, "num_periods": -1}), 3
    ):
        theorem.write_text(json.dumps(written | changes))
        assert repeated(3) == missing
        assert verdict()[0] == "not shown"
    for damage in night.by_day(("[", "[]", "[" * 100_000, "null", '{"fault": NaN}'), 3):
        theorem.write_text(damage)
        assert repeated(3) == missing
        assert re.search("cannot be read|is of other flights", verdict()[1])
    theorem.write_text(json.dumps(written))
    pq.write_table(boxes.slice(0, len(boxes) - 1), tube)
    assert repeated(3) == missing
    assert "the checker refuses the proof" in verdict()[1]
    assert "the checker REFUSES the proof in its run" in reviewed()
    with monkeypatch.context() as patch:  # a process that dies refuses, too
        patch.setattr(sys, "executable", "/bin/false")
        assert repeated(3) == missing
        assert "(it ended with code 1)" in verdict()[1]
    pq.write_table(boxes, tube)
    assert main([*words, "stages=[assure]"]) == 0
    assert verdict()[0] == "shown"
    theorem.unlink()
    assert repeated(3) == missing
    assert "add the stage prove" in verdict()[1]


@pytest.mark.slow
def test_a_run_that_proves_nothing_says_so_last_and_has_a_code_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    assert main([*NEAR, "problem.limit_base_m_s=0.01", f"hydra.run.dir={folder}"]) == 3
    assert capsys.readouterr().err.splitlines()[-1].startswith("not proved: every start keeps the limit")
    assert main([*NEAR, "controller=champion_27", f"hydra.run.dir={tmp_path / 'other'}"]) == 3
    assert capsys.readouterr().err.splitlines()[-1].startswith("not proved: controller 'champion_27' cannot")
