"""`import`, `learn`: controllers made from files of other programs and from tables."""

import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fis_tools import source
from fis_tools.commands.arguments import Output, UserMistake, expected, form_of, write
from fis_tools.formats import serialize
from fis_tools.formats.mapping import MOST_POINTS
from fis_tools.learning.learner import Recipe, Unlearnable, cross_validated, learn_table
from fis_tools.learning.table import Table, UnreadableTable, as_table, read
from fis_tools.model import FuzzyController, FuzzySystem, Sampled, Variable
from fis_tools.model.validate import InvalidSystem
from fis_tools.source import read_controller
from fis_tools.words.text import sentences, with_unit


def import_(
    files: tuple[str, ...],
    /,
    *,
    trust: bool = False,
    output: Output = None,
    name: str | None = None,
    points: Annotated[
        int | None,
        expected(f"a whole number from 2 to {MOST_POINTS}", lambda count: 2 <= count <= MOST_POINTS),
    ] = None,
) -> None:
    """Make one controller file from files of other programs, such as MATLAB or fuzzylite.

    What the files do not state is assumed, and printed. Files that `export` wrote carry it in a comment.

    For example:

        python -m fis_tools import tipper.fis -o tipper.yaml
        python -m fis_tools import tipper.fis --points 1001 -o tipper.json
        python -m fis_tools import tipping.py:build_tipping --trust -o tipping.yaml
        python -m fis_tools import exchange/*.fis --name returned -o returned.yaml

    Parameters
    ----------
    files
        files to read, ours or of other programs (such as .yaml, .fis or .fll; with --trust, FILE.py:NAME)
    trust
        run the Python program that a controller is read from
    output
        .json or .yaml to write [default: JSON, printed]
    name
        what the controller is called [default: as in the files]
    points
        points of every evenly spaced universe
    """
    ending = ".json" if output is None else Path(output).suffix.lower()
    if ending not in {".json", ".yaml", ".yml"}:
        raise UserMistake(f"{output} is no controller file; name one that ends in .json or .yaml")
    readings = [_reading(path, trust) for path in files]
    controllers = [reading.controller for reading in readings]
    systems = _systems(files, controllers)
    if points is not None:
        systems = tuple(_resampled(system, points) for system in systems)
    attributes, conflicts = _merged(controller.attributes for controller in controllers)
    if conflicts:
        raise UserMistake(f"the files differ in the attribute {conflicts[0]!r}; import them one by one")
    provenance, left_out = _merged(controller.provenance for controller in controllers)
    names = list(dict.fromkeys(controller.name for controller in controllers))
    name = name or (names[0] if len(names) == 1 else Path(files[0]).stem)
    controller = FuzzyController(name, systems, attributes, provenance)
    dump = serialize.dump_json if ending == ".json" else serialize.dump_yaml
    try:
        content = dump(controller)
    except InvalidSystem as error:
        raise UserMistake(str(error)) from error
    write(output, content)
    for sentence in (sentence for reading in readings for sentence in reading.assumptions):
        print(f"assumed: {sentence}", file=sys.stderr)
    for key in left_out:
        print(f"left out: the provenance {key}, which differs between the files", file=sys.stderr)


def _reading(path: str, trust: bool) -> serialize.Reading:
    if source.is_program(path):
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


DEFAULTS = Recipe()


def learn(
    table: str,
    /,
    *,
    target: str,
    inputs: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    consequents: Literal["constants", "linear", "sets"] = DEFAULTS.consequents,
    terms: int = DEFAULTS.terms,
    output_terms: int = DEFAULTS.output_terms,
    max_inputs: int = DEFAULTS.max_inputs,
    no_tuning: bool = False,
    output: Output = None,
) -> None:
    """Make a fuzzy system from a table of numbers.

    The first line of the table names its columns; "petal length (cm)" has the unit cm. A target of words is
    classified: the system has an output for each, its share. Rows with an empty cell are left out, and so are
    columns of words and of one value. What is reached is measured on every fifth row by what the other rows
    teach.

    For example:

        python -m fis_tools learn table.csv --target y -o learned.json
        python -m fis_tools learn table.csv --target y --inputs a b --consequents sets --terms 5

    Parameters
    ----------
    table
        a CSV or Parquet file of numbers
    target
        the column that is to be learned
    inputs
        the columns that rules may ask for [default: all others]
    consequents
        what rules conclude: a number, one that is linear in the inputs, or (Wang and Mendel) a fuzzy set
    terms
        terms of each input, 2 to 7
    output_terms
        terms of an output of sets, 2 to 7
    max_inputs
        columns that rules ask for at most, those that matter most
    no_tuning
        leave the terms evenly spaced
    output
        write the controller (.json, .yaml)
    """
    form = form_of(output)
    try:
        read_table = as_table(read(table), target, list(inputs) or None)
        for note in read_table.notes:
            print(f"note: {note}", file=sys.stderr)
        recipe = Recipe(
            consequents=consequents,
            terms=terms,
            output_terms=output_terms,
            max_inputs=max_inputs,
            tune=not no_tuning,
        )
        system = learn_table(read_table, recipe).system
    except (UnreadableTable, Unlearnable) as error:
        raise UserMistake(str(error)) from error
    told = _reached(read_table, recipe)
    if form is not None:
        facts = {
            "learned_from": f"{Path(table).name}, {len(read_table.values)} rows",
            "target": target,
            "held_out": told,
        }
        write(output, form(FuzzyController(system.name, (system,), provenance=tuple(facts.items()))))
    asked = ", ".join(with_unit(variable) for variable in system.inputs)
    print("\n".join([*sentences(system), "", f"{len(system.rules)} rules of {asked}", told]))


def _reached(table: Table, recipe: Recipe) -> str:
    """Say what the recipe reaches on rows that it did not learn from."""
    reached = cross_validated(table, recipe)
    if reached is None:
        return "too few rows to tell what they reach on others"
    if table.has_classes:
        likely = Counter(table.values.tolist()).most_common(1)[0][0]
        return (
            f"right for {1 - reached.error:.1%} of {len(table.values)} rows that they did not learn from; "
            f"always {likely}: {1 - reached.error_of_constant:.1%}"
        )
    return (
        f"root mean squared error {reached.error:.4g} on {len(table.values)} rows that they did not "
        f"learn from; always the mean: {reached.error_of_constant:.4g}"
    )
