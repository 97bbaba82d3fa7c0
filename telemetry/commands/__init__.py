"""The command line: ``python -m telemetry``."""

import atexit
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from cyclopts import App, CycloptsError, Parameter

from telemetry.commands import files, scenes
from telemetry.file.errors import RecordingError

COMMANDS: tuple[Callable[..., int | None], ...] = (
    *(scenes.replay, scenes.campaign, scenes.training, scenes.screenshot),
    *(files.info, files.recover, files.export, files.compare),
)

HELP = """\
Look at recorded inspection flights (MCAP files).

`python -m pipeline +experiment=fly` writes its flight into episodes/ in its run folder. Any MCAP tool reads
it too: open it in Foxglove, or run `rerun FILE.mcap`.

For example:

    python -m telemetry replay flight.mcap
    python -m telemetry campaign outputs/evaluate/RUN
    python -m telemetry training outputs/train/RUN --follow --web
    python -m telemetry screenshot flight.mcap -o pictures
    python -m telemetry info flight.mcap
    python -m telemetry recover flight.mcap.partial
    python -m telemetry export flight.mcap --format parquet -o tables
    python -m telemetry compare a.mcap b.mcap

Exit codes: 0 success; 1 compared flights differ; 2 usage error, explained in one sentence; 130 Ctrl-C; 143
ended by SIGTERM.
"""

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
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with _ended_in_order():
            status = command_line()(
                words or ["--help"], exit_on_error=False, print_error=False, result_action="return_value"
            )
        sys.stdout.flush()
    except BrokenPipeError:
        # the reader has closed the pipe, as `| head` does; nothing more can be printed
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except CycloptsError as error:
        print(f"telemetry: {error} `python -m telemetry --help` tells more.", file=sys.stderr)
        return MISTAKE
    except RecordingError as error:
        print(f"telemetry: {error}", file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        print("telemetry: interrupted", file=sys.stderr)
        return INTERRUPTED
    return int(status or 0) if words else MISTAKE


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


def command_line() -> App:
    """Return the commands, whose functions say what they take and what it means."""
    app = App(
        name="python -m telemetry",
        help=HELP,
        help_format="markdown",
        version_flags=(),
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(negative=(), show_default=_shown),
    )
    for place, command in enumerate(COMMANDS):
        app.command(command, sort_key=place)
    return app


def _shown(default: object) -> str | None:
    """Return a default as help shows it; none where an option is left out."""
    return None if default in (None, False, (), "") else str(default)
