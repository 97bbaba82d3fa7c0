"""Missions, controllers and starts that the fast flight is tried with."""

from dataclasses import replace
from typing import Any

import numpy as np

from fis_tools.model import FuzzyController, FuzzySystem, Gaussian, Term, Triangular, Variable, table_rules
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.state.log import Scenario
from pipeline.physics.motion import state_transition
from pipeline.settings.experiment import Mission
from tests.pipeline.flight.missions import (
    MEAN_MOTION,
    PAPER,
    TOWARDS_THE_POLE,
    restoring_systems,
    steering_systems,
    variable,
)


def mission(**changes: Any) -> Mission:
    """The paper's mission with its centroid, but for some settings; those of a group come as a dict."""
    paper = replace(PAPER, guidance=replace(PAPER.guidance, kind="centroid"))
    groups = {
        name: replace(getattr(paper, name), **settings)
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


def three_input_system() -> FuzzySystem:
    """Like the paper's along-track system, but it pushes less from afar."""
    seen = variable("lambda_u", "rad", -np.pi, np.pi, 0.8)
    speed = variable("velocity_body_y", "m/s", -0.3, 0.3, 0.08)
    distance = variable("distance", "m", 40.0, 100.0, 7.0)
    output = variable("force_y", "N", -0.03, 0.03, 0.0075, default=0.0)
    cells = [(a, b, c) for a in range(-2, 3) for b in range(-2, 3) for c in range(5)]
    consequents = [f"t{int(np.clip(2 + (a - b) * (1 if c < 3 else 0.5), 0, 4))}" for a, b, c in cells]
    return FuzzySystem(
        "along", (seen, speed, distance), (output,), table_rules((seen, speed, distance), output, consequents)
    )


def one_input_system() -> FuzzySystem:
    """A damper along the line of sight."""
    speed = variable("velocity_body_x", "m/s", -0.2, 0.2, 0.05)
    output = variable("force_x", "N", -0.03, 0.03, 0.0075, default=0.0)
    return FuzzySystem(
        "damper", (speed,), (output,), table_rules((speed,), output, ["t4", "t3", "t2", "t1", "t0"])
    )


def sparse_system() -> FuzzySystem:
    """Fires near three distances only; between them it gives its default, 2 mN."""
    peaks = {"near": 55.0, "middle": 70.0, "far": 85.0}
    terms = tuple(Term(name, Triangular(at - 6.0, at, at + 6.0)) for name, at in peaks.items())
    distance = Variable("distance", "m", 40.0, 100.0, terms)
    output = variable("force_x", "N", -0.03, 0.03, 0.0075, default=0.002)
    return FuzzySystem("sparse", (distance,), (output,), table_rules((distance,), output, ["t3", "t2", "t1"]))


def leaning_system(axis: str, reach: float, *senses: tuple[str, str, float]) -> FuzzySystem:
    """Leans against its first input and along the others, by terms that part a range in three."""
    inputs = tuple(
        replace(variable(name, unit, -width, width, 0.4 * width), terms=tuple(three_terms(width)))
        for name, unit, width in senses
    )
    output = variable(axis, "N", -reach, reach, 0.25 * reach, default=0.0)
    cells = np.indices([3] * len(inputs)).reshape(len(inputs), -1).T - 1
    consequents = [f"t{int(np.clip(2 - cell[0] + cell[1:].sum(), 0, 4))}" for cell in cells]
    return FuzzySystem("leaning_" + axis, inputs, (output,), table_rules(inputs, output, consequents))


def three_terms(width: float) -> list[Term]:
    """Below, about and above zero."""
    return [Term(f"t{i}", Gaussian((i - 1) * width, 0.4 * width)) for i in range(3)]


#: senses free motion, the target's direction and the Sun's, and keeps still below its dead bands
ORBITAL = controller(
    (
        leaning_system(
            "force_x",
            0.02,
            ("ring_error_along_track", "m", 80.0),
            ("centre_along_track", "m", 120.0),
            ("target_radial", "", 1.0),
        ),
        leaning_system(
            "force_y",
            0.03,
            ("centre_radial", "m", 60.0),
            ("ring_error_radial", "m", 80.0),
            ("sun_ahead", "", 1.0),
        ),
        leaning_system(
            "force_z",
            0.02,
            ("target_along_track", "", 1.0),
            ("target_cross_track", "", 1.0),
            ("sun_alignment", "", 1.0),
        ),
    ),
    "hill",
    ring_size_m=31.0,
    ring_lead_rad=0.4,
    dead_band_force_x_n=0.002,
    dead_band_force_y_n=0.004,
    dead_band_force_z_n=0.001,
)
#: senses where its drift takes it
LOOKING_AHEAD = controller(
    (
        leaning_system(
            "force_x",
            0.02,
            ("predicted_centre_along_track", "m", 120.0),
            ("closest_approach", "m", 60.0),
            ("velocity_radial", "m/s", 0.1),
        ),
        leaning_system("force_y", 0.03, ("centre_radial", "m", 60.0), ("closest_approach", "m", 40.0)),
    ),
    "hill",
    prediction_time_s=800.0,
    dead_band_force_x_n=0.001,
)
#: senses what coasting comes to, and coasts where that is enough
FORESEEING = controller(
    (
        leaning_system(
            "force_x",
            0.02,
            ("missed", "", 20.0),
            ("coasting_nearest", "m", 60.0),
            ("target_setting", "", 1.0),
        ),
        leaning_system("force_y", 0.03, ("ring_error_radial", "m", 60.0), ("coasting_farthest", "m", 90.0)),
        leaning_system("force_z", 0.02, ("target_cross_track", "", 1.0)),
    ),
    "hill",
    ring_size_m=20.0,
    coast_below_points=30.0,
    coast_margin_m=7.0,
)
#: senses what goes dark for good, and coasts where enough is foreseen
HURRYING = controller(
    (
        leaning_system("force_x", 0.02, ("velocity_radial", "m/s", 0.1), ("urgent_radial", "", 1.0)),
        leaning_system(
            "force_y", 0.03, ("velocity_along_track", "m/s", 0.1), ("urgent_along_track", "", 1.0)
        ),
        leaning_system(
            "force_z", 0.02, ("velocity_cross_track", "m/s", 0.1), ("urgent_cross_track", "", 1.0)
        ),
    ),
    "hill",
    urgency_time_s=150.0,
    skirt_distance_m=70.0,
    coast_below_points=12.0,
)
#: the same, every half minute
PAUSING = replace(
    HURRYING,
    fuzzy=replace(
        HURRYING.fuzzy, attributes=tuple(sorted((*HURRYING.fuzzy.attributes, ("decision_period_s", "30"))))
    ),
)
#: senses the push that shows what sets for good, and coasts where enough is foreseen
SEEING = controller(
    (
        leaning_system(
            "force_x",
            0.02,
            ("see_push_radial", "m/s", 0.2),
            ("aim_radial", "m/s", 0.1),
            ("urgent_radial", "", 1.0),
        ),
        leaning_system(
            "force_y",
            0.03,
            ("see_push_along_track", "m/s", 0.2),
            ("aim_along_track", "m/s", 0.1),
            ("urgent_along_track", "", 1.0),
        ),
        leaning_system(
            "force_z",
            0.02,
            ("see_push_cross_track", "m/s", 0.2),
            ("aim_cross_track", "m/s", 0.1),
            ("urgent_cross_track", "", 1.0),
        ),
    ),
    "hill",
    urgency_time_s=400.0,
    skirt_distance_m=70.0,
    see_horizon_s=1500.0,
    see_damping_ks2=0.08,
    aim_urgent_m_s=0.04,
    coast_below_points=3.0,
)


def touring(**changes: float) -> Controller:
    """A controller that senses the push onto a tour, and what that leans towards."""
    systems = tuple(
        leaning_system(
            f"force_{axis}",
            0.02,
            (f"tour_push_{along}", "m/s", 0.2),
            (f"urgent_{along}", "", 1.0),
            (f"see_push_{along}", "m/s", 0.2),
        )
        for axis, along in zip("xyz", ("radial", "along_track", "cross_track"), strict=True)
    )
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
    return controller(systems, "hill", **constants | changes)


TOURING = touring()
STEERING = controller(steering_systems())
RESTORING = controller(restoring_systems(), "hill")
SPARSE = controller((sparse_system(), steering_systems()[1]))
MIXED = controller((one_input_system(), three_input_system(), steering_systems()[2]))


def random_starts(count: int, seed: int) -> list[Scenario]:
    """Starts in isotropic directions, 50 to 100 m from the chief, drifting, under any Sun."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, np.newaxis]
    return [
        Scenario(distance * direction, velocity, float(angle))
        for direction, distance, velocity, angle in zip(
            directions,
            generator.uniform(50.0, 100.0, count),
            generator.normal(0.0, 0.01, (count, 3)),
            generator.uniform(0.0, 2.0 * np.pi, count),
            strict=True,
        )
    ]


STARTS = random_starts(3, 7)


def drifting_through(position_m: tuple[float, float, float], after_s: float) -> Scenario:
    """A start from where the deputy, without any force, comes through a place after some time."""
    transition = state_transition(MEAN_MOTION, after_s)
    start = np.array([-12.0, 1.0, 70.0])
    velocity = np.linalg.solve(transition[:3, 3:], np.array(position_m) - transition[:3, :3] @ start)
    return Scenario(start, velocity, 0.5)


#: over a pole after 201 s without force, at the start, and nearly so after 2,800 s by `STEERING` and clusters
OVER_POLES = [
    drifting_through((0.0, 0.0, 68.0), 201.0),
    Scenario(np.array([1e-3, 0.0, 60.0]), np.zeros(3), 1.0),
    TOWARDS_THE_POLE,
]
#: from here `STEERING` and `MIXED` inspect all 99 points of a chief before the hour is over
COMPLETED = random_starts(4, 7)[3]
