"""Code, frames and stack of an exported controller, as a compiler lays them out."""

import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from pipeline.onboard.recorded import FLAGS
from plain_files.file_access import read_text

_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "(\w+)\\n[^"\\]*(?:\\n(\d+) bytes \((.*?)\))?')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')


@dataclass(frozen=True)
class Sizes:
    """Bytes that a program takes.

    Parameters
    ----------
    code : int
        Of instructions, without tables.
    frames, stacks : mapping of str to int
        Frame of each function, and most stack that it and what it calls take. Frames of the library and of
        the compiler's own functions are not counted.
    """

    code: int
    frames: Mapping[str, int]
    stacks: Mapping[str, int]


def sizes(folder: Path, compiler: str = "gcc", flags: Sequence[str] = FLAGS) -> Sizes:
    """Return the sizes of an exported controller by a compiler of the GCC family.

    Raises
    ------
    FileNotFoundError
        If the compiler is not installed.
    ValueError
        If a frame has no constant bound, or functions call each other in a circle.
    """
    path, listing = shutil.which(compiler), shutil.which("size")
    if path is None or listing is None:
        raise FileNotFoundError(f"{compiler} and size were not found; install them to measure sizes")
    with TemporaryDirectory() as scratch:
        target = Path(scratch) / "controller.o"
        command: list[str | Path] = [path, *flags, "-fcallgraph-info=su", "-c", "-o", target]
        subprocess.run([*command, folder / "controller.c"], check=True)  # noqa: S603
        graph = read_text(target.with_suffix(".ci"))  # file: made by gcc just now
        sections = subprocess.run(  # noqa: S603
            [listing, "-A", target], check=True, capture_output=True, text=True
        ).stdout
    code = sum(int(size) for size in re.findall(r"^\.text\S*\s+(\d+)", sections, re.MULTILINE))
    return Sizes(code, *stacks_of(graph))


def stacks_of(graph: str) -> tuple[dict[str, int], dict[str, int]]:
    """Return the frames in a call graph as GCC writes it, and the stack from each function down."""
    names, frames = {}, {}
    for title, name, size, kind in _NODE.findall(graph):
        names[title] = name
        if size:
            if kind not in ("static", "dynamic,bounded"):  # of the latter, the size is the greatest
                raise ValueError(f"the frame of {name} is {kind}; it needs a constant bound")
            frames[title] = int(size)
    calls: dict[str, set[str]] = {title: set() for title in names}
    for caller, callee in _EDGE.findall(graph):
        calls.setdefault(caller, set()).add(callee)
    stacks: dict[str, int] = {}

    def stack(title: str, callers: tuple[str, ...]) -> int:
        if title in callers:
            raise ValueError(f"{names.get(title, title)} calls itself")
        if title not in stacks:
            below = (stack(callee, (*callers, title)) for callee in calls.get(title, ()))
            stacks[title] = frames.get(title, 0) + max(below, default=0)
        return stacks[title]

    for title in frames:
        stack(title, ())
    return (
        {names[title]: size for title, size in frames.items()},
        {names[title]: stacks[title] for title in frames},
    )


def stack_table(measured: Sizes) -> Iterator[str]:
    """Return the rows of a table of frames and stacks, deepest first."""
    yield "function,frame in bytes,with what it calls"
    for name, size in sorted(measured.stacks.items(), key=lambda item: (-item[1], item[0])):
        yield f"{name},{measured.frames[name]},{size}"
