"""The thrust logic in C: one function that a flight computer calls once in each control period.

`fis_tools.model.thrust` says what it is. The function does what `pipeline.flight.period.decide.thrust`
does, but for the safety layer, which is no part of the controller.
"""

from collections.abc import Iterator, Mapping
from textwrap import wrap

from fis_tools.model import FuzzyController, Variable
from fis_tools.model.thrust import COMPONENTS, FORESEEN, REASONS, SILENT_N, ThrustLogic

#: reasons that the safety layer alone gives are not in C
_REASONS = tuple(word for word in REASONS if word not in {"safety", "rehearsed"})

#: words that no member of a structure may be called
_KEYWORDS = frozenset(
    {
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum"),
        *("extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return"),
        *("short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void"),
        *("volatile", "while", "attitude", "is_complete"),
    }
)

#: unit and meaning of what coasting is decided by
_FORESEEN = {
    "missed": ("", "how many points coasting to the end would leave unseen"),
    "coasting_nearest": ("m", "least distance on the way"),
    "coasting_farthest": ("m", "greatest distance on the way"),
}

ABOUT = (
    "Call start() once, and step() once at the beginning of each control period. step() tells what is fired "
    "until the next call, as the recorded flights fired it. It is given the signals, and of the mission what "
    "the thrust logic needs. A safety layer, where one flies, comes after it, a rehearsed push before it.",
    "A signal that is not a number asks for nothing. Signals are read only where inference decides, what "
    "coasting is decided by only where a force is decided on; members that are not read may hold anything.",
)

RULES = (
    "Written with MISRA C:2012 in mind: no recursion, no allocation, no variable but the caller's outlives a "
    "call, every loop is bounded by the size of a table, one declaration a line, no macros. The addon misra "
    "of cppcheck finds no rule broken that is required; of the advisory ones tables stand together before "
    "the functions (8.9), the order of operators is C's (12.1), and functions may return early (15.5). "
    "Numbers are compared with 0 exactly where that is meant."
)


def members(controller: FuzzyController, logic: ThrustLogic) -> Mapping[str, tuple[str, str, str]]:
    """Return what `step` is told as signals: member of the structure by signal, its unit, what it is.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.

    Returns
    -------
    mapping of str to (str, str, str)
        In the order of the members.
    """
    sensed: dict[str, Variable] = {v.name: v for system in controller.systems for v in system.inputs}
    found: dict[str, tuple[str, str, str]] = {}
    taken: set[str] = set()
    foreseen = _FORESEEN if logic.may_coast else {}
    for name in dict.fromkeys([*sensed, *foreseen]):
        word = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name) or "_"
        if word[0].isdigit() or word in _KEYWORDS:
            word = f"signal_{word}"
        while word in taken:
            word += "_"
        taken.add(word)
        unit, about = foreseen.get(name, ("", ""))
        if name in sensed:
            unit, about = sensed[name].unit, sensed[name].description or about
        found[name] = (word, unit, about)
    return found


def structures(controller: FuzzyController, logic: ThrustLogic) -> Iterator[str]:
    """Write what `step` is told and what it gives back."""
    yield "/* What became of a component of the force over a control period. */"
    yield "enum reason {"
    for word in _REASONS:
        yield f"    REASON_{word.upper()}, /* {REASONS[word]} */"
    yield "};\n"
    yield "/* What is carried from one control period to the next; start() fills it. */"
    yield "struct step_state {"
    yield "    int periods_to_wait; /* until the next decision */"
    yield "};\n"
    yield "/* What is measured or computed at the beginning of a control period. */"
    yield "struct step_signals {"
    for word, unit, about in members(controller, logic).values():
        told = ", ".join(filter(None, (unit, about)))
        yield from wrap(f"/* {_plain(told)} */", 100, initial_indent="    ", subsequent_indent="     * ")
        yield f"    double {word};"
    if logic.is_turned:
        yield "    double attitude[4]; /* quaternion from the axes of fired_n to body axes, scalar last */"
    yield "    int is_complete; /* whether every point is inspected; not 0 means yes */"
    yield "};\n"
    yield "/* What the mission sets. */"
    yield "struct step_mission {"
    yield "    double max_force_n; /* greatest force along each axis of fired_n */"
    if logic.decision_period_s > 0.0:
        yield "    double control_period_s; /* of which the decision period is a whole number */"
    if logic.may_coast:
        yield "    double min_distance_m; /* least distance allowed */"
        yield "    double max_distance_m; /* greatest distance allowed */"
    yield "    int coasts_when_complete; /* whether nothing is fired once every point is inspected */"
    yield "};\n"
    yield "/* What is fired until the next call, and why. */"
    yield "struct step_force {"
    yield f"    double fired_n[3]; /* {_plain(_fired_axes(logic))} */"
    yield f"    double asked_n[3]; /* by the fuzzy systems, {_axes(logic)} axes */"
    yield "    enum reason reason[3]; /* of each component, in the same axes */"
    yield "};\n"
    yield "void start(struct step_state *state);"
    yield "void step(struct step_state *state, const struct step_signals *signals,"
    yield "          const struct step_mission *mission, struct step_force *force);"


def functions(controller: FuzzyController, logic: ThrustLogic, infer: Mapping[str, str]) -> Iterator[str]:
    """Write `start` and `step`.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.
    infer : mapping of str to str
        The function that infers a system, by the system's name.
    """
    words = {name: member for name, (member, _, _) in members(controller, logic).items()}
    yield _START
    if logic.decision_period_s > 0.0:
        yield _decision(logic.decision_period_s)
    if logic.may_coast:
        yield _coasting(logic, words)
    yield from _asking(controller, infer, words)
    yield _turn_back(logic)
    yield _step(logic)


_START = """\
void start(struct step_state *state)
{
    state->periods_to_wait = 0;
}
"""


def _decision(period_s: float) -> str:
    return f"""\
/* How many control periods a decision is from the next: decision_period_s {period_s!r}. */
static int periods_of_a_decision(const struct step_mission *mission)
{{
    const double periods = floor({period_s!r} / mission->control_period_s + 0.5);

    if (!(periods > 1.0)) {{
        return 1;
    }}
    return periods < 32767.0 ? (int)periods : 32767;
}}
"""


def _coasting(logic: ThrustLogic, words: Mapping[str, str]) -> str:
    missed, nearest, farthest = (words[name] for name in FORESEEN)
    return f"""\
/* Whether coasting to the end shows enough: coast_below_points, coast_margin_m. */
static bool may_coast(const struct step_signals *signals, const struct step_mission *mission)
{{
    const double nearest = mission->min_distance_m + {logic.coast_margin_m!r};
    const double farthest = mission->max_distance_m - {logic.coast_margin_m!r};

    return signals->{missed} < {logic.coast_below_points!r} && signals->{nearest} >= nearest &&
           signals->{farthest} <= farthest;
}}
"""


def _asking(controller: FuzzyController, infer: Mapping[str, str], words: Mapping[str, str]) -> Iterator[str]:
    yield "/* What the fuzzy systems ask for; nothing where one has no answer. */"
    yield "static void ask(const struct step_signals *signals, double asked[3])"
    yield "{"
    for place, system in enumerate(controller.systems):
        yield f"    double inputs_{place}[{len(system.inputs)}];"
    yield "    int axis;\n"
    for place, system in enumerate(controller.systems):
        for index, variable in enumerate(system.inputs):
            yield f"    inputs_{place}[{index}] = signals->{words[variable.name]};"
        axis = COMPONENTS.index(system.outputs[0].name)
        yield f"    asked[{axis}] = {infer[system.name]}(inputs_{place});"
    yield "    for (axis = 0; axis < 3; ++axis) {"
    yield "        if (isnan(asked[axis]) != 0) {"
    yield "            asked[axis] = 0.0;"
    yield "        }"
    yield "    }"
    yield "}\n"


def _turn_back(logic: ThrustLogic) -> str:
    if not logic.is_turned:
        return ""
    return """\
/* Turn a force from body axes to those in which it is fired. */
static void turn_back(const double attitude[4], const double body[3], double fired[3])
{
    const double q1 = attitude[0];
    const double q2 = attitude[1];
    const double q3 = attitude[2];
    const double q4 = attitude[3];

    fired[0] = (q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4) * body[0] + 2.0 * (q1 * q2 - q3 * q4) * body[1] +
              2.0 * (q1 * q3 + q2 * q4) * body[2];
    fired[1] = 2.0 * (q1 * q2 + q3 * q4) * body[0] + (-q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4) * body[1] +
              2.0 * (q2 * q3 - q1 * q4) * body[2];
    fired[2] = 2.0 * (q1 * q3 - q2 * q4) * body[0] + 2.0 * (q2 * q3 + q1 * q4) * body[1] +
              (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4) * body[2];
}
"""


def _step(logic: ThrustLogic) -> str:
    bands = ", ".join(map(repr, logic.dead_bands_n))
    is_body = logic.is_turned
    lines = [
        "/* One control period of the thrust logic. */",
        "void step(struct step_state *state, const struct step_signals *signals,",
        "          const struct step_mission *mission, struct step_force *force)",
        "{",
        f"    static const double dead_bands[3] = {{{bands}}};",
        "    const bool is_complete = signals->is_complete != 0 && mission->coasts_when_complete != 0;",
        "    const bool is_decision = state->periods_to_wait <= 0;",
        "    double commanded[3] = {0.0, 0.0, 0.0};",
        "    enum reason resting = REASON_FIRED;",
        *(["    int is_clipped = 0;"] if is_body else []),
        "    int axis;",
        "",
        "    if (is_decision) {",
        "        state->periods_to_wait = periods_of_a_decision(mission);"
        if logic.decision_period_s > 0.0
        else "        state->periods_to_wait = 1;",
        "    }",
        "    state->periods_to_wait -= 1;",
        "    if (is_complete) {",
        "        resting = REASON_COMPLETE;",
        "    } else if (!is_decision) {",
        "        resting = REASON_WAITING;",
        *(
            [
                "    } else if (may_coast(signals, mission)) {",
                "        resting = REASON_COASTING;",
            ]
            if logic.may_coast
            else []
        ),
        "    } else {",
        "        resting = REASON_FIRED;",
        "    }",
        "    for (axis = 0; axis < 3; ++axis) {",
        "        force->asked_n[axis] = 0.0;",
        "        force->reason[axis] = resting;",
        "    }",
        "    if (resting == REASON_FIRED) {",
        "        ask(signals, force->asked_n);",
        "        for (axis = 0; axis < 3; ++axis) {",
        "            if (fabs(force->asked_n[axis]) >= dead_bands[axis]) {",
        "                commanded[axis] = force->asked_n[axis];",
        "            } else {",
        "                force->reason[axis] = REASON_DEAD_BAND;",
        "            }",
        f"            if (fabs(force->asked_n[axis]) < {SILENT_N!r}) {{",
        "                force->reason[axis] = REASON_SILENT;",
        "            }",
        "        }",
        "    }",
    ]
    if is_body:
        lines += ["    turn_back(signals->attitude, commanded, force->fired_n);"]
    lines += ["    for (axis = 0; axis < 3; ++axis) {"]
    if not is_body:
        lines += ["        force->fired_n[axis] = commanded[axis];"]
    mark = "is_clipped = 1;" if is_body else "force->reason[axis] = REASON_CLIPPED;"
    lines += [
        "        if (force->fired_n[axis] > mission->max_force_n) {",
        "            force->fired_n[axis] = mission->max_force_n;",
        f"            {mark}",
        "        } else if (force->fired_n[axis] < -mission->max_force_n) {",
        "            force->fired_n[axis] = -mission->max_force_n;",
        f"            {mark}",
        "        } else {",
        "            /* within the greatest force */",
        "        }",
        "    }",
    ]
    if is_body:
        lines += [
            "    for (axis = 0; axis < 3; ++axis) {",
            "        if (is_clipped != 0) {",
            "            force->reason[axis] = REASON_CLIPPED;",
            "        }",
            "    }",
        ]
    return "\n".join([*lines, "}", ""])


def _axes(logic: ThrustLogic) -> str:
    return "body" if logic.is_turned else "the same"


def _fired_axes(logic: ThrustLogic) -> str:
    axes = "in the axes that attitude turns from" if logic.is_turned else f"{logic.force_axes} axes"
    return f"fired, {axes}"


def _plain(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
