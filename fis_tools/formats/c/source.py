"""Controllers as C99: one file that stands alone, for flight code and hardware in the loop.

What is written takes the steps of `fis_tools.engines.inference` in the same order and with the same
arithmetic. Tables are constant, loops bounded, nothing is allocated, nothing global changes, and of the
library only ``math.h`` and ``stdbool.h`` are included.

A file has the functions that it calls: of ``parts.c``, or transcribed from those that Python runs. Of the
thrust logic there is one function, called once in each control period: `fis_tools.model.thrust` says what it
is. The function does what `pipeline.flight.period.decide.thrust` does, but for the safety layer, which is no
part of the controller.
"""

from fis_tools import model
from fis_tools.formats import rendered
from fis_tools.formats.c.library import called
from fis_tools.formats.c.step import step_functions, step_structures
from fis_tools.formats.c.system import System
from fis_tools.formats.c.text import OPENING, WARNINGS, comment, identifiers
from fis_tools.model import FuzzyController, FuzzySystem, thrust
from fis_tools.model.intervals import require_type_1
from fis_tools.model.thrust import ThrustLogic
from fis_tools.model.trees import require_unwired

#: what the written file compiles with
FLAGS = " ".join(("-std=c99", *WARNINGS, "-Wstrict-prototypes", "-Wmissing-prototypes"))


def write(controller: FuzzyController, bare: bool = False) -> str:
    """Write a controller as one C99 source file.

    A controller that commands a force becomes ``void step(state, signals, mission, force)``, inference and
    `fis_tools.model.ThrustLogic`, which a flight computer calls once in each control period. Any other
    controller becomes a function a system: one with one output ``double infer_NAME(const double inputs[K])``,
    one with several ``void infer_NAME(const double inputs[K], double outputs[M])``.

    Inputs stand in the system's order and are clipped to their universes; if one is NaN, so is every output.
    Where no rule fires an output is its default, or NaN where it has none. Numbers are the shortest decimals
    that read back as the same doubles.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    bare : bool
        Write a function a system, ``bare_infer_NAME``, without the thrust logic of a controller that has one.

    Raises
    ------
    ValueError
        If an attribute of the thrust logic is no number, a rule concludes a formula, or the controller plans
        its pushes ahead or parks.
    """
    require_type_1(controller.systems, "C")
    require_unwired([controller], "C")
    logic = thrust.thrust_logic(controller)
    has_step = logic is not None and not bare
    if has_step and logic is not None and logic.plans_ahead:
        raise ValueError(
            f"controller {controller.name!r} plans its pushes ahead (foresight_pushes), which C source does "
            "not; write its rules alone with --bare, or leave foresight_pushes out"
        )
    if has_step and logic is not None and logic.parks:
        raise ValueError(
            f"controller {controller.name!r} parks (park_below_points), which takes more than its "
            "rules; write its rules alone with --bare, or all of it with python -m pipeline export_c"
        )
    prefix = "infer" if logic is None or has_step else "bare_infer"
    words = identifiers(system.name for system in controller.systems)
    systems = [System(name, system) for name, system in zip(words, controller.systems, strict=True)]
    names = [f"{prefix}_{name}" for name in words]
    static = "static " if has_step else ""
    signatures = [
        static + _signature(name, system.system) for name, system in zip(names, systems, strict=True)
    ]
    needed = [system.text(signature) for system, signature in zip(systems, signatures, strict=True)]
    declared = [f"{signature};" for signature in signatures]
    if logic is not None and has_step:
        infer = dict(zip((system.system.name for system in systems), names, strict=True))
        needed.append(step_functions(controller, logic, infer))
        declared.insert(0, step_structures(controller, logic).rstrip())
    shared = called("".join(needed))
    return "\n".join([_header(controller, logic, has_step), OPENING, *declared, "", *shared, *needed])


def function_name(system: FuzzySystem) -> str:
    """Return the name of the function that infers a system, written alone."""
    return f"infer_{identifiers([system.name])[0]}"


def _signature(name: str, system: FuzzySystem) -> str:
    """Return a function's declaration without its end."""
    inputs = f"const double inputs[{len(system.inputs)}]"
    if len(system.outputs) == 1:
        return f"double {name}({inputs})"
    return f"void {name}({inputs}, double outputs[{len(system.outputs)}])"


def _header(controller: FuzzyController, logic: ThrustLogic | None, has_step: bool) -> str:
    """Return the comment at the top of the file: what it holds, attributes, and provenance."""
    text = rendered(
        "c/head.jinja",
        controller=controller,
        logic=logic,
        has_step=has_step,
        warnings=FLAGS,
        titles=dict.fromkeys(model.TOOLS[system.semantics].title for system in controller.systems),
    )
    title, *paragraphs = (" ".join(paragraph.split()) for paragraph in text.split("\n\n"))
    facts = [f"{key}: {value}" for key, value in (*controller.attributes, *controller.provenance)]
    lines = (line for paragraph in paragraphs for line in ("", paragraph))
    return comment([title, *(["", *facts] if facts else []), *lines])
