"""A front in miniature: a table, and controllers that fly as it says; the champion among them."""

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from fis_tools.formats import serialize
from pipeline.evaluation.front import COLUMNS
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.goals.flights import fly_all
from pipeline.report import page, pictures
from pipeline.report.contents import read_numbers
from pipeline.run import artifacts, configuration
from pipeline.scenarios import validation_scenarios
from pipeline.stages import train
from pipeline.training.fitness import costs
from tests.pipeline.stages.cases import prepared

WORDS = (
    *("starts.num_cases=3", "starts.num_hard=2", "starts.hard_from=5", "optimizer.rounds=2"),
    *("optimizer.generations=2", "optimizer.validation_cases=7", "optimizer.population_size=8"),
)
#: controllers with triangles, whose numbers stretch, and with Gaussians, whose rules are free; and docking
KINDS = {
    "triangles": ("duration_s=600.0",),
    "Gaussians": (
        *("controller=paper_champion", "optimizer.encoding.rules=free", "optimizer.encoding.stretch=null"),
        "duration_s=600.0",
    ),
    # each time from so many starts that as many fly side by side as in an evaluation, which comes compiled
    "docking": (
        *("controller=champion_docking", "problem=docking", "duration_s=900.0"),
        *("starts.num_cases=9", "starts.hard_from=9", "optimizer.validation_cases=9"),
    ),
}


def run_of(folder: Path, *words: str):
    return prepared(folder, *WORDS, *words, experiment="train_front")


@pytest.fixture(scope="module", params=KINDS)
def trained(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("front")
    stale = folder / artifacts.FRONT_CONTROLLERS / "77.json"
    stale.parent.mkdir(parents=True)
    stale.write_text("of an earlier training")
    job = run_of(folder, *KINDS[request.param])
    unimproved = train.run(job.experiment, folder)
    return job, folder, unimproved, KINDS[request.param]


def rows(folder: Path) -> list[dict[str, float]]:
    with (folder / artifacts.FRONT).open(newline="", encoding="utf-8") as stream:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]


def test_each_controller_flies_as_the_table_says(trained):
    job, folder, _, _ = trained
    experiment, table = job.experiment, rows(folder)
    files = sorted((folder / artifacts.FRONT_CONTROLLERS).iterdir())
    assert [path.name for path in files] == [f"{index:02d}.json" for index in range(len(table))]
    assert len(table) > 1
    penalty = experiment.optimizer.penalty
    starts = validation_scenarios(experiment, experiment.optimizer.validation_cases)
    for row, path in zip(table, files, strict=True):
        controller = serialize.load(path)
        outcomes = fly_all(experiment.mission, from_fuzzy(controller), starts)
        success = outcomes.is_success(experiment.mission.inspection_threshold_percent)
        expected = {
            "delta_v_m_s": outcomes.delta_v_m_s.mean(),
            "inspection_rate_percent": 100 * (outcomes.inspected_count / outcomes.inspectable_count).mean(),
            "success_percent": 100 * (success & ~outcomes.is_violated).mean(),
            "outside_percent": 100 * outcomes.is_violated.mean(),
            "fitness_m_s": costs(outcomes, penalty, experiment.mission).mean(),
        }
        facts = dict(controller.provenance)
        for name, value in expected.items():
            assert row[name] == pytest.approx(value, rel=1e-9)
            assert float(facts[name]) == row[name]
        assert row["spent_m_s"] + row["missed_m_s"] == pytest.approx(row["fitness_m_s"], rel=1e-12)
        assert facts["config_hash"] == configuration.config_hash(job.config)
        assert facts["front"] == f"{path.stem} of {len(table)}"


def test_the_cheapest_comes_first_and_what_is_beaten_does_not_stand(trained):
    table = rows(trained[1])
    spent = [row["delta_v_m_s"] for row in table]
    assert spent == sorted(spent)
    pairs = [(row["spent_m_s"], row["missed_m_s"]) for row in table]
    for pair, row in zip(pairs, table, strict=True):
        is_beaten = any(other != pair and other[0] <= pair[0] and other[1] <= pair[1] for other in pairs)
        assert row["stands"] == (not is_beaten)


def test_the_champion_is_of_the_front_or_what_was_given(trained):
    _, folder, unimproved, _ = trained
    table = rows(folder)
    chosen = [row for row in table if row["handed_back"]]
    champion = serialize.load(folder / artifacts.CHAMPION)
    summary = artifacts.read_json(folder, artifacts.TRAINED)
    assert len(chosen) == (summary["chosen"]["candidate"] == "front")
    assert (unimproved is None) == summary["improved"]
    for row in chosen:
        same = serialize.load(folder / artifacts.FRONT_CONTROLLERS / f"{int(row['controller']):02d}.json")
        assert (champion.systems, champion.attributes) == (same.systems, same.attributes)
        assert float(dict(champion.provenance)["training_fitness"]) == row["training_fitness_m_s"]
    given = summary["given"]
    if unimproved is None:
        is_surer = summary["chosen"]["success"]["low"] > given["success"]["high"]
        assert is_surer or summary["chosen"]["cost_m_s"] < given["cost_m_s"]


def test_a_training_goes_on_to_the_same_front_on_any_number_of_workers(trained, tmp_path):
    _, folder, _, words = trained
    whole = run_of(tmp_path, *words, "optimizer.workers=2").experiment
    first = replace(whole, optimizer=replace(whole.optimizer, rounds=1, workers=1))  # ends after a round
    train.run(first, tmp_path)
    train.run(replace(whole, resume=True), tmp_path)
    assert (tmp_path / artifacts.FRONT).read_bytes() == (folder / artifacts.FRONT).read_bytes()


def test_the_report_draws_the_front_and_lists_its_controllers(trained):
    job, folder, _, _ = trained
    table = rows(folder)
    columns = read_numbers(folder, artifacts.FRONT, COLUMNS)
    contents = SimpleNamespace(front=columns, experiment=job.experiment)
    ((name, caption, figure),) = pictures._front(contents)
    assert name == "front"
    assert artifacts.FRONT_CONTROLLERS in caption
    drawn = [line.get_xdata() for line in figure.axes[0].lines if len(line.get_xdata())]
    spent = {row["delta_v_m_s"] for row in table}
    assert {float(value) for values in drawn for value in values} == spent
    headings, *cells = page.front_rows(columns)
    assert [cell[0] for cell in cells] == [f"{index:02d}" for index in range(len(table))]
    assert all(len(cell) == len(headings) for cell in cells)
    assert [bool(cell[-1] == "handed back") for cell in cells] == [row["handed_back"] == 1 for row in table]
    assert page.front_rows(None) == []
