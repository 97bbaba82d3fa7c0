"""The arguments after ``python -m pipeline``: Hydra's options, and overrides mixed with them in any order."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NoReturn

from hydra._internal.utils import get_args_parser

from fis_tools.file_access import read_bytes, read_shipped
from pipeline.settings.keys import did_you_mean
from pipeline.settings.places import conf_folder

#: the group that experiments are chosen from
EXPERIMENT: Final = "experiment"
#: commands beside experiments, and the modules with functions of their names, which few runs need
_MODULES = {"commands": ("edit", "export_c", "warm"), "results": ("summary", "verify")}
COMMANDS: Final = {name: module for module, names in _MODULES.items() for name in names}
#: options of Hydra that this program lacks, and why
REFUSED: Final = {
    "--config-path": "would replace our configuration; add to it with --config-dir",
    "--config-name": "would replace our configuration; add to it with --config-dir",
    "--experimental-rerun": "would load a pickle; go on with resume=RUN_FOLDER instead",
}
RESUME: Final = "resume="
COMPARE: Final = "compare="


class ConfigError(ValueError):
    """A command line or a configuration that cannot be used."""


class CommandLine(argparse.Namespace):
    """The contents of a command line: all options of Hydra, and these.

    Attributes
    ----------
    config_dir : Path, optional
        The user's own folder of configurations.
    resume : Path, optional
        The folder of a run, or of a sweep, to resume.
    compare : tuple of Path
        The folders of two runs to compare; empty unless they are.
    overrides : list of str
    hydra_options : list of str
        All options that Hydra knows, in its own words.
    folders : list of Path
        The configuration folders, ours and the user's.
    config_option : list of str
        The option of a folder of configurations as it is kept with a run: wherever that is resumed.
    is_ours_to_print : bool
        Whether the configuration is printed by this program, with meanings: ``--cfg job`` and no more.
    """

    help: bool
    version: bool
    multirun: bool
    shell_completion: bool
    cfg: str | None
    config_dir: Path | None
    resume: Path | None
    compare: tuple[Path, ...]
    overrides: list[str]
    hydra_options: list[str]
    folders: list[Path]
    config_option: list[str]
    is_ours_to_print: bool


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
        If an option or its value is unknown, or the first word is neither an option nor an override.
    """
    first = arguments[0] if arguments else ""
    if first and first[0] not in "+-~" and "=" not in first:
        *names, last = sorted(COMMANDS)
        raise ConfigError(
            f"there is no subcommand {first} (there are {', '.join(names)} and {last}); an "
            "experiment is started with +experiment=NAME and settings with key=value, see python -m pipeline "
            "--help"
        )
    parser = CommandParser("python -m pipeline", parents=[get_args_parser()], conflict_handler="resolve")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=Path)
    command, unknown = parser.parse_known_intermixed_args(list(arguments), CommandLine())
    given = {f"--{name.replace('_', '-')}": value for name, value in vars(command).items() if value}
    for option, why in REFUSED.items():
        if option in given:
            raise ConfigError(f"{option} {why}")
    for word in unknown:
        if word.startswith("-"):
            names = [name for action in parser._actions for name in action.option_strings]
            raise ConfigError(f"there is no option {word}{did_you_mean(word, names)}")
    command.folders, command.config_option = [conf_folder()], []
    if command.config_dir is not None:
        given["--config-dir"] = _checked(command.config_dir).resolve()
        command.folders.append(command.config_dir)
        command.config_option = ["--config-dir", str(given["--config-dir"])]
    words = [*command.overrides, *unknown]
    resumed = [word.removeprefix(RESUME) for word in words if word.startswith(RESUME)]
    compared = [w for w in words if w.startswith(COMPARE) and "," in w and not command.multirun]
    if compared and (len(words) > 1 or compared[0].count(",") > 1):
        raise ConfigError(f"{compared[0]} compares two runs and takes nothing else: compare=RUN_A,RUN_B")
    command.resume = Path(resumed[-1]).expanduser() if resumed else None
    folders = compared[0].removeprefix(COMPARE).split(",") if compared else []
    command.compare = tuple(Path(folder).expanduser() for folder in folders)
    command.overrides = [word for word in words if not word.startswith(RESUME) and word not in compared]
    ours = {"--overrides", "--help", "--version"}
    pairs = ((key, value) for key, value in given.items() if key not in ours)
    command.hydra_options = [
        word for key, value in pairs for word in ([key] if value is True else [key, str(value)])
    ]
    plainly = {"--cfg", "job", "--multirun", *command.config_option}
    command.is_ours_to_print = command.cfg == "job" and plainly.issuperset(command.hydra_options)
    return command


def _checked(folder: Path) -> Path:
    """Return a folder of configurations; raise ConfigError for none, and files hidden by those that ship."""
    if not folder.is_dir():
        raise ConfigError(f"--config-dir {folder} is no folder; give one with experiments of your own")
    for path in sorted(folder.rglob("*.yaml")):
        shipped = conf_folder() / path.relative_to(folder)
        # Hydra reads the first that it finds; a copy may stay
        if shipped.is_file() and read_shipped(shipped).encode() != read_bytes(path):
            raise ConfigError(f"{path} has the name of one that ships, which is read in its place; rename it")
    return folder
