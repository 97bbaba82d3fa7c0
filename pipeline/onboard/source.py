"""A program as C99: a header and a source, which call nothing but ``math.h``."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from typing import Any

import numpy as np

from fis_tools.formats import serialize
from fis_tools.formats.c.text import OPENING, broken, comment, plain, table
from fis_tools.model import conjunctions
from fis_tools.model.thrust import LOGIC_REASONS, REASONS, SILENT_N
from fis_tools.words.text import sentence
from pipeline.flight.state.log import LEAST_CHANGE_N
from pipeline.flight.state.signals import BODY
from pipeline.onboard.constant_tables import BYTES, ConstantTable
from pipeline.onboard.dead_stores import without_dead_stores
from pipeline.onboard.fields import offsets
from pipeline.onboard.functions import Function, Line
from pipeline.onboard.interface import CHECKED_BY, REACH, Interface, interface_of
from pipeline.onboard.messages import ABOUTS, INPUT_REASON, MODES, REQUIREMENTS
from pipeline.onboard.prefix import USUAL, renamed
from pipeline.onboard.program import OnboardProgram
from pipeline.onboard.restart import MOST_APART
from pipeline.onboard.values import number_text
from pipeline.run.maker import DISTRIBUTION, git_revision, product_version, sources_hash
from plain_files.document.html import environment, read

#: under which what is exported may be used
LICENCE = "MIT"
#: members of the state that the entries write or read
OF_ENTRIES = frozenset(
    {
        *("requested", "commanded", "coasts", "outputs", "leading", "num_unseen", "limit", "change"),
        *("plan_state", "plan_best", "plan_cost", "plan_given"),
        *("fleet_deputy", "fleet_ahead", "fleet_left_to", "fleet_hears", "fleet_stops"),
    }
)
#: and those that they do where plans are made again in flight
OF_FLIGHTS_AHEAD = frozenset(
    {"spent", "beyond", "y_before", "plan_costs", "plan_prices", "plan_mutants", "plan_limits"}
)
#: what a compiler must not do, where it says that it does
FLOATING_POINT = """\
#if defined __FINITE_MATH_ONLY__ && (__FINITE_MATH_ONLY__ > 0)
#error "compile without -ffinite-math-only: NaN is told apart from numbers"
#endif
#if defined FLT_EVAL_METHOD && (FLT_EVAL_METHOD != 0)
#error "compile for doubles that are rounded after each operation, such as with -msse2 -mfpmath=sse"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif
"""


@dataclass(frozen=True)
class Sources:
    """The source of a program.

    Parameters
    ----------
    header, code : str
    origins : sequence of (int, str, int)
        Line of the code, and file and line of the Python that it was translated from.
    tables : mapping of str to int
        Bytes of each constant table.
    members : mapping of str to (shape, kind)
        Of ``struct controller``, without its parameters.
    state_bytes : int
        That they take.
    identity : mapping of str to str
        SHA-256 of the code, the controller and the generator's sources; its revision, and the licence.
    interface : Interface
    """

    header: str
    code: str
    origins: Sequence[tuple[int, str, int]]
    tables: Mapping[str, int]
    members: Mapping[str, tuple[tuple[int, ...], str]]
    state_bytes: int
    identity: Mapping[str, str]
    interface: Interface


def sources(program: OnboardProgram, prefix: str = USUAL) -> Sources:
    """Return the source of a program; the names that other files see begin with the prefix."""
    again = program.planner.again if program.planner else None
    of_entries = OF_ENTRIES | OF_FLIGHTS_AHEAD if again else OF_ENTRIES
    functions = without_dead_stores(program.translator.functions, of_entries)
    lines = [line for function in functions for line in function.lines]
    tables = [
        table for each in program.translator.tables.values() if (table := ConstantTable(each, lines)).is_used
    ]
    for function in functions:
        for table in tables:
            function.lines = [table.renamed(line) for line in function.lines]
    read_members = {name for line in lines for name in re.findall(r"state->(\w+)", line.text)}
    members = {
        name: member
        for name, member in program.translator.members.items()
        if name in of_entries | read_members
    }
    members |= {"num_unseen": ((1,), "double"), "started": ((1,), "int")}
    members |= {f"last_{name}": ((3,), "double") for name in ("position", "velocity")}
    members |= dict.fromkeys(("last_period", "repeats"), ((1,), "int"))
    if any(function.name == CHECKED_BY["START_POINTS"] for function in functions):
        members["counted"] = ((program.world.num_points,), "unsigned char")
    if program.is_shared:
        members["fleet_has_left"] = (1,), "int"
    if program.is_kept_apart:
        members |= dict.fromkeys(("fleet_period", "fleet_steps"), ((1,), "int"))
    if program.planner:
        members |= program.planner.members
    if again:
        members |= {f"ahead_{name}": members[name] for name in again.exchanged if name in members}
    code = [Line(text) for text in _opening(program)]
    if program.planner:
        at = next(i for i, line in enumerate(code) if line.text == "#include <stdbool.h>")
        code[at + 1 : at + 1] = [Line(f"#include <{name}>") for name in ("stdint.h", "string.h")]
    code += [Line(text) for table in tables for text in table.definition()]
    code += [Line(text) for text in _helpers(lines)]
    if program.planner:
        drawn = int(np.prod(program.translator.members["drawn"][0]))
        text = read("templates/draws.c", "pipeline.onboard").replace("DRAWN", str(drawn))
        code += [Line(line) for line in text.splitlines()]
    for function in functions:
        code += _definition(function)
    interface = _interface(program, members, functions)
    facts = _facts(program, members, interface, {function.name for function in functions})
    code += [Line(text) for text in rendered("entries.c.jinja", **facts).splitlines()]
    text = renamed("".join(f"{line.text}\n" for line in code), prefix)
    identity = {"code": sha256(text.encode()).hexdigest(), **_origin(program)}
    header = {name: _declared(name, *member) for name, member in members.items()}
    return Sources(
        renamed(
            rendered("controller.h.jinja", **facts | {"members": header.values(), "identity": identity}),
            prefix,
        ),
        text,
        [(number, line.file, line.number) for number, line in enumerate(code, start=1) if line.file],
        {table.name: table.num_bytes for table in tables},
        members,
        sum(int(np.prod(shape)) * BYTES[kind] for shape, kind in members.values()),
        identity,
        interface,
    )


def _origin(program: OnboardProgram) -> dict[str, str]:
    """Return what a source was made of and by: digests of controller and generator, and its revision."""
    fuzzy = program.designed.fuzzy
    return {
        "controller": serialize.content_hash(fuzzy) if fuzzy is not None else "",
        "generator": sources_hash(),
        "revision": git_revision() or "",
        "licence": LICENCE,
    }


@cache
def _environment() -> Any:
    options = {"autoescape": lambda name: name.endswith(".xml.jinja")}  # beside XML, code
    forms = environment("pipeline.onboard", "templates", keep_trailing_newline=True, **options)
    forms.filters |= {"exact": number_text, "octets": _octets}
    forms.globals |= {
        **{"abouts": ABOUTS, "modes": MODES, "input_reason": INPUT_REASON, "requirements": REQUIREMENTS},
        "reasons": {reason: REASONS[reason] for reason in (*LOGIC_REASONS, "safety", "rehearsed", "parked")},
        "reason_numbers": {reason: number for number, reason in enumerate(REASONS)},
        "generator": " ".join(filter(None, (DISTRIBUTION, product_version(), git_revision()))),
        "offsets": offsets,
    }
    return forms


def _octets(digits: str) -> list[str]:
    """Return hexadecimal digits as octets of C."""
    return [f"0x{octet:02x}U" for octet in bytes.fromhex(digits)]


def rendered(template: str, **facts: Any) -> str:
    """Render a template of this folder; the filter `exact` writes a double of C."""
    return str(_environment().get_template(template).render(facts))


def _interface(
    program: OnboardProgram, members: Mapping[str, Any], functions: Sequence[Function]
) -> Interface:
    """Return the interface of a program."""
    (_, designed), *_ = program.choices
    return interface_of(
        program.world,
        # where it decides anything, a Sun that this C does not model is refused
        is_sun_in_plane=program.is_sun_in_plane and not {"sun", "sun_at_start"}.isdisjoint(members),
        parameters={name: designed[name] for name in program.parameters},
        members=members,
        functions=functions,
        inputs=program.inputs,
        axes="body" if program.law.force_axes == BODY else "Hill",
        limits="0 none, 1 keep out, 2 keep in, 3 speed, 4 passive safety, "
        f"{'5 apart from others, ' * program.is_kept_apart}7 speed along an axis",
    )


def _facts(
    program: OnboardProgram, members: Mapping[str, Any], interface: Interface, functions: set[str]
) -> dict[str, Any]:
    """Return what the templates ask for."""
    world, law, parameters = program.world, program.law, program.parameters
    systems = program.controller.systems
    orders = [_rule_order(system) for system in systems]
    longest = max(map(len, orders), default=0)
    return {
        "name": plain(program.controller.name),
        "world": world,
        "law": law,
        "interface": interface,
        "parameters": interface.parameters,
        "planner": program.planner,
        "fleet": program.fleet if program.is_shared else None,
        "kept_apart": program.fleet if program.is_kept_apart else None,
        "reach_m": REACH * world.max_distance,
        "functions": functions,
        "members": {name: int(np.prod(shape)) for name, (shape, _) in members.items()},
        "choices": [name for name, _ in program.choices],
        "rows": [[row[name] for name in parameters] or [0.0] for _, row in program.choices],
        "table": table,
        "rule_order": [[*order, *[0] * (longest - len(order))] for order in orders],
        "systems": [int(axis) for axis in law.axes],
        "changed_n": LEAST_CHANGE_N,
        "silent_n": SILENT_N,
        "most_apart": MOST_APART,
        "is_body": law.force_axes == BODY,
    }


def _rule_order(system: Any) -> list[int]:
    """Return the numbers of a system's rules, from 1 on, in the order of `Packed.rules`."""
    _, consequents = conjunctions(system) or ((), ())
    return [int(index) + 1 for index in np.argsort(consequents, kind="stable")]


def _declared(name: str, shape: tuple[int, ...], kind: str) -> str:
    return f"{kind} {name}{''.join(f'[{length}]' for length in shape if length != 1)};"


def _helpers(lines: Sequence[Line]) -> Iterator[str]:
    """Return those functions of the source that do not depend on the flight, as far as they are called."""
    text = read("templates/helpers.c", "pipeline.onboard")
    all_lines = "\n".join(line.text for line in lines)
    for part in re.split(r"\n\n(?=/\*|struct)", text.rstrip("\n")):
        name = re.search(r"(?:double |int |struct )(\w+)", part)
        if name and re.search(rf"\b{name[1]}\b", all_lines):
            yield from ("", *part.splitlines())


def _definition(function: Function) -> Iterator[Line]:
    """Return a function of C with a comment that says what it does and where its formula stands."""
    source, text = function.source, "\n".join(line.text for line in function.lines)
    yield Line("")
    about = f"{source.summary} {source.file}: {source.name}.".replace("``", "")
    for text_line in comment([about]).split("\n"):
        yield Line(text_line)
    yield Line(f"static {function.signature}", source.file, source.line)
    yield Line("{")
    for name in re.findall(r"(\w+)(?=,|\))", function.signature.partition("(")[2]):
        if not re.search(rf"(?<![\w>.]){name}\b", text):
            yield Line(f"    (void){name};")
    for line in function.lines:
        for piece in broken(line.text, 8):
            yield Line(piece, line.file, line.number)
    yield Line("}")


def _opening(program: OnboardProgram) -> Iterator[str]:
    """Return what stands above the tables: what this is, its rules in words, and what it includes."""
    paragraphs = [
        f"The on-board function of {program.controller.name}: each formula is translated from the "
        "Python that flies; its file and name stand above it. Compile with -ffp-contract=off and without "
        "-ffast-math: results depend on the order of operations.",
        "",
        "Its rules; the tables values and rules hold them as numbers.",
    ]
    for system in program.controller.systems:
        paragraphs += ["", f"{system.name}:"]
        paragraphs += [f"{number:3d}. {sentence(rule)}" for number, rule in enumerate(system.rules, start=1)]
    yield from comment(paragraphs).split("\n")
    yield from ('#include "controller.h"', "", "#include <float.h>", *OPENING.split("\n"))
    yield from FLOATING_POINT.splitlines()
