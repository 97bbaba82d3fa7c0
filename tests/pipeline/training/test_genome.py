"""What evolution tunes in a controller, and the controllers that genomes stand for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import Controller, ControllerError, coast, from_fuzzy
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings.training import Encoding
from pipeline.training.genome import genome_of
from tests.pipeline.training.evolution.cases import ENCODING
from tests.places import PROJECT

CONTROLLERS = PROJECT / "conf" / "controller"
ELLIPSE = serialize.load(CONTROLLERS / "ellipse.yaml")
PAPER = serialize.load(CONTROLLERS / "paper.yaml")

CONSTANT_BOUNDS: dict[str, Any] = {
    "ring_size_m": (5.0, 60.0),
    "ring_lead_rad": (-2.0, 3.0),
    "dead_band_n": (0.0, 0.06),
    "coast_below_points": (0.0, 6.0),
}


def encoding(**changes: Any) -> Encoding:
    return replace(ENCODING, **changes)


def flown(fuzzy: FuzzyController) -> Controller:
    return from_fuzzy(fuzzy)


@pytest.mark.parametrize("rules", ["free", "planes", "fixed"])
@pytest.mark.parametrize("constants", [{}, CONSTANT_BOUNDS])
def test_what_flies_of_a_genome_is_the_controller_that_it_decodes_to(
    rules: str, constants: dict[str, Any]
) -> None:
    genome = genome_of(flown(ELLIPSE), encoding(rules=rules, **constants))
    assert len(genome.gene_names()) == genome.num_genes
    genomes = np.random.default_rng(2).random((5, genome.num_genes))
    population = genome.pack(genomes)
    for row, genes in enumerate(genomes):
        one = flown(genome.decode(genes)).numbers
        np.testing.assert_array_equal(population.values[row], one.values[0])
        np.testing.assert_array_equal(population.rules[row], one.rules[0])


def test_constants_run_from_their_least_to_their_greatest_and_others_stay() -> None:
    genome = genome_of(flown(ELLIPSE), encoding(**CONSTANT_BOUNDS))
    genes = np.zeros(genome.num_genes)
    values = dict(zip(CONSTANTS, flown(genome.decode(genes)).constants, strict=True))
    assert (values["ring_size_m"], values["ring_lead_rad"], values["dead_band_force_y_n"]) == (5.0, -2.0, 0.0)
    assert values["prediction_time_s"] == float(dict(ELLIPSE.attributes)["prediction_time_s"])
    values = dict(zip(CONSTANTS, flown(genome.decode(genes + 1.0)).constants, strict=True))
    assert (values["ring_size_m"], values["dead_band_force_z_n"]) == (60.0, 0.06)
    assert values["coast_below_points"] == 6.0


def test_a_controller_is_found_again_in_its_genome() -> None:
    genome = genome_of(flown(ELLIPSE), encoding(**CONSTANT_BOUNDS))
    drawn = np.random.default_rng(7).random(genome.num_genes)
    controller = genome.decode(drawn)
    again = genome.decode(genome.encode(controller))
    assert [system.rules for system in again.systems] == [system.rules for system in controller.systems]
    for name, _ in controller.attributes:
        if name not in CONSTANTS:
            continue
        assert float(dict(again.attributes)[name]) == pytest.approx(float(dict(controller.attributes)[name]))


def test_rules_that_are_fixed_stay_and_constants_may_be_new_to_a_controller() -> None:
    genome = genome_of(flown(PAPER), encoding(rules="fixed", dead_band_n=(0.0, 0.01)))
    drawn = genome.decode(np.random.default_rng(8).random(genome.num_genes))
    for system, kept in zip(drawn.systems, PAPER.systems, strict=True):
        assert [rule.consequents for rule in system.rules] == [rule.consequents for rule in kept.rules]
    assert 0.0 < float(dict(drawn.attributes)["dead_band_force_x_n"]) < 0.01
    assert dict(drawn.attributes)["force_axes"] == "body"


def test_what_is_not_fuzzy_has_nothing_to_tune() -> None:
    with pytest.raises(ControllerError, match="'coast' has no fuzzy system to train"):
        genome_of(coast(), encoding())


def test_a_population_of_a_controller_without_constants_carries_none() -> None:
    genome = genome_of(flown(PAPER), encoding())
    bare = replace(PAPER, attributes=(("force_axes", "body"),))
    assert genome.pack(genome.encode()[np.newaxis]).values.shape == flown(bare).numbers.values.shape
