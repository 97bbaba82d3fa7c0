"""`export`, `import`, `learn`: controllers into files, from files of other programs and from tables."""

import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fis_tools.commands import arguments
from fis_tools.commands.arguments import ControllerArguments, Output, write
from fis_tools.errors import Mistake, raised_as
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.files import ONE_SYSTEM, WHOLE, File, of_one_system, system_files, wires_lost
from fis_tools.formats.mapping import MOST_POINTS
from fis_tools.learning.learner import Recipe, cross_validated, learn_table
from fis_tools.learning.table import TrainingTable, as_table, read
from fis_tools.model import (
    FuzzyController,
    FuzzySystem,
    Sampled,
    Semantics,
    Variable,
    Wire,
    with_semantics,
    with_variables,
)
from fis_tools.model.intervals import with_bounds
from fis_tools.source import is_program, read_controller
from fis_tools.words.text import sentences, with_unit


def export(
    args: ControllerArguments,
    *,
    format: Annotated[str, Parameter(choices=(*WHOLE, *ONE_SYSTEM))],
    output: Output = None,
    bare: bool = False,
) -> None:
    """Write a controller as tables, for other programs, or as C source.

    - markdown, csv, text, html, latex: terms and rules to read
    - json, yaml: a controller file, which holds everything
    - fis (MATLAB and Octave), fll, fcl: one file per system; what the format cannot hold is listed, and
      carried in a comment that `import` reads
    - c: self-contained C99: step() with the thrust logic for a controller that commands a force, else one
      function per system
    - fmu: FMI 2.0 for co-simulation (Simulink, Dymola, OpenModelica): one file per system, its inference
      alone; with a compiled library if there is a gcc

    For example:

        python -m fis_tools export controller.yaml --format markdown > controller.md
        python -m fis_tools export controller.yaml --format fis -o exchange
        python -m fis_tools export controller.yaml --format fll --system force_x -o force_x.fll

    Parameters
    ----------
    format
        what to write
    output
        where to [default: printed]; a folder if its name has no ending and each system has its file
    bare
        c: inference alone, without the thrust logic of a controller that commands a force
    """
    if bare and format != "c":
        raise Mistake("--bare is for --format c; leave it out")
    controller = args.read()
    if format in ONE_SYSTEM:
        _write_each(controller, format, output)
        return
    with raised_as(Mistake, ValueError):
        write(output, source.write(controller, bare) if bare else WHOLE[format].write(controller))


def _write_each(controller: FuzzyController, form: str, output: str | None) -> None:
    """Write each system to its own file, and report what the files cannot hold."""
    path = None if output is None else Path(output)
    if form == "fmu" and path is None:
        raise Mistake("an FMU is an archive and cannot be printed; add -o FILE.fmu or -o FOLDER")
    if path is None or path.suffix.lower() == ONE_SYSTEM[form]:  # a file of such a form holds one system
        controller.only_system("add --system, or -o FOLDER for a file each")
    with raised_as(Mistake, ValueError):
        systems = system_files(controller, ONE_SYSTEM[form])
    files: dict[str, File] = {}
    for name, single in systems.items():
        with raised_as(Mistake, ValueError, where=f"{single.systems[0].name}: "):
            files[name] = of_one_system(single, form)
    for name, file in files.items():
        if path is None:
            print(file.content.decode(), end="")
        elif path.is_dir() or not path.suffix or len(files) > 1:
            arguments.write_file(path / name, file.content)
            print(path / name)
        else:
            arguments.write_file(path, file.content)
        for loss in file.losses:
            print(f"{name}: {loss}", file=sys.stderr)
    for loss in wires_lost(controller):
        print(loss, file=sys.stderr)


def import_(
    files: tuple[str, ...],
    /,
    *,
    trust: bool = False,
    output: Output = None,
    name: str | None = None,
    points: Annotated[int | None, arguments.whole_number(2, MOST_POINTS)] = None,
    as_: Annotated[Semantics | None, Parameter(name="--as")] = None,
    wire: tuple[tuple[str, str], ...] = (),
    sets: Literal["lower", "upper"] | None = None,
) -> None:
    """Make one controller file from files of other programs, such as MATLAB or fuzzylite.

    What the files do not state is assumed, and printed. Files that `export` wrote carry it in a comment.

    For example:

        python -m fis_tools import tipper.fis -o tipper.yaml
        python -m fis_tools import tipper.fis --points 1001 -o tipper.json
        python -m fis_tools import tipping.py:build_tipping --trust -o tipping.yaml
        python -m fis_tools import tipper.fis --as fuzzylite -o tipper.yaml
        python -m fis_tools import exchange/*.fis --name returned -o returned.yaml
        python -m fis_tools import a.fis b.fis --wire a/out b/in -o tree.yaml

    Parameters
    ----------
    files
        files to read, ours or of other programs (such as .yaml, .fis; with --trust, FILE.py:NAME)
    trust
        run the Python program that a controller is read from
    output
        .json or .yaml to write [default: JSON, printed]
    name
        what the controller is called [default: as in the files]
    points
        points of every evenly spaced universe
    as_
        the program whose answers the systems give [default: each file's own]
    wire
        pass an output on to an input, as in MATLAB's fistree: --wire SYSTEM/OUTPUT SYSTEM/INPUT
    sets
        of interval type-2 sets, keep these functions alone, so that the systems are type-1
    """
    form = arguments.form_of(output) or serialize.dump_json
    readings = [_reading(path, trust) for path in files]
    controllers = [reading.controller for reading in readings]
    systems = _systems(files, controllers)
    assumed = [sentence for reading in readings for sentence in reading.assumptions]
    if points is not None:
        from fis_tools.formats.exchange.writing import jumps_between_points  # noqa: PLC0415 - seldom needed

        systems = tuple(_resampled(system, points) for system in systems)
        untrue = {sentence for reading in readings for sentence in reading.about_points}
        assumed = [sentence for sentence in assumed if sentence not in untrue]
        assumed += chain(*map(jumps_between_points, systems))
    if sets is not None:
        systems = tuple(with_bounds(system, sets) for system in systems)
    if as_ is not None:
        systems = tuple(with_semantics(system, as_) for system in systems)
    attributes, conflicts = _merged(controller.attributes for controller in controllers)
    if conflicts:
        raise Mistake(f"the files differ in the attribute {conflicts[0]!r}; import them one by one")
    provenance, contradicted = _merged(controller.provenance for controller in controllers)
    purposes, unlike = _merged(
        (("purpose", controller.purpose),) for controller in controllers if controller.purpose
    )
    wires = (
        *(each for controller in controllers for each in controller.wires),
        *(Wire(*ends) for ends in wire),
    )
    left_out = [*unlike, *(f"provenance {key}" for key in contradicted)]
    names = list(dict.fromkeys(controller.name for controller in controllers))
    name = name or (names[0] if len(names) == 1 else Path(files[0]).stem)
    purpose = dict(purposes).get("purpose", "")
    controller = FuzzyController(name, systems, attributes, provenance, purpose, wires)
    write(output, form(controller))
    for sentence in assumed:
        print(f"assumed: {sentence}", file=sys.stderr)
    for what in left_out:
        print(f"left out: the {what}, which differs between the files", file=sys.stderr)


def _reading(path: str, trust: bool) -> serialize.Reading:
    if is_program(path):
        return serialize.Reading(read_controller(path, trust), ())
    return serialize.read(path)


def _systems(paths: Sequence[str], controllers: Sequence[FuzzyController]) -> tuple[FuzzySystem, ...]:
    """Collect the systems of all files; their names must differ."""
    systems: dict[str, tuple[str, FuzzySystem]] = {}
    for path, controller in zip(paths, controllers, strict=True):
        for system in controller.systems:
            if system.name in systems:
                raise Mistake(
                    f"{systems[system.name][0]} and {path} both have a system {system.name!r}; rename one in "
                    "its file, or import them one by one"
                )
            systems[system.name] = (path, system)
    return tuple(system for _, system in systems.values())


def _resampled(system: FuzzySystem, num_points: int) -> FuzzySystem:
    """Return a system with another number of points in each universe, unless it lists values there."""

    def resampled(variable: Variable) -> Variable:
        is_fixed = any(isinstance(term.membership, Sampled) for term in variable.terms)
        return variable if is_fixed or variable.points else replace(variable, num_points=num_points)

    return with_variables(system, resampled)


def _merged(facts: Iterable[tuple[tuple[str, str], ...]]) -> tuple[tuple[tuple[str, str], ...], list[str]]:
    """Merge facts; return those that nothing contradicts, sorted, and the keys of the others."""
    kept: dict[str, str] = {}
    contradicted: set[str] = set()
    for key, value in (fact for each in facts for fact in each):
        if kept.setdefault(key, value) != value:
            contradicted.add(key)
    return tuple(sorted(fact for fact in kept.items() if fact[0] not in contradicted)), sorted(contradicted)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RecipeOptions(Recipe):
    """The options of `learn`: what the learned system may look like.

    Parameters
    ----------
    consequents
        what rules conclude: a number, one that is linear in the inputs, or (Wang and Mendel) a fuzzy set
    terms
        terms of each input, 2 to 7
    output_terms
        terms of an output of sets, 2 to 7
    max_inputs
        how many columns rules may ask for: those that matter most
    tune
        move the peaks of terms to where errors are least, or leave them evenly spaced
    """

    tune: Annotated[bool, Parameter(negative="--no-tuning")] = True


DEFAULTS = RecipeOptions()


def learn(
    table: str,
    /,
    *,
    target: str,
    inputs: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    recipe: RecipeOptions = DEFAULTS,
    output: Output = None,
) -> None:
    """Make a fuzzy system from a table of numbers.

    The first line of the table names its columns; "petal length (cm)" has the unit cm. A target of words is
    classified: the system has an output for each, its share. Rows with an empty cell are left out, and so are
    columns of words and of one value. The score comes from cross-validation in five folds.

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
    output
        write the controller (.json, .yaml)
    """
    form = arguments.form_of(output)
    read_table = as_table(read(table), target, list(inputs) or None)
    for note in read_table.notes:
        print(f"note: {note}", file=sys.stderr)
    system = learn_table(read_table, recipe).system
    held_out = _reached(read_table, recipe)
    if form is not None:
        facts = {
            "learned_from": f"{Path(table).name}, {len(read_table.values)} rows",
            "target": target,
            "held_out": held_out,
        }
        write(output, form(FuzzyController(system.name, (system,), provenance=tuple(facts.items()))))
    input_words = ", ".join(with_unit(variable) for variable in system.inputs)
    print("\n".join([*sentences(system), "", f"{len(system.rules)} rules of {input_words}", held_out]))


def _reached(table: TrainingTable, recipe: Recipe) -> str:
    """Describe the recipe's error on rows that it did not learn from."""
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
