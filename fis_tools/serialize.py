"""Controllers as text: JSON and YAML that a person can read and that rebuild the controller exactly.

`fis_tools.formats.mapping` says what a file contains. Reading one executes nothing.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from fis_tools.formats import json, yaml
from fis_tools.formats.mapping import SCHEMA, SCHEMA_VERSION, from_mapping, to_mapping
from fis_tools.formats.plain import MAX_FILE_BYTES, Unreadable
from fis_tools.model import FuzzyController
from fis_tools.validate import ControllerFileError

__all__ = [
    "SCHEMA",
    "SCHEMA_VERSION",
    "ControllerFileError",
    "dump_json",
    "dump_yaml",
    "from_mapping",
    "load",
    "loads",
    "to_mapping",
]

Kind = Literal["json", "yaml"]
_KINDS: dict[str, Kind] = {".json": "json", ".yaml": "yaml", ".yml": "yaml"}


def dump_json(controller: FuzzyController) -> str:
    """Write a controller as JSON text; see `to_mapping` for what is refused."""
    return json.write(to_mapping(controller))


def dump_yaml(controller: FuzzyController) -> str:
    """Write a controller as YAML text; see `to_mapping` for what is refused."""
    return yaml.write(to_mapping(controller))


def load(path: Path | str) -> FuzzyController:
    """Read a controller from a file whose name ends in .json, .yaml or .yml.

    Raises
    ------
    ControllerFileError
        If the file is missing, too large, cut short, of another schema, hostile or wrong in itself.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise ControllerFileError(f"{path}: cannot be read ({reason}); check the path") from error
    kind = _KINDS.get(path.suffix.lower())
    if kind is None:
        raise ControllerFileError(
            f"{path}: a controller file ends in .json, .yaml or .yml; rename it if it is one"
        )
    if len(content) > MAX_FILE_BYTES:
        raise ControllerFileError(f"{path}: larger than {MAX_FILE_BYTES} bytes; a controller is much smaller")
    try:
        return loads(content.decode("utf-8-sig"), kind)
    except UnicodeDecodeError as error:
        raise ControllerFileError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    except ControllerFileError as error:
        raise ControllerFileError(f"{path}: {error}") from error


def loads(text: str, kind: Kind) -> FuzzyController:
    """Read a controller from text.

    Parameters
    ----------
    text : str
        The whole file.
    kind : {"json", "yaml"}
        Which of the two it is.

    Raises
    ------
    ControllerFileError
        As `load` does.
    """
    reader: Callable[[str], Any] = {"json": json.read, "yaml": yaml.read}[kind]
    try:
        mapping = reader(text)
    except Unreadable as error:
        raise ControllerFileError(str(error)) from error
    return from_mapping(mapping)
