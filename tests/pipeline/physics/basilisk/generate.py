"""Write trajectories.json: two craft that fly for an hour as Basilisk (AVSLab) moves them.

Basilisk wants an environment of its own, and nothing from the network at run time::

    python -m venv bsk && bsk/bin/pip install bsk==2.12.1
    bsk/bin/python tests/pipeline/physics/basilisk/generate.py

Each craft is integrated by itself in inertial axes (RK4, 1 s); Hill axes are those of Basilisk's `rv2hill`.
"""

import json
import tempfile
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from Basilisk import __version__
from Basilisk.architecture import astroConstants, messaging
from Basilisk.simulation import (
    dragDynamicEffector,
    eclipse,
    exponentialAtmosphere,
    radiationPressure,
    spacecraft,
)
from Basilisk.utilities import SimulationBaseClass, macros, orbitalMotion, simIncludeGravBody

MEAN_MOTION, GRAVITY = 0.0011068, 3.986004418e14
EARTH_RADIUS_M, ASTRONOMICAL_UNIT_M = 6_378_137.0, 149_597_870_700.0
SEMI_MAJOR_AXIS = (GRAVITY / MEAN_MOTION**2) ** (1.0 / 3.0)
#: of Basilisk's sunlight at one astronomical unit, N/m^2
PRESSURE = astroConstants.SOLAR_FLUX_EARTH / astroConstants.SPEED_LIGHT
STEP_S, SAMPLE_S, DURATION_S, MASS = 1.0, 300.0, 3600.0, 12.0

ROUND = {"eccentricity": 0.0, "true_anomaly_deg": 0.0, "inclination_deg": 51.6, "latitude_argument_deg": 0.0}
PLAIN = {"j2": 0.0, "drag_m_s2": 0.0, "radiation_m_s2": 0.0}
J2, DRAG, RADIATION = {"j2": 1.08262668e-3}, {"drag_m_s2": 3e-7}, {"radiation_m_s2": 1e-7}
#: an ellipse beside the chief, and a deputy at rest above it, which drifts away
ELLIPSE = ([50.0, 0.0, 50.0], [0.0, -2.0 * MEAN_MOTION * 50.0, 0.0])
ABOVE = ([100.0, 0.0, 0.0], [0.0, 0.0, 0.0])
#: name to dynamics, whether the Earth casts a shadow, and the start
CASES: dict[str, tuple[dict[str, float], bool, tuple[list[float], list[float]]]] = {
    "two bodies": (ROUND | PLAIN, False, ELLIPSE),
    "two bodies, far": (ROUND | PLAIN, False, ABOVE),
    "an eccentric chief": (
        ROUND | PLAIN | {"eccentricity": 0.05, "true_anomaly_deg": 40.0, "latitude_argument_deg": 70.0},
        False,
        ELLIPSE,
    ),
    "oblateness": (ROUND | PLAIN | J2, False, ELLIPSE),
    "oblateness, far, over the poles": (ROUND | PLAIN | J2 | {"inclination_deg": 97.4}, False, ABOVE),
    "drag": (ROUND | PLAIN | DRAG, False, ELLIPSE),
    "sunlight": (ROUND | PLAIN | RADIATION, False, ELLIPSE),
    "sunlight and shadow": (ROUND | PLAIN | RADIATION, True, ELLIPSE),
    "everything": (ROUND | J2 | DRAG | RADIATION, True, ELLIPSE),
}
SUN_DEG = (150.0, 10.0)
#: orbits in whose shadow the chief is timed: eccentricity, true anomaly at the start (deg), semi-major axis
ECLIPSES = {
    "a circle": (0.0, 0.0, SEMI_MAJOR_AXIS),
    "eccentricity 0.1, from the apogee": (0.1, 180.0, 1.2 * SEMI_MAJOR_AXIS),
    "eccentricity 0.3, from the perigee": (0.3, 0.0, 1.6 * SEMI_MAJOR_AXIS),
}


def earth_of(j2: float, folder: Path) -> Any:
    """Return the factory of an Earth with this oblateness and no other."""
    factory = simIncludeGravBody.gravBodyFactory()
    earth = factory.createCustomGravObject("earth", GRAVITY, radEquator=EARTH_RADIUS_M)
    earth.isCentralBody = True
    if j2:
        field = folder / "field.csv"
        rows = [f"{EARTH_RADIUS_M},{GRAVITY},0,2,2,1,0,0", "0,0,1,0", "1,0,0,0", "1,1,0,0"]
        rows += [f"2,0,{-j2 / np.sqrt(5.0):.17g},0", "2,1,0,0", "2,2,0,0"]
        field.write_text("\n".join(rows) + "\n", encoding="ascii")
        earth.useSphericalHarmonicsGravityModel(str(field), 2)
    return factory


def chief_at_start(dynamics: dict[str, float]) -> tuple[Any, Any]:
    """Return the chief's inertial place and velocity at the start."""
    elements = orbitalMotion.ClassicElements()
    elements.a, elements.e = SEMI_MAJOR_AXIS, dynamics["eccentricity"]
    elements.i, elements.Omega = radians(dynamics["inclination_deg"]), 0.0
    elements.f = radians(dynamics["true_anomaly_deg"])
    elements.omega = radians(dynamics["latitude_argument_deg"]) - elements.f
    position, velocity = orbitalMotion.elem2rv(GRAVITY, elements)
    return np.array(position), np.array(velocity)


def message_of(name: str, position: Any) -> Any:
    """Return the message of a body that stays at an inertial place."""
    state = messaging.SpicePlanetStateMsgPayload(
        PlanetName=name,
        PositionVector=list(position),
        VelocityVector=[0.0] * 3,
        J20002Pfix=np.eye(3).tolist(),
    )
    return messaging.SpicePlanetStateMsg().write(state)


def add(simulation: Any, model: Any, *priority: int) -> None:
    """Let a model take part in a simulation, which does not keep it by itself."""
    simulation.AddModelToTask("task", model, *priority)
    simulation.kept.append(model)


def add_drag(simulation: Any, craft: Any, acceleration: float) -> None:
    """Let air that is everywhere as dense slow a craft so much at the speed of a circular orbit."""
    air = exponentialAtmosphere.ExponentialAtmosphere()
    air.ModelTag, air.planetRadius, air.scaleHeight = "air", EARTH_RADIUS_M, 1e15
    air.baseDensity = 2.0 * acceleration * MASS / (GRAVITY / SEMI_MAJOR_AXIS)
    air.addSpacecraftToModel(craft.scStateOutMsg)
    drag = dragDynamicEffector.DragDynamicEffector()
    drag.coreParams.projectedArea, drag.coreParams.dragCoeff = 1.0, 1.0
    drag.atmoDensInMsg.subscribeTo(air.envOutMsgs[0])
    craft.addDynamicEffector(drag)
    add(simulation, air)
    add(simulation, drag)


def add_sunlight(simulation: Any, craft: Any, acceleration: float, sun: Any, has_shadow: bool) -> None:
    """Let the Sun push a craft so much at one astronomical unit, where the Earth does not hide it."""
    light = radiationPressure.RadiationPressure()
    light.setUseCannonballModel()
    light.area, light.coefficientReflection = acceleration * MASS / PRESSURE, 1.0
    sun_message = message_of("sun", sun)
    light.sunEphmInMsg.subscribeTo(sun_message)
    simulation.kept.append(sun_message)
    if has_shadow:
        shadow, earth_message = eclipse.Eclipse(), message_of("earth", np.zeros(3))
        shadow.sunInMsg.subscribeTo(sun_message)
        shadow.addPlanetToModel(earth_message)
        shadow.addSpacecraftToModel(craft.scStateOutMsg)
        light.sunEclipseInMsg.subscribeTo(shadow.eclipseOutMsgs[0])
        add(simulation, shadow)
        simulation.kept.append(earth_message)
    craft.addDynamicEffector(light)
    add(simulation, light)


def flown(dynamics: dict[str, float], has_shadow: bool, start: Any, folder: Path) -> dict[str, Any]:
    """Fly one case."""
    position, velocity = chief_at_start(dynamics)
    axes = orbitalMotion.hillFrame(position, velocity)
    angle, elevation = (radians(degrees) for degrees in SUN_DEG)
    flat = np.cos(elevation)
    sun = ASTRONOMICAL_UNIT_M * axes.T @ [flat * np.cos(angle), flat * np.sin(angle), np.sin(elevation)]
    deputy_place, deputy_velocity = orbitalMotion.hill2rv(position, velocity, *map(np.array, start))

    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(STEP_S)))
    earth, simulation.kept, recorders = earth_of(dynamics["j2"], folder), [], []
    for name, at, speed in (("chief", position, velocity), ("deputy", deputy_place, deputy_velocity)):
        craft = spacecraft.Spacecraft()
        craft.ModelTag, craft.hub.mHub = name, MASS
        craft.hub.r_CN_NInit, craft.hub.v_CN_NInit = list(at), list(speed)
        earth.addBodiesTo(craft)
        add(simulation, craft, 10)
        if name == "deputy" and dynamics["drag_m_s2"]:
            add_drag(simulation, craft, dynamics["drag_m_s2"])
        if name == "deputy" and dynamics["radiation_m_s2"]:
            add_sunlight(simulation, craft, dynamics["radiation_m_s2"], sun, has_shadow)
        recorders.append(craft.scStateOutMsg.recorder(macros.sec2nano(SAMPLE_S)))
        add(simulation, recorders[-1])
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(DURATION_S))
    simulation.ExecuteSimulation()
    chief, deputy = recorders
    path = [
        orbitalMotion.rv2hill(*states)[0].tolist()
        for states in zip(chief.r_BN_N, chief.v_BN_N, deputy.r_BN_N, deputy.v_BN_N, strict=True)
    ]
    return {
        "dynamics": dynamics,
        "has_shadow": has_shadow,
        "position_m": start[0],
        "velocity_m_s": start[1],
        "times_s": (chief.times() * macros.NANO2SEC).tolist(),
        "path_m": [[round(value, 7) for value in position] for position in path],
    }


def eclipsed(eccentricity: float, true_anomaly_deg: float, axis: float) -> dict[str, Any]:
    """Return when the chief enters and leaves the dark in an orbit, s: where half of the Sun is hidden."""
    elements = orbitalMotion.ClassicElements()
    elements.a, elements.e, elements.i = axis, eccentricity, radians(ROUND["inclination_deg"])
    elements.Omega, elements.omega, elements.f = 0.0, 0.0, radians(true_anomaly_deg)
    position, velocity = map(np.array, orbitalMotion.elem2rv(GRAVITY, elements))
    angle, elevation = (radians(degrees) for degrees in SUN_DEG)
    flat = np.cos(elevation)
    sun = [flat * np.cos(angle), flat * np.sin(angle), np.sin(elevation)]
    simulation = SimulationBaseClass.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", macros.sec2nano(STEP_S)))
    simulation.kept, factory = [], simIncludeGravBody.gravBodyFactory()
    factory.createCustomGravObject("earth", GRAVITY, radEquator=EARTH_RADIUS_M).isCentralBody = True
    craft, shadow = spacecraft.Spacecraft(), eclipse.Eclipse()
    craft.hub.mHub, craft.hub.r_CN_NInit, craft.hub.v_CN_NInit = MASS, list(position), list(velocity)
    factory.addBodiesTo(craft)
    axes = orbitalMotion.hillFrame(position, velocity)
    messages = [message_of("sun", ASTRONOMICAL_UNIT_M * axes.T @ sun), message_of("earth", np.zeros(3))]
    shadow.sunInMsg.subscribeTo(messages[0])
    shadow.addPlanetToModel(messages[1])
    shadow.addSpacecraftToModel(craft.scStateOutMsg)
    recorder = shadow.eclipseOutMsgs[0].recorder()
    for model in (craft, shadow, recorder):
        add(simulation, model)
    simulation.InitializeSimulation()
    duration = 10.0 * np.ceil(0.2 * np.pi * np.sqrt(axis**3 / GRAVITY))
    simulation.ConfigureStopTime(macros.sec2nano(duration))
    simulation.ExecuteSimulation()
    # nothing is written before the first update
    share, times = np.array(recorder.illuminationFactor)[1:], recorder.times()[1:] * macros.NANO2SEC
    turns = np.flatnonzero(np.diff((share < 0.5).astype(int)))
    return {
        "eccentricity": eccentricity,
        "true_anomaly_deg": true_anomaly_deg,
        "semi_major_axis_m": axis,
        "duration_s": duration,
        "turns_s": [round(float(times[turn] + 0.5 * STEP_S), 1) for turn in turns],
        "is_dark_at_start": bool(share[0] < 0.5),
    }


def main() -> None:
    """Fly all cases."""
    with tempfile.TemporaryDirectory() as folder:
        cases = {name: flown(*case, Path(folder)) for name, case in CASES.items()}
    tables = {
        "made_by": f"Basilisk {__version__}, {Path(__file__).name}",
        "mean_motion_rad_s": MEAN_MOTION,
        "sun_deg": SUN_DEG,
        "cases": cases,
        "eclipses": {name: eclipsed(*orbit) for name, orbit in ECLIPSES.items()},
    }
    text = json.dumps(tables, indent=1)
    Path(__file__).with_name("trajectories.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
