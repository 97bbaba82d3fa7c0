"""What an on-board function is given and answers: the table from which all that crosses its edge is written.

Header, input checks, packets, the interface's page and the wrappers are templates over these fields, and test
vectors have their layout, so that a field is named, bounded and explained once.
"""

from typing import NamedTuple

from pipeline.onboard.fields import POINTS, InterfaceField
from pipeline.settings.fleet import Fleet

#: a step's Sun is not that of the start, turned on, where they are farther apart
APART_DEG = 4.0


class InputSource(NamedTuple):
    """What measures some inputs, which have one age, and the bit of the status where that is too great."""

    name: str
    bit: int
    about: str


SOURCES = (
    InputSource("navigation", 512, "position and velocity were estimated"),
    InputSource("attitude", 1024, "the attitude was measured"),
    InputSource("sun", 2048, "the Sun's direction was computed"),
    InputSource("points", 4096, "the points not inspected were counted"),
)


def _sun(name: str, about: str, member: str, source: str = "", step_bit: str = "") -> InterfaceField:
    return InterfaceField(
        name,
        "double",
        f"cosine and sine of {about}",
        2,
        is_unit=True,
        source=source,
        bit="BAD_SUN",
        member=member,
        step_bit=step_bit,
        start=(1.0, 0.0),
    )


ANGLE, ELEVATION = "the Sun's angle in the orbit plane", "the Sun's elevation over that plane"
START = (
    _sun("sun_angle", ANGLE, "sun_at_start", step_bit="START_SUN"),
    _sun("sun_elevation", ELEVATION, "height_at_start", step_bit="START_SUN"),
    InterfaceField(
        "counts",
        "flags",
        "not 0 where a point counts",
        POINTS,
        member="unseen",
        step_bit="START_POINTS",
        start=1.0,
    ),
)
STEP = (
    InterfaceField("period", "int", "of control, from 0 on", limits=(0, "last_period"), bit="BAD_PERIOD"),
    InterfaceField("is_given", "int", "not 0 where given_n is fired instead of what the rules ask for"),
    *(
        InterfaceField(
            f"age_{source.name}",
            "int",
            f"control periods since {source.about}; 0 in this one",
            limits=(0, source.name),
            bit=f"OLD_{source.name.upper()}",
        )
        for source in SOURCES
    ),
    InterfaceField(
        "position_m",
        "double",
        "estimated, from the chief to the deputy",
        3,
        "m",
        "Hill axes",
        limits=("-reach_m", "reach_m"),
        is_nonzero=True,
        source="navigation",
        bit="BAD_POSITION",
        member="belief_position",
    ),
    InterfaceField(
        "velocity_m_s",
        "double",
        "estimated, relative to Hill axes",
        3,
        "m/s",
        "Hill axes",
        limits=("-speed_m_s", "speed_m_s"),
        source="navigation",
        bit="BAD_VELOCITY",
        member="belief_velocity",
    ),
    InterfaceField(
        "attitude",
        "double",
        "quaternion, scalar last",
        4,
        "",
        "from Hill to body axes",
        is_unit=True,
        source="attitude",
        bit="BAD_ATTITUDE",
        member="belief_attitude",
        start=(0.0, 0.0, 0.0, 1.0),
    ),
    _sun("sun_angle", ANGLE, "sun", "sun"),
    _sun("sun_elevation", ELEVATION, "sun_height", "sun"),
    InterfaceField(
        "given_n",
        "double",
        "chosen on the ground, such as a rehearsed push",
        3,
        "N",
        "Hill axes",
        limits=(-1e6, 1e6),
        only_with="is_given",
        bit="BAD_GIVEN",
    ),
    InterfaceField(
        "unseen",
        "flags",
        "not 0 where a point counts and is not inspected",
        POINTS,
        source="points",
        member="unseen",
        start=1.0,
    ),
)
#: and how far the estimate may be off, where plans are made again: without it the last one is flown on
STEP_AND_COVARIANCE = (
    *STEP,
    InterfaceField(
        "covariance",
        "double",
        "of position and velocity as estimated, row by row",
        36,
        "m^2, m^2/s, m^2/s^2",
        "Hill axes",
        limits=("-square_m2", "square_m2"),
        bit="BAD_COVARIANCE",
    ),
)


def of_others(fleet: Fleet) -> tuple[InterfaceField, ...]:
    """Return what a step is given of each other deputy from which one is kept apart; in one order in all."""
    delay = fleet.delay_periods
    return tuple(
        field
        for number in range(1, fleet.deputies)
        for field in (
            InterfaceField(
                f"age_other_{number}",
                "int",
                "control periods since another deputy told where it would stop; negative where not heard",
                limits=(delay, delay),
                bit="OLD_OTHERS",
                start=-1.0,
            ),
            InterfaceField(
                f"other_{number}_stop_m",
                "double",
                "where it would stop, as it told; in period 0 heard or not",
                3,
                "m",
                "Hill axes",
                limits=("-reach_m", "reach_m"),
                source=f"other_{number}",
                bit="BAD_OTHERS",
            ),
        )
    )


OUTPUT = (
    InterfaceField("code", "word", "CONTROLLER_ID"),
    InterfaceField("status", "int", "bits of what is wrong: CONTROLLER_BAD_*, CONTROLLER_OLD_*"),
    InterfaceField("mode", "int", "what decided: CONTROLLER_MODE_*"),
    InterfaceField("force_n", "double", "to fire until the next step", 3, "N", "Hill axes"),
    InterfaceField("inferred_n", "double", "what the fuzzy systems ask for", 3, "N", "{axes} axes"),
    InterfaceField("reason", "reason", "of each component of inferred_n", 3),
    InterfaceField("leading_rule", "int", "that fires most strongly for each, from 1 on; 0 for none", 3),
    InterfaceField("safety_limit", "int", "for which the force was changed: {limits}"),
)
#: an uplink of a parameter, and what is answered
CHANGE = (
    InterfaceField("parameter", "int", "CONTROLLER_PARAMETER_*"),
    InterfaceField("value", "double", "in the unit of the parameter"),
)
CHANGED = (
    InterfaceField("parameter", "int", "CONTROLLER_PARAMETER_*"),
    InterfaceField("status", "int", "0, or CONTROLLER_BAD_PARAMETERS where nothing was changed"),
    InterfaceField("value", "double", "read back: what the parameter is now, 0 where there is none"),
)
#: what the export is required to do, by the id that stands beside the code that serves it
REQUIREMENTS = {
    "B1": "It commands what the controller commands in simulation, bit for bit.",
    "B2": "An input out of its range sets a bit of the status.",
    "B3": "An input that is too old sets a bit of the status.",
    "B4": "Where an input is missing, what needs it gives way: rules, a plan, collision avoidance.",
    "B5": "A parameter out of its range is refused, and what it is then is answered.",
    "B6": "Collision avoidance needs position and velocity, and no more than it reads.",
    "B7": "Messages are the same octets on every processor.",
    "B8": "Before a start that is well, nothing is fired.",
    "B9": "What a start was given is held against each step; where it does not fit, the rules give way.",
}
#: what messages are, by the name of their structure
ABOUTS = {
    "start_input": "The Sun in period 0, also after a restart in flight, and the points that count.",
    "step_input": "What is known at the beginning of a control period.",
    "output": "What is fired, and why.",
    "change_input": "A parameter's new value.",
    "change_output": "What became of it.",
}
#: bits of the status that no field of a step sets alone
OTHER_BITS = {
    "BAD_START": (64, "controller_start() was not called, or returned another status than 0"),
    "BAD_PARAMETERS": (128, "a parameter is out of its range"),
    "STALE": (256, "a host sets it where no new input came since the last step"),
}
#: bits that a step sets where a field of the start does not go with it
START_BITS = {
    "START_SUN": (8192, f"the Sun is over {APART_DEG:g}° from where that of the start has turned to"),
    "START_POINTS": (16384, "a point is to be inspected that did not count at the start"),
}
#: numbers of bits that a field of a step sets
FIELD_BITS = {
    **{"BAD_PERIOD": 1, "BAD_POSITION": 2, "BAD_VELOCITY": 4, "BAD_ATTITUDE": 8, "BAD_SUN": 16},
    **{"BAD_GIVEN": 32, "BAD_COVARIANCE": 32768, "BAD_OTHERS": 65536, "OLD_OTHERS": 131072},
    **{f"OLD_{source.name.upper()}": source.bit for source in SOURCES},
}
#: the reason of a component where the rules lack an input; the others are those of flights
INPUT_REASON = 9
MODES = {
    "OFF": "nothing is fired",
    "SAFETY": "collision avoidance alone, which asks for no force but to keep the limits",
    "RULES": "the rules",
    "PLAN": "a plan, made on board or given from the ground",
}
