"""The commands that summarise several runs: ``summary SWEEP`` and ``compare=RUN_A,RUN_B``."""

import sys
from collections.abc import Sequence
from pathlib import Path

from fis_tools.document import Block, Document, text
from pipeline.command_line.job import ConfigError, differences
from pipeline.evaluation import paired
from pipeline.report.swept import contents, page, words
from pipeline.run import artifacts, tables
from pipeline.settings.schema import present

OK = 0
#: files that `summary` writes into a sweep's folder
PAGE, RUNS, EFFECTS = "summary.html", "summary.parquet", "effects.parquet"
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
    _print([*words.runs_table(swept), *words.effects_table(swept)])
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
    for told in differences(present(configs[0]), present(configs[1]), ()):
        sys.stdout.write(f"they differ in {told.replace('(then ', '(A ').replace(', now ', ', B ')}\n")
    return OK


def _print(blocks: Sequence[Block]) -> None:
    sys.stdout.write(text.write(Document(blocks)))
