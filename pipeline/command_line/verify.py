"""The command ``python -m pipeline verify RUN``: whether its files are intact and its flights repeat."""

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.command_line.overrides import ConfigError
from pipeline.run import artifacts
from pipeline.run.integrity import Integrity, check_files
from pipeline.run.maker import present_maker, unlike

OK, DIFFERENT = 0, 1


def verify(words: Sequence[str]) -> int:
    """Check a run, print what was found, and return the exit code: 1 where something differs.

    Raises
    ------
    ConfigError, ValueError, OSError
        If no run is given, or it cannot be read.
    """
    if len(words) != 1:
        raise ConfigError("verify takes the folder of one run: python -m pipeline verify outputs/NAME/TIME")
    folder = Path(words[0]).expanduser()
    found = check_files(folder)
    sys.stdout.write("\n".join(_told(found)) + "\n")
    makers = artifacts.read_manifest(folder).get("makers", [])
    differing = [unlike(maker, present_maker()) for maker in makers]
    for told in filter(None, differing):
        sys.stdout.write(
            f"made by another maker ({'; '.join(told)}): flights may differ in the last digits\n"
        )
    return OK if _fly_again(folder) and found.is_whole else DIFFERENT


def _told(found: Integrity) -> list[str]:
    lines = [f"files: {len(found.intact)} as they were written"]
    lines += [f"  {name} has CHANGED since it was written" for name in found.changed]
    lines += [f"  {name} is MISSING" for name in found.missing]
    lines += [f"  {name} is not in the manifest" for name in found.added]
    return lines


def _fly_again(folder: Path) -> bool:
    """Fly the recorded flights again; tell whether each agrees."""
    places = (artifacts.RECORDINGS, artifacts.WORST_FLIGHTS)
    paths = [path for place in places for path in sorted((folder / place).glob("*.mcap"))]
    if not paths:
        sys.stdout.write("flights: none is recorded\n")
        return True
    from pipeline.recording.reflight import fly_again  # noqa: PLC0415 - compiled code, where there are flights

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
