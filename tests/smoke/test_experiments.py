"""Every experiment of conf/, all its stages, in miniature and through the command line."""

import json
import re
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml

import telemetry
from fis_tools.formats import serialize
from pipeline.run import artifacts, configuration, manifests
from tests.smoke.command_line import EXPERIMENTS, FEW, MINIATURE, NUM_SAMPLES, PROJECT, run_pipeline

pytestmark = pytest.mark.slow


#: what each stage leaves
FILES_OF = {
    "scenario": (artifacts.SCENARIOS,),
    "train": (artifacts.LOGBOOK, artifacts.HISTORY, artifacts.CHECKPOINT, artifacts.CHAMPION),
    "evaluate": (artifacts.EPISODES, artifacts.TRAJECTORIES, artifacts.SUMMARY, artifacts.BESIDE_OPTIMUM),
    "optimum": (
        artifacts.OPTIMUM_CASES,
        artifacts.OPTIMUM_PLANS,
        artifacts.OPTIMUM_FORCES,
        artifacts.OPTIMUM_SUMMARY,
    ),
    "compare": (artifacts.COMPARISON_TABLE, artifacts.COMPARISON_EPISODES, artifacts.COMPARISON),
    "assure": (
        artifacts.REQUIREMENTS,
        artifacts.ASSURED_CASES,
        artifacts.SEARCHED,
        artifacts.WORST_FLIGHTS,
        artifacts.PROOF_BOXES,
        artifacts.DOMAIN,
        artifacts.EVIDENCE,
        artifacts.EVIDENCE_PAGE,
    ),
    "prove": (artifacts.THEOREM, artifacts.TUBE, artifacts.PROVED_CONTROLLER),
    "record": (artifacts.RECORDINGS,),
    "report": (artifacts.FIGURES, artifacts.REPORT, artifacts.REVIEW),
}


@pytest.fixture(scope="module", params=EXPERIMENTS)
def finished(request, tmp_path_factory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp(request.param) / "run"
    small = [*MINIATURE, *FEW.get(request.param, ())]
    if request.param == "assure":  # which has flights of its own
        small.remove("monte_carlo.num_cases=3")
    return request.param, run_pipeline(f"+experiment={request.param}", *small, folder=folder)


def stages_of(experiment: str) -> list[str]:
    text = (PROJECT / "conf" / "experiment" / f"{experiment}.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["stages"]


def test_all_stages_finish_and_the_manifest_knows_every_file(finished):
    experiment, folder = finished
    manifest = manifests.read(folder)
    assert manifest["finished_stages"] == stages_of(experiment)
    assert manifest["sha256"] == {
        name: artifacts.file_hash(folder / name) for name in artifacts.list_artifacts(folder)
    }
    assert manifest["config_hash"] == configuration.config_hash(configuration.read(folder))


def test_each_stage_leaves_its_files(finished):
    experiment, folder = finished
    written = {name for stage in stages_of(experiment) for name in FILES_OF.get(stage, ())}
    # flights of ten minutes are not compared with plans of an hour
    written.discard(artifacts.BESIDE_OPTIMUM)
    # an untrained controller asks for more force than is to be proved
    written.discard(artifacts.PROOF_BOXES)
    if experiment == "compare_docking":
        written.discard(artifacts.FIGURES)  # its page draws its own
    if "compare" in stages_of(experiment):
        written.discard(artifacts.REVIEW)  # of many controllers none is the run's
    assert written
    for name in written:
        path = folder / name
        assert path.exists(), name
        assert list(path.iterdir()) if path.is_dir() else path.stat().st_size > 0, name


def test_champions_are_controllers_and_the_logbook_has_every_generation(finished):
    experiment, folder = finished
    if "train" not in stages_of(experiment):
        assert not (folder / artifacts.CHAMPION).exists()
        return
    champion = serialize.load(folder / artifacts.CHAMPION)
    assert dict(champion.provenance)["generations"] == "3"
    assert len((folder / artifacts.LOGBOOK).read_text().splitlines()) == 1 + 3
    assert pq.read_table(folder / artifacts.HISTORY).num_rows == 3


def test_evaluations_have_a_row_for_each_case_and_sample(finished):
    experiment, folder = finished
    if "evaluate" not in stages_of(experiment):
        assert not (folder / "evaluate").exists()
        return
    assert pq.read_table(folder / artifacts.EPISODES).num_rows == 3
    period = configuration.read(folder)["control_period_s"]
    assert pq.read_table(folder / artifacts.TRAJECTORIES).num_rows == 3 * (1 + 600 / period)
    assert artifacts.read_json(folder, artifacts.SUMMARY)["num_cases"] == 3


def test_recordings_hold_whole_flights(finished):
    experiment, folder = finished
    if "record" not in stages_of(experiment):
        assert not (folder / artifacts.RECORDINGS).exists()
        return
    recordings = sorted((folder / artifacts.RECORDINGS).iterdir())
    is_trained, is_evaluated = ("train" in stages_of(experiment), "evaluate" in stages_of(experiment))
    assert len(recordings) == (8 if is_trained else 0) + (3 if is_evaluated else 1)
    for path in recordings:
        flight = telemetry.read(path)
        assert len(flight["/deputy/state"]) == NUM_SAMPLES
        assert flight.attachments["config.yaml"]


def test_the_report_needs_nothing_but_itself(finished):
    experiment, folder = finished
    if "report" not in stages_of(experiment):
        assert not (folder / artifacts.REPORT).exists()
        return
    page = (folder / artifacts.REPORT).read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert page.rstrip().endswith("</html>")
    links = re.findall(r"""<a\b[^>]*?href=["']([^"']+)""", page)
    assert [link for link in links if not link.startswith("#") and not (folder / link).is_file()] == []
    loaded = re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"'\s)>]+)""", page)
    assert [place for place in loaded if not place.startswith(("data:", "#")) and place not in links] == []
    pictures = list((folder / artifacts.FIGURES).glob("*.png"))
    assert pictures or (experiment == "compare_docking")
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in pictures)


ONE_WORKER = ("optimizer.workers=1", "monte_carlo.workers=1")
TRAINING = ("+experiment=train", *MINIATURE, "stages=[scenario,train,evaluate]")


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> Path:
    """A training that everything else is compared with."""
    return run_pipeline(*TRAINING, *ONE_WORKER, folder=tmp_path_factory.mktemp("first") / "run")


def numbers(folder: Path) -> tuple[object, str, str]:
    """What a run found: the champion's systems, how it was found, and what it flew."""
    champion = json.loads((folder / artifacts.CHAMPION).read_text())
    return (
        champion["systems"],
        (folder / artifacts.LOGBOOK).read_text(),
        artifacts.file_hash(folder / artifacts.EPISODES),
    )


def test_the_same_seed_finds_the_same_champion_on_any_number_of_workers(first, tmp_path):
    again = run_pipeline(*TRAINING, "optimizer.workers=2", "monte_carlo.workers=2", folder=tmp_path / "again")
    assert numbers(again) == numbers(first)
