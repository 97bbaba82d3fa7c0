"""Change the inference that is written as C, and as a page's script, for `benchmarks.inference_mutants`.

What is compared is what runs: one operator or number is another in the functions that are written for every
batch of systems. What gcc or node does not take is no change. A change is sought for a minute of processor
time.
"""

import os
import random
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from benchmarks.agree import BATCH, cases, processor_s
from fis_tools.formats.c import source
from fis_tools.review import transcribed
from tests.fis_tools.agreement.compared import differences

#: by form, the function that writes its code
WRITTEN: Final[Mapping[str, tuple[Any, str]]] = {"C": (source, "write"), "page": (transcribed, "script")}
#: what stands in the place of what
OTHERS: Final[Mapping[str, str]] = {
    **{"<": "<= >", "<=": "< >=", ">": ">= <", ">=": "> <=", "==": "!=", "!=": "=="},
    **{"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "&&": "||", "||": "&&"},
    **{"===": "!==", "!==": "==="},
}
#: binary operators, and numbers that no name, bracket of a declaration or exponent holds
TOKEN: Final = re.compile(
    r"(?<= )(?:" + "|".join(map(re.escape, sorted(OTHERS, key=len, reverse=True))) + r")(?= )"
    r"|(?<![\w.\"%])\d+(?:\.\d+)?(?![\w.\"])"
)
#: lines without inference: comments, directives, declarations without a value, and rows of data
SILENT: Final = re.compile(r"\s*(?:/[*/]|\*|#|static |[\w *]+\[[^=]*\];|[-\d.,e+ {}\[\]();NA]*$)")
#: by form, the file that is checked, and by what
CHECKED: Final[Mapping[str, tuple[str, ...]]] = {
    "C": ("changed.c", "gcc", *source.FLAGS.split(), "-fsyntax-only"),
    "page": ("changed.js", "node", "--check"),
}
#: batches whose code is changed; processor time of a search, and of one that does not end by itself
NUM_BATCHES, MINUTE_S, MOST_CPU_S = 3, 60.0, 90


@dataclass(frozen=True)
class Change:
    """A line as it is written, and as it reads instead."""

    line: str
    new: str

    def __str__(self) -> str:
        """Return both."""
        return f"{self.line.strip()} -> {self.new.strip()}"

    def applied(self, code: str) -> str:
        """Return the code with this line changed where it first stands."""
        lines = code.split("\n")
        if self.line in lines:
            lines[lines.index(self.line)] = self.new
        return "\n".join(lines)


def changes_of(code: str, draw: random.Random) -> list[Change]:
    """Return every change of the lines of functions."""
    changes = dict[Change, None]()
    for line in code.split("\n"):
        if not line.startswith((" ", "\t")) or SILENT.match(line):
            continue
        for token in TOKEN.finditer(line.split("/*")[0].split("//")[0]):
            word = token[0]
            other = draw.choice(OTHERS[word].split()) if word in OTHERS else str(float(word) + 1.0)
            other = other.removesuffix(".0") if word.isdigit() else other
            changes[Change(line, line[: token.start()] + other + line[token.end() :])] = None
    return [*changes]


@contextmanager
def rewritten(engine: str, rewrite: Callable[[str], str]) -> Iterator[None]:
    """Let the code of a form pass a function when it is written, inside."""
    module, name = WRITTEN[engine]
    write = getattr(module, name)
    setattr(module, name, lambda *args, **kwargs: rewrite(write(*args, **kwargs)))
    try:
        yield
    finally:
        setattr(module, name, write)


def is_taken(engine: str, code: str, folder: Path) -> bool:
    """Return whether gcc or node takes the code."""
    path = folder / CHECKED[engine][0]
    path.write_text(code, encoding="utf-8")
    return not subprocess.run([*CHECKED[engine][1:], path], check=False, capture_output=True).returncode  # noqa: S603


def sought(engine: str, change: Change, seed: int, folder: Path) -> None:
    """End the process with 1 as soon as something differs, with 0 after a minute of processor time."""
    # written code may loop for ever
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S))
    until, number = processor_s() + MINUTE_S, 0
    with rewritten(engine, change.applied):
        while processor_s() < until:
            if differences(cases(seed, number, BATCH), folder, (engine,)):
                os._exit(1)
            number += 1
    os._exit(0)


def is_found(engine: str, change: Change, seed: int, folder: Path) -> bool:
    """Return whether a process that seeks a change finds it, ends otherwise, or does not end."""
    child = get_context("fork").Process(target=sought, args=(engine, change, seed, folder))
    child.start()
    child.join()
    return child.exitcode != 0


def num_found(engine: str, count: int, seed: int) -> int:
    """Return how many of so many changes are found; print each."""
    draw = random.Random(seed)  # noqa: S311 - the same each time
    codes: list[str] = []

    def keep(code: str) -> str:
        codes.append(code)
        return code

    with tempfile.TemporaryDirectory(prefix="written-") as root:
        folder = Path(root)
        written: list[str] = []
        for number in range(NUM_BATCHES):
            codes.clear()
            with rewritten(engine, keep):
                if differing := differences(cases(seed, number, BATCH), folder, (engine,)):
                    raise ValueError(f"without a change something differs: {differing[0]}")
            # a system may be written by itself before, to see whether it can be
            written.append(max(codes, key=len))
        # lines of single systems, their data, stand in one batch alone
        common = set.intersection(*(set(code.split("\n")) for code in written))
        every = {
            change: code for code in written for change in changes_of(code, draw) if change.line in common
        }
        found = tried = 0
        for change in draw.sample([*every], len(every)):
            if not is_taken(engine, change.applied(every[change]), folder):
                continue
            answer = is_found(engine, change, seed, folder)
            print(f"{engine}: {change}: {'found' if answer else 'not found'}", file=sys.stderr, flush=True)
            tried, found = tried + 1, found + answer
            if tried == count:
                break
    return found
