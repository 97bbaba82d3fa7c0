"""The paper's reproduction over seeds: its arms compose, and its tables say what plain Python counts."""

import statistics

import numpy as np
import pytest
from pyarrow import parquet

from benchmarks import artefact
from fis_tools.engines.inference import infer
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.settings.experiment import Mission
from tests.places import PROJECT


@pytest.fixture(scope="module")
def paper():
    return source.named("paper", Mission()).fuzzy


def test_a_third_input_changes_no_force_until_it_is_trained(paper):
    wider = artefact.with_three_inputs(paper)
    assert sum(len(system.rules) for system in paper.systems) == 75
    assert sum(len(system.rules) for system in wider.systems) == 375
    generator = np.random.default_rng(3)
    for before, after in zip(paper.systems, wider.systems, strict=True):
        names = [variable.name for variable in after.inputs]
        for _ in range(20):
            values = [generator.uniform(variable.minimum, variable.maximum) for variable in after.inputs]
            fewer = [values[names.index(variable.name)] for variable in before.inputs]
            new = infer(after, np.array(values)).outputs[0].value
            # the new input's degree cuts what fires, which moves the centre of what is cut a little
            assert (
                abs(new - infer(before, np.array(fewer)).outputs[0].value) < 0.05 * before.outputs[0].maximum
            )


@pytest.mark.parametrize("arm", artefact.arms())
def test_each_arm_composes(arm, tmp_path, paper):
    levels, words = artefact.arms()[arm]
    (tmp_path / artefact.WIDER).write_text(
        artefact.serialize.dump_json(artefact.with_three_inputs(paper)), encoding="utf-8"
    )
    words = [word.format(folder=tmp_path) for word in words]
    experiment = compose_experiment(["+experiment=train_paper", *words]).experiment
    assert experiment.optimizer.generations == artefact.GENERATIONS
    assert artefact.is_main(levels) == (arm in list(artefact.arms())[: len(artefact.HELD)])


def rows(arm: str, delta_v: list[float]) -> list[dict[str, object]]:
    shared = dict.fromkeys(artefact.MEASURES, 1.0)
    return [{"arm": arm, "seed": seed, **shared, "delta_v_m_s": value} for seed, value in enumerate(delta_v)]


def test_tables_hold_interquartile_means_and_differences_of_pairs():
    first, second = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 100.0], [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 101.0]
    text = artefact.tables(rows("a", first) + rows("b", second))
    arms, effects, *_ = (part.splitlines() for part in text.split("\n\n"))
    column = 2 + list(artefact.MEASURES).index("delta_v_m_s")
    cells = [[cell.strip() for cell in line.split("|")[1:-1]][column] for line in (*arms[2:], effects[2])]
    assert cells[0].startswith(f"{statistics.mean(first[2:6]):.2f} (")
    assert cells[0].endswith("1.00 to 100.00")
    # each pair differs by one
    assert cells[2] == "+1.00 (+1.00 to +1.00)"


def test_trainings_whose_rows_are_given_are_not_flown_again(tmp_path, capsys):
    given = PROJECT / "docs" / "results" / artefact.TRAININGS
    main = list(artefact.arms())[: len(artefact.HELD)]
    assert (
        artefact.main([str(tmp_path), "--rows", str(given), "--arms", str(len(main)), "--seeds", "10"]) == 0
    )
    assert capsys.readouterr().err == ""
    rows = parquet.read_table(given).to_pylist()
    assert parquet.read_table(tmp_path / artefact.TRAININGS).to_pylist() == [
        row for arm in main for row in rows if row["arm"] == arm and row["seed"] < artefact.FIRST_SEED + 10
    ]


def test_the_protocols_counts_are_told():
    group = [
        {"delta_v_m_s": fuel, "inspected_percent": seen, "outside_percent": outside}
        for fuel, seen, outside in ((1.0, 96.0, 0.0), (2.0, 94.0, 5.0), (6.0, 99.0, 0.5))
    ]
    assert artefact.sentence(group) == (
        "2 of 3 burn less than 5.62 m/s, 1 of them inspect at least 95 % on average; "
        "1 leave the limits in more than 1 % of flights"
    )
