"""The paper's mission as settings, and a hand-made controller that keeps the deputy busy."""

from dataclasses import replace

import numpy as np

from fis_tools.model import FuzzySystem, Gaussian, Term, Variable, table_rules
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Guidance

MEAN_MOTION = 0.0011068
FULL_INERTIA = ((1.2, 0.1, -0.05), (0.1, 0.9, 0.08), (-0.05, 0.08, 1.1))
#: settings are the paper's unless others are given
PAPER = Mission(guidance=Guidance(kind="clusters"))
IDEAL = replace(PAPER, attitude=replace(PAPER.attitude, mode="ideal"))

PI = float(np.pi)
AXES = {"x": "radial", "y": "along_track", "z": "cross_track"}
#: by axis, what a system sees and its speed: unit, range, width of terms; and the sign of the answer
STEERED = {
    "x": (("distance", "m", 40.0, 100.0, 7.0), ("velocity_body_x", "m/s", -0.2, 0.2, 0.05), -1),
    "y": (("lambda_u", "rad", -PI, PI, 0.8), ("velocity_body_y", "m/s", -0.3, 0.3, 0.08), 1),
    "z": (("eta_u", "rad", -PI, PI, 0.8), ("velocity_body_z", "m/s", -0.3, 0.3, 0.08), 1),
}


def variable(name, unit, low, high, sigma, *, default=None, num_terms=5):
    means = np.linspace(low, high, num_terms)
    terms = tuple(Term(f"t{i}", Gaussian(float(mean), sigma)) for i, mean in enumerate(means))
    return Variable(name, unit, low, high, terms, default=default)


def answering(name, inputs, output, answers):
    """A system with a rule, of one term of five, for each cell of its inputs."""
    consequents = [f"t{int(np.clip(answer, 0, 4))}" for answer in answers]
    return FuzzySystem(name, inputs, (output,), table_rules(inputs, output, consequents))


def force(axis, strength=0.03, default=0.0):
    return variable(f"force_{axis}", "N", -strength, strength, strength / 4.0, default=default)


def steering_system(axis, seen, speed, sign, strength=0.03):
    """A system that answers what it sees with a force, and damps the speed along its axis."""
    answers = [2 + sign * a - b for a in range(-2, 3) for b in range(-2, 3)]
    inputs = variable(*seen), variable(*speed)
    return answering(f"steer_{axis}", inputs, force(axis, strength), answers)


def steering_systems():
    """The paper's structure, untrained: it follows its target and keeps its distance."""
    return tuple(steering_system(axis, *seen) for axis, seen in STEERED.items())


def restoring_systems():
    """Springs and dampers along Hill axes: they hold the deputy near the chief."""
    systems = []
    for axis, name in AXES.items():
        position = f"position_{name}", "m", -80.0, 80.0, 18.0
        speed = f"velocity_{name}", "m/s", -0.3, 0.3, 0.08
        systems.append(steering_system(axis, position, speed, -1, 0.02))
    return tuple(systems)
