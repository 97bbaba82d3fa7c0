"""Every experiment of conf/, all its stages, in miniature and through the command line."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml

import telemetry
from fis_tools.formats import serialize
from pipeline.run import artifacts, configuration, manifests
from tests.policies import Page, check_policy
from tests.smoke.command_line import EXPERIMENTS, FEW, MINIATURE, NUM_SAMPLES, PROJECT, run_pipeline

pytestmark = pytest.mark.slow


#: what each stage leaves
FILES_OF = {
    "scenario": (artifacts.SCENARIOS,),
    "train": (artifacts.LOGBOOK, artifacts.HISTORY, artifacts.CHECKPOINT, artifacts.CHAMPION),
    "evaluate": (artifacts.EPISODES, artifacts.TRAJECTORIES, artifacts.SUMMARY, artifacts.BESIDE_OPTIMUM),
    "optimum": (
        *(artifacts.OPTIMUM_CASES, artifacts.OPTIMUM_PLANS),
        *(artifacts.OPTIMUM_FORCES, artifacts.OPTIMUM_SUMMARY),
    ),
    "compare": (artifacts.COMPARISON_TABLE, artifacts.COMPARISON_EPISODES, artifacts.COMPARISON),
    "assure": (
        *(artifacts.REQUIREMENTS, artifacts.ASSURED_CASES, artifacts.SEARCHED, artifacts.WORST_FLIGHTS),
        *(artifacts.PROOF_BOXES, artifacts.DOMAIN, artifacts.EVIDENCE, artifacts.EVIDENCE_PAGE),
    ),
    "prove": (artifacts.THEOREM, artifacts.TUBE, artifacts.PROVED_CONTROLLER),
    "record": (artifacts.RECORDINGS,),
    "report": (artifacts.FIGURES, artifacts.REPORT, artifacts.REVIEW),
}


@pytest.fixture(scope="module", params=EXPERIMENTS)
def finished(request, tmp_path_factory) -> tuple[str, Path, list[str]]:
    """An experiment, the folder of its run, and its stages."""
    experiment, folder = request.param, tmp_path_factory.mktemp(request.param) / "run"
    small = [*MINIATURE, *FEW.get(experiment, ())]
    if experiment == "assure":  # which has flights of its own
        small.remove("monte_carlo.num_cases=3")
    text = (PROJECT / "conf" / "experiment" / f"{experiment}.yaml").read_text(encoding="utf-8")
    run_pipeline(f"+experiment={experiment}", *small, folder=folder)
    return experiment, folder, yaml.safe_load(text)["stages"]


def test_all_stages_finish_leave_their_files_and_the_manifest_knows_them(finished):
    experiment, folder, stages = finished
    manifest = manifests.read(folder)
    assert manifest["finished_stages"] == stages
    hashes = {name: artifacts.file_hash(folder / name) for name in artifacts.list_artifacts(folder)}
    assert manifest["sha256"] == hashes
    assert manifest["config_hash"] == configuration.config_hash(configuration.read(folder))
    written = {name for stage in stages for name in FILES_OF.get(stage, ())}
    # flights of ten minutes are not compared with plans of an hour
    written.discard(artifacts.BESIDE_OPTIMUM)
    # an untrained controller asks for more force than is to be proved
    written.discard(artifacts.PROOF_BOXES)
    if experiment == "compare_docking":
        written.discard(artifacts.FIGURES)  # its page draws its own
    if "compare" in stages:
        written.discard(artifacts.REVIEW)  # of many controllers none is the run's
    assert written
    for name in written:
        path = folder / name
        assert path.exists(), name
        assert list(path.iterdir()) if path.is_dir() else path.stat().st_size > 0, name
    for stage, name in {"train": artifacts.CHAMPION, "evaluate": "evaluate"}.items():
        assert (folder / name).exists() == (stage in stages)


def test_files_hold_every_generation_case_sample_and_flight(finished):
    _, folder, stages = finished
    if "train" in stages:
        champion = serialize.load(folder / artifacts.CHAMPION)
        assert dict(champion.provenance)["generations"] == "3"
        assert len((folder / artifacts.LOGBOOK).read_text().splitlines()) == 1 + 3
        assert pq.read_table(folder / artifacts.HISTORY).num_rows == 3
    if "evaluate" in stages:
        assert pq.read_table(folder / artifacts.EPISODES).num_rows == 3
        period = configuration.read(folder)["control_period_s"]
        assert pq.read_table(folder / artifacts.TRAJECTORIES).num_rows == 3 * (1 + 600 / period)
        assert artifacts.read_json(folder, artifacts.SUMMARY)["num_cases"] == 3
    recordings = list(folder.glob(f"{artifacts.RECORDINGS}/*"))
    num_flights = 8 * ("train" in stages) + (3 if "evaluate" in stages else 1)
    assert len(recordings) == (num_flights if "record" in stages else 0)
    for path in recordings:
        flight = telemetry.read(path)
        assert len(flight["/deputy/state"]) == NUM_SAMPLES
        assert flight.attachments["config.yaml"]


def test_the_report_needs_nothing_but_itself(finished):
    experiment, folder, stages = finished
    assert (folder / artifacts.REPORT).exists() == ("report" in stages)
    if "report" not in stages:
        return
    text = (folder / artifacts.REPORT).read_text(encoding="utf-8")
    check_policy(text)
    links = [link["href"] for link in Page(text).all("a") if "href" in link]
    assert [link for link in links if not link.startswith("#") and not (folder / link).is_file()] == []
    pictures = list((folder / artifacts.FIGURES).glob("*.png"))
    assert pictures or (experiment == "compare_docking")
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in pictures)


def test_the_same_seed_finds_the_same_champion_on_any_number_of_workers(tmp_path):
    training, found = ("+experiment=train", *MINIATURE, "stages=[scenario,train,evaluate]"), []
    for count in (1, 2):
        workers = (f"optimizer.workers={count}", f"monte_carlo.workers={count}")
        folder = run_pipeline(*training, *workers, folder=tmp_path / str(count))
        champion = json.loads((folder / artifacts.CHAMPION).read_text())
        files = [(folder / name).read_bytes() for name in (artifacts.LOGBOOK, artifacts.EPISODES)]
        found.append((champion["systems"], files))
    assert found[0] == found[1]
