"""Commands about runs that are there: ``verify RUN``, ``summary SWEEP`` and ``compare=RUN_A,RUN_B``."""

import sys
from collections.abc import Sequence
from pathlib import Path

from fis_tools.document import Document, text
from pipeline.command_line.arguments import CommandParser
from pipeline.evaluation import paired_runs, statistics
from pipeline.report import sweep, sweep_page, verification
from pipeline.report.contents import read_summary
from pipeline.run import artifacts, configuration, tables, writing
from pipeline.settings.schema import differences, present

OK, DIFFERENT = 0, 1
#: files that `summary` writes into a sweep's folder
PAGE, RUNS, EFFECTS = "summary.html", "summary.parquet", "effects.parquet"
#: number of runs whose failures, or commands, are printed
MOST_PRINTED = 20


def verify(given: Sequence[str]) -> int:
    """Check every file of a run against its manifest and fly its recordings again; or compare two runs.

    Usage: python -m pipeline verify RUN_FOLDER [OTHER_RUN_FOLDER]

    The exit code is 0 if all is well, and 1 if something differs, is missing or cannot be read.

    Raises
    ------
    ConfigError, pipeline.run.artifacts.ArtifactError
        If no run is given.
    pipeline.run.maker.NotInForce
        If the run is reproducible, and this process is not.
    """
    folder, *others = _folders("verify", given, 1, 2)
    is_well = verification.verify_equal(folder, *others) if others else verification.verify(folder)
    return OK if is_well else DIFFERENT


def summary(given: Sequence[str]) -> int:
    """Print the results of a sweep, and write them as Parquet and HTML into its folder.

    Usage: python -m pipeline summary FOLDER

    The folder of a sweep, python -m pipeline -m ..., is outputs/NAME-sweep/TIME. Any other folder of runs
    will do, such as that of a job array.

    Raises
    ------
    ConfigError, ValueError, OSError
        If no sweep is given, or it cannot be read.
    """
    (folder,) = _folders("summary", given, 1)
    results = sweep.gather_results(folder)
    tables.write_parquet(folder / RUNS, sweep.columns_of(results))
    tables.write_parquet(folder / EFFECTS, sweep.effect_columns(results))
    writing.write_atomically(folder / PAGE, sweep_page.write(results))
    parts = sweep_page.runs_table, sweep_page.settings_table, sweep_page.effects_table
    sys.stdout.write(text.write(Document([block for part in parts for block in part(results)])))
    sys.stdout.writelines(f"to fly {run.folder}: {run.fly}\n" for run in results.offered)
    sys.stdout.writelines(f"failed: {run.folder}: {run.failure}\n" for run in results.failed[:MOST_PRINTED])
    sys.stdout.write(f"written: {', '.join(str(folder / name) for name in (PAGE, RUNS, EFFECTS))}\n")
    return OK


def compare(given: Sequence[str]) -> int:
    """Print two runs side by side on the cases that they share.

    Usage: python -m pipeline compare=RUN_A,RUN_B

    Raises
    ------
    ConfigError, ValueError, OSError
        If there are not two, one cannot be read, was not evaluated, or they share no case.
    """
    first, second = _folders("compare", given, 2)
    configs = [present(configuration.read(folder)) for folder in (first, second)]
    confidence = float(read_summary(first).get("confidence_percent", sweep.CONFIDENCE_PERCENT))
    here, there = (tables.read_or_open(folder, artifacts.EPISODES) for folder in (first, second))
    compared = paired_runs.compare(here, there, confidence)
    ahead = []
    for episodes, rows in zip((here, there), paired_runs.common_cases(here, there), strict=True):
        delta_v = episodes["delta_v_m_s"]
        planned = episodes.get("ahead_delta_v_m_s", 0.0 * delta_v)
        ahead.append(statistics.percent_ahead(delta_v[rows], planned[rows]))
    table = sweep_page.compared_table((first.name, second.name), compared, ahead, confidence)
    sys.stdout.write(text.write(Document(table)))
    different = differences(configs[0], configs[1], but=(), words=("A", "B"))
    sys.stdout.writelines(f"they differ in {key}\n" for key in different)
    return OK


def _folders(command: str, words: Sequence[str], *numbers: int) -> list[Path]:
    """Return the folders that a command is given, which takes some number of them and nothing else."""
    if len(words) not in numbers:
        takes = f"{' or '.join(map(str, numbers))} {'folder' if numbers == (1,) else 'folders'}"
        parser = CommandParser(f"python -m pipeline {command}")
        parser.error(f"{command} takes {takes} and nothing else, and {len(words)} words are given")
    return [Path(word).expanduser() for word in words]
