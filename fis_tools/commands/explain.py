"""`explain`: why this output? which rules moved it, what would flip it, and what each did over a flight."""

import math
from typing import Annotated

from fis_tools.commands.arguments import UserMistake, analysing, expected
from fis_tools.commands.instant import AskedInstant, instants
from fis_tools.document import data
from fis_tools.engines.inference import infer
from fis_tools.findings.explanation import explain, shares
from fis_tools.model import FuzzyController
from fis_tools.words import text

SCHEMA = "fuzzy-explanation"
SCHEMA_VERSION = 2


def run(
    asked: AskedInstant,
    *,
    crossing: Annotated[float | None, expected("a finite number", math.isfinite)] = None,
    steps: bool = False,
    all: bool = False,
    json: bool = False,
) -> None:
    """Tell why: which rules moved the output, what would flip it.

    With --inputs or --time it tells of one inference the share of each rule in the output (Shapley values:
    they add up to its way from the output of no rule), what would be missing without the rule ("needed":
    nothing where others say the same), and the smallest change of one input that flips the output's sign.
    With --flights (or a flight as CONTROLLER) it tells the shares over them. Of a flight it tells about
    forces that were fired; where none was, it says why. --all-periods tells about every inference.

    For example:

        python -m fis_tools explain controller.yaml --inputs distance=80,velocity_body_x=0.05
        python -m fis_tools explain episodes/best.mcap --time 600 --system force_x --crossing=-0.01
        python -m fis_tools explain episodes/best.mcap
        python -m fis_tools explain controller.yaml --flights episodes/*.mcap --all
        python -m fis_tools explain fan.yaml --data room.csv --time 60

    Parameters
    ----------
    crossing
        look for what takes the output across this value, in its unit [default: 0, its sign]
    steps
        tell the inference step by step instead
    all
        tell also the rules that hardly moved anything
    json
        print it for programs (schema fuzzy-explanation, version 2)
    """
    if asked.inputs is not None and asked.flights:
        raise UserMistake("--flights are for the share of each rule over them; drop --inputs, or the flights")
    if steps and (json or crossing is not None):
        raise UserMistake("--steps go without --json and --crossing; drop one of them")
    controller = asked.read()
    if asked.is_instant or not asked.paths:
        print(_of_instants(asked, controller, crossing or 0.0, steps, all, json), end="")
        return
    if steps or crossing is not None:
        raise UserMistake("--steps and --crossing are about one inference; add --time SECONDS or --inputs")
    print(_over_flights(asked, controller, all, json), end="")


def _of_instants(
    asked: AskedInstant, controller: FuzzyController, crossing: float, steps: bool, all: bool, json: bool
) -> str:
    found = list(instants(asked, controller))
    silent = [f"{one.note}\n" for one in found if one.note]
    if steps:
        steps_of = [text.explain(infer(one.system, one.inputs)) for one in found if one.inputs is not None]
        return "\n".join([*steps_of, *silent])
    try:
        with analysing(controller):
            explained = [explain(one.system, one.inputs, crossing) for one in found if one.inputs is not None]
    except ValueError as error:
        raise UserMistake(str(error)) from error
    if json:
        plain = [one.plain() for one in explained]
        idle = [{"system": one.system.name, "words": one.note} for one in found if one.inputs is None]
        return data.write(SCHEMA, SCHEMA_VERSION, {"explanations": plain, "not_fired": idle})
    return "\n".join([*(one.text(everything=all) for one in explained), *silent])


def _over_flights(asked: AskedInstant, controller: FuzzyController, all: bool, json: bool) -> str:
    flown = asked.flown(controller) or {}
    with analysing(controller):
        found = {
            system.name: shares(system, flown[system.name]) if len(flown.get(system.name, ())) else None
            for system in controller.systems
        }
    if json:
        plain = [one.plain() for one in found.values() if one is not None]
        return data.write(SCHEMA, SCHEMA_VERSION, {"shares": plain})
    return "\n".join(
        f"{name}: it never fired anything on these flights\n" if one is None else one.text(everything=all)
        for name, one in found.items()
    )
