"""The command ``verify``: whether a run's files are intact and its flights repeat.

For two runs, whether they made the same files, and if not, whether they should have.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.command_line.job import ConfigError, differences
from pipeline.run import artifacts, reproducible
from pipeline.run.integrity import Integrity, check_files, put_beside
from pipeline.run.maker import present_maker, unlike

OK, DIFFERENT = 0, 1


def verify(words: Sequence[str]) -> int:
    """Check a run, or compare two; print the findings and return the exit code: 1 if something differs.

    Raises
    ------
    ConfigError, ValueError, OSError
        If no run is given, or it cannot be read.
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
        return _compare(folder, others[0])
    found = check_files(folder)
    if artifacts.read_config(folder).get("reproducible") is True:
        reproducible.require()
    sys.stdout.write("\n".join(_told(found)) + "\n")
    for maker in artifacts.read_manifest(folder).get("makers", []):
        _tell_unlike("made by another maker", unlike(maker, present_maker()))
    return OK if _fly_again(folder) and found.is_whole else DIFFERENT


def _compare(folder: Path, other: Path) -> int:
    """Print how two runs differ, and whether that is to be expected."""
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
    return DIFFERENT if found.different or found.single else OK


def _tell_unlike(what: str, differing: Sequence[str]) -> None:
    if differing:
        sys.stdout.write(f"{what} ({'; '.join(differing)}): results may differ in the last digits\n")


def _told(found: Integrity) -> list[str]:
    lines = [f"files: {len(found.intact)} as they were written"]
    lines += [f"  {name} has CHANGED since it was written" for name in found.changed]
    lines += [f"  {name} is MISSING" for name in found.missing]
    lines += [f"  {name} is not in the manifest" for name in found.added]
    return lines


def _fly_again(folder: Path) -> bool:
    """Fly the recorded flights again; return whether each agrees."""
    places = (artifacts.RECORDINGS, artifacts.WORST_FLIGHTS)
    paths = [path for place in places for path in sorted((folder / place).glob("*.mcap"))]
    if not paths:
        sys.stdout.write("flights: none is recorded\n")
        return True
    from pipeline.recording.reflight import fly_again  # noqa: PLC0415 - compiled code, only if there are flights

    sys.stdout.write(f"flights: {len(paths)} recorded\n")
    all_agree = True
    for path in paths:
        try:
            again = fly_again(path)
        except ValueError as error:
            told, agrees = f"CANNOT BE FLOWN AGAIN: {error}", False
        else:
            agrees = again.is_close
            told = "flown again, equal to the last bit"
            if not again.is_equal:
                how = "equal but for the last digits" if again.is_close else "DIFFERENT"
                told = f"flown again, {how}: by {again.greatest:.3g} in {again.where}"
        all_agree &= agrees
        sys.stdout.write(f"  {path.name}: {told}\n")
    return all_agree
