"""A front in miniature: a table and controllers that fly as it says, and the champion among them."""

import csv
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from fis_tools.analysis.measures import rule_consistency
from fis_tools.formats import serialize
from pipeline.command_line.config import Job
from pipeline.flight.cases.starts import validation_scenarios
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_all
from pipeline.run import artifacts
from pipeline.settings.experiment import Logger, SettingError
from pipeline.stages import train
from pipeline.training.progress import logged
from tests.pipeline.stages.cases import prepared

WORDS = (
    "starts.num_cases=4", "starts.num_hard=2", "starts.hard_from=6", "optimizer.rounds=2",
    "optimizer.generations=2", "optimizer.validation_cases=7", "duration_s=600.0",
)  # fmt: skip


def prepared_front(folder: Path, *words: str) -> Job:
    return prepared(folder, *WORDS, *words, experiment="train_front")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("front")
    stale = folder / artifacts.FRONT_CONTROLLERS / "77.json"
    artifacts.write_atomically(stale, "of an earlier training")
    run = prepared_front(folder)
    train.run(run.experiment, folder)
    return run, folder


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """A front with three objectives."""
    folder = tmp_path_factory.mktemp("read")
    run = prepared_front(folder, "optimizer.consistency=true", "optimizer.population_size=8")
    train.run(run.experiment, folder)
    return folder


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / artifacts.FRONT).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.slow
def test_each_controller_flies_as_the_table_says(trained):
    run, folder = trained
    experiment = run.experiment
    table = rows(folder)
    files = sorted((folder / artifacts.FRONT_CONTROLLERS).iterdir())
    assert [path.name for path in files] == [f"{int(row['controller']):02d}.json" for row in table]
    assert len(table) > 1
    starts = validation_scenarios(experiment.starts, experiment.sun, experiment.seed, 7)
    for row, path in zip(table, files, strict=True):
        controller = serialize.load(path)
        outcomes = fly_all(experiment.mission, from_fuzzy(controller), starts)
        expected = {
            "delta_v_m_s": outcomes.delta_v_m_s.mean(),
            "inspection_rate_percent": 100.0 * outcomes.inspected_count.mean() / 99.0,
            "success_percent": 100.0 * np.mean((outcomes.inspected_count >= 95) & ~outcomes.is_violated),
            "outside_percent": 100.0 * np.mean(outcomes.is_violated),
        }
        provenance = dict(controller.provenance)
        for name, value in expected.items():
            assert float(row[f"validation_{name}"]) == pytest.approx(value, rel=1e-9)
            assert provenance[f"validation_{name}"] == row[f"validation_{name}"]
        assert provenance["config_hash"] == artifacts.config_hash(run.config)
        assert provenance["front"] == f"{path.stem} of {len(table)}"


@pytest.mark.slow
def test_the_cheapest_comes_first_and_what_is_dominated_does_not_stand(trained):
    table = rows(trained[1])
    delta_v = [float(row["validation_delta_v_m_s"]) for row in table]
    assert delta_v == sorted(delta_v)
    pairs = [(float(row["validation_spent_m_s"]), float(row["validation_missed_m_s"])) for row in table]
    for pair, row in zip(pairs, table, strict=True):
        is_dominated = any(other != pair and other[0] <= pair[0] and other[1] <= pair[1] for other in pairs)
        assert row["stands"] == str(not is_dominated)
    names = ("training_spent_m_s", "training_missed_m_s")
    training = np.array([[float(row[name]) for name in names] for row in table])
    for pair in training:
        assert not np.any(np.all(training <= pair, axis=1) & np.any(training < pair, axis=1))


@pytest.mark.slow
def test_rule_consistency_is_an_objective(read):
    table = rows(read)
    for row in table:
        controller = serialize.load(read / artifacts.FRONT_CONTROLLERS / f"{int(row['controller']):02d}.json")
        rules = [value for system in controller.systems for value in rule_consistency(system).values]
        assert float(row["rule_consistency"]) == pytest.approx(np.mean(rules), rel=1e-9)
    names = ("training_spent_m_s", "training_missed_m_s", "rule_consistency")
    training = np.array([[float(row[name]) for name in names] for row in table]) * (1.0, 1.0, -1.0)
    for objectives in training:
        assert not np.any(np.all(training <= objectives, axis=1) & np.any(training < objectives, axis=1))
    # some is here for its rules alone
    assert any(np.any(np.all(training[:, :2] < objectives[:2], axis=1)) for objectives in training)


@pytest.mark.slow
def test_the_champion_is_the_fronts_best_on_the_validation_starts(trained):
    _, folder = trained
    table = rows(folder)
    best = min(table, key=lambda row: float(row["validation_fitness_m_s"]))
    assert [row["controller"] for row in table if row["champion"] == "True"] == [best["controller"]]
    champion = serialize.load(folder / artifacts.CHAMPION)
    same = serialize.load(folder / artifacts.FRONT_CONTROLLERS / f"{int(best['controller']):02d}.json")
    assert (champion.systems, champion.attributes) == (same.systems, same.attributes)
    assert dict(champion.provenance)["validation_fitness"] == best["validation_fitness_m_s"]
    assert dict(champion.provenance)["training_fitness"] == best["training_fitness_m_s"]
    assert float(best["validation_fitness_m_s"]) == pytest.approx(
        float(best["validation_spent_m_s"]) + float(best["validation_missed_m_s"])
    )


@pytest.mark.slow
def test_a_training_goes_on_to_the_same_front_on_any_number_of_workers(trained, tmp_path):
    whole = prepared_front(tmp_path, "optimizer.workers=2").experiment
    # ends after the first round; composed with optimizer.rounds=1, it would have no optimizer.next_round
    first = replace(whole, optimizer=replace(whole.optimizer, rounds=1, workers=1))
    train.run(first, tmp_path)
    train.run(replace(whole, resume=True), tmp_path)
    assert (tmp_path / artifacts.FRONT).read_bytes() == (trained[1] / artifacts.FRONT).read_bytes()
    genomes = [pq.read_table(folder / artifacts.FRONT_GENOMES)["genome"] for folder in (tmp_path, trained[1])]
    assert genomes[0].equals(genomes[1])


ROWS = [{"generation": float(n), "best": 1.0 / (n + 3), "points": 90.0 + n} for n in range(5)]


def log_each(folder: Path, rows: Sequence[Mapping[str, float]]) -> None:
    """As a training does, row after row."""
    with logged(Logger(kind="tensorboard"), folder) as log:
        for count in range(1, len(rows) + 1):
            log(rows[:count])


def assert_on_board(folder: Path, rows: Sequence[Mapping[str, float]]) -> None:
    """A board keeps single precision."""
    pytest.importorskip("tensorboard")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says that TensorFlow is not there
        from tensorboard.backend.event_processing import event_accumulator  # noqa: PLC0415

        events = event_accumulator.EventAccumulator(str(folder / artifacts.TENSORBOARD))
        events.Reload()
    assert set(events.Tags()["scalars"]) == set(rows[0])
    for name in rows[0]:
        found = [(event.step, event.value) for event in events.Scalars(name)]
        np.testing.assert_allclose(found, [(step, row[name]) for step, row in enumerate(rows)], rtol=1e-6)


def test_tensorboard_shows_each_generation_once_also_after_going_on(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    log_each(tmp_path, ROWS[:4])
    log_each(tmp_path, ROWS)
    assert_on_board(tmp_path, ROWS)


def test_a_training_is_logged_as_in_its_logbook(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    run = prepared(tmp_path / "run", "logger=tensorboard")
    train.run(run.experiment, tmp_path / "run")
    with (tmp_path / "run" / artifacts.LOGBOOK).open(newline="", encoding="utf-8") as stream:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]
    assert_on_board(tmp_path / "run", rows)
    assert not [name for name in artifacts.list_artifacts(tmp_path / "run") if "tensorboard" in name]


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    with pytest.raises(SettingError, match=r"logger=tensorboard needs the package tensorboardX; install"):
        log_each(tmp_path, ROWS)
