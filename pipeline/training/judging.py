"""Fitness functions of a training: flights from a round's starts, and from those that choose the champion."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.array_types import Floats
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.population import lanes_for
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.goals.flights import fly_all, fly_genomes
from pipeline.flight.state.log import Outcomes, Scenario, combined
from pipeline.flight.world.pack import pack_world
from pipeline.run.engine import HERE, TaskPool
from pipeline.scenarios import hard_candidates, training_scenarios
from pipeline.settings.experiment import Experiment, Mission
from pipeline.training.evolution.front import OBJECTIVE
from pipeline.training.evolution.generations import Evaluate, Subspace
from pipeline.training.evolution.rounds import Evolution, evolve_rounds
from pipeline.training.fitness import costs, fitness_parts, objectives
from pipeline.training.genome import Genome, genome_of

#: stands in a champion's purpose before that of what the search started from
_OF_TEMPLATE = "Its template's purpose was: "


def fitness_of_round(
    experiment: Experiment,
    genome: Genome,
    round_index: int,
    champion: Floats | None = None,
    pool: TaskPool = HERE,
) -> Evaluate:
    """Return the function that flies genomes from a round's starts and evaluates them.

    Parameters
    ----------
    experiment : Experiment
    genome : Genome
        Meaning of the genes.
    round_index : int
        From 0.
    champion : (num_genes,) array, optional
        Of the round before: the worst of some further starts for it are added to the round's own.
    pool : TaskPool
        Where controllers that rehearse are flown.
    """
    scenarios, num_hard = training_scenarios(experiment, round_index), experiment.starts.num_hard
    if champion is not None and num_hard > 0:
        candidates = hard_candidates(experiment, round_index)
        worst = np.argsort(
            -costs_of(experiment, genome, champion, candidates, round_index, pool), kind="stable"
        )
        scenarios += [candidates[index] for index in worst[:num_hard]]
    return fitness_from(experiment, genome, scenarios, round_index, pool)


def fitness_from(
    experiment: Experiment, genome: Genome, scenarios: list[Scenario], round_index: int, pool: TaskPool = HERE
) -> Evaluate:
    """Return the function that flies genomes from some starts and evaluates them with a round's prices."""
    penalty = experiment.optimizer.penalty_of_round(round_index)
    fly = flights_from(experiment, genome, scenarios, pool)

    def evaluate(genomes: Floats) -> dict[str, Floats]:
        """Fly genomes, (n, num_genes); return the parts of their fitness, (n,) each."""
        outcomes = fly(genomes)
        parts = fitness_parts(outcomes, penalty, experiment.mission)
        if experiment.optimizer.algorithm == "nsga2":
            of_front = objectives(outcomes, penalty, experiment.mission)
            parts |= {OBJECTIVE + name: values for name, values in of_front.items()}
        return parts

    return evaluate


def costs_of(
    experiment: Experiment,
    genome: Genome,
    champion: Floats,
    scenarios: list[Scenario],
    round_index: int,
    pool: TaskPool = HERE,
) -> Floats:
    """Return the cost of each flight of a genome at the prices of a round, m/s, shape (scenarios,)."""
    penalty = experiment.optimizer.penalty_of_round(round_index)
    outcomes = flights_from(experiment, genome, scenarios, pool)(champion[np.newaxis])
    return costs(outcomes, penalty, experiment.mission).reshape(-1)


def flights_from(
    experiment: Experiment, genome: Genome, scenarios: list[Scenario], pool: TaskPool
) -> Callable[[Floats], Outcomes]:
    """Return the function that flies genomes of shape (n, num_genes) from some starts; outcomes of (n, m).

    Controllers that rehearse images of a tour do so in training too, one task of the pool each; first
    pushes are left to the rules. So do fleets, of which outcomes are those of all deputies together.
    """
    mission, workers = experiment.mission, experiment.optimizer.workers
    if mission.has_fleet or tour_images(genome.template):

        def fly_ahead(genomes: Floats) -> Outcomes:
            threads = pool.threads(workers)
            tasks = [(mission, genome.decode(genes), scenarios, threads) for genes in genomes]
            return combined(pool.map(fly_fuzzy, tasks), np.stack)

        return fly_ahead
    world, law, cases = pack_world(mission), law_of(genome.template, mission), cases_of(mission, scenarios)
    lanes = lanes_for(len(scenarios))
    return lambda genomes: fly_genomes(mission, world, law, genome.pack(genomes), cases, workers, lanes)


def fly_fuzzy(
    mission: Mission, fuzzy: FuzzyController, scenarios: list[Scenario], workers: int | None
) -> Outcomes:
    """Fly a fuzzy controller, which may rehearse, or a fleet of it, from some starts."""
    return fly_all(mission, from_fuzzy(fuzzy), scenarios, workers)


def evolved(experiment: Experiment, genome: Genome, pool: TaskPool = HERE, **kept: Any) -> Evolution:
    """Train from the genome's template; keywords go to `evolve_rounds`."""
    judge, settings = partial(fitness_of_round, experiment, genome, pool=pool), experiment.optimizer
    first = genome.encode()[np.newaxis]
    if settings.num_planes_rounds:
        planar = genome_of(genome.template, replace(settings.encoding, rules="planes"))
        kept["planes"] = Subspace(planar.encode(), planar.expand)
    return evolve_rounds(judge, genome.num_genes, settings, experiment.seed, initial=first, **kept)


def named_after(experiment: Experiment, genome: Genome, champion: Floats) -> FuzzyController:
    """Return a champion's controller, with a name and a purpose that tell of its template and experiment."""
    controller = genome.decode(champion)
    earlier = serialize.unmarked(controller).purpose.rpartition(_OF_TEMPLATE)[2]
    purpose = f"Trained by {experiment.name}." + (f" {_OF_TEMPLATE}{earlier}" if earlier else "")
    return replace(controller, name=f"{genome.template.name}_{experiment.name}", purpose=purpose)
