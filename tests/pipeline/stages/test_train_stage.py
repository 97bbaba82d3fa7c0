"""Training in miniature: what it leaves behind, going on, stopping, and what it refuses."""

import csv
import errno
import os
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow.parquet as pq
import pytest

from fis_tools.formats import serialize
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation import selection
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_all
from pipeline.run import artifacts, configuration, writing
from pipeline.scenarios import hard_candidates, training_scenarios, validation_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.settings.places import conf_folder
from pipeline.stages import record, train
from pipeline.training import judging
from pipeline.training.fitness import costs
from pipeline.training.genome import genome_of
from pipeline.training.progress import TrainingProgress, logged
from plain_files import file_access
from telemetry import RecordingError
from tests.pipeline.stages.cases import prepared

PARTS = ["delta_v_m_s", "points", "outside", "outside_m", "short"]
COLUMNS = ["round", "generation", "evaluations", "best", "mean", "std", "step_size", *PARTS]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained")
    run = prepared(folder)
    train.run(run.experiment, folder)
    return run, folder


def logbook(folder: Path, name: str = artifacts.LOGBOOK) -> list[dict[str, float]]:
    with (folder / name).open(newline="", encoding="utf-8") as stream:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]


def genomes(folder: Path) -> np.ndarray:
    return np.array(pq.read_table(folder / artifacts.HISTORY)["genome"].to_pylist())


def events(path: Path) -> list[Any]:
    """Events in a file of TensorBoard: each between its length, of eight bytes, and checksums of four."""
    event_pb2 = pytest.importorskip("tensorboardX.proto.event_pb2")
    content, parsed = path.read_bytes(), []
    while content:
        end = 12 + int.from_bytes(content[:8], "little")
        parsed.append(event_pb2.Event.FromString(content[12:end]))
        content = content[end + 4 :]
    return parsed


ROWS = [{"best": 2.5, "mean": 3.0}, {"best": 1.5, "mean": 2.0}]


def on_tensorboard() -> Experiment:
    return compose_experiment(["+experiment=train", "logger=tensorboard"]).experiment


def test_tensorboard_gets_each_row_once(tmp_path):
    with logged(on_tensorboard(), tmp_path) as log:
        log(ROWS[:1])
        log(ROWS)
    (path,) = (tmp_path / artifacts.TENSORBOARD).iterdir()
    scalars = [
        (each.step, value.tag, value.simple_value) for each in events(path) for value in each.summary.value
    ]
    assert scalars == [(step, *item) for step, row in enumerate(ROWS) for item in row.items()]


@pytest.mark.parametrize("is_full", [False, True])
def test_a_log_for_tensorboard_that_cannot_be_written_ends_no_training(
    is_full, tmp_path, monkeypatch, capsys
):
    if is_full:
        record_writer = pytest.importorskip("tensorboardX.record_writer")
        monkeypatch.setattr(record_writer, "open_file", lambda _: open("/dev/full", "wb"))  # noqa: SIM115
    else:
        writing.write_atomically(tmp_path / artifacts.TENSORBOARD, "")
    with logged(on_tensorboard(), tmp_path) as log:
        log(ROWS[:1])
        log(ROWS)
    reason = "No space left on device" if is_full else "File exists"
    said = (
        f"note: {tmp_path / artifacts.TENSORBOARD} cannot be written ({reason}); the training is not logged "
    )
    assert capsys.readouterr().err == f"{said}there from here on\n"


def test_the_logbook_and_the_history_hold_every_generation_with_its_parts(trained):
    _, folder = trained
    rows = logbook(folder)
    counted = [(row["round"], row["generation"], row["evaluations"]) for row in rows]
    assert counted == [(0, 0, 6), (0, 1, 11), (0, 2, 16), (0, 3, 21)]
    assert list(rows[0]) == COLUMNS
    table = pq.read_table(folder / artifacts.HISTORY)
    assert table.column_names == [*COLUMNS, "genome"]
    # floats are written so that they read back to the same bits
    assert table.select(COLUMNS).to_pylist() == rows
    best = [row["best"] for row in rows]
    assert best == sorted(best, reverse=True)
    assert genomes(folder).shape == (4, 150)
    assert not list(folder.glob("train/.*"))


SHIPPED = conf_folder() / "controller" / "champion_27.yaml"


def encoding_of(run):
    """The genome of a run's controller."""
    return genome_of(source.load(run.controller, run.mission), run.optimizer.encoding)


def test_each_champions_fitness_is_found_again_from_its_genome(trained):
    run, folder = trained
    encoding = encoding_of(run.experiment)
    evaluate = judging.fitness_of_round(run.experiment, encoding, 0)
    fitness = evaluate(genomes(folder))
    for index, row in enumerate(logbook(folder)):
        assert row["best"] == fitness["fitness"][index]
        assert [row[name] for name in PARTS] == [fitness[name][index] for name in PARTS]
    # the first population holds the configured controller
    assert logbook(folder)[0]["best"] <= evaluate(encoding.encode()[np.newaxis])["fitness"][0]


def test_the_champion_is_the_last_genome_and_says_where_it_comes_from(trained):
    run, folder = trained
    champion = serialize.load(folder / artifacts.CHAMPION)
    assert champion.name == "paper_train_paper"
    assert champion.systems == encoding_of(run.experiment).decode(genomes(folder)[-1]).systems
    assert champion.attributes == (("force_axes", "body"),)
    provenance = dict(champion.provenance)
    assert (provenance["experiment"], provenance["seed"]) == ("train_paper", "1")
    assert provenance["config_hash"] == configuration.config_hash(run.config)
    assert float(provenance["training_fitness"]) == logbook(folder)[-1]["best"]
    assert (provenance["generations"], provenance["interrupted"]) == ("4", "false")


def test_a_generation_that_only_the_checkpoint_knows_is_written_down(trained, tmp_path, monkeypatch):
    """Killed after the last checkpoint and before the logbook."""
    run = prepared(tmp_path).experiment
    with monkeypatch.context() as patched:
        write = train.write_history

        def killed(folder, history):
            if len(history) == 4:
                raise SystemExit(9)
            write(folder, history)

        patched.setattr(train, "write_history", killed)
        patched.setattr(train, "WRITE_EVERY_S", 0.0)
        with pytest.raises(SystemExit):
            train.run(run, tmp_path)
    assert len(logbook(tmp_path)) == 3
    train.run(replace(run, resume=True), tmp_path)
    for name in (artifacts.LOGBOOK, artifacts.HISTORY):
        assert (tmp_path / name).read_bytes() == (trained[1] / name).read_bytes()


def test_an_interrupt_leaves_the_champion_so_far(trained, tmp_path, monkeypatch):
    def interrupt(_progress, generation):
        if generation.generation == 2:
            raise KeyboardInterrupt

    run = prepared(tmp_path).experiment
    with monkeypatch.context() as patched:
        patched.setattr(TrainingProgress, "show_generation", interrupt)
        with pytest.raises(KeyboardInterrupt):
            train.run(run, tmp_path)
    provenance = dict(serialize.load(tmp_path / artifacts.CHAMPION).provenance)
    assert (provenance["interrupted"], provenance["generations"]) == ("true", "3")
    assert float(provenance["training_fitness"]) == logbook(tmp_path)[-1]["best"]
    np.testing.assert_array_equal(genomes(tmp_path), genomes(trained[1])[:3])
    train.run(replace(run, resume=True), tmp_path)
    champions = [artifacts.read_json(run_folder, artifacts.CHAMPION) for run_folder in (tmp_path, trained[1])]
    assert champions[0]["systems"] == champions[1]["systems"]
    for name in (artifacts.LOGBOOK, artifacts.HISTORY):
        assert (tmp_path / name).read_bytes() == (trained[1] / name).read_bytes()


def test_an_interrupt_before_anything_is_known_leaves_no_champion(tmp_path, monkeypatch):
    def interrupt(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(judging, "fitness_parts", interrupt)
    with pytest.raises(KeyboardInterrupt):
        train.run(prepared(tmp_path).experiment, tmp_path)
    assert not (tmp_path / artifacts.CHAMPION).exists()
    assert not (tmp_path / artifacts.CHECKPOINT).exists()


def test_rounds_draw_starts_of_their_own_and_hand_the_champion_on(tmp_path):
    words = ("starts.num_cases=4", "optimizer.rounds=2", "optimizer.generations=1")
    run = prepared(tmp_path, *words, experiment="train_champion").experiment
    train.run(run, tmp_path)
    rows = logbook(tmp_path)
    assert [(row["round"], row["generation"]) for row in rows] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    encoding = encoding_of(run)
    last = genomes(tmp_path)[1][np.newaxis]
    judged = [judging.fitness_of_round(run, encoding, index)(last)["fitness"][0] for index in (0, 1)]
    assert judged[0] == rows[1]["best"]
    assert judged[1] != judged[0]
    assert rows[2]["best"] <= judged[1]


def test_from_the_second_round_on_the_starts_that_the_champion_flies_worst_join(tmp_path):
    words = ("starts.num_cases=4", "starts.num_hard=3", "starts.hard_from=40", "duration_s=1200.0")
    run = prepared(tmp_path, *words, experiment="train_champion").experiment
    genome = encoding_of(run)
    champion = genome.encode()
    plain = judging.fitness_of_round(run, genome, 1)(champion[np.newaxis])
    mined = judging.fitness_of_round(run, genome, 1, champion)(champion[np.newaxis])
    outcomes = fly_all(run.mission, source.load(run.controller, run.mission), hard_candidates(run, 1))
    each = np.sort(costs(outcomes, run.optimizer.penalty.of_round(1), run.mission))
    expected = (4 * plain["fitness"][0] + each[-3:].sum()) / 7
    assert mined["fitness"][0] == pytest.approx(expected, rel=1e-9)
    assert expected > plain["fitness"][0]


def test_the_champion_is_the_best_of_all_generations_on_starts_of_its_own(tmp_path):
    few = ("optimizer.rounds=3", "optimizer.generations=2", "optimizer.validation_cases=9")
    run = prepared(tmp_path, "starts.num_cases=4", *few, experiment="train_champion").experiment
    assert train.run(run, tmp_path) is None
    with (tmp_path / artifacts.VALIDATION).open() as stream:
        rows = list(csv.DictReader(stream))
    generations = [(int(row["round"]), int(row["generation"])) for row in rows[2:]]
    assert [row["candidate"] for row in rows[:3]] == ["given", "start", "champion"]
    assert generations == sorted(generations)
    assert generations[-1] == (2, 2)
    # nobody succeeds in so short flights: cost decides
    assert {float(row["success_fraction"]) for row in rows} == {0.0}
    best = min(rows[2:], key=lambda row: float(row["cost_m_s"]))
    assert float(best["cost_m_s"]) < float(rows[0]["cost_m_s"])
    champion = serialize.load(tmp_path / artifacts.CHAMPION)
    chosen = genomes(tmp_path)[3 * int(best["round"]) + int(best["generation"])]
    assert champion.systems == encoding_of(run).decode(chosen).systems
    # a template may say that it is not trained
    assert champion.purpose.startswith("Trained by train_champion. Its template's purpose was: A start for")
    facts = dict(champion.provenance)
    assert facts["improved"] == "true"
    assert facts["validation_fitness"] == best["cost_m_s"]
    assert facts["training_fitness"] == best["training_fitness"]
    starts = validation_scenarios(run, 9)
    drawn = [training_scenarios(run, index) for index in range(3)]
    flown = {tuple(s.position_m) for each in drawn for s in each}
    assert not flown & {tuple(s.position_m) for s in starts}
    given = source.load(run.controller, run.mission)
    for controller, row in ((from_fuzzy(champion), best), (given, rows[0])):
        outcomes = fly_all(run.mission, controller, starts)
        mean_cost = costs(outcomes, run.optimizer.penalty.of_round(2), run.mission).mean()
        assert mean_cost == pytest.approx(float(row["cost_m_s"]), rel=1e-9)


def test_of_many_champions_the_best_from_few_starts_fly_from_all(tmp_path, monkeypatch):
    monkeypatch.setattr(selection, "FINALISTS", 3)
    few = ("optimizer.rounds=3", "optimizer.generations=2", "optimizer.validation_cases=9")
    run = prepared(tmp_path, "starts.num_cases=4", *few, experiment="train_champion").experiment
    assert train.run(run, tmp_path) is None
    with (tmp_path / artifacts.VALIDATION).open() as stream:
        judged = list(csv.DictReader(stream))
    rows = [row for row in judged if row["num_cases"] == "9"]
    assert 3 <= len(rows) <= 5 < len(judged)
    assert rows[0]["candidate"] == "given"
    assert (rows[-1]["round"], rows[-1]["generation"]) == ("2", "2")


#: searches that lead away from a controller that flies
ASTRAY = {
    "cma_es": "+experiment=train_readable_late sun=random",
    "local": """+experiment=train_rules optimizer.mutation=local optimizer.first_population=near
        optimizer.encoding.rules=fixed optimizer.encoding.stretch=[0.3,3.0] starts.num_hard=0
        optimizer.elitism_rate=0.0""",
    "paper": "+experiment=train_champion optimizer.encoding.rules=fixed optimizer.encoding.stretch=[0.3,3.0]",
}
BRIEF = (
    *("starts=random", "starts.num_cases=2", "stages=[train]", "controller=champion_27"),
    *("optimizer.generations=1", "optimizer.rounds=2", "optimizer.population_size=6"),
)


@pytest.mark.slow
@pytest.mark.parametrize("validation_cases", [0, 60])
@pytest.mark.parametrize("kind", ASTRAY)
def test_training_never_hands_back_worse_than_it_was_given(kind, validation_cases, tmp_path, ran):
    step = () if kind == "paper" else ("optimizer.initial_step=1.0",)
    words = [*ASTRAY[kind].split(), *BRIEF, *step, f"optimizer.validation_cases={validation_cases}"]
    errors = ran(*words, f"hydra.run.dir={tmp_path}", code=4).err
    last = errors.strip().splitlines()[-1]
    assert last.startswith("not improved")
    assert last.count("% succeed") == 2
    summary = artifacts.read_json(tmp_path, artifacts.TRAINED)
    assert summary["improved"] is False
    assert summary["num_cases"] == (validation_cases or 400)
    given, best = summary["given"], summary["best_champion"]
    assert given["success"]["fraction"] > 0.9
    assert given == summary["chosen"]
    is_behind = best["success"]["high"] < given["success"]["low"]
    assert is_behind or best["cost_m_s"] >= given["cost_m_s"] * (1 - 1e-9)
    champion, before = serialize.load(tmp_path / artifacts.CHAMPION), serialize.load(SHIPPED)
    assert (champion.name, champion.systems) == (before.name, before.systems)
    assert champion.attributes == before.attributes
    assert dict(champion.provenance)["improved"] == "false"


@pytest.mark.slow
def test_a_champion_that_owes_its_success_to_the_validation_starts_is_left_out(tmp_path, ran):
    small = ["population_size=16", "generations=4", "rounds=1", "validation_cases=200", "initial_step=1.0"]
    words = ["+experiment=train_readable_late", "controller=champion_27", "optimizer=front", "seed=6"]
    words += [f"optimizer.{setting}" for setting in small]
    errors = ran(*words, "starts.num_cases=32", "stages=[train]", f"hydra.run.dir={tmp_path}", code=4).err
    assert errors.strip().endswith("from 800 further starts it fails more often")
    summary = artifacts.read_json(tmp_path, artifacts.TRAINED)
    given, best = summary["given"], summary["best_champion"]
    assert summary["chosen"] == given
    assert best["success"]["high"] > given["success"]["low"]
    assert best["cost_m_s"] < given["cost_m_s"]


@pytest.mark.slow
def test_a_better_champion_is_handed_back_with_code_0(tmp_path, ran):
    words = ["+experiment=train_champion", *BRIEF, "controller=paper", f"hydra.run.dir={tmp_path}"]
    ran(*words, "optimizer.generations=3")
    summary = artifacts.read_json(tmp_path, artifacts.TRAINED)
    assert summary["improved"] is True
    chosen, given = summary["chosen"], summary["given"]
    has_more_success = chosen["success"]["low"] > given["success"]["high"]
    assert has_more_success or chosen["cost_m_s"] < given["cost_m_s"]


STOPPED = "No space left on device; make room"


def fill_disk(monkeypatch: pytest.MonkeyPatch, num_files: int) -> None:
    """Refuse all files that are begun but for the first of them."""
    begun, write = count(), writing.beside

    def beside(path: Path) -> AbstractContextManager[BinaryIO]:
        if next(begun) >= num_files:
            raise writing.WriteError(f"{path} cannot be written: {STOPPED}")
        return write(path)

    monkeypatch.setattr(writing, "beside", beside)
    monkeypatch.setattr(train, "WRITE_EVERY_S", 0.0)


# a generation writes its checkpoint, the logbook and the history
@pytest.mark.parametrize(("num_files", "name"), [(0, artifacts.CHECKPOINT), (1, ""), (7, ""), (8, "")])
def test_training_goes_on_once_there_is_room(trained, tmp_path, monkeypatch, num_files, name):
    run = prepared(tmp_path).experiment
    with monkeypatch.context() as patched:
        fill_disk(patched, num_files)
        with pytest.raises(writing.WriteError, match=rf"{name} cannot be written: {STOPPED}"):
            train.run(run, tmp_path)
    assert not (tmp_path / artifacts.CHAMPION).exists()
    assert not list(tmp_path.rglob("*.partial")) + list(tmp_path.glob("train/.*"))
    train.run(replace(run, resume=True), tmp_path)
    np.testing.assert_array_equal(genomes(tmp_path), genomes(trained[1]))


def test_a_disk_that_fills_up_while_flights_are_recorded_leaves_the_champion(trained, monkeypatch):
    run, folder = trained
    before = (folder / artifacts.CHAMPION).read_bytes()
    create = file_access.create

    def create_once(path):
        if path.name.startswith("training-1"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return create(path)

    monkeypatch.setattr(file_access, "create", create_once)
    telemetry = replace(run.experiment.telemetry, record_ranked=False)
    with pytest.raises(RecordingError, match=r"No space left on device.*make room"):
        record.run(replace(run.experiment, telemetry=telemetry), folder)
    assert (folder / artifacts.CHAMPION).read_bytes() == before
    assert [path.name for path in (folder / artifacts.RECORDINGS).iterdir()] == ["training-0.mcap"]
