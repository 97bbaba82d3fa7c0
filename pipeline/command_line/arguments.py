"""The arguments after ``python -m pipeline``: Hydra's options, and overrides mixed with them in any order."""

import argparse
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn

from hydra._internal.utils import get_args_parser

from fis_tools.file_access import read_bytes, read_shipped
from pipeline.settings.keys import did_you_mean
from pipeline.settings.places import conf_folder

#: the group that experiments are chosen from
EXPERIMENT: Final = "experiment"
#: commands beside experiments
COMMANDS: Final = ("edit", "export_c", "summary", "verify", "warm")
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


@dataclass(frozen=True)
class CommandLine:
    """The contents of a command line.

    Parameters
    ----------
    help, version, multirun : bool
    topics : tuple of str
        Experiments, groups and keys that help is asked for.
    cfg : str, optional
        What Hydra is to print of the configuration: ``job``, ``hydra`` or ``all``.
    config_dir : Path, optional
        The user's own folder of configurations.
    resume : Path, optional
        The folder of a run, or of a sweep, to resume.
    compare : tuple of (Path, Path), optional
        The folders of two runs to compare.
    overrides : tuple of str
    hydra_options : tuple of str
        All options that Hydra knows, in its own words.
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
    hydra_options: tuple[str, ...]

    @property
    def folders(self) -> list[Path]:
        """The configuration folders, ours and the user's."""
        return folders_with(self.config_dir)

    @property
    def is_ours_to_print(self) -> bool:
        """Whether the configuration is printed by this program, with meanings: ``--cfg job`` and no more."""
        return self.cfg == "job" and set(self.hydra_options) <= {
            "--cfg",
            "job",
            "--multirun",
            *self.config_option,
        }

    @property
    def is_completion(self) -> bool:
        """Whether a shell asks for completions, or how to install them."""
        return "--shell-completion" in self.hydra_options

    @property
    def config_option(self) -> list[str]:
        """The option of a folder of configurations as it is kept with a run: wherever that is resumed."""
        return ["--config-dir", str(self.config_dir.resolve())] if self.config_dir else []


def folders_with(config_dir: Path | None) -> list[Path]:
    """Return the configuration folders, ours and the user's."""
    return [conf_folder(), *([config_dir] if config_dir else [])]


class CommandParser(argparse.ArgumentParser):
    """Parses options; what is wrong is told in a sentence."""

    def error(self, message: str) -> NoReturn:
        """Raise ConfigError; the program exits only through `pipeline.command_line.cli.main`."""
        raise ConfigError(f"{message}; see {self.prog} --help")


def _parser() -> CommandParser:
    """Return a parser of Hydra's options, whose version is this program's."""
    hydra = get_args_parser()
    parser = CommandParser(
        prog="python -m pipeline",
        add_help=False,
        allow_abbrev=False,
        parents=[hydra],
        conflict_handler="resolve",
    )
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=Path)
    return parser


def parse_arguments(arguments: Sequence[str]) -> CommandLine:
    """Parse a command line, without the program's name.

    Raises
    ------
    ConfigError
        If an option or its value is unknown, or the first word is neither an option nor an override.
    """
    first = arguments[0] if arguments else ""
    if first and first[0] not in "+-~" and "=" not in first:
        raise ConfigError(
            f"there is no subcommand {first} (there are {', '.join(COMMANDS[:-1])} and {COMMANDS[-1]}); an "
            "experiment is started with +experiment=NAME and settings with key=value, see python -m pipeline "
            "--help"
        )
    parser = _parser()
    options, unknown = parser.parse_known_intermixed_args(list(arguments))
    for name in REFUSED:
        if getattr(options, name.lstrip("-").replace("-", "_")) is not None:
            raise ConfigError(f"{name} {REFUSED[name]}")
    for word in unknown:
        if word.startswith("-"):
            names = [name for action in parser._actions for name in action.option_strings]
            raise ConfigError(f"there is no option {word}{did_you_mean(word, names)}")
    words = [*options.overrides, *unknown]
    matches = {word: re.fullmatch(r"(?:\+experiment=)?([\w.]+)", word) for word in words if options.help}
    topics = [match[1] for match in matches.values() if match]
    words = [word for word in words if not matches.get(word)]
    if options.config_dir is not None:
        check_config_dir(options.config_dir)
    resumed = [word.removeprefix(RESUME) for word in words if word.startswith(RESUME)]
    compared = (
        [] if options.multirun else [word for word in words if word.startswith(COMPARE) and "," in word]
    )
    if compared and (len(words) > 1 or compared[0].count(",") > 1):
        raise ConfigError(f"{compared[0]} compares two runs and takes nothing else: compare=RUN_A,RUN_B")
    first, _, second = compared[0].removeprefix(COMPARE).partition(",") if compared else ("", "", "")
    return CommandLine(
        **{name: getattr(options, name) for name in ("help", "version", "multirun", "cfg", "config_dir")},
        topics=tuple(topics),
        resume=Path(resumed[-1]).expanduser() if resumed else None,
        compare=(Path(first).expanduser(), Path(second).expanduser()) if compared else None,
        overrides=tuple(word for word in words if not word.startswith(RESUME) and word not in compared),
        hydra_options=tuple(_hydra_options(vars(options))),
    )


def _hydra_options(options: dict[str, Any]) -> list[str]:
    """Return the options that Hydra is given, without overrides, help and version."""
    words: list[str] = []
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        if name in ("overrides", "help", "version") or value in (None, False):
            continue
        path = str(value.resolve()) if isinstance(value, Path) else value
        words += [option] if value is True else [option, str(path)]
    return words


def check_config_dir(folder: Path) -> None:
    """Raise ConfigError for a folder of configurations that is none, and files hidden by those that ship."""
    if not folder.is_dir():
        raise ConfigError(f"--config-dir {folder} is no folder; give one with experiments of your own")
    for path in sorted(folder.rglob("*.yaml")):
        shipped = conf_folder() / path.relative_to(folder)
        # Hydra reads the first that it finds; a copy may stay
        if shipped.is_file() and read_shipped(shipped).encode() != read_bytes(path):
            raise ConfigError(f"{path} has the name of one that ships, which is read in its place; rename it")
