"""A requirement is shown by the proof of the run that it is judged in, and by no other."""

import json
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
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


@pytest.mark.slow
def test_a_requirement_is_shown_by_the_proof_of_its_run_alone(tmp_path: Path) -> None:
    path, folder = tmp_path / "near.yaml", tmp_path / "run"
    path.write_text(REQUIREMENT)
    few = ("assurance.num_cases=4", "assurance.domain_cases=1")
    words = [*NEAR, *few, f"assurance.requirements={path}", f"hydra.run.dir={folder}"]

    def verdict() -> tuple[str, str]:
        (told,) = json.loads((folder / "assure" / "evidence.json").read_text())["requirements"]
        return told["verdict"], told["methods"]["tube"]["why"]

    assert main([*words, "stages=[prove,assure]"]) == 0
    assert verdict()[0] == "shown"
    assert "is at the goal after" in verdict()[1]
    page = folder / "assure" / "evidence.html"
    assert ">tube<" in page.read_text()
    assert 'id="tube-figure_1"' in page.read_text()
    theorem = folder / "prove" / "theorem.json"
    told = json.loads(theorem.read_text())
    theorem.write_text(json.dumps(told | {"mass_kg": 11.0}))
    assert main([*words, "stages=[assure]"]) == 0
    assert verdict() == ("not shown", "prove/theorem.json is of other flights; repeat the stage prove")
    assert "tube-figure_1" not in page.read_text()
    theorem.unlink()
    assert main([*words, "stages=[assure]"]) == 0
    assert "add the stage prove" in verdict()[1]
