"""Fleets are trained together: their starts, and the fitness of a team by the definition of its parts."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from fis_tools.formats import serialize
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.fleets import OF_DEPUTIES
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.run import artifacts
from pipeline.scenarios import hard_candidates, training_scenarios, validation_scenarios
from pipeline.settings.experiment import SettingError
from pipeline.training.genome import genome_of
from pipeline.training.judging import fitness_of_round
from tests.pipeline.stages.cases import carried_out

WORDS = (
    *("+experiment=train_readable", "duration_s=900", "attitude=ideal", "optimizer.generations=1"),
    *(
        "optimizer.population_size=6",
        "optimizer.rounds=1",
        "starts.num_cases=3",
        "starts.hard_from=4",
        "starts.num_hard=1",
    ),
    *("optimizer.validation_cases=4", "stages=[scenario,train,evaluate]"),
)


def experiment_of(*words):
    return compose_experiment([*WORDS, *words]).experiment


FLEET, ALONE = experiment_of("fleet.deputies=3", "fleet.sharing=mask"), experiment_of()


@pytest.mark.parametrize(
    "drawn",
    [
        training_scenarios,
        lambda experiment: hard_candidates(experiment, 2),
        lambda e: validation_scenarios(e, 5),
    ],
    ids=["training", "hard", "validation"],
)
def test_the_first_deputy_starts_as_the_only_one_and_the_others_elsewhere_under_its_sun(drawn):
    fleets, alone = drawn(FLEET), drawn(ALONE)
    assert len(fleets) == len(alone) > 2
    for fleet, only in zip(fleets, alone, strict=True):
        assert len(fleet.fleet) == 3
        np.testing.assert_array_equal(fleet.position_m, only.position_m)
        assert {start.sun_angle_rad for start in fleet.fleet} == {only.sun_angle_rad}
        positions = np.array([start.position_m for start in fleet.fleet])
        assert len(np.unique(positions, axis=0)) == 3
        low, high = FLEET.starts.min_distance_m, FLEET.starts.max_distance_m
        distances = np.linalg.norm(positions, axis=1)
        assert ((low <= distances) & (distances <= high)).all()


def test_the_fitness_of_a_team_counts_the_fuel_of_all_and_each_point_once():
    template = source.load(FLEET.controller, FLEET.mission)
    genome = genome_of(template, FLEET.optimizer.encoding)
    genomes = np.stack([genome.encode(), np.random.default_rng(1).random(genome.num_genes)])
    parts = fitness_of_round(FLEET, genome, 0)(genomes)
    starts, price = training_scenarios(FLEET), FLEET.optimizer.penalty_of_round(0)
    for row, genes in enumerate(genomes):
        flown = fly_all_fleets(FLEET.mission, from_fuzzy(genome.decode(genes)), starts)
        each = dict(zip(OF_DEPUTIES, np.moveaxis(flown.of_deputies, 2, 0), strict=True))
        spent, seen = each["delta_v_m_s"].sum(axis=1), each["inspected_count"].sum(axis=1)
        limits = FLEET.mission.deputy
        near = limits.min_distance_m + price.near_margin_m - each["min_distance_m"]
        far = each["max_distance_m"] - (limits.max_distance_m - price.far_margin_m)
        metres = np.maximum(np.maximum(near, far), 0.0).max(axis=1)
        lit = flown.inspectable_count
        needed = np.ceil(FLEET.mission.inspection_threshold_percent / 100.0 * lit)
        paid = np.minimum(metres, price.outside_most_m or np.inf)
        cost = spent + price.outside_m_s * (metres > 0.0) * (1.0 + paid)
        cost += price.short_point_m_s * np.maximum(needed - seen, 0) + price.missed_point_m_s * (lit - seen)
        assert parts["fitness"][row] == pytest.approx(cost.mean(), rel=1e-12)
        assert parts["delta_v_m_s"][row] == pytest.approx(spent.mean(), rel=1e-12)
        assert parts["points"][row] == pytest.approx(seen.mean(), rel=1e-12)
        assert parts["short"][row] == np.count_nonzero(seen < needed)


def test_a_training_of_fleets_ends_alike_on_any_number_of_threads(tmp_path):
    champions = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        carried_out(
            compose_experiment(
                [*WORDS, "fleet.deputies=2", "monte_carlo.num_cases=5", f"optimizer.workers={workers}"]
            ),
            folder,
        )
        champions.append(serialize.load(folder / artifacts.CHAMPION).systems)
        deputies = pq.read_table(folder / "evaluate" / "deputies.parquet")
        assert len(deputies) == 2 * 5
    assert champions[0] == champions[1]


def test_starts_that_are_no_draw_are_refused():
    with pytest.raises(SettingError, match=r"starts.kind=octants knows of one deputy; choose starts=random"):
        compose_experiment(["+experiment=train_paper", "fleet.deputies=2", "stages=[scenario,train]"])
