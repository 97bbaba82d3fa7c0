"""Commands about runs that are there: ``verify RUN``, ``summary SWEEP`` and ``compare=RUN_A,RUN_B``."""

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.command_line import endings, runs
from pipeline.command_line.arguments import CommandParser
from pipeline.controllers.source import controller_of_run
from pipeline.evaluation import paired_runs, statistics
from pipeline.evaluation.evaluated import read_flights
from pipeline.evaluation.statistics import Columns
from pipeline.report import sweep, sweep_page, verification
from pipeline.report.contents import read_summary
from pipeline.report.evaluated_run import EvaluatedRun
from pipeline.report.played import MOST_RUNS
from pipeline.run import artifacts, configuration, tables, typed, writing
from pipeline.settings.schema import differences, present
from plain_files.document import Block, Document, text

OK, DIFFERENT = 0, 1
#: files that `summary` writes into a sweep's folder
PAGE, RUNS, EFFECTS = "summary.html", "summary.parquet", "effects.parquet"
#: runs that are compared at once
MOST_COMPARED = MOST_RUNS
#: what runs beside each other are called
LETTERS = "ABCDEFGH"
#: begins the word that says where a page goes
TO_PAGE = "page="
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
    will do, such as that of a job array. Runs of which a file cannot be read are left out, and named.

    Raises
    ------
    ConfigError, ValueError, OSError
        If no sweep is given, or it cannot be read.
    """
    (folder,) = _folders("summary", given, 1)
    results = sweep.gather_results(folder)
    parts = sweep_page.runs_table, sweep_page.settings_table, sweep_page.effects_table
    sys.stdout.write(text.write(Document([block for part in parts for block in part(results)])))
    sys.stdout.writelines(f"to fly {run.folder}: {run.fly}\n" for run in results.offered)
    sys.stdout.writelines(f"failed: {run.folder}: {run.failure}\n" for run in results.failed[:MOST_PRINTED])
    left_out = results.left_out[:MOST_PRINTED]
    sys.stdout.writelines(f"left out: {run.folder}: {run.failure}\n" for run in left_out)
    # last: where nothing can be written, it is printed all the same
    tables.write_parquet(folder / RUNS, sweep.columns_of(results))
    tables.write_parquet(folder / EFFECTS, sweep.effect_columns(results))
    writing.write_atomically(folder / PAGE, sweep_page.write(results, _offered(results)))
    sys.stdout.write(f"written: {', '.join(str(folder / name) for name in (PAGE, RUNS, EFFECTS))}\n")
    return OK


def _offered(results: sweep.SweepResults) -> list[EvaluatedRun]:
    """Return the runs that a sweep offers to be flown; none where one of them is not of this program."""
    folders = [results.folder / run.folder for run in results.offered]
    try:
        return [_evaluated(folder, read_flights(folder)) for folder in folders]
    except endings.MISTAKES:  # the page does without
        return []


def _evaluated(folder: Path, episodes: Columns) -> EvaluatedRun:
    experiment = runs.stored(folder).experiment
    controller = controller_of_run(experiment, folder)
    command = typed.fly(folder, "case=CASE")
    return EvaluatedRun(folder.name, experiment, controller, episodes, command)


def compare(given: Sequence[str]) -> int:
    """Print runs side by side on the cases that they share, each against the first.

    Usage: python -m pipeline compare=RUN_A,RUN_B[,RUN_C...] [page=FILE.html]

    With page=FILE.html it also writes a page in which each case opens the flights of all runs beside each
    other, under one time.

    Raises
    ------
    ConfigError, ValueError, OSError
        If there are not two, one cannot be read, was not evaluated, or they share no case.
    """
    pages = [Path(word.removeprefix(TO_PAGE)).expanduser() for word in given if word.startswith(TO_PAGE)]
    joined, *rest = [word for word in given if not word.startswith(TO_PAGE)] or [""]
    first, *others = folders = _folders(
        "compare", _at_commas(joined), *range(2, MOST_COMPARED + 1), rest=rest
    )
    configs = [present(configuration.read(folder)) for folder in folders]
    confidence = float(read_summary(first).get("confidence_percent", sweep.CONFIDENCE_PERCENT))
    episodes = [read_flights(folder) for folder in folders]
    blocks: list[Block] = []
    for letter, folder, there in zip(LETTERS[1 : len(folders)], others, episodes[1:], strict=True):
        compared = paired_runs.compare(episodes[0], there, confidence)
        ahead = []
        for flown, rows in zip(
            (episodes[0], there), paired_runs.common_cases(episodes[0], there), strict=True
        ):
            delta_v = flown["delta_v_m_s"]
            planned = flown.get("ahead_delta_v_m_s", 0.0 * delta_v)
            ahead.append(statistics.percent_ahead(delta_v[rows], planned[rows]))
        blocks += sweep_page.compared_table((first.name, folder.name), compared, ahead, confidence, letter)
    sys.stdout.write(text.write(Document(blocks)))
    for letter, config in zip(LETTERS[1 : len(folders)], configs[1:], strict=True):
        different = differences(configs[0], config, but=(), words=("A", letter))
        sys.stdout.writelines(f"they differ in {key}\n" for key in different)
    for path in pages:
        writing.write_atomically(path, _side_by_side(folders, episodes, blocks))
        sys.stdout.write(f"written: {path}\n")
    return OK


def _side_by_side(folders: Sequence[Path], episodes: Sequence[Columns], blocks: Sequence[Block]) -> str:
    """Return the page of runs that are compared."""
    played = [_evaluated(folder, flown) for folder, flown in zip(folders, episodes, strict=True)]
    return sweep_page.write_compared(played, blocks)


def _at_commas(joined: str) -> list[str]:
    """Return folders that are joined by commas, which stand in the names of some as well."""
    folders: list[str] = []
    rest = joined.split(",")
    while rest:
        names = [",".join(rest[:end]) for end in range(1, len(rest) + 1)]
        name = next((name for name in names if Path(name).expanduser().is_dir()), names[0])
        folders.append(name)
        rest = rest[name.count(",") + 1 :]
    return folders


def _folders(command: str, words: Sequence[str], *numbers: int, rest: Sequence[str] = ()) -> list[Path]:
    """Return the folders that a command is given, which takes some number of them and nothing else."""
    words = list(filter(None, words))
    if len(words) not in numbers or rest:
        counts = f"{numbers[0]} to {numbers[-1]}" if len(numbers) > 2 else " or ".join(map(str, numbers))
        takes = f"{counts} {'folder' if numbers == (1,) else 'folders'}"
        number = len(words) + len(rest)
        parser = CommandParser(f"python -m pipeline {command}")
        given = f"{number} {'word is' if number == 1 else 'words are'} given"
        if 0 < number < numbers[0]:  # the other folders are likely beside it, or in it
            given += f"; {artifacts.choose_others(Path(words[0]).expanduser())}"
        parser.error(f"{command} takes {takes} and nothing else, and {given}")
    return [Path(word).expanduser() for word in words]
