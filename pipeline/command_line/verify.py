"""The command ``verify``: whether a run's files are intact and its flights repeat.

For two runs, whether they made the same files, and if not, whether they should have.
"""

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from pipeline.command_line.job import ConfigError, differences
from pipeline.run import artifacts, reproducible
from pipeline.run.integrity import Integrity, check_files, put_beside
from pipeline.run.maker import present_maker, unlike
from telemetry import RecordingError

OK, DIFFERENT = 0, 1


def verify(words: Sequence[str]) -> int:
    """Check a run, or compare two; print the findings and return the exit code: 1 if something differs.

    Raises
    ------
    ConfigError, pipeline.run.artifacts.ArtifactError
        If no run is given.
    pipeline.run.reproducible.NotInForce
        If the run is reproducible, and this process is not.
    """
    if len(words) not in (1, 2):
        raise ConfigError(
            "verify takes the folder of a run, and of another one to compare it with: "
            "python -m pipeline verify outputs/NAME/TIME"
        )
    folder, *others = (Path(word).expanduser() for word in words)
    if others:
        return OK if _checked("comparison", lambda: _compare(folder, others[0])) else DIFFERENT
    if not (folder / artifacts.MANIFEST).exists():
        artifacts.read_config(folder)  # says why, of a folder that is none of a run
    with suppress(artifacts.ArtifactError):  # told below, as a file that is missing or changed
        if artifacts.read_config(folder).get("reproducible") is True:
            reproducible.require()
    checks = {"files": _check_files, "makers": _tell_makers, "flights": _fly_again}
    are_right = [_checked(what, partial(check, folder)) for what, check in checks.items()]
    return OK if all(are_right) else DIFFERENT


def _checked(what: str, check: Callable[[], bool]) -> bool:
    """Return the result of a check; False, with a sentence, for whatever it raises of a damaged file."""
    try:
        return check()
    except Exception as error:  # noqa: BLE001 - reporting damage is what this command is for
        told = str(error) if isinstance(error, ValueError | OSError | RecordingError) else ""
        sys.stdout.write(f"{what}: CANNOT BE CHECKED: {told or type(error).__name__}\n")
        return False


def _check_files(folder: Path) -> bool:
    """Print the files that are not as they were written; return whether all are."""
    found = check_files(folder)
    sys.stdout.write("\n".join(_told(found)) + "\n")
    return found.is_whole


def _tell_makers(folder: Path) -> bool:
    """Print how the makers of a run differ from the present one; return True, for that is no damage."""
    for maker in artifacts.read_manifest(folder).get("makers", []):
        _tell_unlike("made by another maker", unlike(maker, present_maker()))
    return True


def _compare(folder: Path, other: Path) -> bool:
    """Print how two runs differ, and whether that is to be expected; return whether they are equal."""
    found = put_beside(folder, other)
    configs = artifacts.stored_config(folder), artifacts.stored_config(other)
    for told in differences(*configs, but=("hydra",), words=("here", "there")):
        sys.stdout.write(f"configuration: {told}\n")
    sys.stdout.write(f"files: {len(found.equal)} equal to the last bit\n")
    sys.stdout.writelines(f"  {name} differs\n" for name in found.different)
    sys.stdout.writelines(f"  {name} is in one of them alone\n" for name in found.single)
    makers = [artifacts.read_manifest(place).get("makers", []) for place in (folder, other)]
    for one in makers[0]:
        for two in makers[1]:
            _tell_unlike("makers differ", unlike(one, two))
    return not (found.different or found.single)


def _tell_unlike(what: str, differing: Sequence[str]) -> None:
    if differing:
        sys.stdout.write(f"{what} ({'; '.join(differing)}): results may differ in the last digits\n")


def _told(found: Integrity) -> list[str]:
    lines = [f"files: {len(found.intact)} as they were written"]
    lines += [f"  {name} has CHANGED since it was written" for name in found.changed]
    lines += [f"  {name} is MISSING" for name in found.missing]
    lines += [f"  {name} is not in the manifest" for name in found.added]
    lines += [f"  {told}, which is not followed" for told in found.strangers]
    return lines


def _fly_again(folder: Path) -> bool:
    """Fly the recorded flights again; return whether each agrees."""
    places = (artifacts.RECORDINGS, artifacts.WORST_FLIGHTS)
    paths = [path for place in places for path in sorted((folder / place).glob("*.mcap"))]
    if not paths:
        sys.stdout.write("flights: none is recorded\n")
        return True
    sys.stdout.write(f"flights: {len(paths)} recorded\n")
    agree = [_checked(f"  {path.name}", partial(_flies_again, path)) for path in paths]
    return all(agree)


def _flies_again(path: Path) -> bool:
    """Print whether a recorded flight repeats, and return it."""
    from pipeline.recording.reflight import fly_again  # noqa: PLC0415 - compiled code, only if there are flights

    again = fly_again(path)
    told = "equal to the last bit"
    if not again.is_equal:
        how = "equal but for the last digits" if again.is_close else "DIFFERENT"
        told = f"{how}: by {again.greatest:.3g} in {again.where}"
    sys.stdout.write(f"  {path.name}: flown again, {told}\n")
    return again.is_close
