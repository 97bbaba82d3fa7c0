"""Who learns for the leaderboard: how each is trained within a budget of control periods.

Each may try as many settings: those of its row of `VARIANTS`, one change at a time, of which
``python -m benchmarks leaderboard --tune`` trains one policy each and flies all from the same validation
starts. What did best is what `CONTENDERS` train by.
"""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.budget import training_of
from pipeline.command_line.endings import OK, UNIMPROVED
from pipeline.gym import task_of
from pipeline.gym.suite import TASKS
from pipeline.run.artifacts import CHAMPION, LOGBOOK, VALIDATION
from plain_files.file_access import write_text

#: policies that are written on the way, to draw what a training comes to with time
NUM_WRITTEN: Final = 5
#: of a search for rules: rounds and generations, by flights of which there are fewer; candidates of a
#: generation; the share of flights that compares champions; the first step, a share of each range
SHAPES: Final = ((10_000, (2, 4)), (100_000, (4, 9)), (np.inf, (8, 11)))
POPULATION, COMPARED, STEP = 11, 0.15, 0.05
#: compared with the champions of generations: what was given, as it is and as genes
NUM_GIVEN: Final = 2
#: how a search was flown, beside its champion
TOLD: Final = "training.json"
#: trains by changes of its settings, within a budget, from a seed, into a folder: policies, the last at last
Train = Callable[[Mapping[str, Any], str, float, int, Path], list[Path]]


def _policies(folder: Path) -> list[Path]:
    """Return the policies of a folder in the order of their training."""
    on_the_way = sorted((path for path in folder.glob("*.onnx") if path.stem.isdecimal()), key=_number)
    return [*on_the_way, folder / "policy.onnx"]


def _number(path: Path) -> int:
    return int(path.stem)


def told_of(path: Path) -> Mapping[str, Any]:
    """Return how a policy, or the champion of a search, was trained: ``done`` control periods, and so on."""
    is_policy = path.suffix == ".onnx"
    beside = path.with_suffix(".json") if is_policy else path.with_name(TOLD)
    told: dict[str, Any] = json.loads(beside.read_text(encoding="utf-8"))
    return training_of(path) | told if is_policy else told


def by_baselines(name: str) -> Train:
    """Return a training by Stable-Baselines3, by settings of `benchmarks.ppo`."""

    def train(changes: Mapping[str, Any], task: str, budget: float, seed: int, folder: Path) -> list[Path]:
        from benchmarks.ppo import SETTINGS, Training  # noqa: PLC0415 - brings torch

        basis = SETTINGS[name]
        model = {key: changes.get(key, value) for key, value in basis.model.items()}
        others = {key: value for key, value in changes.items() if key not in model}
        settings = replace(basis, model=model, words=(*basis.words, *TASKS[task]), **others)
        num_periods = task_of(settings.words, decision_period_s=settings.decision_period_s).num_periods
        rounds = int(budget / num_periods) // settings.steps_of_round
        if rounds < 1:
            least = settings.steps_of_round * num_periods
            raise ValueError(f"a budget of {budget:g} periods is less than one round of {least:,}")
        steps = rounds * settings.steps_of_round
        # what is written at the end of all is the policy itself
        Training(folder, settings, seed, steps, every=steps // NUM_WRITTEN + 1).run()
        return _policies(folder)

    return train


def by_evolution(changes: Mapping[str, Any], task: str, budget: float, seed: int, folder: Path) -> list[Path]:
    """Train by the evolution strategy of `benchmarks.evolved`."""
    from benchmarks.evolved import SETTINGS, Evolution  # noqa: PLC0415 - imports the rest slowly

    settings = replace(SETTINGS["minute"], **changes)
    every = int(budget) // NUM_WRITTEN
    Evolution(folder, settings, seed, int(budget), TASKS[task], every=every).run()
    return _policies(folder)


def by_imitation(kind: str) -> Train:
    """Return a training by plans that are imitated, of a network or of rules; see `benchmarks.apprentice`."""

    def train(changes: Mapping[str, Any], task: str, budget: float, seed: int, folder: Path) -> list[Path]:
        from benchmarks.apprentice import KINDS  # noqa: PLC0415 - imports the rest slowly

        training, settings = KINDS[kind]
        path = training(folder, replace(settings, **changes), seed, int(budget), TASKS[task]).run()
        return _policies(folder) if path.suffix == ".onnx" else [path]

    return train


def by_search(changes: Mapping[str, Any], task: str, budget: float, seed: int, folder: Path) -> list[Path]:
    """Search readable rules by ``+experiment=train_readable``, from ``controller=aim``, a person's guess.

    Some of the flights compare the champions of generations with each other.
    """
    mission, began = task_of(TASKS[task]).mission, passed()
    flights = int(budget / mission.num_controls)
    num_rounds, num_generations = next(shape for most, shape in SHAPES if flights < most)
    # each round flies the population that it begins with, too
    generations, population = num_rounds * (num_generations + 1), changes.get("population_size", POPULATION)
    sizes = {
        "optimizer.population_size": population,
        "optimizer.rounds": num_rounds,
        "optimizer.generations": num_generations,
        "optimizer.validation_cases": int(COMPARED * flights / (generations + NUM_GIVEN)),
        "starts.num_cases": int((1.0 - COMPARED) * flights / (population * generations)),
        "optimizer.initial_step": changes.get("initial_step", STEP),
    }
    words = ["+experiment=train_readable", "stages=[scenario,train]", f"seed={seed}", *TASKS[task]]
    words += [f"{key}={value}" for key, value in sizes.items()] + [f"hydra.run.dir={folder}"]
    command = [sys.executable, "-m", "pipeline", *words]
    ran = subprocess.run(command, check=False, stdout=subprocess.DEVNULL)  # noqa: S603
    if ran.returncode not in (OK, UNIMPROVED):
        raise RuntimeError(f"the search ended with {ran.returncode}: python -m pipeline {' '.join(words)}")
    evaluations = int(_rows(folder / LOGBOOK)[-1]["evaluations"])
    compared = sum(int(row["num_cases"]) for row in _rows(folder / VALIDATION))
    flights = evaluations * sizes["starts.num_cases"] + compared
    told = {"done": flights * mission.num_controls, "flights": flights, "processor_s": passed() - began}
    write_text(folder / TOLD, json.dumps(told, indent=1) + "\n")
    return [folder / CHAMPION]


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def passed() -> float:
    """Return the processor time of this process and those that it has run, s."""
    return sum(os.times()[:4])


#: what the table calls each, the package that it needs, and how it is trained
CONTENDERS: Final[Mapping[str, tuple[str, str, Train]]] = {
    "ppo": ("PPO, once a minute", "stable_baselines3", by_baselines("minute")),
    "sac": ("SAC, once a minute", "stable_baselines3", by_baselines("sac")),
    "cma_es": ("CMA-ES, once a minute", "deap", by_evolution),
    "rules": ("27 rules, searched", "deap", by_search),
    "imitation": ("network imitating plans, once a minute", "sklearn", by_imitation("network")),
    "imitated_rules": ("up to 27 rules, imitating plans", "sklearn", by_imitation("rules")),
}
#: settings that are tried, as changes of those that are trained by
VARIANTS: Final[Mapping[str, tuple[dict[str, Any], ...]]] = {
    "ppo": ({}, {"learning_rate": 1e-3}, {"num_envs": 128}, {"num_envs": 128, "learning_rate": 2e-4}),
    "sac": (
        {},
        {"gamma": 0.995},
        {"gamma": 0.995, "learning_rate": 1e-3},
        {"gamma": 0.995, "gradient_steps": 8},
    ),
    "cma_es": ({}, {"step": 0.3}, {"hidden": 8}, {"hidden": 8, "step": 0.3}),
    "rules": (
        {},
        {"population_size": 21},
        {"population_size": 21, "initial_step": 0.1},
        {"population_size": 21, "initial_step": 0.025},
    ),
    "imitation": ({}, {"weight": 1.0}, {"weight": 3.0}, {"weight": 3.0, "margin_m": 15.0}),
    "imitated_rules": (
        {},
        {"slack_m_s": 0.01},
        {"slack_m_s": 0.01, "first_share": 1.0},
        {"slack_m_s": 0.01, "silent": 0.02},
    ),
}
