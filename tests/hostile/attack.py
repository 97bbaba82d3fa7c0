"""Readers tried on damaged files: each input in bounded time and memory, or refused in a sentence.

Inputs are read in processes of their own. One that has grown is replaced, so that memory kept from one input
does not hide what the next one takes.
"""

import gc
import multiprocessing
import random
import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from tests.hostile.damage import DAMAGES
from tests.hostile.readers import Reader

SECONDS: Final = 10
BYTES: Final = 1024**3
#: by which a process may have grown and still measure the next input
KEPT_BYTES: Final = 64 * 1024**2
#: after which a process that says nothing is taken to hang outside Python, s; other work may slow it
SILENT_S: Final = 600.0
FORK: Final = multiprocessing.get_context("fork")

#: may yield after each of its steps
Work = Callable[[], Iterator[None] | None]


class HangError(BaseException):
    """A reader that took too long; no reader catches it."""


class BrokenError(Exception):
    """What a reader does that it must not; the input is in the file ``input`` of its folder."""


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    """Raise HangError in code that takes more processor time."""

    def stop(_signal: int, _frame: object) -> None:
        raise HangError(f"longer than {seconds} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def survives(reader: Reader, content: bytes, folder: Path) -> None:
    """Read something; pass on exceptions that a reader must not raise.

    Raises
    ------
    HangError, MemoryError
        If it takes too long or too much memory.
    """
    before = _memory("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from now on
    with limited(SECONDS), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            reader.read(content, folder)
        except reader.refusals as refusal:
            if not str(refusal).strip():
                raise AssertionError("a refusal that says nothing") from refusal
    grown = _memory("VmHWM") - before
    if grown > BYTES:
        raise MemoryError(f"{grown} bytes")


def _memory(name: str) -> int:
    """Return what this process has, or had at most, bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))


def attack(reader: Reader, examples: int, number: int, folder: Path) -> int:
    """Try a number of damaged inputs on a reader; return how many were tried.

    Raises
    ------
    BrokenError
        What the first of them that breaks the reader makes it do.
    """
    rng = random.Random(number)  # noqa: S311
    inputs = [(rng.getrandbits(63), rng.choice(reader.samples)) for _ in range(examples)]
    tried = 0

    def try_until_grown() -> Iterator[None]:
        begun = _memory("VmRSS")
        for draw, sample in inputs[tried:]:
            content = DAMAGES[reader.kind](sample, random.Random(draw))  # noqa: S311
            (folder / "input").write_bytes(content)
            survives(reader, content, folder)
            yield
            if _memory("VmRSS") > begun + KEPT_BYTES:
                return

    while tried < examples:
        tried += _apart(try_until_grown)
    return tried


def assert_survives_apart(reader: Reader, content: bytes, folder: Path) -> None:
    """Read something in a process of its own; raise BrokenError for what must not be."""
    _apart(lambda: survives(reader, content, folder))


def _apart(work: Work) -> int:
    """Do work in a fork of this process; return how often it yielded."""
    here, there = FORK.Pipe(duplex=False)
    # the fork's searches for garbage would copy all that this process holds, a second for a gigabyte
    gc.collect(1)
    gc.freeze()
    process = FORK.Process(target=_serve, args=(work, there))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which readers here do not wait for
        process.start()
    there.close()
    count, message = 0, ""
    while not message:
        if not here.poll(SILENT_S):
            process.kill()
            message = f"does not return within {SILENT_S:g} s"
        else:
            try:
                message = here.recv()
            except EOFError:
                break
            count += not message
    process.join()
    if message or process.exitcode:
        raise BrokenError(message or f"ended its process with {process.exitcode}")
    return count


def _serve(work: Work, pipe: Connection) -> None:
    """Work; send an empty word for each step, or what goes wrong."""
    try:
        for _ in work() or ():
            pipe.send("")
    except BaseException as error:  # noqa: BLE001 - all is told
        frame = traceback.extract_tb(error.__traceback__)[-1]
        pipe.send(f"{type(error).__name__}: {str(error)[:2000]} ({frame.filename}:{frame.lineno})")
