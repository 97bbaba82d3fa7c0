"""A second process on this machine, for Python work that would otherwise use only one processor.

Functions with their arguments, and their results, go as pickles through pipes that nobody else can reach.
It is not a fork of the first process, whose threads and compiled code might not survive one.
"""

import gc
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any, Final

#: starts parts, given a function at module level and its arguments for each; the returned function runs the
#: others here, and returns all results in the order of the parts
Share = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Callable[[], list[Any]]]

_SERVE: Final = f"from {__name__} import serve; serve()"


@contextmanager
def second_process(module: str) -> Iterator[Share]:
    """Start a process that imports a module and then runs every second part once; none on one processor."""
    if os.cpu_count() == 1:
        yield alone
        return
    path = os.pathsep.join(filter(None, sys.path))
    with subprocess.Popen(  # noqa: S603 - ourselves
        [sys.executable, "-c", _SERVE, module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # looking for plug-ins of pydantic takes a while, and there are none
        env=os.environ | {"PYTHONPATH": path, "PYDANTIC_DISABLE_PLUGINS": "__all__"},
    ) as process:
        try:
            yield lambda do, parts: _shared(process, do, parts)
        finally:
            process.kill()


def alone(do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]) -> Callable[[], list[Any]]:
    """Run all parts here; see `Share`."""
    return lambda: [do(*part) for part in parts]


def _shared(
    process: "subprocess.Popen[bytes]", do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]
) -> Callable[[], list[Any]]:
    """Send every second part; see `Share`."""
    assert process.stdin is not None  # noqa: S101 - it has both pipes
    assert process.stdout is not None  # noqa: S101
    answer = process.stdout
    with suppress(BrokenPipeError), process.stdin as stream:
        pickle.dump((do, parts[1::2]), stream)

    def finish() -> list[Any]:
        results: list[Any] = [None] * len(parts)
        results[::2] = [do(*part) for part in parts[::2]]
        try:
            results[1::2] = pickle.load(answer)  # noqa: S301 - of our own process
        except (EOFError, pickle.UnpicklingError):  # it has died, and cannot have done anything else
            results[1::2] = [do(*part) for part in parts[1::2]]
        return results

    return finish


def serve() -> None:
    """Run as the second process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first is interrupted, and ends this one
    gc.disable()  # it is short-lived
    with ThreadPoolExecutor(1) as reading:
        given = reading.submit(sys.stdin.buffer.read)  # a pipe holds little: do not make the writer wait
        import_module(sys.argv[1])
        if sent := given.result():
            do, parts = pickle.loads(sent)  # noqa: S301 - of the process that started this one
            pickle.dump([do(*part) for part in parts], sys.stdout.buffer)
