"""Controllers as files of every form that is written, by how a file's name ends."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from fis_tools.formats import csv, serialize
from fis_tools.formats.c import fmu, source
from fis_tools.model import FuzzyController
from fis_tools.words.text import outline, rule_list
from plain_files.document import html, text


class Whole(NamedTuple):
    """A file format that holds a whole controller: its writer, and how its files' names end."""

    write: Callable[[FuzzyController], str]
    endings: tuple[str, ...]


#: What a controller can be written as besides the forms of other programs.
WHOLE = {
    "markdown": Whole(lambda controller: text.write_markdown(outline(controller)), (".md",)),
    "csv": Whole(csv.write, (".csv",)),
    "text": Whole(lambda controller: text.write(rule_list(controller)), (".txt",)),
    "html": Whole(lambda controller: html.page(outline(controller)), (".html",)),
    "latex": Whole(lambda controller: text.write_latex(outline(controller)), (".tex",)),
    "json": Whole(serialize.dump_json, (".json",)),
    "yaml": Whole(serialize.dump_yaml, (".yaml", ".yml")),
    "c": Whole(source.write, (".c",)),
}
_WRITERS = {ending: form.write for form in WHOLE.values() for ending in form.endings}
#: How the names of files end that hold one system each, by their forms.
ONE_SYSTEM = {**{name: form.endings[0] for name, form in serialize.FORMS.items()}, "fmu": ".fmu"}
#: How the names of files end that are written.
ENDINGS = (*_WRITERS, *ONE_SYSTEM.values())


@dataclass(frozen=True)
class File:
    """The content of a file, and what its format cannot hold, one sentence each."""

    content: bytes
    losses: Sequence[str] = ()


def file_name(name: str) -> str:
    """Return a name that every file system takes."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "_"


def system_files(controller: FuzzyController, ending: str) -> dict[str, FuzzyController]:
    """Return each system as a controller, by the name of its file; raise ValueError for equal names."""
    files: dict[str, FuzzyController] = {}
    for system in controller.systems:
        name = file_name(system.name) + ending
        if any(name.casefold() == other.casefold() for other in files):
            raise ValueError(f"two systems would both be written as {name}; rename {system.name!r}")
        files[name] = controller.only([system.name])
    return files


def written(controller: FuzzyController, path: Path) -> dict[Path, File]:
    """Return the files that hold a controller, by their paths; forms that hold one system have one for each.

    Raises
    ------
    ValueError
        If no form's names end like this, the form cannot hold the controller, or two names are alike.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(f"{path.name} ends in none of {', '.join(ENDINGS)}; name the file so")
    if ending in _WRITERS:
        return {path: File(_WRITERS[ending](controller).encode())}
    (form,) = (name for name, written in ONE_SYSTEM.items() if written == ending)
    if len(controller.systems) == 1:
        return {path: of_one_system(controller, form)}
    files = {
        path.with_name(f"{path.stem}-{name}"): of_one_system(single, form)
        for name, single in system_files(controller, ending).items()
    }
    last = next(reversed(files))
    return {**files, last: replace(files[last], losses=(*files[last].losses, *wires_lost(controller)))}


def wires_lost(controller: FuzzyController) -> list[str]:
    """Return a sentence on wires, which files of one system cannot hold."""
    words = ", ".join(f"{wire.source} {wire.target}" for wire in controller.wires)
    return [f"the wires are in no file ({words}); import --wire takes them again"] if words else []


def of_one_system(controller: FuzzyController, form: str) -> File:
    """Return the file of one of the forms `ONE_SYSTEM` that holds a controller with one system.

    Raises
    ------
    ValueError
        If the form cannot hold it.
    """
    if form == "fmu":
        return File(*fmu.pack(controller, serialize.fingerprint(controller)))
    file = serialize.writer(form)(controller)
    return File(file.text.encode(), file.losses)
