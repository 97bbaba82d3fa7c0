"""The configuration of a run of which a sweep of an earlier version kept only the words that started it.

The words are data: neither Hydra nor OmegaConf sees any of them. A word chooses one of the options that ship,
by its name, or sets a key to a plain value; everything else is refused.
"""

import re
import shlex
from pathlib import Path
from typing import Any, Final, NamedTuple

from pipeline.command_line.arguments import EXPERIMENT, ConfigError
from pipeline.command_line.choices import options
from pipeline.command_line.config import compose_node, plain
from pipeline.command_line.overrides import SUFFIXES
from pipeline.run.sweep import SweptRun
from pipeline.settings import start_table
from pipeline.settings.keys import is_key, value_at, with_values
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import checked

#: a key and its value, without anything that an expression, a quotation or a path outside needs
WORD: Final = re.compile(r"(\+{0,2})([\w./]+)=([\w.+:/-]*|\[[\w.+:/,-]*\])")
#: in a configuration of ours, a reference to another key
REFERENCE: Final = re.compile(r"\$\{([\w.]+)\}")
CONSTANTS: Final = {"null": None, "true": True, "false": False}


class Taken(NamedTuple):
    """Words of a command: choices of options that ship, values of keys, and those that are not taken."""

    choices: list[str]
    values: dict[str, Any]
    refused: list[str]


def config_of(folder: Path, run: SweptRun) -> dict[str, Any]:
    """Return the checked configuration of a run of a sweep from its recorded words.

    Parameters
    ----------
    folder : Path
        The sweep's.
    run : SweptRun

    Raises
    ------
    ConfigError, pipeline.settings.checks.SettingError
        If it has none, or one that is not taken; the message says what to type instead.
    """
    if not run.command:
        raise ConfigError(f"{run.folder} was deleted, and how it was started is not known; start it by hand")
    taken = _taken(run.command)
    if not taken.refused:
        config = plain(compose_node(taken.choices), resolve=False)
        config = _resolved(with_values(config, taken.values))
        worlds = value_at(config, "compare.worlds")
        if not any(isinstance(changes, str) for changes in (worlds or {}).values()):
            start_table.read_starts(config)
            return checked(config, frozenset(taken.values))[0]
        taken.refused.append("compare.worlds")
    others = [word for word in run.command if word not in taken.refused]
    typed = shlex.join(["python", "-m", "pipeline", *others, f"hydra.run.dir={folder / run.folder}"])
    raise ConfigError(
        f"{run.folder} was deleted, and of the words that started it these are no plain values of keys: "
        f"{', '.join(taken.refused)}. What is stored is not composed; to start the run again, add them, if "
        f"you trust them, to: {typed}"
    )


def _taken(command: tuple[str, ...]) -> Taken:
    """Sort the words of a command."""
    taken, groups = Taken([], {}, []), options([conf_folder()])
    for word in command:
        match = WORD.fullmatch(word)
        plus, key, text = match.groups() if match else ("", "", "")
        reader = SUFFIXES.get(key, {}).get(Path(text.lower()).suffix)
        ours = next((name for name in groups.get(key, ()) if name in (reader, text)), None)
        if reader:
            taken.values[f"{key}.path"] = text
        if key in groups and ours:
            added = "+" if plus or key == EXPERIMENT else ""
            taken.choices.append(f"{added}{key}={ours}")
        elif match and key not in groups and is_key(key):
            taken.values[key] = _value(text)
        else:
            taken.refused.append(word)
    return taken


def _value(text: str) -> Any:
    """Return a plain value: a number, a constant, a text, or a list of these."""
    if text.startswith("["):
        return [_value(item) for item in text[1:-1].split(",") if item]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return CONSTANTS.get(text.lower(), text)


def _resolved(config: dict[str, Any]) -> dict[str, Any]:
    """Return a configuration with the references of our own files to other keys replaced."""

    def replaced(node: Any) -> Any:
        if isinstance(node, dict):
            return {key: replaced(value) for key, value in node.items()}
        match = REFERENCE.fullmatch(node) if isinstance(node, str) else None
        return value_at(config, match[1]) if match else node

    return {key: replaced(value) for key, value in config.items()}
