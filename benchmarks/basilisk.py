"""The exported module of Basilisk, built and flown there: each force beside the product's, bit by bit.

In an environment with the product, ``pip install bsk==2.12.1 bsk-sdk==2.12.1 cmake ninja swig``, then
``python -m benchmarks basilisk``. Chief and deputy are spacecraft of Basilisk about a point (RK4, 1 s), the
exported controller commands the deputy every control period, and the camera is the reference's.
"""

import argparse
import importlib
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.constants import EARTH_GRAVITY_M3_S2
from pipeline.controllers import source
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.reference.light import semi_major_axis
from pipeline.flight.reference.period import look, start
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.onboard.export import export
from pipeline.onboard.program import OnboardProgram, translate
from pipeline.onboard.recorded import OUTPUT, Library, Recorded, recorded

#: what both worlds are: two bodies about a point, and a camera that points as it should
WORLD = ("dynamics=two_body", "attitude=ideal")
STEP_S = 1.0
INCLINATION_DEG = 51.6
#: the deputy's attitude relative to Hill axes, held in the flight: a modified Rodrigues parameter
SIGMA_BH = (0.1, -0.2, 0.3)
MODULES = (
    *("architecture.messaging", "architecture.sysModel", "fswAlgorithms.hillStateConverter"),
    *("simulation.extForceTorque", "simulation.simpleNav", "simulation.spacecraft"),
    *("utilities.SimulationBaseClass", "utilities.macros", "utilities.orbitalMotion"),
    *("utilities.RigidBodyKinematics", "utilities.simIncludeGravBody"),
)


def built(folder: Path) -> Any:
    """Return the module of Basilisk that an export holds, built by its own rules."""
    sdk = importlib.import_module("bsk_sdk")
    sources, binary = folder / "wrappers" / "basilisk", folder / "build"
    options = f"-DCMAKE_PREFIX_PATH={sdk.cmake_config_dir()}", f"-DPython3_EXECUTABLE={sys.executable}"
    for words in (("-G", "Ninja", "-S", sources, "-B", binary, *options), ("--build", binary)):
        subprocess.run(["cmake", *words], check=True, stdout=subprocess.DEVNULL)  # noqa: S603, S607
    sys.path.append(str(binary))
    return importlib.import_module("inspectionController")


class Deputy:
    """Both spacecraft in Basilisk, the deputy under the command of the exported module."""

    def __init__(self, module: Any, program: OnboardProgram, scenario: Scenario, flight: Recorded) -> None:
        self.program, self.flight = program, flight
        self.reference = reference_of(program.mission, program.controller, scenario)
        self.state: Any = start(self.reference)
        self.controller = module.inspectionController()
        for name in ("sun_angle", "sun_elevation", "counts"):
            setattr(self.controller.start, name, flight.start[name].tolist())
        self.inputs, self.outputs = flight.steps.copy(), np.zeros(len(flight.steps), OUTPUT)
        self.commands = np.zeros((len(flight.steps), 3))
        self._fly(scenario)

    def _fly(self, scenario: Scenario) -> None:
        bsk = {name.rpartition(".")[2]: importlib.import_module(f"Basilisk.{name}") for name in MODULES}
        nano, orbital, rotation = bsk["macros"].sec2nano, bsk["orbitalMotion"], bsk["RigidBodyKinematics"]
        mission, world = self.program.mission, self.program.world
        elements = orbital.ClassicElements()
        elements.a, elements.e, elements.i = semi_major_axis(mission), 0.0, radians(INCLINATION_DEG)
        elements.Omega = elements.omega = elements.f = 0.0
        chief = tuple(map(np.array, orbital.elem2rv(EARTH_GRAVITY_M3_S2, elements)))
        deputy = orbital.hill2rv(*chief, np.array(scenario.position_m), np.array(scenario.velocity_m_s))
        body_from_inertial = rotation.MRP2C(list(SIGMA_BH)) @ orbital.hillFrame(*chief)
        turning = rotation.MRP2C(list(SIGMA_BH)) @ [0.0, 0.0, world.mean_motion]

        simulation = bsk["SimulationBaseClass"].SimBaseClass()
        process = simulation.CreateNewProcess("process")
        process.addTask(simulation.CreateNewTask("motion", nano(STEP_S)), 2)
        process.addTask(simulation.CreateNewTask("control", nano(world.control_period)), 1)
        factory = bsk["simIncludeGravBody"].gravBodyFactory()
        factory.createCustomGravObject("earth", EARTH_GRAVITY_M3_S2).isCentralBody = True
        converter = bsk["hillStateConverter"].hillStateConverter()
        thruster = bsk["extForceTorque"].ExtForceTorque()
        simulation.AddModelToTask("motion", thruster, 20)
        kept: list[Any] = [factory]
        for name, (position, velocity), reader in (
            ("chief", chief, converter.chiefStateInMsg),
            ("deputy", deputy, converter.depStateInMsg),
        ):
            craft, navigation = bsk["spacecraft"].Spacecraft(), bsk["simpleNav"].SimpleNav()
            craft.ModelTag, craft.hub.mHub = name, mission.deputy.mass_kg
            craft.hub.r_CN_NInit, craft.hub.v_CN_NInit = list(position), list(velocity)
            craft.hub.sigma_BNInit = rotation.C2MRP(body_from_inertial).tolist()
            craft.hub.omega_BN_BInit = turning.tolist()
            craft.hub.IHubPntBc_B = np.eye(3).tolist()
            factory.addBodiesTo(craft)
            if name == "deputy":
                craft.addDynamicEffector(thruster)
            navigation.scStateInMsg.subscribeTo(craft.scStateOutMsg)
            reader.subscribeTo(navigation.transOutMsg)
            simulation.AddModelToTask("motion", craft, 10)
            simulation.AddModelToTask("control", navigation, 9)
            kept += [craft, navigation]
        attitude = (
            bsk["messaging"].NavAttMsg().write(bsk["messaging"].NavAttMsgPayload(sigma_BN=list(SIGMA_BH)))
        )
        self.controller.hillStateInMsg.subscribeTo(converter.hillStateOutMsg)
        self.controller.attNavInMsg.subscribeTo(attitude)
        thruster.cmdForceBodyInMsg.subscribeTo(self.controller.cmdForceOutMsg)
        simulation.AddModelToTask("control", converter, 8)
        see, note = self._see, self._note

        class Camera(bsk["sysModel"].SysModel):  # type: ignore[misc, name-defined]
            """Tells the controller the Sun, and the points that are not inspected yet."""

            def UpdateState(self, time: int) -> None:  # noqa: N802 - Basilisk's name
                """Look from where Basilisk has the deputy."""
                see(converter.hillStateOutMsg.read(), round(time / nano(world.control_period)))

        class Notes(bsk["sysModel"].SysModel):  # type: ignore[misc, name-defined]
            """Notes what was commanded."""

            def UpdateState(self, time: int) -> None:  # noqa: N802
                """Note it."""
                note(round(time / nano(world.control_period)))

        for model, priority in ((Camera(), 7), (self.controller, 6), (Notes(), 5)):
            simulation.AddModelToTask("control", model, priority)
            kept.append(model)
        simulation.InitializeSimulation()
        simulation.ConfigureStopTime(nano(world.control_period * (len(self.inputs) - 1)))
        simulation.ExecuteSimulation()

    def _see(self, hill: Any, k: int) -> None:
        self.state.truth = np.array([*hill.r_DC_H, *hill.v_DC_H])
        seen = look(self.reference, k, self.state)
        self.state.is_inspected, self.state.attitude, self.state.y = seen.is_inspected, seen.attitude, seen.y
        step, known = self.inputs[k], self.controller.known
        step["unseen"] = (self.flight.start["counts"] > 0) & ~seen.is_inspected
        for name in ("sun_angle", "sun_elevation", "unseen"):
            setattr(known, name, step[name].tolist())

    def _note(self, k: int) -> None:
        known, output = self.controller.known, self.controller.output
        for name in ("position_m", "velocity_m_s", "attitude"):
            self.inputs[k][name] = list(getattr(known, name))
        self.outputs[k]["status"], self.outputs[k]["force_n"] = output.status, list(output.force_n)
        self.commands[k] = self.controller.cmdForceOutMsg.read().forceRequestBody


def report(deputy: Deputy, log: FlightLog, folder: Path) -> str:
    """Return what differs: from the C on the same inputs, and from the product's own flight."""
    flight, library = deputy.flight, Library(folder)
    answers = library.answers(flight._replace(steps=deputy.inputs))
    num_equal = int((answers["force_n"] == deputy.outputs["force_n"]).all(axis=1).sum())
    rotation = importlib.import_module("Basilisk.utilities.RigidBodyKinematics")
    turned = deputy.outputs["force_n"] @ rotation.MRP2C(list(SIGMA_BH)).T
    forces, positions = deputy.outputs["force_n"], deputy.inputs["position_m"]
    unseen: Floats = deputy.inputs["unseen"][-1]
    return (
        f"{num_equal} of {len(forces)} forces equal those of the C that the product flies, bit by bit; "
        f"{np.count_nonzero(np.any(forces != 0.0, axis=1))} are not zero, "
        f"{np.count_nonzero(deputy.outputs['status'])} inputs are refused\n"
        f"the message to the thrusters is that force in body axes within "
        f"{np.abs(deputy.commands - turned).max():.1e} N\n"
        f"from the product's own flight forces differ by at most "
        f"{np.abs(forces - log.force_commanded_n).max():.1e} N, positions by "
        f"{np.abs(positions - log.position_m[:-1]).max():.1e} m; points not inspected at the end: "
        f"{np.count_nonzero(unseen)} and {int((flight.steps['unseen'][-1] > 0).sum())}\n"
    )


def main(arguments: Sequence[str]) -> None:
    """Build the module, fly it, and print what differs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks basilisk", description=__doc__)
    parser.add_argument("words", nargs="*", default=["controller=champion_27", "sun=random"])
    words = parser.parse_args(arguments).words
    job = compose_experiment(["+experiment=evaluate", *words, *WORLD])
    mission = job.experiment.mission
    program = translate(mission, source.load(job.config["controller"], mission))
    (scenario,) = importlib.import_module("pipeline.scenarios").evaluation_scenarios(job.experiment, slice(1))
    log = fly_logged(mission, program.controller, scenario)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        export(program, [scenario], folder)
        deputy = Deputy(built(folder), program, scenario, recorded(program, scenario, log))
        sys.stdout.write(f"{program.controller.name} {' '.join(words[1:])}\n{report(deputy, log, folder)}")
