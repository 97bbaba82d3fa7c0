"""`import`: files of other programs into one controller file."""

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from fis_tools import programs
from fis_tools.commands.arguments import UserMistake, add_trust, write
from fis_tools.formats import serialize
from fis_tools.formats.own.mapping import MOST_POINTS
from fis_tools.model import FuzzyController, FuzzySystem, Sampled, Variable
from fis_tools.model.validate import InvalidSystem
from fis_tools.source import read_controller

EPILOG = """\
What the files do not state is assumed, and printed. Files that `export` wrote carry it in a comment.

examples:
  python -m fis_tools import tipper.fis -o tipper.yaml
  python -m fis_tools import tipper.fis --points 1001 -o tipper.json
  python -m fis_tools import tipping.py:build_tipping --trust -o tipping.yaml
  python -m fis_tools import exchange/*.fis --name returned -o returned.yaml
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    command.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help=f"files to read ({', '.join(serialize.ENDINGS)}; with --trust, FILE.py:NAME)",
    )
    add_trust(command)
    command.add_argument(
        "-o", "--output", metavar="FILE", help=".json or .yaml to write (default: JSON, printed)"
    )
    command.add_argument(
        "--name", metavar="NAME", help="what the controller is called (default: as in the files)"
    )
    command.add_argument(
        "--points",
        type=_points,
        metavar="N",
        help=f"points of every evenly spaced universe (2 to {MOST_POINTS})",
    )


def _points(word: str) -> int:
    if not word.isdecimal() or not 2 <= int(word) <= MOST_POINTS:
        raise argparse.ArgumentTypeError(f"{word!r} is no whole number from 2 to {MOST_POINTS}")
    return int(word)


def run(arguments: argparse.Namespace) -> None:
    """Read files of other programs and write one controller file."""
    ending = ".json" if arguments.output is None else Path(arguments.output).suffix.lower()
    if ending not in {".json", ".yaml", ".yml"}:
        raise UserMistake(f"{arguments.output} is no controller file; name one that ends in .json or .yaml")
    readings = [_reading(path, arguments.trust) for path in arguments.files]
    controllers = [reading.controller for reading in readings]
    systems = _systems(arguments.files, controllers)
    if arguments.points is not None:
        systems = tuple(_resampled(system, arguments.points) for system in systems)
    attributes, conflicts = _merged(controller.attributes for controller in controllers)
    if conflicts:
        raise UserMistake(f"the files differ in the attribute {conflicts[0]!r}; import them one by one")
    provenance, left_out = _merged(controller.provenance for controller in controllers)
    names = list(dict.fromkeys(controller.name for controller in controllers))
    name = arguments.name or (names[0] if len(names) == 1 else Path(arguments.files[0]).stem)
    controller = FuzzyController(name, systems, attributes, provenance)
    dump = serialize.dump_json if ending == ".json" else serialize.dump_yaml
    try:
        content = dump(controller)
    except InvalidSystem as error:
        raise UserMistake(str(error)) from error
    write(arguments.output, content)
    for sentence in (sentence for reading in readings for sentence in reading.assumptions):
        print(f"assumed: {sentence}", file=sys.stderr)
    for key in left_out:
        print(f"left out: the provenance {key}, which differs between the files", file=sys.stderr)


def _reading(path: str, trust: bool) -> serialize.Reading:
    if programs.is_program(path):
        return serialize.Reading(read_controller(path, trust), ())
    return serialize.read(path)


def _systems(paths: Sequence[str], controllers: Sequence[FuzzyController]) -> tuple[FuzzySystem, ...]:
    """Put the systems of all files together; their names must differ."""
    found: dict[str, tuple[str, FuzzySystem]] = {}
    for path, controller in zip(paths, controllers, strict=True):
        for system in controller.systems:
            if system.name in found:
                raise UserMistake(
                    f"{found[system.name][0]} and {path} both have a system {system.name!r}; rename one in "
                    "its file, or import them one by one"
                )
            found[system.name] = (path, system)
    return tuple(system for _, system in found.values())


def _resampled(system: FuzzySystem, num_points: int) -> FuzzySystem:
    def resampled(variable: Variable) -> Variable:
        is_fixed = any(isinstance(term.membership, Sampled) for term in variable.terms)
        return variable if is_fixed or variable.points else replace(variable, num_points=num_points)

    return replace(
        system, inputs=tuple(map(resampled, system.inputs)), outputs=tuple(map(resampled, system.outputs))
    )


def _merged(facts: Iterable[tuple[tuple[str, str], ...]]) -> tuple[tuple[tuple[str, str], ...], list[str]]:
    """Put facts together; return those that nothing contradicts, sorted, and the keys of the others."""
    kept: dict[str, str] = {}
    contradicted: set[str] = set()
    for key, value in (fact for each in facts for fact in each):
        if kept.setdefault(key, value) != value:
            contradicted.add(key)
    return tuple(sorted(fact for fact in kept.items() if fact[0] not in contradicted)), sorted(contradicted)
