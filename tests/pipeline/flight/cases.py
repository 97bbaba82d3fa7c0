"""Missions, controllers and starts that the fast flight is tried with."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from fis_tools.model import FuzzyController, FuzzySystem, Term, Triangular, Variable
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import SIGNALS
from pipeline.physics.motion import state_transition
from pipeline.settings.experiment import Mission
from tests.pipeline.flight import missions
from tests.pipeline.flight.missions import MEAN_MOTION, PAPER, STEERED, answering, force, variable


def mission(**changes: Any) -> Mission:
    """The paper's mission with its centroid, but for some settings; those of a group come as a dict."""
    paper = replace(PAPER, guidance=replace(PAPER.guidance, kind="centroid"))
    groups = {
        name: asdict(getattr(paper, name)) | settings
        for name, settings in changes.items()
        if isinstance(settings, dict)
    }
    return replace(paper, **(changes | groups))


def ball(moment: float) -> tuple[tuple[float, ...], ...]:
    """A spherical inertia, kg m^2."""
    return ((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, moment))


def controller(systems: tuple[FuzzySystem, ...], force_axes: str = "body", **constants: float) -> Controller:
    """A controller of some systems."""
    attributes = {"force_axes": force_axes} | {name: repr(value) for name, value in constants.items()}
    return from_fuzzy(FuzzyController("tried", systems, tuple(sorted(attributes.items()))))


def with_attributes(controller: Controller, **changes: str | None) -> Controller:
    """Another controller, without the attributes that are None."""
    attributes = dict(controller.fuzzy.attributes) | changes
    kept = sorted((name, text) for name, text in attributes.items() if text is not None)
    return from_fuzzy(replace(controller.fuzzy, attributes=tuple(kept)))


def three_input_system() -> FuzzySystem:
    """Like the paper's along-track system, but it pushes less from afar."""
    inputs = tuple(variable(*seen) for seen in (*STEERED["y"][:2], STEERED["x"][0]))
    cells = [(a, b, c) for a in range(-2, 3) for b in range(-2, 3) for c in range(5)]
    answers = [2 + (a - b) * (1 if c < 3 else 0.5) for a, b, c in cells]
    return answering("along", inputs, force("y"), answers)


def one_input_system() -> FuzzySystem:
    """A damper along the line of sight."""
    return answering("damper", (variable(*STEERED["x"][1]),), force("x"), [4, 3, 2, 1, 0])


def sparse_system() -> FuzzySystem:
    """Fires near three distances only; between them it gives its default, 2 mN."""
    peaks = {"near": 55.0, "middle": 70.0, "far": 85.0}
    terms = tuple(Term(name, Triangular(at - 6.0, at, at + 6.0)) for name, at in peaks.items())
    distance = Variable("distance", "m", 40.0, 100.0, terms)
    return answering("sparse", (distance,), force("x", default=0.002), [3, 2, 1])


def leaning_system(axis: str, reach: float, *senses: tuple[str, str, float]) -> FuzzySystem:
    """Leans against its first input and along the others, by terms that part a range in three."""
    inputs = tuple(variable(*signal, -width, width, 0.4 * width, num_terms=3) for *signal, width in senses)
    output = variable(axis, "N", -reach, reach, 0.25 * reach, default=0.0)
    cells = np.indices([3] * len(inputs)).reshape(len(inputs), -1).T - 1
    return answering("leaning_" + axis, inputs, output, [2 - cell[0] + cell[1:].sum() for cell in cells])


def leaning(senses: dict[str, tuple[float, dict[str, float]]], constants: dict[str, float]) -> Controller:
    """A controller along Hill axes: by axis its greatest force, N, and the widths of what it senses."""
    systems = tuple(
        leaning_system(f"force_{axis}", reach, *((name, SIGNALS[name].unit, w) for name, w in widths.items()))
        for axis, (reach, widths) in senses.items()
    )
    return controller(systems, "hill", **constants)


def along_each(widths: dict[str, float], reach_y: float = 0.03) -> dict[str, tuple[float, dict[str, float]]]:
    """The same senses along each axis."""
    return {
        axis: (reach_y if axis == "y" else 0.02, {f"{name}_{along}": width for name, width in widths.items()})
        for axis, along in missions.AXES.items()
    }


#: senses free motion, the target's direction and the Sun's, and keeps still below its dead bands
ORBITAL = leaning(
    {
        "x": (0.02, {"ring_error_along_track": 80.0, "centre_along_track": 120.0, "target_radial": 1.0}),
        "y": (0.03, {"centre_radial": 60.0, "ring_error_radial": 80.0, "sun_ahead": 1.0}),
        "z": (0.02, {"target_along_track": 1.0, "target_cross_track": 1.0, "sun_alignment": 1.0}),
    },
    {
        "ring_size_m": 31.0,
        "ring_lead_rad": 0.4,
        "dead_band_force_x_n": 0.002,
        "dead_band_force_y_n": 0.004,
        "dead_band_force_z_n": 0.001,
    },
)
#: senses where its drift takes it
LOOKING_AHEAD = leaning(
    {
        "x": (
            0.02,
            {"predicted_centre_along_track": 120.0, "closest_approach": 60.0, "velocity_radial": 0.1},
        ),
        "y": (0.03, {"centre_radial": 60.0, "closest_approach": 40.0}),
    },
    {"prediction_time_s": 800.0, "dead_band_force_x_n": 0.001},
)
#: senses what coasting comes to, and coasts where that is enough
FORESEEING = leaning(
    {
        "x": (0.02, {"missed": 20.0, "coasting_nearest": 60.0, "target_setting": 1.0}),
        "y": (0.03, {"ring_error_radial": 60.0, "coasting_farthest": 90.0}),
        "z": (0.02, {"target_cross_track": 1.0}),
    },
    {"ring_size_m": 20.0, "coast_below_points": 30.0, "coast_margin_m": 7.0},
)
#: senses what goes dark for good, and coasts where enough is foreseen
HURRYING = leaning(
    along_each({"velocity": 0.1, "urgent": 1.0}),
    {"urgency_time_s": 150.0, "skirt_distance_m": 70.0, "coast_below_points": 12.0},
)
#: the same, every half minute
PAUSING = with_attributes(HURRYING, decision_period_s="30")
#: senses the push that shows what sets for good, and coasts where enough is foreseen
SEEING = leaning(
    along_each({"see_push": 0.2, "aim": 0.1, "urgent": 1.0}),
    {
        "urgency_time_s": 400.0,
        "skirt_distance_m": 70.0,
        "see_horizon_s": 1500.0,
        "see_damping_ks2": 0.08,
        "aim_urgent_m_s": 0.04,
        "coast_below_points": 3.0,
    },
)
#: the same until one push leads onto a closed ellipse, which misses few points and passes the chief
PARKING = with_attributes(SEEING, park_below_points="58", park_reach_m_s="0.1", coast_margin_m="4")


def touring(**changes: float) -> Controller:
    """A controller that senses the push onto a tour, and what that leans towards."""
    constants = {
        "urgency_time_s": 900.0,
        "skirt_distance_m": 70.0,
        "see_damping_ks2": 0.08,
        "tour_time_s": 700.0,
        "tour_lean_m": 20.0,
        "tour_radial_mean_m": -11.0,
        "tour_radial_cos_1_m": 50.0,
        "tour_radial_sin_2_m": -30.0,
        "tour_along_track_sin_1_m": 80.0,
        "tour_along_track_cos_2_m": 17.0,
        "tour_cross_track_sin_1_m": 25.0,
        "tour_cross_track_cos_2_m": -14.0,
        "tour_lift_mean_m": 12.0,
        "tour_lift_sin_2_m": -40.0,
    }
    return leaning(along_each({"tour_push": 0.2, "urgent": 1.0, "see_push": 0.2}, 0.02), constants | changes)


TOURING = touring()
STEERING = controller(missions.steering_systems())
RESTORING = controller(missions.restoring_systems(), "hill")
SPARSE = controller((sparse_system(), missions.steering_systems()[1]))
MIXED = controller((one_input_system(), three_input_system(), missions.steering_systems()[2]))


def isotropic(generator: np.random.Generator, count: int) -> np.ndarray:
    """Unit vectors."""
    directions = generator.normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, np.newaxis]


def random_starts(count: int, seed: int) -> list[Scenario]:
    """Starts in isotropic directions, 50 to 100 m from the chief, drifting, under any Sun."""
    generator = np.random.default_rng(seed)
    directions = isotropic(generator, count)
    distances = generator.uniform(50.0, 100.0, count)
    velocities = generator.normal(0.0, 0.01, (count, 3))
    angles = generator.uniform(0.0, 2.0 * np.pi, count)
    positions = distances[:, np.newaxis] * directions
    return [Scenario(*start) for start in zip(positions, velocities, angles.tolist(), strict=True)]


STARTS = random_starts(3, 7)


def drifting_through(position_m: tuple[float, float, float], after_s: float) -> Scenario:
    """A start from where the deputy, without any force, comes through a place after some time."""
    transition = state_transition(MEAN_MOTION, after_s)
    start = np.array([-12.0, 1.0, 70.0])
    velocity = np.linalg.solve(transition[:3, 3:], np.array(position_m) - transition[:3, :3] @ start)
    return Scenario(start, velocity, 0.5)


#: over a pole after 201 s without force, at the start, and nearly so, closer than 0.06 deg, after 2,800 s by
#: `STEERING` and clusters
OVER_POLES = [
    drifting_through((0.0, 0.0, 68.0), 201.0),
    Scenario(np.array([1e-3, 0.0, 60.0]), np.zeros(3), 1.0),
    Scenario(np.array([45.0, -40.0, 35.0]), np.zeros(3), 0.3),
]
#: from here `STEERING` and `MIXED` inspect all 99 points of a chief before the hour is over
COMPLETED = random_starts(4, 7)[3]
