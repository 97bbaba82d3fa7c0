"""A controller flies from its file exactly as its genome flew in the population."""

from pathlib import Path

import numpy as np
import pytest

from fis_tools.formats import serialize
from fis_tools.genes.parameters import Bounds, SystemEncoding
from fis_tools.model import FuzzyController
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import from_fuzzy, law_of
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.world.pack import pack_world
from tests.pipeline.flight.cases import COMPLETED, OVER_POLES, STARTS, mission
from tests.places import PROJECT

PAPER = serialize.load(PROJECT / "conf" / "controller" / "paper.yaml")
MISSION = mission(guidance={"kind": "clusters"})
FLIGHTS = [*STARTS, *OVER_POLES, COMPLETED]


@pytest.mark.parametrize("workers", [1, 3])
def test_a_genome_its_json_and_its_yaml_fly_the_same_bit_for_bit(workers: int, tmp_path: Path) -> None:
    encoding = SystemEncoding(PAPER.systems, Bounds())
    genomes = np.random.default_rng(8).random((5, encoding.num_genes))
    genomes[0] = encoding.encode(PAPER.systems)
    law = law_of(from_fuzzy(PAPER), MISSION)
    tracks = np.empty((5 * len(FLIGHTS), MISSION.num_controls + 1, 3), dtype=np.float32)
    population = fly_population(
        pack_world(MISSION), law, encoding.pack(genomes), cases_of(MISSION, FLIGHTS), workers, tracks
    )
    assert population.delta_v_m_s.shape == (5, len(FLIGHTS))
    assert len(np.unique(population.delta_v_m_s)) == population.delta_v_m_s.size
    for row, genome in enumerate(genomes):
        champion = FuzzyController("champion", encoding.decode(genome), PAPER.attributes)
        (tmp_path / "champion.json").write_text(serialize.dump_json(champion), encoding="utf-8")
        (tmp_path / "champion.yaml").write_text(serialize.dump_yaml(champion), encoding="utf-8")
        for name in ("champion.json", "champion.yaml"):
            track = np.empty((len(FLIGHTS), MISSION.num_controls + 1, 3), dtype=np.float32)
            alone = fly_all(MISSION, from_fuzzy(serialize.load(tmp_path / name)), FLIGHTS, 1, track)
            np.testing.assert_array_equal(track, tracks[row * len(FLIGHTS) : (row + 1) * len(FLIGHTS)])
            for fact, values in vars(alone).items():
                np.testing.assert_array_equal(values, getattr(population, fact)[row], err_msg=fact)


def test_a_template_of_which_nothing_is_clipped_survives_its_genome() -> None:
    encoding = SystemEncoding(PAPER.systems, Bounds())
    again = FuzzyController("again", encoding.decode(encoding.encode(PAPER.systems)), PAPER.attributes)
    one, other = (fly_all(MISSION, from_fuzzy(fuzzy), FLIGHTS) for fuzzy in (PAPER, again))
    np.testing.assert_array_equal(one.inspected_count, other.inspected_count)
    np.testing.assert_allclose(one.delta_v_m_s, other.delta_v_m_s, rtol=1e-6)
