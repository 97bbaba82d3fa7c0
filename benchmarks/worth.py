"""The price and the worth of readable rules: ``python -m benchmarks worth champion_27``.

Beside each champion fly, from the same starts and with the same constants: a linear law over the same signals
in place of the rules, and a single table of five terms for each axis. Law and tables are fitted alike, by a
search such as made the champion, with its prices. Fits are kept in a folder; the same call goes on with them.
From starts of their own the plans of least fuel that ship fly open loop, made with the whole flight known.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields, replace
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.linear_law import LinearLaw, flying
from benchmarks.structures import WORDS
from benchmarks.timing import fuel_by_rules
from fis_tools.genes.planes import plane_gains
from fis_tools.model import Gaussian, Term, Triangular, Variable, rule_table, table_rules
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.selection import select
from pipeline.evaluation.statistics import fraction, statistic
from pipeline.flight.control.controller import Controller, PilotController, from_fuzzy
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.state.signals import CONSTANTS
from pipeline.optimum.solved import solved_for
from pipeline.scenarios import evaluation_scenarios, training_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.training.genome import Genome, genome_of
from pipeline.training.judging import costs_of, evolved

#: of the starts, which no training used
SEED: Final = 777
CONFIDENCE: Final = 95.0
#: what a plan takes, as in docs/explanation/compiled-code.md
SECONDS: Final = "2.5 s a start"

READABLE: Final = (
    "+experiment=train_readable_late",
    "starts.num_cases=200",
    "optimizer.rounds=8",
    "optimizer.initial_step=0.06",
)
LARGE: Final = (
    "+experiment=train_polish",
    "optimizer.rounds=5",
    "optimizer.initial_step=0.06",
    "optimizer.encoding.rules=planes",
)
#: the search of the tour, as long as those above
TOUR: Final = (
    "+experiment=train_readable",
    "optimizer=tour",
    "starts.num_cases=200",
    "optimizer.population_size=21",
    "optimizer.rounds=8",
    "optimizer.initial_step=0.06",
    "optimizer.encoding.tour_m=null",
    "optimizer.penalty.short_point_m_s=2",
    "optimizer.penalty.missed_point_m_s=0.01",
)
#: of its last training
PRICES_OF_ANY_SUN: Final = (
    "optimizer.penalty.short_point_m_s=0.6",
    "optimizer.penalty.missed_point_m_s=0.12",
    "optimizer.penalty.near_margin_m=2.5",
)
#: how law and table are fitted in place of each champion's rules, under which Sun all of them fly, and how
#: many numbers the champion's own training tuned besides the constants
STUDIES: Final[Mapping[str, tuple[Sequence[str], str, int]]] = {
    "champion_27": ((*READABLE, "sun=random"), "random", 15),
    "champion_27_fixed_sun": ((*READABLE, "sun=fixed"), "fixed", 15),
    "champion_27_one_push": ((*READABLE, "sun=random"), "random", 15),
    "champion_81": ((*READABLE, "sun=random"), "random", 21),
    "champion_afrl": ((*READABLE, "world=afrl"), "random", 15),
    "champion_afrl_weighted": (
        (*READABLE, "optimizer.penalty.missed_point_m_s=0", "world=afrl_weighted"),
        "random",
        15,
    ),
    "champion_afrl_six_dof": (
        (*READABLE, "optimizer.penalty.missed_point_m_s=0.02", "world=afrl_six_dof"),
        "random",
        15,
    ),
    "champion_rso": ((*READABLE, "optimizer.penalty.short_point_m_s=5", "world=rso"), "random", 15),
    "champion_docking": (("+experiment=train_docking", "problem=docking"), "random", 15),
    "champion_leo": ((*TOUR, "world=leo"), "random", 6),
    "paper_champion": (("+experiment=train_champion", "optimizer.generations=10"), "fixed", 150),
    "champion_fixed_sun": (LARGE, "fixed", 96),
    "champion_any_sun": ((*LARGE, *PRICES_OF_ANY_SUN, "sun=random"), "random", 96),
}


#: the plans that ship for another world than the paper's, and that for which they were made, if it differs
PLANS: Final = {"champion_leo": ("dynamics=cw", "optimum.reference=pipeline/optimum/shipped/leo")}


def training_of(name: str, rounds: int | None) -> Experiment:
    """Return the search in place of a champion's rules; its constants stay."""
    words = [*STUDIES[name][0], f"controller={name}", "optimizer.validation_cases=2000"]
    words += [] if rounds is None else [f"optimizer.rounds={rounds}"]
    encoding = compose_experiment(words).experiment.optimizer.encoding
    tuned = [key.name for key in fields(encoding) if key.name in {"dead_band_n", *CONSTANTS}]
    return compose_experiment([*words, *(f"optimizer.encoding.{key}=null" for key in tuned)]).experiment


def table_of(champion: Controller, senses: Sequence[int]) -> Controller:
    """Return a champion with a table of five terms for each axis, which senses one of its inputs."""
    systems = []
    for system, column in zip(champion.systems, senses, strict=True):
        rules = rule_table(system)
        assert rules is not None
        is_rising = plane_gains(system, rules)[column] >= 0.0
        inputs, output = (five_terms(system.inputs[column]),), five_terms(system.outputs[0])
        words = table_rules(inputs, output, WORDS[5] if is_rising else WORDS[5][::-1])
        systems.append(replace(system, inputs=inputs, outputs=(output,), rules=words))
    assert champion.fuzzy is not None
    return from_fuzzy(replace(champion.fuzzy, systems=tuple(systems)))


def five_terms(variable: Variable) -> Variable:
    """Return a variable with five evenly spaced terms of the shape that its own have."""
    means = np.linspace(variable.minimum, variable.maximum, 5).tolist()
    step = means[1] - means[0]
    is_gaussian = isinstance(variable.terms[0].membership, Gaussian)
    shapes = [
        Gaussian(mean, 0.4 * step) if is_gaussian else Triangular(mean - step, mean, mean + step)
        for mean in means
    ]
    return replace(variable, terms=tuple(map(Term, WORDS[5], shapes)))


def main_inputs(training: Experiment, champion: Controller) -> tuple[int, ...]:
    """Return the input of each axis with which a table costs least before the search, of all choices."""
    starts = training_scenarios(training)

    def cost(senses: tuple[int, ...]) -> float:
        genome = genome_of(table_of(champion, senses), training.optimizer.encoding)
        return float(costs_of(training, genome, genome.encode(), starts, 0).mean())

    return min(product(*(range(len(system.inputs)) for system in champion.systems)), key=cost)


def fitted(
    training: Experiment, genes: Any, judged: Experiment, starts: list[Scenario], checkpoint: Path
) -> tuple[Outcomes, int]:
    """Search, and return the flights of the best on the validation starts, and the evaluations."""
    is_linear = isinstance(genes, LinearLaw)
    with flying() if is_linear else nullcontext():
        history = evolved(training, genes, checkpoint=checkpoint, resume=True).history
        chosen = select(training, genes, history).chosen.candidate
        best = genes.decode(chosen.genome)
        flown = fly_all(judged.mission, best if is_linear else from_fuzzy(best), starts)
    return flown, history[-1].evaluations


def planned(judged: Experiment, made_for: Experiment) -> tuple[list[Scenario], Outcomes]:
    """Return the starts of the plans made for an experiment, and their flights in another, open loop."""
    solved = solved_for(made_for)
    forces = np.array([solved.plan(case, judged.mission) for case in range(len(solved.scenarios))])

    def play(*_: object) -> Any:
        return forces

    pilot: Any = play
    plan = PilotController("plan", pilot)
    return solved.scenarios, fly_all(judged.mission, plan, solved.scenarios)


def row(words: Sequence[object], flown: Outcomes, threshold: float) -> str:
    """Return a row of the table."""
    is_outside = flown.is_violated
    inside = fraction(flown.is_success(threshold) & ~is_outside, CONFIDENCE)
    spent = statistic(flown.delta_v_m_s, CONFIDENCE)
    line = (
        *words,
        f"{100 * inside.fraction:.1f} % ({100 * inside.low:.1f} to {100 * inside.high:.1f})",
        f"{spent.mean:.3f} ({spent.low:.3f} to {spent.high:.3f}){fuel_by_rules(flown)}",
        f"{flown.inspected_count.mean():.1f}",
        f"{100 * is_outside.mean():.1f} %",
    )
    return f"| {' | '.join(map(str, line))} |"


def rows(name: str, cases: int, rounds: int | None, folder: Path, plans: Path | None) -> Iterator[str]:
    """Yield the rows of a champion and of what stands beside it."""
    training, (_, sun, numbers) = training_of(name, rounds), STUDIES[name]
    world = [word for word in STUDIES[name][0] if word.startswith(("world=", "problem="))]
    flying_words = ["+experiment=evaluate", f"controller={name}", *world, f"sun={sun}", f"seed={SEED}"]
    judged = compose_experiment([*flying_words, f"monte_carlo.num_cases={cases}"]).experiment
    starts = evaluation_scenarios(judged)
    champion, encoding = named(name, judged.mission), training.optimizer.encoding
    threshold = judged.mission.inspection_threshold_percent
    rules = sum(len(system.rules) for system in champion.systems)
    yield row(
        (f"`{name}`", f"{rules} rules", numbers, ""), fly_all(judged.mission, champion, starts), threshold
    )
    laws: dict[str, LinearLaw | Genome] = {"linear law": LinearLaw(champion)}
    if any(len(system.inputs) > 1 for system in champion.systems):  # or its rules are such tables
        senses = main_inputs(training, champion)
        used = [system.inputs[column].name for system, column in zip(champion.systems, senses, strict=True)]
        laws[f"tables of {', '.join(used)}"] = genome_of(table_of(champion, senses), encoding)
    for law, genes in laws.items():
        flown, count = fitted(training, genes, judged, starts, folder / f"{name}-{law.split()[0]}.npz")
        yield row(("", law, genes.num_genes, f"{count:,}"), flown, threshold)
    words_of_plans = PLANS.get(name, ()) if plans is None else (f"optimum.reference={plans}",)
    if world and not words_of_plans:  # for which no plans ship
        return
    planned_starts, flown = planned(judged, compose_experiment([*flying_words, *words_of_plans]).experiment)
    number = f"{len(planned_starts)} other starts"
    yield row(("", f"plan, open loop, {number}", "", "" if world else SECONDS), flown, threshold)
    flown = fly_all(judged.mission, champion, planned_starts)
    yield row(("", f"{rules} rules, the same {number}", numbers, ""), flown, threshold)


def main(arguments: Sequence[str]) -> int:
    """Fit, fly, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks worth", description=__doc__)
    parser.add_argument("champions", nargs="*", metavar="CHAMPION", help=f"of {', '.join(STUDIES)}; or all")
    parser.add_argument("--cases", type=int, default=10_000, help="flights of each")
    parser.add_argument("--rounds", type=int, help="of the fits; more go on with those that are kept")
    parser.add_argument("--folder", type=Path, default=Path("outputs/worth"), help="where fits are kept")
    parser.add_argument("--plans", type=Path, help="run of +experiment=optimum whose plans fly, in any world")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.champions if name not in STUDIES]
    if unknown:
        parser.error(f"no study of {unknown[0]!r}; there are {', '.join(STUDIES)}")
    options.folder.mkdir(parents=True, exist_ok=True)
    print("| | decides by | numbers | fitted by | success | delta-v (m/s) | points | outside |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for name in options.champions or STUDIES:
        for line in rows(name, options.cases, options.rounds, options.folder, options.plans):
            print(line, flush=True)
    return 0
