"""Controllers as text: every kind of file that is read, and our own JSON and YAML, which hold everything.

`fis_tools.formats.mapping` says what a JSON or YAML file contains. Files of other programs hold one
system each; what they do not state is assumed, and listed. Reading any file executes nothing.

Who makes a controller stores the hash of its content beside what is told of it, such as its fitness. A reader
that finds another content says so, as one more fact: wherever provenance is shown, it is seen.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from fis_tools.errors import ControllerFileError
from fis_tools.formats import mapping, notation
from fis_tools.formats.mapping import to_mapping
from fis_tools.model import FuzzyController
from fis_tools.model.validate import LONGEST_NAME
from plain_files.file_access import read_bytes
from plain_files.plain_text import as_number


@dataclass(frozen=True)
class Written:
    """The content of a file, and what it cannot hold.

    Parameters
    ----------
    text : str
        The whole file.
    losses : tuple of str
        What the format has no place for, one sentence each.
    """

    text: str
    losses: tuple[str, ...]


@dataclass(frozen=True)
class Reading:
    """A controller that was read, and the assumptions made for what the file does not state.

    Parameters
    ----------
    controller : FuzzyController
        It has no problems.
    assumptions : tuple of str
        What the file did not state, one sentence each.
    about_points : tuple of str
        Those of them that are about the points of universes, and do not hold of other points.
    """

    controller: FuzzyController
    assumptions: tuple[str, ...]
    about_points: tuple[str, ...] = ()


@dataclass(frozen=True)
class Form:
    """A kind of file that holds one system.

    Parameters
    ----------
    program : str
        What it is a file of.
    endings : tuple of str
        How its names end; the first is written.
    is_read : bool
        Whether it is read as well as written.
    """

    program: str
    endings: tuple[str, ...]
    is_read: bool = True


#: The kinds of files of other programs; the module of `exchange` named after a kind writes and reads it.
FORMS = {
    "fis": Form("MATLAB and Octave", (".fis",)),
    "fll": Form("fuzzylite", (".fll",)),
    "fcl": Form("jFuzzyLogic", (".fcl",)),
}

#: A kind of file: "json", "yaml", or one of other programs, see `FORMS`.
Kind = str
_KINDS: dict[str, Kind] = {
    ".json": "json",
    ".yaml": "yaml",
    ".yml": "yaml",
    **{ending: name for name, form in FORMS.items() if form.is_read for ending in form.endings},
}
#: How the names of the files end that are read.
ENDINGS = tuple(_KINDS)

_PLAIN_READERS: dict[Kind, Callable[[str], Any]] = {"json": notation.read_json, "yaml": notation.read_yaml}
#: characters of an attribute that is written as a number; a double needs 24
LONGEST_NUMBER = 32


def from_mapping(content: Any) -> FuzzyController:
    """Read a controller from plain data, and check it against the hash in its provenance.

    Raises
    ------
    ControllerFileError
        As `fis_tools.formats.mapping.from_mapping` does.
    """
    return checked(mapping.from_mapping(content))


def dump_json(controller: FuzzyController) -> str:
    """Write a controller as JSON text; see `to_mapping` for what is refused."""
    return notation.write_json(to_mapping(controller))


def fingerprint(controller: FuzzyController) -> str:
    """Return the SHA-256 of a controller's JSON: what reviews, signatures and evidence refer to.

    The same as of the file that ``python -m fis_tools export CONTROLLER --format json`` writes.
    """
    return hashlib.sha256(dump_json(controller).encode()).hexdigest()


def dump_yaml(controller: FuzzyController) -> str:
    """Write a controller as YAML text, for people; see `to_mapping` for what is refused.

    An attribute that is a number is written as one. In JSON, by which controllers are told apart, it is text.

    Raises
    ------
    ControllerFileError
        If it comes to more bytes than are read.
    """
    content = to_mapping(controller)
    content["attributes"] = {name: _number_or_text(text) for name, text in controller.attributes}
    text = notation.write_yaml(content)
    if len(text) > notation.MAX_FILE_BYTES:
        raise ControllerFileError(
            f"{controller.name!r} comes to {len(text)} bytes of YAML, and {notation.MAX_FILE_BYTES} are "
            "read; write JSON"
        )
    return text


def _number_or_text(text: str) -> float | str:
    """Return an attribute as the number that reads back to the same text, if there is one."""
    if len(text) >= LONGEST_NUMBER:
        return text
    for kind in (int, float):
        with suppress(ValueError):
            number = kind(text)
            if repr(number) == text and math.isfinite(number):
                return number
    return text


def kind_of(path: Path | str) -> Kind | None:
    """Return the kind of file that a name's ending says; None for one that is not read."""
    return _KINDS.get(Path(path).suffix.lower())


def load(path: Path | str) -> FuzzyController:
    """Read a controller from a file, by the ending of its name (`ENDINGS`).

    Raises
    ------
    ControllerFileError
        If the file is missing, too large, cut short, of another schema, hostile or wrong in itself.
    """
    return read(path).controller


def read(path: Path | str) -> Reading:
    """Read a controller from a file, and tell what the file does not state.

    Raises
    ------
    ControllerFileError
        As `load` does.
    """
    path = Path(path)
    kind = kind_of(path)
    most = notation.MAX_JSON_BYTES if kind == "json" else notation.MAX_FILE_BYTES
    try:
        content = read_bytes(path, most)
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise ControllerFileError(f"{path}: cannot be read ({reason}); check the path") from error
    if kind is None:
        endings = f"{', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}"
        raise ControllerFileError(f"{path}: a controller file ends in {endings}; rename it if it is one")
    try:
        text, notes = _decoded(content, kind)
        reading = reads(text, kind)
        return replace(reading, assumptions=(*notes, *reading.assumptions))
    except UnicodeDecodeError as error:
        raise ControllerFileError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    except ControllerFileError as error:
        raise ControllerFileError(f"{path}: {error}") from error


def _decoded(content: bytes, kind: Kind) -> tuple[str, tuple[str, ...]]:
    """Return a file's text, and a note on its encoding: old programs write Latin-1."""
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError as error:
        if kind in _PLAIN_READERS or b"\0" in content:
            raise
        byte = f"byte {error.start} is no UTF-8"
        return content.decode("latin-1"), (f"the file is text in Latin-1: {byte}",)


def loads(text: str, kind: Kind) -> FuzzyController:
    """Read a controller from text.

    Parameters
    ----------
    text : str
        The whole file.
    kind : str
        Which kind of file it is: "json", "yaml", or one of `FORMS`.

    Raises
    ------
    ControllerFileError
        As `load` does.
    """
    return reads(text, kind).controller


def reads(text: str, kind: Kind) -> Reading:
    """Read a controller from text, and tell what the text does not state; parameters as for `loads`."""
    if kind not in _PLAIN_READERS:
        return _module(kind).read(text)
    return Reading(from_mapping(_PLAIN_READERS[kind](text)), ())


def writer(name: str) -> Callable[[FuzzyController], Written]:
    """Return the function that writes a kind of another program's files."""
    return _module(name).write


def _module(name: str) -> Any:
    """Import the module of a kind, on demand."""
    return import_module(f"fis_tools.formats.exchange.{name}")


#: the fact that holds the hash of the content that the others are about
CONTENT_HASH: Final = "controller_hash"
#: the fact that tells of a later change
EDITED: Final = "edited"
#: the fact that tells of a change by `fis_tools.findings.simplification`
SIMPLIFIED: Final = "simplified_from"
#: how the name of a controller ends that was changed
EDITED_NAME, SIMPLIFIED_NAME = ", edited", ", simplified"
#: what stands in its purpose before the earlier one
_EARLIER: Final = "Before that, its purpose was: "


def content_hash(controller: FuzzyController) -> str:
    """Return the SHA-256 of what a controller does: its attributes and systems without descriptions."""
    numbers = {name: as_number(text) for name, text in controller.attributes}
    facts = {name: text if numbers[name] is None else numbers[name] for name, text in controller.attributes}
    mapped = to_mapping(controller)
    content = {"attributes": facts, "systems": _without_descriptions(mapped["systems"])}
    content |= {key: mapped[key] for key in ("wires",) if key in mapped}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def described(controller: FuzzyController, facts: Mapping[str, str]) -> FuzzyController:
    """Return a controller with facts about it as its provenance, and the hash of what they are about."""
    provenance = {**facts, CONTENT_HASH: content_hash(controller)}
    return replace(controller, provenance=tuple(sorted(provenance.items())))


def checked(controller: FuzzyController) -> FuzzyController:
    """Return a controller that was read, marked as edited if its provenance is of another."""
    provenance = dict(controller.provenance)
    expected = provenance.get(CONTENT_HASH)
    if expected is None or expected == content_hash(controller):
        return controller
    is_simplified = SIMPLIFIED in provenance
    who = "by simplify" if is_simplified else "by hand"
    return renamed(controller, SIMPLIFIED_NAME if is_simplified else EDITED_NAME).with_provenance(
        {EDITED: f"{who} after training; fitness and figures are of hash {expected}"}
    )


def renamed(controller: FuzzyController, ending: str = EDITED_NAME) -> FuzzyController:
    """Return a changed controller whose name and purpose say so, once."""
    name, words = original_name(controller), ending.removeprefix(", ")
    if name != controller.name:
        return controller
    purpose = f"{name}, {words}. {_EARLIER}{controller.purpose}"
    return replace(
        controller,
        name=f"{name[: LONGEST_NAME - len(ending)].rstrip()}{ending}",
        purpose=purpose if controller.purpose else "",
    )


def unmarked(controller: FuzzyController) -> FuzzyController:
    """Return a controller, such as one trained anew, with the name and the purpose before it was changed."""
    purpose = controller.purpose.partition(_EARLIER)[2] or controller.purpose
    return replace(controller, name=original_name(controller), purpose=purpose)


def original_name(controller: FuzzyController) -> str:
    """Return a controller's name without the ending that says that it was changed."""
    return controller.name.removesuffix(EDITED_NAME).removesuffix(SIMPLIFIED_NAME) or controller.name


def edited(controller: FuzzyController) -> str | None:
    """Return the note that a controller was changed after its provenance was written; None if it was not."""
    return dict(controller.provenance).get(EDITED)


def _without_descriptions(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_descriptions(entry) for key, entry in value.items() if key != "description"}
    return [_without_descriptions(entry) for entry in value] if isinstance(value, list) else value
