"""`learn`: a fuzzy system from a table."""

import sys
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fis_tools.commands.arguments import Output, UserMistake, form_of, write
from fis_tools.learning.learner import Recipe, Unlearnable, cross_validated, learn_table
from fis_tools.learning.table import Table, UnreadableTable, as_table, read
from fis_tools.model import FuzzyController
from fis_tools.words.text import sentences, with_unit

DEFAULTS = Recipe()


def run(
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
