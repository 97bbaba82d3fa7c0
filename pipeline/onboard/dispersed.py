"""The on-board function of flights whose settings are drawn: one for all of them, or none.

A controller in simulation knows what is drawn for its flight, and its C what it was translated with. So
settings may be dispersed where the C is the same whatever is drawn, as where sensors, thrusters and motion
err.
"""

from collections.abc import Callable
from dataclasses import replace

from pipeline.flight.cases.dispersions import mission_with
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.source import sources
from pipeline.settings.dispersions import Distribution, distributions
from pipeline.settings.experiment import Mission

#: probabilities of the values with which a function is compared: of a normal distribution three deviations
#: off
COMPARED_AT = 0.00135, 0.99865


def of_all_flights(mission: Mission, translated: Callable[[Mission], OnboardProgram]) -> OnboardProgram:
    """Return the on-board function of all flights of a mission, with the mission as it is dispersed.

    Parameters
    ----------
    mission : Mission
    translated : callable
        Translates it with settings that are not drawn.

    Raises
    ------
    NotTranslatableError
        If the function depends on what is drawn for a flight.
    SettingError
        If a flight may draw an impossible value.
    """
    dispersed = distributions(mission.dispersions)
    program = translated(mission_with(mission, ()))
    if not dispersed:
        return program
    code = sources(program).code

    def matters(drawn: Distribution) -> bool:
        missions = (mission_with(mission, ((drawn.key, drawn.value(share)),)) for share in COMPARED_AT)
        return any(sources(translated(flown)).code != code for flown in missions)

    if keys := [drawn.key for drawn in dispersed if matters(drawn)]:
        raise NotTranslatableError(
            f"the on-board function of {program.designed.name!r} depends on {' and '.join(keys)}, of which "
            "each flight draws its own; leave these dispersions out, and export each value by itself"
        )
    return replace(program, mission=mission)
