"""The arguments after ``python -m pipeline``: Hydra's options, and overrides mixed with them in any order."""

import argparse
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final, NoReturn

from pipeline.settings.keys import KNOWN, choices_of, did_you_mean
from pipeline.settings.places import conf_folder
from plain_files import plain_yaml
from plain_files.file_access import read_bytes, read_shipped

#: the group that experiments are chosen from
EXPERIMENT: Final = "experiment"
#: commands beside experiments, and the modules with functions of their names, which few runs need
_MODULES = {
    "commands": ("edit", "export_c", "warm"),
    "flown_again": ("again", "fly", "repeat"),
    "merged": ("merge",),
    "results": ("compare", "summary", "verify"),
}
COMMANDS: Final = {name: module for module, names in _MODULES.items() for name in names}
#: options of Hydra that this program lacks, and why
REFUSED: Final = {
    "--config-path": "would replace our configuration; add to it with --config-dir",
    "--config-name": "would replace our configuration; add to it with --config-dir",
    "--experimental-rerun": "would load a pickle; go on with resume=RUN_FOLDER instead",
}
RESUME: Final = "resume="
#: keys that name a folder
FOLDERS: Final = ("hydra.run.dir", "hydra.sweep.dir")


class ConfigError(ValueError):
    """A command line or a configuration that cannot be used."""


class CommandLine(argparse.Namespace):
    """The contents of a command line: all options of Hydra, and these.

    Attributes
    ----------
    version : bool
    config_dir : Path, optional
        The user's own folder of configurations.
    resume : Path, optional
        The folder of a run, or of a sweep, to resume.
    overrides : list of str
    hydra_options : list of str
        The options with their values, as they were written.
    folders : list of Path
        The configuration folders, ours and the user's.
    """

    version: bool
    config_dir: Path | None
    resume: Path | None
    overrides: list[str]
    hydra_options: list[str]
    folders: list[Path]


class CommandParser(argparse.ArgumentParser):
    """Parses the options of a command; errors are sentences."""

    def __init__(self, command: str, **settings: Any) -> None:
        super().__init__(command, add_help=False, allow_abbrev=False, **settings)

    def error(self, message: str) -> NoReturn:
        """Raise ConfigError; the program exits only through `pipeline.command_line.cli.main`."""
        raise ConfigError(f"{message}; see {self.prog} --help")


def parse_arguments(arguments: Sequence[str]) -> CommandLine:
    """Parse a command line, without the program's name.

    Raises
    ------
    ConfigError
        If an option or its value is unknown, the first word is neither an option nor an override, or a
        folder has no name.
    """
    first = arguments[0] if arguments else ""
    if first and not first.startswith("-") and not _is_override(first):
        raise ConfigError(
            f"there is no command {first}{choices_of(first, sorted(COMMANDS), 'commands')}. An experiment is "
            "started with +experiment=NAME, settings with key=value; see python -m pipeline --help"
        )
    from pipeline.command_line.hydra_parts import get_args_parser  # noqa: PLC0415 - Hydra

    parser = CommandParser("python -m pipeline", parents=[get_args_parser()], conflict_handler="resolve")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=Path)
    words = [  # an override after --info is not what is to be shown
        f"{word}=all" if word in ("--info", "-i") and _is_override(after) else word
        for word, after in zip_longest(arguments, arguments[1:], fillvalue="")
    ]
    command, unknown = parser.parse_known_intermixed_args(words, CommandLine())
    for option, why in REFUSED.items():
        if getattr(command, option.lstrip("-").replace("-", "_")):
            raise ConfigError(f"{option} {why}")
    overrides = [*command.overrides, *unknown]
    for word in overrides:
        if word.startswith("-"):
            known = [*parser._option_string_actions, *KNOWN]
            raise ConfigError(f"there is no option {word}{did_you_mean(word, known)}")
        if word.lstrip("+").rstrip("'\" ") in (RESUME, *(f"{key}=" for key in FOLDERS)):
            raise ConfigError(f"{word} names no folder; write one behind it, or leave it out")
    resumed = [word.removeprefix(RESUME) for word in overrides if word.startswith(RESUME)]
    command.resume = Path(resumed[-1]).expanduser() if resumed else None
    command.overrides = [word for word in overrides if not word.startswith(RESUME)]
    command.hydra_options = [word for word in words if word not in overrides]
    command.multirun |= "hydra.mode=MULTIRUN" in overrides
    command.folders = [conf_folder()]
    if command.config_dir is not None:
        check_folder("--config-dir", command.config_dir)
        command.folders.append(command.config_dir)
    return command


def _is_override(word: str) -> bool:
    return word.startswith(("+", "~")) or "=" in word


def is_change(word: str) -> bool:
    """Return whether a word changes a setting, and neither resumes nor sweeps."""
    return _is_override(word) and not word.startswith(("-", RESUME, "hydra.mode="))


def check_folder(option: str, folder: Path) -> None:
    """Raise ConfigError for a folder of configurations that is none, or has a file that cannot be used.

    That is a file that one that ships hides, or an option that is no mapping.
    """
    if not folder.is_dir():
        raise ConfigError(f"{option} {folder} is no folder; give one with experiments of your own")
    for path in sorted(filter(Path.is_file, folder.rglob("*.yaml"))):
        group, shipped = path.relative_to(folder).parts[0], conf_folder() / path.relative_to(folder)
        # Hydra reads the first that it finds; a copy may stay
        if shipped.is_file() and read_shipped(shipped).encode() != read_bytes(path):
            raise ConfigError(f"{path} has the name of one that ships, which is read in its place; rename it")
        if (conf_folder() / group).is_dir() and not plain_yaml.is_mapping(read_bytes(path.resolve())):
            raise ConfigError(f"{path} is no mapping; write settings into it as key: value, or move it away")
