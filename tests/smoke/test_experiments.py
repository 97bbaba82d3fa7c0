"""Every experiment of conf/, all its stages, in miniature and through the command line."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml

import telemetry
from fis_tools.formats import serialize
from pipeline.command_line.cli import main
from pipeline.command_line.runs import MISSED, OK, UNIMPROVED, UNPROVED
from pipeline.run import artifacts, configuration, manifests
from tests import night
from tests.policies import Page, check_policy
from tests.smoke import miniature
from tests.state import unchanged

pytestmark = pytest.mark.slow

#: flights of ten minutes do not come to the goal that is to be proved
PROVE_NOTHING = ("prove",)

#: what few runs leave: flights of ten minutes are not compared with plans of an hour, and an untrained
#: controller asks for more force than is to be proved
SELDOM = {artifacts.BESIDE_OPTIMUM, artifacts.PROOF_BOXES, artifacts.TENSORBOARD}
SELDOM |= {artifacts.EPISODE_PARTS}
FILES = {name for key, name in vars(artifacts).items() if key.isupper() and isinstance(name, str)} - SELDOM


#: a run of each takes a minute in all
EXPERIMENTS = night.by_day(miniature.EXPERIMENTS, 3)


@pytest.fixture(scope="module", params=EXPERIMENTS, ids=lambda path: path.stem)
def finished(request, tmp_path_factory) -> tuple[str, Path, list[str]]:
    """An experiment, the folder of its run, and its stages."""
    experiment = request.param.stem
    folder = tmp_path_factory.mktemp(experiment) / "run"
    with unchanged():
        code = main([*miniature.words(experiment), f"hydra.run.dir={folder}"])
    if (folder / artifacts.FIT).exists():
        assert code == MISSED  # which no goal of 95 % of so few flights is not
    elif (folder / artifacts.TRAINED).exists():
        is_improved = artifacts.read_json(folder, artifacts.TRAINED)["improved"]
        assert code == (OK if is_improved else UNIMPROVED)
    else:
        assert code == (UNPROVED if experiment in PROVE_NOTHING else OK)
    return experiment, folder, yaml.safe_load(request.param.read_text(encoding="utf-8"))["stages"]


def num_deputies(folder: Path) -> int:
    return configuration.read(folder)["fleet"]["deputies"]


def test_all_stages_finish_leave_their_files_and_the_manifest_knows_them(finished):
    experiment, folder, stages = finished
    manifest = manifests.read(folder)
    assert manifest["finished_stages"] == stages
    hashes = {name: artifacts.file_hash(folder / name) for name in artifacts.list_artifacts(folder)}
    assert manifest["sha256"] == hashes
    assert manifest["config_hash"] == configuration.config_hash(configuration.read(folder))
    written = {name for name in FILES if artifacts.stage_of(name) in stages}
    if experiment == "compare_docking":
        written.discard(artifacts.FIGURES)  # its page draws its own
    if experiment != "train_front":
        written -= {artifacts.FRONT, artifacts.FRONT_CONTROLLERS}
    if "compare" in stages:
        written.discard(artifacts.REVIEW)  # of many controllers none is the run's
    if "evaluate" in stages and "nominal" not in artifacts.read_json(folder, artifacts.SUMMARY):
        written.discard(artifacts.NOMINAL_EPISODES)  # nothing is dispersed
    # fleets have a table of their deputies in place of trajectories
    written.discard(artifacts.TRAJECTORIES if num_deputies(folder) > 1 else artifacts.DEPUTIES)
    if num_deputies(folder) > 1:  # nor does any search vary one deputy's start
        written -= {artifacts.SEARCHED, artifacts.DOMAIN}
    assert written
    for name in written:
        path = folder / name
        assert path.exists(), name
        assert list(path.iterdir()) if path.is_dir() else path.stat().st_size > 0, name
    for makers, name in ({"train", "fit"}, artifacts.CHAMPION), ({"evaluate"}, "evaluate"):
        assert (folder / name).exists() == bool(makers.intersection(stages))


def test_files_hold_every_generation_case_sample_and_flight(finished):
    _, folder, stages = finished
    if "train" in stages:
        assert dict(serialize.load(folder / artifacts.CHAMPION).provenance)["generations"] == "3"
        assert len((folder / artifacts.LOGBOOK).read_text().splitlines()) == 1 + 3
        assert pq.read_table(folder / artifacts.HISTORY).num_rows == 3
    if "evaluate" in stages:
        assert pq.read_table(folder / artifacts.EPISODES).num_rows == 3
        period = configuration.read(folder)["control_period_s"]
        if num_deputies(folder) > 1:
            assert pq.read_table(folder / artifacts.DEPUTIES).num_rows == 3 * num_deputies(folder)
        else:
            assert pq.read_table(folder / artifacts.TRAJECTORIES).num_rows == 3 * (1 + 600 / period)
        assert artifacts.read_json(folder, artifacts.SUMMARY)["num_cases"] == 3
    recordings = list(folder.glob(f"{artifacts.RECORDINGS}/*"))
    num_flights = 8 * ("train" in stages) + (3 * num_deputies(folder) if "evaluate" in stages else 1)
    assert len(recordings) == (num_flights if "record" in stages else 0)
    for path in recordings:
        flight = telemetry.read(path)
        assert len(flight["/deputy/state"]) == 61
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
    training, results = (*miniature.words("train"), "stages=[scenario,train,evaluate]"), []
    for count in (1, 2):
        folder = tmp_path / str(count)
        workers = (f"optimizer.workers={count}", f"monte_carlo.workers={count}")
        # so short a training may hand back what it was given
        assert main([*training, *workers, f"hydra.run.dir={folder}"]) in (0, 4)
        files = [(folder / name).read_bytes() for name in (artifacts.LOGBOOK, artifacts.EPISODES)]
        results.append((artifacts.read_json(folder, artifacts.CHAMPION)["systems"], files))
    assert results[0] == results[1]
