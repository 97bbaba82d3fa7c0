"""Controllers as files of every form that is written, by how a file's name ends."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fis_tools.document import html, text
from fis_tools.formats import csv, serialize
from fis_tools.formats.c import fmu, source
from fis_tools.model import FuzzyController
from fis_tools.words.text import outline, rule_list

#: What a controller can be written as besides the forms of other programs.
WHOLE: dict[str, Callable[[FuzzyController], str]] = {
    "markdown": lambda controller: text.write_markdown(outline(controller)),
    "csv": csv.write,
    "text": lambda controller: text.write(rule_list(controller)),
    "html": lambda controller: html.page(outline(controller)),
    "latex": lambda controller: text.write_latex(outline(controller)),
    "json": serialize.dump_json,
    "yaml": serialize.dump_yaml,
    "c": source.write,
}
_WHOLE_ENDINGS = {
    ".md": "markdown",
    ".csv": "csv",
    ".txt": "text",
    ".html": "html",
    ".tex": "latex",
    ".json": "json",
    ".yaml": "yaml",
    ".yml": "yaml",
    ".c": "c",
}
#: How the names of files end that hold one system each, by their forms.
ONE_SYSTEM = {**{name: form.endings[0] for name, form in serialize.FORMS.items()}, "fmu": ".fmu"}
#: How the names of files end that are written.
ENDINGS = (*_WHOLE_ENDINGS, *ONE_SYSTEM.values())


@dataclass(frozen=True)
class File:
    """The content of a file, and what its form has no place for, one sentence each."""

    content: bytes
    losses: Sequence[str] = ()


def written(controller: FuzzyController, place: Path) -> dict[Path, File]:
    """Return the files that hold a controller, by their paths; forms that hold one system have one for each.

    Raises
    ------
    ValueError
        If no form's names end like this, or the form cannot hold the controller.
    """
    ending = place.suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(f"{place.name} ends in none of {', '.join(ENDINGS)}; name the file so")
    if ending in _WHOLE_ENDINGS:
        return {place: File(WHOLE[_WHOLE_ENDINGS[ending]](controller).encode())}
    alone = [replace(controller, systems=(system,)) for system in controller.systems]
    paths = [place.with_stem(f"{place.stem}-{one.systems[0].name}") for one in alone]
    paths = [place] if len(alone) == 1 else paths
    (form,) = (name for name, written in ONE_SYSTEM.items() if written == ending)
    return {path: of_one_system(one, form) for path, one in zip(paths, alone, strict=True)}


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
