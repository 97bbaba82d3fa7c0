"""The commands that summarise several runs: ``summary SWEEP`` and ``compare=RUN_A,RUN_B``."""

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from pipeline.command_line.job import ConfigError, differences
from pipeline.evaluation import paired
from pipeline.report.swept import contents, page, words
from pipeline.report.swept.words import Table
from pipeline.run import artifacts, tables

OK = 0
#: files that `summary` writes into a sweep's folder
PAGE, RUNS, EFFECTS = "summary.html", "summary.parquet", "effects.parquet"
#: width of a table that is not printed on a terminal, characters
WIDTH = 200
#: number of runs whose failures, or commands, are printed
MOST_PRINTED = 20


def summary(given: Sequence[str]) -> int:
    """Print the results of a sweep, and write them as Parquet and HTML into its folder.

    Raises
    ------
    ConfigError, ValueError, OSError
        If no sweep is given, or it cannot be read.
    """
    if len(given) != 1:
        raise ConfigError(
            "summary takes the folder of one sweep: python -m pipeline summary outputs/NAME-sweep/TIME"
        )
    folder = Path(given[0]).expanduser()
    swept = contents.gather(folder)
    tables.write_parquet(folder / RUNS, contents.columns_of(swept))
    tables.write_parquet(folder / EFFECTS, contents.effect_columns(swept))
    artifacts.write_atomically(folder / PAGE, page.write(swept))
    _print(words.runs_table(swept))
    effects = words.effects_table(swept)
    if effects.rows:
        _print(effects)
    for run in swept.offered:
        sys.stdout.write(f"to fly {run.name}: {run.fly}\n")
    for run in words.failures_of(swept)[:MOST_PRINTED]:
        sys.stdout.write(f"failed: {run.name}: {run.failure}\n")
    sys.stdout.write(f"written: {', '.join(str(folder / name) for name in (PAGE, RUNS, EFFECTS))}\n")
    return OK


def compare(first: Path, second: Path) -> int:
    """Print two runs side by side on the cases that they share.

    Raises
    ------
    ValueError, OSError
        If one cannot be read, was not evaluated, or they share no case.
    """
    configs = [artifacts.stored_config(folder) for folder in (first, second)]
    confidence = float(artifacts.read_json(first, artifacts.SUMMARY)["confidence_percent"])
    one, other = (tables.read_parquet(folder, artifacts.EPISODES) for folder in (first, second))
    compared = paired.compare(one, other, confidence)
    _print(words.compared_table(first.name, second.name, compared, confidence))
    sys.stdout.write("p: Wilcoxon's signed ranks; for shares of flights McNemar's exact test\n")
    for told in differences(configs[0], configs[1], ()):
        sys.stdout.write(f"they differ in {told.replace('(then ', '(A ').replace(', now ', ', B ')}\n")
    return OK


def _print(table: Table) -> None:
    """Print a table: as wide as the terminal, elsewhere as wide as needed."""
    console = Console(file=sys.stdout)
    if not console.is_terminal:
        console = Console(file=sys.stdout, width=WIDTH)
    grid = Grid(title=Text(table.title), title_justify="left", header_style="bold")
    for heading, is_number in zip(table.headings, table.are_numbers, strict=True):
        grid.add_column(Text(heading), justify="right" if is_number else "left")
    for row in table.rows:
        grid.add_row(*map(Text, row))
    console.print(grid)
