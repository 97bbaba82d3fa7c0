"""`audit`, `explain`, `diff`, `simplify`: what is found in a controller, reported."""

import math
import shutil
from collections.abc import Sequence
from dataclasses import fields, replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter, Token

from fis_tools.analysis import flights
from fis_tools.commands import arguments
from fis_tools.commands.arguments import FlightArguments, InstantArguments, Output, analysing
from fis_tools.engines.inference import infer
from fis_tools.errors import Mistake, raised_as, require_known
from fis_tools.findings import audit as faults
from fis_tools.findings import explanation, simplification
from fis_tools.findings.audit import Severity, Thresholds, report
from fis_tools.findings.difference import difference
from fis_tools.findings.simplification import Budget
from fis_tools.model import FuzzyController, tree
from fis_tools.model.trees import require_unwired
from fis_tools.source import read_controller
from fis_tools.words import text as wording
from plain_files.document import as_json, text
from plain_files.plain_text import as_number

#: A terminal of another width than this is taken as this.
NARROWEST, WIDEST = 60, 120


def audit(
    args: FlightArguments,
    *,
    json: bool = False,
    fail_on: Literal["note", "warning", "serious"] | None = None,
    thresholds: str = "",
) -> int:
    """List what a reviewer should know: gaps, slips, idle rules.

    The exit status is 0; with --fail-on it is 1 where a finding is that severe or worse; a mistake
    gives 2.

    For example:

        python -m fis_tools audit controller.yaml
        python -m fis_tools audit controller.yaml --flights episodes/*.mcap --fail-on serious
        python -m fis_tools audit episodes/best.mcap --json > audit.json
        python -m fis_tools audit controller.yaml --thresholds coverage=0.5,look_alike=0.6

    Thresholds, shares from 0 to 1 but for the last two:

    - fired (0.05): a rule counts as fired, and a value as covered at all, from this strength on
    - coverage (0.2): each value should belong to a term, and each input to a rule, this much
    - look_alike (0.7): terms that share more of their areas mean the same
    - possibility (0.85): terms that hold together by more are hard to tell apart
    - inside (0.9): a term of which more lies under another one says little of its own
    - zero (0.8): how much 0 should belong to a term called zero
    - jump (0.55): neighbouring rules should differ by no more of the output's range
    - against (0.25): up to this share of steps against the rest, an input counts as meant to act one way
    - asymmetry (0.1): no more of the pairs of rules should break a symmetry that the others have
    - reversal (0.1): the least way back of an output that counts, of its range
    - consistency (0.3): the least consistency of a rule
    - reach (0.5): an output should reach this much of its range
    - clipped (0.05): an input should lie outside its range in no more of the inferences
    - dead (0.5): no more of the rules should never fire on flights
    - dominant (0.6): no rule should lead, or matter, by more
    - idle (0.001): a rule should move an output by more of its range on average
    - rules (60): the most rules of a system
    - terms (9): the most terms of a variable

    Parameters
    ----------
    json
        print it for programs (schema fuzzy-audit, version 2)
    fail_on
        end with status 1 if a finding is that severe or worse
    thresholds
        what counts as a finding: NAME=NUMBER,NAME=NUMBER
    """
    controller = args.read()
    limits = _thresholds(thresholds)
    with analysing(controller):
        audited = faults.audit(controller, args.flown(controller), limits)
    if json:
        print(as_json(report.SCHEMA, report.SCHEMA_VERSION, audited.plain()), end="")
    else:
        width = min(WIDEST, max(NARROWEST, shutil.get_terminal_size((text.WIDTH, 24)).columns))
        print(text.write(audited.document(), width), end="")
    return 0 if fail_on is None else int(bool(audited.at_least(Severity[fail_on.upper()])))


def _thresholds(words: str) -> Thresholds:
    """Return the thresholds of an audit with some of them replaced, as ``NAME=NUMBER,...`` says."""
    values = arguments.assignments(words)
    defaults = {field.name: field.default for field in fields(Thresholds)}
    require_known(values, defaults, "there is no threshold", Mistake)
    for name, value in values.items():
        is_share = isinstance(defaults[name], float)  # the others are counts
        if value < 0.0 or (is_share and value > 1.0):
            right = "a share from 0 to 1" if is_share else "a number that is not below 0"
            raise Mistake(f"the threshold {name!r} is {value:g}; give {right}")
    return replace(Thresholds(), **values)  # type: ignore[arg-type]


EXPLANATION = ("fuzzy-explanation", 2)


def explain(
    args: InstantArguments,
    *,
    crossing: Annotated[float | None, arguments.expected("a finite number", math.isfinite)] = None,
    steps: bool = False,
    all: bool = False,
    json: bool = False,
) -> None:
    """Explain an output: which rules moved it, what would flip it.

    With --inputs or --time it explains one inference: the share of each rule in the output (Shapley values,
    which add up to how far all rules moved it), what would be missing without the rule ("needed": nothing
    where others say the same), and the smallest change of one input that flips the output's sign. With
    --flights (or a flight as CONTROLLER) it gives the shares over all inferences whose force was fired; with
    --all-periods, over every one. Where no force was fired, --time says why. It also says which points the
    inputs come from, and what was simulated, if the flight holds that. Wired systems are explained as a
    whole, through the wires, then one by one.

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
        show the inference step by step instead
    all
        list also the rules that hardly moved anything
    json
        print it for programs (schema fuzzy-explanation, version 2)
    """
    if args.inputs is not None and args.flights:
        raise Mistake("--flights are for the share of each rule over them; drop --inputs, or the flights")
    if steps and (json or crossing is not None):
        raise Mistake("--steps go without --json and --crossing; drop one of them")
    controller = args.read()
    if controller.wires and not steps and args.time is None:
        print(_of_chain(args, controller, crossing or 0.0, all, json), end="")
        return
    if args.is_instant or not args.paths:
        print(_of_instants(args, controller, crossing or 0.0, steps, all, json), end="")
        return
    if steps or crossing is not None:
        raise Mistake("--steps and --crossing are about one inference; add --time SECONDS or --inputs")
    print(_over_flights(args, controller, all, json), end="")


def _of_chain(
    args: InstantArguments, controller: FuzzyController, crossing: float, all: bool, json: bool
) -> str:
    """Return the explanation of wired systems as one, as text or JSON."""
    require_unwired([controller] if args.paths else [], "the share of rules along a log")
    whole = tree(controller)
    with raised_as(Mistake, ValueError), analysing(controller):
        explained = explanation.explain(whole, arguments.given_to(args.inputs or "", whole), crossing)
    return (
        as_json(*EXPLANATION, {"explanations": [explained.plain()]})
        if json
        else explained.text(everything=all)
    )


def _of_instants(
    args: InstantArguments, controller: FuzzyController, crossing: float, steps: bool, all: bool, json: bool
) -> str:
    """Return the explanations of single inferences, given by hand or logged, as text or JSON."""
    chosen = list(arguments.instants(args, controller))
    silent = [f"{instant.note}\n" for instant in chosen if instant.note]
    if steps:
        steps_of = [
            wording.explain(infer(instant.system, instant.inputs))
            for instant in chosen
            if instant.inputs is not None
        ]
        return "\n".join([*steps_of, *silent])
    with raised_as(Mistake, ValueError), analysing(controller):
        explained = [
            explanation.explain(instant.system, instant.inputs, crossing, instant.points)
            for instant in chosen
            if instant.inputs is not None
        ]
    path, time_s = (args.paths[0], args.time) if args.time is not None else ("", 0.0)
    now, rehearsed = flights.read_points(path, time_s), flights.read_rehearsals(path, time_s)
    if json:
        plain = [result.plain() for result in explained]
        idle = [
            {"system": instant.system.name, "words": instant.note}
            for instant in chosen
            if instant.inputs is None
        ]
        more: dict[str, Any] = {"rehearsed": rehearsed} if rehearsed else {}
        if now is not None and now.is_missed is not None:
            more["missed"] = np.flatnonzero(now.is_missed).tolist()
        return as_json(*EXPLANATION, {"explanations": plain, "not_fired": idle, **more})
    ahead = [text.write(explanation.rehearsed(what, ways, all)) for what, ways in rehearsed.items()]
    seen = explanation.missed(now) if now is not None else None
    missed = [text.write(seen)] if seen is not None else []
    return "\n".join([*(result.text(everything=all) for result in explained), *silent, *missed, *ahead])


def _over_flights(args: InstantArguments, controller: FuzzyController, all: bool, json: bool) -> str:
    """Return each rule's share in the outputs along flights, as text or JSON."""
    flown = args.flown(controller) or {}
    with analysing(controller):
        shares = {
            system.name: explanation.shares(system, flown[system.name])
            if len(flown.get(system.name, ()))
            else None
            for system in controller.systems
        }
    if json:
        plain = [each.plain() for each in shares.values() if each is not None]
        return as_json(*EXPLANATION, {"shares": plain})
    return "\n".join(
        f"{name}: it never fired anything on these flights\n" if each is None else each.text(everything=all)
        for name, each in shares.items()
    )


def diff(
    args: FlightArguments, after: str, *, json: bool = False, exit_code: bool = False, output: Output = None
) -> int:
    """Tell what changed from one controller to another.

    For each term it says how far it moved and how much of its area is still shared. Rules are compared by
    what they ask for, whatever their order; outputs are compared over 4096 inputs spread over the ranges
    (fewer for outputs of more than 48,000 points), and along --flights.

    The exit status is 0; with --exit-code it is 1 where something changed; a mistake gives 2.

    For example:

        python -m fis_tools diff before.yaml after.yaml
        python -m fis_tools diff before.yaml outputs/train/TIME --flights episodes/*.mcap
        python -m fis_tools diff before.yaml after.fis --exit-code
        python -m fis_tools diff before.yaml after.yaml -o diff.html

    Parameters
    ----------
    after
        the controller that CONTROLLER is compared with
    json
        print it for programs (schema fuzzy-difference, version 1)
    exit_code
        end with status 1 if anything changed
    output
        a page (.html), or the same as is printed [default: printed]
    """
    is_page = not json and Path(output or "").suffix.lower() in {".html", ".htm"}
    if is_page:  # a missing package is reported before anything is computed
        import_module("fis_tools.render")
    paths = (args.controller, after)
    old, new = (arguments.chosen(read_controller(path, args.trust), args.system) for path in paths)
    samples = arguments.flown_inputs(args.flights, new, args.all_periods)
    with analysing(old, new):
        differences = difference(old, new, samples, paths)
    if json:
        content = as_json("fuzzy-difference", 1, differences.plain())
    else:
        content = differences.html() if is_page else differences.text()
    arguments.write(output, content)
    return int(exit_code and not differences.is_empty)


DEFAULTS = Budget()


def _share(_kind: object, tokens: Sequence[Token]) -> float:
    """Read ``5%`` or ``0.05``."""
    word = tokens[0].value.strip()
    value = as_number(word.removesuffix("%"))
    whole = 100.0 if word.endswith("%") else 1.0
    if value is None or not 0.0 <= value / whole <= 1.0:
        raise ValueError(f"{word!r} is no share from 0% to 100%; write 5% or 0.05")
    return value / whole


Share = Annotated[float, Parameter(converter=_share)]


def simplify(
    args: FlightArguments,
    *,
    max_change: Share = DEFAULTS.max_change,
    mean_change: Share = DEFAULTS.mean_change,
    look_alike: Share = DEFAULTS.look_alike,
    flights_only: bool = False,
    output: Output = None,
    json: bool = False,
) -> None:
    """Make a simpler controller that answers nearly the same.

    Steps leave out inputs, drop rules, merge terms that look alike, and round numbers. Each is measured
    against the original; what changes least goes first, until nothing more fits the budget. It holds along
    the flights that are given, and at 4,096 points spread over the whole ranges of the inputs; between them a
    change can be larger. With --flights-only far more can go, but inputs that were not flown may give
    anything, and flights from other starts get worse. The result is an ordinary controller: fly it before you
    trust it.

    For example:

        python -m fis_tools simplify controller.yaml -o simpler.yaml
        python -m fis_tools simplify controller.yaml --flights episodes/*.mcap --max-change 2%
        python -m fis_tools simplify controller.yaml --flights episodes/*.mcap --flights-only

    Parameters
    ----------
    max_change
        the largest change of an output that is allowed, of its range: 5% or 0.05
    mean_change
        the mean change that is allowed, likewise
    look_alike
        merge terms that share so much of their areas
    flights_only
        keep the budget along the flights alone
    output
        write the simpler controller (.json, .yaml)
    json
        print the steps for programs (schema fuzzy-simplification, version 1)
    """
    form = arguments.form_of(output)
    controller = args.read()
    samples = args.flown(controller)
    if samples is None and flights_only:
        raise Mistake("--flights-only needs flights; add --flights, or leave it out")
    with raised_as(Mistake, ValueError):
        budget = Budget(max_change, mean_change, flights_only, look_alike)
    with analysing(controller) as tell:
        simplified = simplification.simplify(controller, samples, budget, tell)
    if form is not None:
        arguments.write(output, form(simplified.controller))
    print(as_json("fuzzy-simplification", 1, simplified.plain()) if json else simplified.text(), end="")
