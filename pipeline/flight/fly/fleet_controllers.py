"""Controllers by which fleets fly: those that plan, if at all, in a way that deputies can divide or share."""

from dataclasses import fields

from pipeline.flight.control.controller import (
    Controller,
    ControllerError,
    OpenLoopController,
    PilotController,
    RuleController,
)
from pipeline.flight.control.law import rehearsed_pushes
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.state.signals import constant
from pipeline.settings.experiment import Mission
from pipeline.settings.fleet import Fleet


def check_controller(mission: Mission, controller: Controller) -> None:
    """Raise ControllerError for a controller that plans ahead as if it were alone, or for what is not so."""
    refused = f"controller {controller.name!r} plans for one deputy, and fleet.deputies is above 1; "
    cure = "choose one that goes by its rules alone, such as champion_27, or leave fleet.deputies out"
    if isinstance(controller, PilotController):
        _check_pilot(mission.fleet, controller)
        return
    if not isinstance(controller, RuleController | OpenLoopController):
        raise ControllerError(refused + cure)
    if foresees(controller):
        _check_planning(mission, controller, cure)
    elif len(rehearsed_pushes(controller)):
        raise ControllerError(refused + cure)
    elif tour_images(controller):
        for name, what in (("rehearsal_period_s", "later again"), ("rehearsal_draws", "with drawn errors")):
            if (value := controller.constants[constant(name)]) > 0.0:
                raise ControllerError(
                    f"controller {controller.name!r} rehearses tours {what}, by {name}={value:g}, and fleets "
                    "rehearse them once, at the start, as they believe all to be; choose a controller that "
                    "does so, such as champion_leo, or leave fleet.deputies out"
                )


def _check_planning(mission: Mission, controller: Controller, cure: str) -> None:
    """Raise ControllerError for a controller that would plan again as if on board."""
    exact = mission.navigation.mode, mission.actuators.kind, mission.dynamics.model
    if controller.constants[constant("foresight_bare")] > 0.0 and exact != ("perfect", "ideal", "cw"):
        raise ControllerError(
            f"controller {controller.name!r} plans as on board, by foresight_bare, and fleets do so only "
            f"where all is exact, and here are navigation={exact[0]}, actuators={exact[1]}, "
            f"dynamics={exact[2]}; {cure}"
        )


def _check_pilot(fleet: Fleet, controller: PilotController) -> None:
    """Raise ControllerError unless a fleet's deputies observe what those of the learners' environment do."""
    plain = Fleet(deputies=fleet.deputies, sharing="mask")
    others = [each.name for each in fields(plain) if getattr(fleet, each.name) != getattr(plain, each.name)]
    if controller.pilot.turns:
        raise ControllerError(
            f"policy {controller.name!r} turns one deputy, itself; leave fleet.deputies out"
        )
    if others:
        cure = ", ".join(f"fleet.{name}={getattr(plain, name)}" for name in others)
        raise ControllerError(
            f"policy {controller.name!r} learned where each deputy knows at once which points any has seen, "
            f"and no more; give {cure}"
        )
