"""Commands about runs that are there: ``verify RUN``, ``summary SWEEP`` and ``compare=RUN_A,RUN_B``.

The first checks whether a run's files are intact and its flights repeat; for two runs, whether they made the
same files, and if not, whether they should have. The others summarise several runs.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from fis_tools.document import Block, Document, text
from pipeline.command_line.arguments import ConfigError
from pipeline.evaluation import statistics
from pipeline.report import sweep
from pipeline.report.contents import read_summary
from pipeline.run import artifacts, configuration, manifests, tables, writing
from pipeline.run.maker import present_maker, require_reproducible, unlike
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
    if len(given) not in (1, 2):
        raise ConfigError(
            "verify takes the folder of a run, and of another one to compare it with: "
            "python -m pipeline verify outputs/NAME/TIME"
        )
    folder, *others = (Path(word).expanduser() for word in given)
    if others:
        return OK if _checked("comparison", lambda: _compare_files(folder, others[0])) else DIFFERENT
    if not (folder / artifacts.MANIFEST).exists():
        configuration.read(folder)  # says why, of a folder that is none of a run
    with suppress(artifacts.ArtifactError):  # told below, as a file that is missing or changed
        if configuration.read(folder).get("reproducible") is True:
            require_reproducible()
    checks = {"files": _check_files, "makers": _print_makers, "flights": _fly_again}
    are_right = [_checked(what, partial(check, folder)) for what, check in checks.items()]
    return OK if all(are_right) else DIFFERENT


def _checked(what: str, check: Callable[[], bool]) -> bool:
    """Return the result of a check; print a sentence and return False if it raises an error."""
    try:
        return check()
    except Exception as error:  # noqa: BLE001 - reporting damage is what this command is for
        reason = str(error) if isinstance(error, ValueError | OSError) else ""
        sys.stdout.write(f"{what}: CANNOT BE CHECKED: {reason or type(error).__name__}\n")
        return False


def _check_files(folder: Path) -> bool:
    """Compare a run's files with their hashes; print which differ, and return whether none does.

    The configuration is also compared by content.
    """
    manifest = manifests.read(folder)
    expected: dict[str, str] = manifest.get("sha256", {})
    there = set(artifacts.list_artifacts(folder))
    changed = {name for name in there & set(expected) if artifacts.file_hash(folder / name) != expected[name]}
    if artifacts.CONFIG in there and not _is_own_config(folder, manifest):
        changed.add(artifacts.CONFIG)
    missing, strangers = sorted(set(expected) - there), list(artifacts.strangers(folder))
    lines = [f"files: {len((there & set(expected)) - changed)} as they were written"]
    lines += [f"  {name} has CHANGED since it was written" for name in sorted(changed)]
    lines += [f"  {name} is MISSING" for name in missing]
    lines += [f"  {name} is not in the manifest" for name in sorted(there - set(expected))]
    lines += [f"  {stranger}, which is not followed" for stranger in strangers]
    sys.stdout.write("\n".join(lines) + "\n")
    return not (changed or missing or strangers)


def _is_own_config(folder: Path, manifest: Mapping[str, Any]) -> bool:
    try:
        return configuration.is_of(configuration.read(folder), manifest)
    except artifacts.ArtifactError:
        return False


def _print_makers(folder: Path) -> bool:
    """Print how the makers of a run differ from the present one; return True, as this is no damage."""
    for maker in manifests.read(folder).get("makers", []):
        _print_unlike("made by another maker", unlike(maker, present_maker()))
    return True


def _compare_files(folder: Path, other: Path) -> bool:
    """Print how configurations, files and makers of two runs differ; return whether all files are equal."""
    both = [manifests.read(path) for path in (folder, other)]
    first, second = (manifest.get("sha256", {}) for manifest in both)
    names = sorted({*first, *second} - {artifacts.CONFIG})
    shared = [name for name in names if name in first and name in second]
    different = [name for name in shared if first[name] != second[name]]
    configs = configuration.read(folder), configuration.read(other)
    for difference in differences(*configs, but=("hydra",), words=("here", "there")):
        sys.stdout.write(f"configuration: {difference}\n")
    sys.stdout.write(f"files: {len(shared) - len(different)} equal to the last bit\n")
    sys.stdout.writelines(f"  {name} differs\n" for name in different)
    sys.stdout.writelines(f"  {name} is in one of them alone\n" for name in names if name not in shared)
    for here, there in product(*(manifest.get("makers", []) for manifest in both)):
        _print_unlike("makers differ", unlike(here, there))
    return len(different) == 0 and names == shared


def _print_unlike(what: str, differing: Sequence[str]) -> None:
    if differing:
        sys.stdout.write(f"{what} ({'; '.join(differing)}): results may differ in the last digits\n")


def _fly_again(folder: Path) -> bool:
    """Fly all recorded flights of a run again; return whether each repeats, but for the last digits."""
    names = (artifacts.RECORDINGS, artifacts.WORST_FLIGHTS)
    paths = [path for name in names for path in sorted((folder / name).glob("*.mcap"))]
    if not paths:
        sys.stdout.write("flights: none is recorded\n")
        return True
    sys.stdout.write(f"flights: {len(paths)} recorded\n")
    agree = [_checked(f"  {path.name}", partial(_flies_again, path)) for path in paths]
    return all(agree)


def _flies_again(path: Path) -> bool:
    """Fly a recording again; print how far it repeats, and return whether it does but for the last digits."""
    from pipeline.recording.reflight import fly_again  # noqa: PLC0415 - compiled code, only if there are flights

    again = fly_again(path)
    outcome = "equal to the last bit"
    if not again.is_equal:
        how = "equal but for the last digits" if again.is_close else "DIFFERENT"
        outcome = f"{how}: by {again.greatest:.3g} in {again.where}"
    sys.stdout.write(f"  {path.name}: flown again, {outcome}\n")
    return again.is_close


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
    if len(given) != 1:
        raise ConfigError(
            "summary takes the folder of one sweep, or of other runs: python -m pipeline summary "
            "outputs/NAME-sweep/TIME"
        )
    folder = Path(given[0]).expanduser()
    results = sweep.gather_results(folder)
    tables.write_parquet(folder / RUNS, sweep.columns_of(results))
    tables.write_parquet(folder / EFFECTS, sweep.effect_columns(results))
    writing.write_atomically(folder / PAGE, sweep.write(results))
    _print([*sweep.runs_table(results), *sweep.settings_table(results), *sweep.effects_table(results)])
    for run in results.offered:
        sys.stdout.write(f"to fly {run.folder}: {run.fly}\n")
    for run in results.failed[:MOST_PRINTED]:
        sys.stdout.write(f"failed: {run.folder}: {run.failure}\n")
    sys.stdout.write(f"written: {', '.join(str(folder / name) for name in (PAGE, RUNS, EFFECTS))}\n")
    return OK


def compare(first: Path, second: Path) -> int:
    """Print two runs side by side on the cases that they share.

    Raises
    ------
    ValueError, OSError
        If one cannot be read, was not evaluated, or they share no case.
    """
    configs = [configuration.read(folder) for folder in (first, second)]
    confidence = float(read_summary(first).get("confidence_percent", sweep.CONFIDENCE_PERCENT))
    first_episodes, second_episodes = (
        tables.read_parquet(folder, artifacts.EPISODES) for folder in (first, second)
    )
    compared = statistics.compare(first_episodes, second_episodes, confidence)
    _print(sweep.compared_table(first.name, second.name, compared, confidence))
    sys.stdout.write("p: Wilcoxon's signed ranks; for shares of flights McNemar's exact test\n")
    for difference in differences(present(configs[0]), present(configs[1]), but=(), words=("A", "B")):
        sys.stdout.write(f"they differ in {difference}\n")
    return OK


def _print(blocks: Sequence[Block]) -> None:
    sys.stdout.write(text.write(Document(blocks)))
