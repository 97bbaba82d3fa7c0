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
}
_ONE_SYSTEM = {ending: name for name, form in serialize.FORMS.items() for ending in form.endings[:1]}
#: How the names of files end that are written.
ENDINGS = (*_WHOLE_ENDINGS, *_ONE_SYSTEM, ".c", ".fmu")


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
    if ending == ".c":
        return {place: File(source.write(controller, bare=False).encode())}
    alone = [replace(controller, systems=(system,)) for system in controller.systems]
    paths = (
        [place]
        if len(alone) == 1
        else [place.with_stem(f"{place.stem}-{one.systems[0].name}") for one in alone]
    )
    return {path: _of_one_system(one, ending) for path, one in zip(paths, alone, strict=True)}


def _of_one_system(controller: FuzzyController, ending: str) -> File:
    if ending == ".fmu":
        return File(fmu.pack(controller.systems[0], serialize.fingerprint(controller)).content)
    file = serialize.writer(_ONE_SYSTEM[ending])(controller)
    return File(file.text.encode(), file.losses)
