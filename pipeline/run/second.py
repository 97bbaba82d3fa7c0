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
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any, Final

#: takes a function at module level and its arguments for each part, and starts with the last; the returned
#: function runs parts here from the first on until all are done, and returns the results in their order
Share = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Callable[[], list[Any]]]

_SERVE: Final = f"from {__name__} import serve; serve()"


@contextmanager
def second_process(module: str) -> Iterator[Share]:
    """Start a process that imports a module and then shares one list of parts; none on one processor."""
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
    """Let the process begin with the last part; see `Share`."""
    assert process.stdin is not None  # noqa: S101 - it has a pipe
    with suppress(BrokenPipeError), process.stdin as stream:
        pickle.dump((do, parts[::-1]), stream)

    def finish() -> list[Any]:
        answers: SimpleQueue[tuple[Any] | None] = SimpleQueue()
        receiver = threading.Thread(target=_receive, args=(process, answers), daemon=True)
        receiver.start()
        results: list[Any] = [None] * len(parts)
        # parts before `first` are done here, those from `last` on there
        first, last, is_alive = 0, len(parts), True
        try:
            while first < last:
                try:  # the only one that is left has been begun there
                    answer = answers.get(block=is_alive and first == last - 1)
                except Empty:
                    results[first] = do(*parts[first])
                    first += 1
                    continue
                if answer is None:
                    is_alive = False
                else:
                    last -= 1
                    (results[last],) = answer
        finally:
            process.kill()  # what it may still be doing has been done here
            receiver.join()
        return results

    return finish


def _receive(process: "subprocess.Popen[bytes]", answers: "SimpleQueue[tuple[Any] | None]") -> None:
    """Receive one result after the other; None when no more will come."""
    assert process.stdout is not None  # noqa: S101 - it has a pipe
    try:
        with suppress(EOFError, pickle.UnpicklingError):  # it has ended
            while True:
                answers.put((pickle.load(process.stdout),))  # noqa: S301 - of our own process
    finally:
        answers.put(None)


def serve() -> None:
    """Run as the second process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first is interrupted, and ends this one
    gc.disable()  # it is short-lived
    # a pipe holds little: neither the writer here nor the one there is made to wait
    with ThreadPoolExecutor(1) as pipes:
        given = pipes.submit(sys.stdin.buffer.read)
        import_module(sys.argv[1])
        if sent := given.result():
            do, parts = pickle.loads(sent)  # noqa: S301 - of the process that started this one
            for part in parts:
                # pickled here: what cannot be ends this process, and is done again in the first
                pipes.submit(_send, pickle.dumps(do(*part)))


def _send(result: bytes) -> None:
    with suppress(BrokenPipeError):
        sys.stdout.buffer.write(result)
        sys.stdout.buffer.flush()
