"""Standard streams whose errors end no work: they may be closed, full, or lack a character."""

import atexit
import gc
import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

#: the code of a program whose standard output could not be written to its end
UNWRITTEN = 2
#: objects made before Python looks for those that only refer to each other: after its 700, loading alone
#: makes it look 400 times
OBJECTS = 50_000
#: two to this power are the cycles for which OpenBLAS's idle threads wait for work before they sleep: its own
#: 26 cost a tenth of a second of processor time for each library that is loaded, and no sum depends on it
OPENBLAS_SPIN = "4"


class Output:
    """Standard output: after the first error nothing more is written, and a reader that went away is none.

    Letters that the encoding lacks are written as escapes. What is not defined here is the stream's own.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self._is_lost = False

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the stream."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text and return its length; nothing is written after the first error."""
        self._try(lambda: self._write(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Write the buffered text."""
        self._try(self._stream.flush)

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
        except UnicodeEncodeError:
            encoding = self._stream.encoding
            self._stream.write(text.encode(encoding, "backslashreplace").decode(encoding))

    def _try(self, act: Callable[[], None]) -> None:
        if self._is_lost:
            return
        try:
            act()
        except BrokenPipeError:
            self._is_lost = True
        except OSError as error:
            self._is_lost = True
            error.filename = "standard output"
            raise


class Notices(Output):
    """Standard error, for notices: what cannot be written there is dropped."""

    def _try(self, act: Callable[[], None]) -> None:
        with suppress(OSError, ValueError):  # the disk is full, or the stream closed
            act()

    def isatty(self) -> bool:
        """Return whether a terminal shows it."""
        with suppress(OSError, ValueError):
            return bool(self._stream.isatty())
        return False


@contextmanager
def guarded() -> Iterator[None]:
    """Replace the standard streams during the block by those that end no work."""
    before = sys.stdout, sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # file: the null device
        if not isinstance(sys.stdout, Output):
            sys.stdout = Output(nowhere if sys.stdout is None else sys.stdout)
        if not isinstance(sys.stderr, Notices):
            sys.stderr = Notices(nowhere if sys.stderr is None else sys.stderr)
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before


def print_result(text: str) -> None:
    """Print the result of work that is done; say so on standard error where it cannot be printed."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        sys.stderr.write(f"note: the work is done; standard output cannot be written ({error.strerror})\n")


def _keep_docstrings() -> None:
    """Start this process, which ``python -OO`` robbed of the texts of its help, anew without that option."""
    options = sys.orig_argv[1 : len(sys.orig_argv) - len(sys.argv) + 1]
    kept = [option for option in options if option.strip("O") != "-"]
    if len(kept) < len(options) or os.environ.get("PYTHONOPTIMIZE"):
        command = [sys.executable, *kept, *sys.orig_argv[1 + len(options) :]]
        os.execve(sys.executable, command, {**os.environ, "PYTHONOPTIMIZE": ""})  # noqa: S606


def run_program(main: Callable[[], int]) -> NoReturn:
    """End this process, which is a program's, with the exit code of its command line.

    Standard streams that are closed are opened on nothing, lest a file that the program opens take their
    number.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # file: the null device, of the lowest free number: this one
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", OPENBLAS_SPIN)
    gc.set_threshold(OBJECTS)
    atexit.register(gc.freeze)  # taking apart in the end what is loaded takes a fifth of a second
    if sys.flags.optimize > 1 and (not sys.argv[1:] or {"-h", "--help"} & set(sys.argv[1:])):
        _keep_docstrings()
    with guarded():
        code = main()
        try:
            sys.stdout.flush()
        except OSError as error:
            sys.stderr.write(f"error: standard output cannot be written ({error.strerror})\n")
            code = code or UNWRITTEN
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            try:
                stream.flush()
            except OSError:  # told above; what is held back would fail again at the end
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # file: the null device
    sys.exit(code)
