"""The command line: ``python -m telemetry``."""

import argparse
import atexit
import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from telemetry.commands import files, scenes
from telemetry.file.errors import RecordingError

COMMANDS = (
    *(scenes.replay, scenes.campaign, scenes.training, scenes.screenshot),
    *(files.info, files.recover, files.export, files.compare),
)

DESCRIPTION = """\
Look at recorded inspection flights (MCAP files).

`python -m pipeline +experiment=fly` writes its flight to episodes/*.mcap in its run folder.
Any MCAP tool reads it too: open it in Foxglove, or run `rerun FILE.mcap`."""

EXIT_CODES = """\
exit codes: 0 success; 1 compared flights differ; 2 usage error, explained in one sentence;
130 Ctrl-C; 143 ended by SIGTERM"""

MISTAKE = 2
#: as shells do for SIGINT
INTERRUPTED = 130
#: likewise for SIGTERM
TERMINATED = 143


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        0; 1 if compared flights differ; 2 after a usage error, which has been explained on the standard error
        stream; 130 after Ctrl-C.

    Raises
    ------
    SystemExit
        With 143 after SIGTERM.
    """
    atexit.register(gc.freeze)  # taking apart in the end what is loaded takes a fifth of most commands
    options = _parser().parse_args(arguments)
    try:
        with _ended_in_order():
            status = int(options.run(options) or 0)
        sys.stdout.flush()
    except BrokenPipeError:
        # the reader has closed the pipe, as `| head` does; nothing more can be printed
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except RecordingError as error:
        print(f"telemetry: {error}", file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        print("telemetry: interrupted", file=sys.stderr)
        return INTERRUPTED
    return status


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let SIGTERM unwind the block as Ctrl-C does, so that viewers end and temporary files go."""

    def end(_number: int, _frame: object) -> None:
        sys.unraisablehook = lambda _unraisable: None  # what libraries have half made complains as it goes
        os.write(2, b"telemetry: ended by SIGTERM\n")  # not by print, which may be at work
        raise SystemExit(TERMINATED)

    if threading.current_thread() is not threading.main_thread():  # which alone may handle signals
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _parser() -> argparse.ArgumentParser:
    examples = [line for command in COMMANDS for line in command.lines]
    parser = argparse.ArgumentParser(
        prog="python -m telemetry",
        description=DESCRIPTION,
        epilog="\n".join(["examples:", *examples, "", EXIT_CODES]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_to(commands)
    return parser
