"""`export`: a controller in another form."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fis_tools.array_types import Floats
from fis_tools.commands.arguments import (
    AskedInOrder,
    Output,
    UserMistake,
    chosen,
    file_name,
    place_for,
    write,
)
from fis_tools.document import html, text
from fis_tools.formats import csv, serialize
from fis_tools.formats.c import fmu, parts, source
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.formats.serialize import Written
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import thrust_logic
from fis_tools.model.validate import InvalidSystem
from fis_tools.words.text import outline, rule_list


@dataclass(frozen=True)
class Form:
    """What a controller can be written as.

    Parameters
    ----------
    ending : str
        How the names of its files end.
    write : callable, optional
        A controller to a text.
    write_ranked : callable, optional
        The same, and the rules can be given in the order of how much they matter.
    """

    ending: str
    write: Callable[[FuzzyController], str] | None = None
    write_ranked: Callable[[FuzzyController, Mapping[str, Floats] | None], str] | None = None


FORMS = {
    "markdown": Form(".md", write_ranked=lambda *content: text.write_markdown(outline(*content))),
    "csv": Form(".csv", write_ranked=csv.write),
    "text": Form(".txt", write_ranked=lambda *content: text.write(rule_list(*content))),
    "html": Form(".html", write_ranked=lambda *content: html.page(outline(*content))),
    "latex": Form(".tex", write_ranked=lambda *content: text.write_latex(outline(*content))),
    "json": Form(".json", write=serialize.dump_json),
    "yaml": Form(".yaml", write=serialize.dump_yaml),
    **{name: Form(form.endings[0]) for name, form in serialize.FORMS.items()},
    "c": Form(".c"),
    "fmu": Form(".fmu"),
}


def export(
    asked: AskedInOrder,
    *,
    format: Annotated[str, Parameter(choices=tuple(FORMS))],
    output: Output = None,
    bare: bool = False,
) -> None:
    """Write a controller as tables, for other programs, or as C source.

    - markdown, csv, text, html, latex: terms and rules to read
    - json, yaml: a controller file, which holds everything
    - fis, fll, fml, fcl: MATLAB and Octave, fuzzylite, IEEE 1855, IEC 61131-7: a file a system; what the form
      has no place for is listed, and carried, where it has comments for that, in one that `import` reads
    - c: C99 source that stands alone: for a controller that commands a force step(), which has its thrust
      logic; else a function a system
    - fmu: FMI 2.0 for co-simulation (Simulink, Dymola, OpenModelica): a file a system, its inference alone;
      with a library where gcc is at hand

    For example:

        python -m fis_tools export controller.yaml --format markdown > controller.md
        python -m fis_tools export controller.yaml --format csv --by importance --flights episodes/*.mcap
        python -m fis_tools export controller.yaml --format fis -o exchange
        python -m fis_tools export controller.yaml --format fll --system force_x -o force_x.fll

    Parameters
    ----------
    format
        what to write
    output
        where to [default: printed]; with a file a system, a folder if its name has no ending
    bare
        c: inference alone, without the thrust logic of a controller that commands a force
    """
    form = FORMS[format]
    if asked.by is not None and form.write_ranked is None:
        ranked = ", ".join(name for name, each in FORMS.items() if each.write_ranked is not None)
        raise UserMistake(f"--by is for forms to read; choose one of {ranked}, or leave it out")
    if bare and format != "c":
        raise UserMistake("--bare is for --format c; leave it out")
    controller = asked.read()
    if format == "c":
        _write_c(controller, output, bare)
    elif format == "fmu":
        _write_fmus(controller, output)
    elif format in serialize.FORMS:
        _write_each(controller, serialize.writer(format), form.ending, output)
    elif form.write_ranked is not None:
        write(output, form.write_ranked(controller, asked.importance(controller)))
    elif form.write is not None:
        write(output, form.write(controller))


def _write_c(controller: FuzzyController, output: str | None, bare: bool) -> None:
    """Write a controller as C, and tell what it needs."""
    try:
        text = source.write(controller, bare)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    write(output, text)
    counts = parts.operations(controller)._asdict()
    operations = ", ".join(f"{count:,} {name}" for name, count in counts.items())
    print(f"a call takes at most {operations} on doubles", file=sys.stderr)
    stack = parts.stack_bytes(text)
    words = "no gcc here to measure it"
    if stack is not None:
        words = f"at most {stack:,} bytes, without the C library's; by gcc -O2 on this machine"
    print(f"stack: {words}", file=sys.stderr)


def _write_each(
    controller: FuzzyController, form: Callable[[FuzzyController], Written], ending: str, output: str | None
) -> None:
    """Write each system into a file of its own, and tell what the files do not say."""
    place = None if output is None else Path(output)
    is_folder = place is not None and _is_folder(controller, place)
    files: dict[str, Written] = {}
    for name, alone in _files(controller, ending, place).items():
        try:
            files[name] = form(alone)
        except (NotExpressible, InvalidSystem) as error:
            raise UserMistake(f"{alone.systems[0].name}: {error}") from error
    for name, written in files.items():
        if is_folder and place is not None:
            write(str(place_for(place / name)), written.text)
            print(place / name)
        else:
            write(output, written.text)
        for loss in written.losses:
            print(f"{name}: {loss}", file=sys.stderr)


def _write_fmus(controller: FuzzyController, output: str | None) -> None:
    """Write each system as an FMU, and tell what it can run on."""
    if output is None:
        raise UserMistake("an FMU is an archive and cannot be printed; add -o FILE.fmu or -o FOLDER")
    place = Path(output)
    for name, alone in _files(controller, FORMS["fmu"].ending, place).items():
        try:
            packed = fmu.pack(alone.systems[0], serialize.fingerprint(alone))
        except ValueError as error:
            raise UserMistake(str(error)) from error
        path = place_for(place / name if _is_folder(controller, place) else place)
        path.write_bytes(packed.content)
        holds = f"a library for {packed.library}, by gcc on this machine, and its source"
        if not packed.library:
            holds = "the source alone: a library is made where gcc is, on Linux and x86-64"
        print(f"{path}: {holds}")
        if thrust_logic(alone) is not None:
            print(f"{path}: inference alone, without the thrust logic of the controller", file=sys.stderr)


def _is_folder(controller: FuzzyController, place: Path) -> bool:
    """Return whether a place is one for several files."""
    return place.is_dir() or not place.suffix or len(controller.systems) > 1


def _files(controller: FuzzyController, ending: str, place: Path | None) -> dict[str, FuzzyController]:
    """Return what goes into which file, where a file holds one system."""
    if len(controller.systems) > 1 and (place is None or place.suffix == ending):
        names = ", ".join(system.name for system in controller.systems)
        raise UserMistake(
            f"a file of this form holds one system, and there are several; add --system, one of {names}, or "
            "-o FOLDER for a file each"
        )
    files: dict[str, FuzzyController] = {}
    for system in controller.systems:
        name = file_name(system.name) + ending
        if any(name.casefold() == other.casefold() for other in files):
            raise UserMistake(
                f"two systems would both be written as {name}; write one at a time, with --system"
            )
        files[name] = chosen(controller, system.name)
    return files
