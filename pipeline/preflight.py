"""What the stages of a run would refuse, told before its folder is made."""

import sys
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING

from pipeline.run import maker
from pipeline.run.engine import check_engine
from pipeline.run.extras import require_packages
from pipeline.settings.experiment import Experiment, SettingError

if TYPE_CHECKING:
    from pipeline.flight.control.controller import Controller


def check_before(experiment: Experiment) -> None:
    """Check whatever stages would refuse later, before any folder is made."""
    check_engine(experiment.engine)
    require_packages(experiment)
    # NumPy, needed once the settings are right
    from pipeline.flight.cases.dispersions import missions_at_ends  # noqa: PLC0415
    from pipeline.flight.world.chief import check_perigee, num_chief_steps  # noqa: PLC0415

    if experiment.reproducible:
        maker.require_reproducible()
    for mission in (experiment.mission, *missions_at_ends(experiment.mission)):
        num_chief_steps(mission)
        check_perigee(mission)
    if experiment.mission.chief.shape == "mesh":
        from pipeline.flight.world.surface import surface_of  # noqa: PLC0415 - the same

        surface_of(experiment.mission)
    guidance = experiment.mission.guidance
    if "train" in experiment.stages and (guidance.kind, guidance.engine) == ("clusters", "sklearn"):
        raise SettingError(
            "guidance.engine is sklearn, which flies one flight at a time; "
            "train with guidance.engine=compiled"
        )
    if "assure" in experiment.stages:
        from pipeline.evaluation.assurance.requirements import check_formulas, check_starts, load_requirements  # noqa: PLC0415 - the same

        requirements = load_requirements(experiment.assurance.requirements, experiment.mission)
        check_formulas(requirements, experiment.mission)
        check_starts(requirements, experiment.monte_carlo)
    _check_fit(experiment)
    if "optimum" in experiment.stages:
        from pipeline.optimum.problem import check_light  # noqa: PLC0415 - compiled code, like the controller's
        from pipeline.optimum.solved import check_points  # noqa: PLC0415 - the same

        check_light(experiment.mission)
        check_points(experiment.mission, experiment.optimum.points)
    if "evaluate" in experiment.stages:
        from pipeline.optimum.solved import IncomparableError, solved_for  # noqa: PLC0415 - the same

        with suppress(IncomparableError):
            solved_for(experiment)
    from pipeline.controllers.source import load, named  # noqa: PLC0415 - compiled code, needed once the rest is right
    from pipeline.flight.control.controller import about_points  # noqa: PLC0415 - the same
    from pipeline.flight.control.law import law_of  # noqa: PLC0415 - the same

    controllers = [load(experiment.controller, experiment.mission)]
    if "assure" in experiment.stages:
        from pipeline.evaluation.assurance.certificates import check_questions  # noqa: PLC0415 - the same

        check_questions(requirements, controllers[0])
    if "train" in experiment.stages:
        from pipeline.training.genome import genome_of  # noqa: PLC0415 - the same

        genome_of(controllers[0], experiment.optimizer.encoding)
    elif "search" not in experiment.stages:
        law_of(controllers[0], experiment.mission)
    names = experiment.compare.controllers if "compare" in experiment.stages else ()
    controllers += [named(name, experiment.mission) for name in names]
    _check_fleet(experiment, controllers)
    for controller in controllers if experiment.mission.problem.kind == "reach" else ():
        if sensed := about_points(controller):
            sys.stderr.write(
                f"note: {controller.name} senses {', '.join(sensed)}, which are about points to inspect, and "
                "there are none where problem.kind is reach\n"
            )


def _check_fleet(experiment: Experiment, controllers: Iterable["Controller"]) -> None:
    """Check that no controller that a fleet flies by plans for one deputy alone."""
    if experiment.mission.has_fleet:
        from pipeline.flight.fly.fleet_controllers import check_controller  # noqa: PLC0415 - compiled code

        for controller in controllers:
            check_controller(experiment.mission, controller)


def _check_fit(experiment: Experiment) -> None:
    """Check that the controllers that a fit scales have rules, and that its goal can be shown."""
    if "fit" in experiment.stages:
        from pipeline.evaluation.fitting import check_goal, load_bases, load_named  # noqa: PLC0415 - compiled code

        check_goal(experiment)
        load_bases(experiment)
        load_named("fit.planners", experiment.fit.planners)
