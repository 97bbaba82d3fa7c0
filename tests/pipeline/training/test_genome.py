"""What evolution tunes in a controller, and the controllers that genomes stand for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fis_tools.formats import serialize
from pipeline.flight.control.controller import ControllerError, coast, from_fuzzy
from pipeline.flight.state.log import Outcomes, points_needed
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings.experiment import Mission
from pipeline.settings.training import Encoding, Penalty
from pipeline.training.fitness import fitness_parts, objectives
from pipeline.training.genome import bounds_around, genome_of
from tests.pipeline.training.evolution import cases
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


@pytest.mark.parametrize("rules", ["free", "planes", "fixed"])
@pytest.mark.parametrize("constants", [{}, CONSTANT_BOUNDS])
def test_what_flies_of_a_genome_is_the_controller_that_it_decodes_to(rules, constants):
    genome = genome_of(from_fuzzy(ELLIPSE), Encoding(rules=rules, **constants))
    assert len(genome.gene_names()) == genome.num_genes
    genomes = np.random.default_rng(2).random((5, genome.num_genes))
    population = genome.pack(genomes)
    for row, genes in enumerate(genomes):
        decoded = from_fuzzy(genome.decode(genes)).numbers
        np.testing.assert_array_equal(population.values[row], decoded.values[0])
        np.testing.assert_array_equal(population.rules[row], decoded.rules[0])


@pytest.mark.parametrize("rules", ["planes", "fixed"])
def test_the_whole_genome_of_a_shorter_one_is_the_same_controller(rules):
    short = genome_of(from_fuzzy(ELLIPSE), Encoding(rules=rules, **CONSTANT_BOUNDS))
    whole = genome_of(from_fuzzy(ELLIPSE), Encoding(**CONSTANT_BOUNDS))
    genomes = np.random.default_rng(4).random((5, short.num_genes))
    for genes, expanded in zip(genomes, short.expand(genomes), strict=True):
        assert len(expanded) == whole.num_genes
        assert short.decode(genes) == whole.decode(expanded)


def test_constants_run_from_their_least_to_their_greatest_and_others_stay():
    genome = genome_of(from_fuzzy(ELLIPSE), Encoding(**CONSTANT_BOUNDS))
    genes = np.zeros(genome.num_genes)
    values = dict(zip(CONSTANTS, from_fuzzy(genome.decode(genes)).constants, strict=True))
    assert (values["ring_size_m"], values["ring_lead_rad"], values["dead_band_force_y_n"]) == (5.0, -2.0, 0.0)
    assert values["prediction_time_s"] == float(dict(ELLIPSE.attributes)["prediction_time_s"])
    values = dict(zip(CONSTANTS, from_fuzzy(genome.decode(genes + 1.0)).constants, strict=True))
    assert (values["ring_size_m"], values["dead_band_force_z_n"]) == (60.0, 0.06)
    assert values["coast_below_points"] == 6.0


def test_a_controller_is_found_again_in_its_genome():
    genome = genome_of(from_fuzzy(ELLIPSE), Encoding(**CONSTANT_BOUNDS))
    controller = genome.decode(np.random.default_rng(7).random(genome.num_genes))
    again = genome.decode(genome.encode(controller))
    assert [system.rules for system in again.systems] == [system.rules for system in controller.systems]
    for name, _ in controller.attributes:
        if name in CONSTANTS:
            actual, expected = (float(dict(each.attributes)[name]) for each in (again, controller))
            assert actual == pytest.approx(expected)


@pytest.mark.parametrize(
    ("value", "bounds", "expected"),
    [
        (0.5, (0.0, 1.0), (0.0, 1.0)),
        (6527.0, (200.0, 1500.0), (200.0, 19581.0)),
        (60.0, (200.0, 1500.0), (20.0, 1500.0)),
        (0.09, (0.0, 0.06), (0.0, 0.27)),
        (-260.0, (-150.0, 150.0), (-390.0, 390.0)),
        (0.0, (1.0, 3.0), (1.0, 3.0)),
    ],
)
def test_bounds_reach_around_a_constant_that_they_would_clip(value, bounds, expected):
    assert bounds_around(value, *bounds) == pytest.approx(expected)


def test_a_controller_beyond_the_bounds_is_in_its_genome_and_what_is_clipped_is_told():
    far = replace(ELLIPSE, attributes=tuple((dict(ELLIPSE.attributes) | {"ring_size_m": "95.0"}).items()))
    settings = Encoding(**CONSTANT_BOUNDS)
    genome = genome_of(from_fuzzy(far), settings)
    assert float(dict(genome.decode(genome.encode()).attributes)["ring_size_m"]) == pytest.approx(95.0)
    assert not [words for words in genome.clipped() if words.startswith("ring_size_m")]
    # a constant that is new begins at the nearest bound
    new = genome_of(from_fuzzy(PAPER), Encoding(rules="fixed", tour_time_s=(200.0, 1500.0)))
    assert new.clipped()[-1] == "tour_time_s 0 to 200"
    stretched = genome_of(from_fuzzy(far), Encoding(rules="fixed", stretch=(2.0, 3.0)))
    assert stretched.clipped() == stretched.gene_names()
    reach = genome_of(from_fuzzy(PAPER), Encoding(output_range_n=(5.0, 6.0)))
    outputs = [system.outputs[0].name for system in PAPER.systems]
    assert len(reach.clipped()) == len(outputs)
    assert all(name in words for name, words in zip(outputs, reach.clipped(), strict=True))


def test_rules_that_are_fixed_stay_and_constants_may_be_new_to_a_controller():
    genome = genome_of(from_fuzzy(PAPER), Encoding(rules="fixed", dead_band_n=(0.0, 0.01)))
    drawn = genome.decode(np.random.default_rng(8).random(genome.num_genes))
    for system, kept in zip(drawn.systems, PAPER.systems, strict=True):
        assert [rule.consequents for rule in system.rules] == [rule.consequents for rule in kept.rules]
    assert 0.0 < float(dict(drawn.attributes)["dead_band_force_x_n"]) < 0.01
    assert dict(drawn.attributes)["force_axes"] == "body"
    with pytest.raises(ControllerError, match="'coast' has no fuzzy system to train; choose a fuzzy one"):
        genome_of(coast(), Encoding())


def test_a_population_of_a_controller_without_constants_carries_none():
    genome = genome_of(from_fuzzy(PAPER), Encoding())
    bare = replace(PAPER, attributes=(("force_axes", "body"),))
    assert genome.pack(genome.encode()[np.newaxis]).values.shape == from_fuzzy(bare).numbers.values.shape


#: from 15 to 200 m, with a success at 95 %
MISSION = Mission()
PENALTY = replace(cases.PENALTY, outside_m_s=1000.0, short_point_m_s=10.0, missed_point_m_s=0.5)


def parts_of(*controllers: list[tuple[float, int, float]], penalty: Penalty = PENALTY) -> dict[str, Any]:
    """The parts of controllers' fitness, of whose flights delta-v, points and metres outside are given."""
    delta_v, points, outside = np.moveaxis(np.array(controllers), 2, 0)
    same = {"inspectable_count": 99, "safety_periods": 0, "safety_delta_v_m_s": 0.0}
    same |= {"ahead_delta_v_m_s": 0.0, "full_wheel_s": 0.0}
    same |= {f"{kind}_distance_m": 70.0 for kind in ("mean", "min", "max")}
    constant = {name: np.full(points.shape, value) for name, value in same.items()}
    counts = points.astype(np.int64)
    flown = Outcomes(delta_v_m_s=delta_v, inspected_count=counts, outside_m=outside, **constant)
    parts = fitness_parts(flown, penalty, MISSION)
    both = objectives(flown, penalty, MISSION)
    np.testing.assert_allclose(both["spent"] + both["missed"], parts["fitness"], rtol=1e-12)
    return {name: values.tolist() for name, values in (parts | both).items()}


@pytest.mark.parametrize(
    ("num_points", "threshold_percent", "needed"),
    [(99, 95.0, 95), (100, 95.0, 95), (100, 95.5, 96), (99, 100.0, 99), (99, 0.0, 0), (1, 50.0, 1)],
)
def test_the_least_number_of_points_that_reaches_the_threshold(num_points, threshold_percent, needed):
    assert points_needed(num_points, threshold_percent) == needed
    assert needed == 0 or 100.0 * (needed - 1) / num_points < threshold_percent <= 100.0 * needed / num_points


def test_the_fitness_of_a_flight_each_of_another_controller():
    flights = {
        (2.0, 99, 0.0): 2.0,
        (2.0, 95, 0.0): 2.0 + 0.5 * 4,
        (2.0, 94, 0.0): 2.0 + 10.0 + 0.5 * 5,
        (2.0, 90, 0.0): 2.0 + 50.0 + 0.5 * 9,
        (2.0, 99, 0.001): 2.0 + 1000.0 * 1.001,
        (0.0, 0, 3.0): 4000.0 + 950.0 + 49.5,
    }
    assert parts_of(*([flight] for flight in flights))["fitness"] == pytest.approx(list(flights.values()))
    # at most so many metres outside are paid for
    capped = replace(PENALTY, outside_most_m=2.0)
    outside_m = [0.0, 1.0, 2.0, 40.0]
    parts = parts_of(*([(0.0, 99, metres)] for metres in outside_m), penalty=capped)
    assert (parts["fitness"], parts["outside_m"]) == ([0.0, 2000.0, 3000.0, 3000.0], outside_m)


def test_the_fitness_of_a_controller_is_the_mean_over_its_flights_and_its_parts_add_up():
    assert parts_of([(1.0, 99, 0.0), (3.0, 94, 2.0)], [(0.2, 97, 0.0), (0.4, 98, 0.0)]) == {
        "fitness": pytest.approx([(1.0 + 3.0 + 3000.0 + 10.0 + 2.5) / 2, 0.3 + 0.75]),
        "delta_v_m_s": pytest.approx([2.0, 0.3]),
        "points": [96.5, 97.5],
        "outside": [1.0, 0.0],
        "outside_m": [1.0, 0.0],
        "short": [1.0, 0.0],
        # faults, 3000 and 10, fall half on either
        "spent": pytest.approx([(1.0 + 3.0 + 1505.0) / 2, 0.3]),
        "missed": pytest.approx([(2.5 + 1505.0) / 2, 0.75]),
    }


def test_the_price_of_points_grows_from_round_to_round():
    penalty = replace(PENALTY, outside_m_s=1e5, short_point_m_s=0.5, missed_point_m_s=0.1, growth=2.0)
    assert penalty.of_round(0) == penalty
    third = penalty.of_round(2)
    assert (third.outside_m_s, third.short_point_m_s, third.missed_point_m_s) == (1e5, 2.0, 0.4)
