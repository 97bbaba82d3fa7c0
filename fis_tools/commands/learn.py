"""`learn`: a fuzzy system from a table."""

import argparse
from collections import Counter

from fis_tools.commands.arguments import UserMistake, form_of, write
from fis_tools.learning.from_tables import cross_validated, learn_table
from fis_tools.learning.recipe import Recipe, Unlearnable
from fis_tools.learning.table import Table, UnreadableTable, as_table, read
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.words.text import sentences, with_unit

DEFAULTS = Recipe()

EPILOG = """\
The first line of the table names its columns; "petal length (cm)" has the unit cm. A target of words is
classified: the system has an output for each, its share. What is reached is measured on every fifth row by
what the other rows teach.

examples:
  python -m fis_tools learn table.csv --target y -o learned.json
  python -m fis_tools learn table.csv --target y --inputs a b --consequents sets --terms 5 -o learned.yaml
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    command.add_argument("table", metavar="TABLE", help="a CSV or Parquet file of numbers")
    command.add_argument("--target", metavar="COLUMN", required=True, help="what is to be learned")
    command.add_argument(
        "--inputs", nargs="+", metavar="COLUMN", help="what rules may ask for (default: all other columns)"
    )
    command.add_argument(
        "--consequents",
        choices=["constants", "linear", "sets"],
        default=DEFAULTS.consequents,
        help="what rules conclude: a number, one that is linear in the inputs, or (Wang and Mendel) a fuzzy "
        f"set (default: {DEFAULTS.consequents})",
    )
    for key, what in (
        ("terms", "terms of each input, 2 to 7"),
        ("output_terms", "terms of an output of sets, 2 to 7"),
        ("max_inputs", "columns that rules ask for at most, those that matter most"),
    ):
        default = getattr(DEFAULTS, key)
        option = f"--{key.replace('_', '-')}"
        command.add_argument(
            option, type=int, default=default, metavar="N", help=f"{what} (default: {default})"
        )
    command.add_argument("--no-tuning", action="store_true", help="leave the terms evenly spaced")
    command.add_argument("-o", "--output", metavar="FILE", help="write the controller (.json, .yaml)")


def run(arguments: argparse.Namespace) -> None:
    """Learn a system, print its rules and what it reaches, and write it."""
    form = form_of(arguments.output)
    try:
        table = as_table(read(arguments.table), arguments.target, arguments.inputs)
        recipe = Recipe(
            consequents=arguments.consequents,
            terms=arguments.terms,
            output_terms=arguments.output_terms,
            max_inputs=arguments.max_inputs,
            tune=not arguments.no_tuning,
        )
        system = learn_table(table, recipe).system
    except (UnreadableTable, Unlearnable) as error:
        raise UserMistake(str(error)) from error
    if form is not None:
        write(arguments.output, form(FuzzyController(system.name, (system,))))
    print(_told(system, table, recipe))


def _told(system: FuzzySystem, table: Table, recipe: Recipe) -> str:
    asked = ", ".join(with_unit(variable) for variable in system.inputs)
    lines = [*sentences(system), "", f"{len(system.rules)} rules of {asked}"]
    reached = cross_validated(table, recipe)
    if reached is None:
        lines.append("too few rows to tell what they reach on others")
    elif table.has_classes:
        likely = Counter(table.values.tolist()).most_common(1)[0][0]
        lines.append(
            f"right for {1 - reached.error:.1%} of {len(table.values)} rows that they did not learn from; "
            f"always {likely}: {1 - reached.error_of_constant:.1%}"
        )
    else:
        lines.append(
            f"root mean squared error {reached.error:.4g} on {len(table.values)} rows that they did not "
            f"learn from; always the mean: {reached.error_of_constant:.4g}"
        )
    return "\n".join(lines)
