"""The arguments after ``python -m pipeline``: options, and overrides mixed with them in any order."""

import argparse
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from pipeline.settings.keys import did_you_mean
from pipeline.settings.places import conf_folder

#: the group that experiments are chosen from
EXPERIMENT = "experiment"
#: options that Hydra programs usually have, and why this one lacks them
REFUSED = {
    "--config-path": "would replace our configuration; add to it with --config-dir",
    "--config-name": "would replace our configuration; add to it with --config-dir",
    "--experimental-rerun": "would load a pickle; go on with resume=RUN_FOLDER instead",
}
#: options, with their argparse settings
OPTIONS: Mapping[tuple[str, ...], Mapping[str, Any]] = {
    ("--help", "-h"): {"action": "store_true"},
    ("--version",): {"action": "store_true"},
    ("--multirun", "-m"): {"action": "store_true"},
    ("--cfg", "-c"): {"choices": ("job",)},
    ("--config-dir", "-cd"): {"type": Path},
}
RESUME, COMPARE = "resume=", "compare="


class ConfigError(ValueError):
    """A command line or a configuration that cannot be used."""


@dataclass(frozen=True)
class Asked:
    """The contents of a command line.

    Parameters
    ----------
    help, version, multirun : bool
    topics : tuple of str
        Experiments, groups and keys that help is asked for.
    cfg : str, optional
        ``job``, to print the configuration.
    config_dir : Path, optional
        The user's own folder of configurations.
    resume : Path, optional
        The folder of a run, or of a sweep, to resume.
    compare : tuple of (Path, Path), optional
        The folders of two runs to compare.
    overrides : tuple of str
    """

    help: bool
    topics: tuple[str, ...]
    version: bool
    multirun: bool
    cfg: str | None
    config_dir: Path | None
    resume: Path | None
    compare: tuple[Path, Path] | None
    overrides: tuple[str, ...]

    @property
    def folders(self) -> list[Path]:
        """The configuration folders, ours and the user's."""
        return folders_with(self.config_dir)


def folders_with(config_dir: Path | None) -> list[Path]:
    """Return the configuration folders, ours and the user's."""
    return [conf_folder(), *([config_dir] if config_dir else [])]


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Raise ConfigError; the program exits only through `pipeline.command_line.cli.main`."""
        raise ConfigError(f"{message}; see python -m pipeline --help")


def read_arguments(arguments: Sequence[str]) -> Asked:
    """Read a command line, without the program's name.

    Raises
    ------
    ConfigError
        If an option or its value is unknown, or the first word is neither an option nor an override.
    """
    first = arguments[0] if arguments else ""
    if first and first[0] not in "+-~" and "=" not in first:
        raise ConfigError(
            f"there is no subcommand {first} (there are edit, summary, verify and warm); an experiment is "
            "started with +experiment=NAME and settings with key=value, see python -m pipeline --help"
        )
    parser = _Parser(add_help=False, allow_abbrev=False)
    for names, how in OPTIONS.items():
        parser.add_argument(*names, **how)
    options, words = parser.parse_known_args(list(arguments))
    asked = {word: re.fullmatch(r"(?:\+experiment=)?([\w.]+)", word) for word in words if options.help}
    topics = [found[1] for found in asked.values() if found]
    words = [word for word in words if not asked.get(word)]
    for word in words:
        if word.startswith("-"):
            _refuse(word)
    if options.config_dir is not None:
        _check_folder(options.config_dir)
    resumed = [word.removeprefix(RESUME) for word in words if word.startswith(RESUME)]
    compared = (
        [] if options.multirun else [word for word in words if word.startswith(COMPARE) and "," in word]
    )
    overrides = tuple(word for word in words if not word.startswith(RESUME) and word not in compared)
    if compared and (len(words) > 1 or compared[0].count(",") > 1):
        raise ConfigError(f"{compared[0]} compares two runs and takes nothing else: compare=RUN_A,RUN_B")
    one, _, other = compared[0].removeprefix(COMPARE).partition(",") if compared else ("", "", "")
    return Asked(
        **vars(options),
        topics=tuple(topics),
        resume=Path(resumed[-1]).expanduser() if resumed else None,
        compare=(Path(one).expanduser(), Path(other).expanduser()) if compared else None,
        overrides=overrides,
    )


def _check_folder(folder: Path) -> None:
    """Raise ConfigError for a folder of configurations that is none, and files hidden by those that ship."""
    if not folder.is_dir():
        raise ConfigError(f"--config-dir {folder} is no folder; give one with experiments of your own")
    for path in sorted(folder.rglob("*.yaml")):
        shipped = conf_folder() / path.relative_to(folder)
        # Hydra reads the first that it finds; a copy may stay
        if shipped.is_file() and shipped.read_bytes() != path.read_bytes():
            raise ConfigError(f"{path} has the name of one that ships, which is read in its place; rename it")


def _refuse(word: str) -> NoReturn:
    option = word.partition("=")[0]
    if option in REFUSED:
        raise ConfigError(f"{option} {REFUSED[option]}")
    known = [name for names in OPTIONS for name in names]
    raise ConfigError(f"there is no option {word}{did_you_mean(word, known)}")
