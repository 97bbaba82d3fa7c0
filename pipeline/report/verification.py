"""Whether a run's files are intact and its flights repeat; or whether two runs made the same files.

What is found is printed as it is found: the flights of a long run take minutes.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from pipeline.run import artifacts, configuration, manifests
from pipeline.run.maker import present_maker, require_reproducible, unlike
from pipeline.settings.schema import differences


def verify(folder: Path) -> bool:
    """Check a run's files against its manifest and fly its recordings again; return whether all is well.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder is none of a run.
    pipeline.run.maker.NotInForce
        If the run is reproducible, and this process is not.
    """
    if not (folder / artifacts.MANIFEST).exists():
        configuration.read(folder)  # raises for a folder that is no run's
    with suppress(artifacts.ArtifactError):  # told below, as a file that is missing or changed
        if configuration.read(folder).get("reproducible") is True:
            require_reproducible()
    checks = {"files": _check_files, "makers": _print_makers, "flights": _fly_again}
    are_right = [_checked(what, partial(check, folder)) for what, check in checks.items()]
    return all(are_right)


def verify_equal(folder: Path, other: Path) -> bool:
    """Print how two runs differ, and whether that is to be expected; return whether they are equal."""
    return _checked("comparison", partial(_compare_files, folder, other))


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

    A file that the manifest does not name differs, too. The configuration is also compared by content.
    """
    manifest = manifests.read(folder)
    expected: dict[str, str] = manifest.get("sha256", {})
    present = set(artifacts.list_artifacts(folder))
    changed = {
        name for name in present & set(expected) if artifacts.file_hash(folder / name) != expected[name]
    }
    if artifacts.CONFIG in present and not _is_own_config(folder, manifest):
        changed.add(artifacts.CONFIG)
    missing, strangers = sorted(set(expected) - present), list(artifacts.strangers(folder))
    unknown = sorted(present - set(expected))
    lines = [f"files: {len((present & set(expected)) - changed)} as they were written"]
    lines += [f"  {name} has CHANGED since it was written" for name in sorted(changed)]
    lines += [f"  {name} is MISSING" for name in missing]
    lines += [f"  {name} is not in the manifest" for name in unknown]
    lines += [f"  {stranger}, which is not followed" for stranger in strangers]
    sys.stdout.write("\n".join(lines) + "\n")
    return not (changed or missing or unknown or strangers)


def _is_own_config(folder: Path, manifest: Mapping[str, Any]) -> bool:
    """Return whether the stored configuration is that of the manifest."""
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
    for first_maker, second_maker in product(*(manifest.get("makers", []) for manifest in both)):
        _print_unlike("makers differ", unlike(first_maker, second_maker))
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
