"""Compiled inference beside scikit-fuzzy's compute(), one thread, for the champion's 25-rule systems."""

import time

import numpy as np

from benchmarks.timing import best_cpu_seconds, line
from fis_tools.kernel import evaluate, pack
from fis_tools.skfuzzy_build import build_simulation
from pipeline import controller_source
from pipeline.config import compose_experiment


def run(controller: str, num_samples: int = 200_000, num_reference: int = 200) -> None:
    """Print microseconds an evaluation for both engines, and the ratio."""
    experiment = compose_experiment(["+experiment=evaluate", f"controller={controller}"]).experiment
    systems = controller_source.load(experiment.controller, experiment.mission).systems
    print(f"Inference: systems of {controller}, random inputs over their universes, one thread")
    generator = np.random.default_rng(0)
    for system in systems:
        low = np.array([variable.minimum for variable in system.inputs])
        high = np.array([variable.maximum for variable in system.inputs])
        inputs = generator.uniform(low, high, (num_samples, len(low)))
        packed = pack(system)
        fast = best_cpu_seconds(lambda p=packed, x=inputs: evaluate(p, x)) / num_samples
        simulation = build_simulation(system)
        started = time.process_time()
        for row in inputs[:num_reference]:  # once each: scikit-fuzzy remembers inputs that it has seen
            for variable, value in zip(system.inputs, row, strict=True):
                simulation.input[variable.name] = float(value)
            simulation.compute()
        slow = (time.process_time() - started) / num_reference
        line(f"{system.name}, {len(system.rules)} rules: compiled, microseconds", f"{1e6 * fast:.3f}")
        line(
            f"{system.name}, {len(system.rules)} rules: scikit-fuzzy compute(), microseconds",
            f"{1e6 * slow:,.0f}",
        )
        line(f"{system.name}, {len(system.rules)} rules: times as fast", f"{slow / fast:,.0f}")
