"""Look at recorded inspection flights (MCAP files).

`python -m pipeline +experiment=fly` writes its flight into episodes/ in its run folder. Any MCAP tool reads
it too: open it in Foxglove, or run `rerun FILE.mcap`.

For example:

    python -m telemetry replay flight.mcap
    python -m telemetry page flight.mcap
    python -m telemetry campaign outputs/evaluate/RUN
    python -m telemetry screenshot flight.mcap -o pictures
    python -m telemetry info flight.mcap
    python -m telemetry recover flight.mcap.partial
    python -m telemetry export flight.mcap --format parquet -o tables
    python -m telemetry compare a.mcap b.mcap

Exit codes: 0 success; 1 compared flights differ; 2 usage error, explained in one sentence; 130 Ctrl-C; 143
ended by SIGTERM.
"""

import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass
from json import dumps
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from plain_files.file_access import replacing
from plain_files.streams import guarded
from telemetry.file import RecordingError, explained, tables
from telemetry.file.compare import compare as comparison_of
from telemetry.file.compare import in_words as comparison_in_words
from telemetry.file.partial_file import PARTIAL_SUFFIX
from telemetry.file.reader import read
from telemetry.file.recover import Recovery
from telemetry.file.recover import recover as rescue
from telemetry.file.summary import in_words as summary_in_words
from telemetry.file.summary import summarize

if TYPE_CHECKING:
    from telemetry.scene.viewer import Scene

#: compared flights differ
DIFFERENT = 1

Output = Annotated[Path | None, Parameter(name=("--output", "-o"))]


def info(file: Path, /, *, json: bool = False) -> None:
    """Describe a flight and what its file holds.

    Prints how the flight started and ended, the inputs and outputs of its fuzzy systems, and the number of
    messages on each topic.

    For example:

        python -m telemetry info flight.mcap
        python -m telemetry info flight.mcap --json

    Parameters
    ----------
    file
        a flight
    json
        print JSON, for programs
    """
    summary = summarize(read(file))
    if json:
        print(dumps(summary, indent=2, ensure_ascii=False))
    else:
        print("\n".join(summary_in_words(summary)))


def recover(file: Path, /, *, output: Output = None) -> None:
    """Rescue every flushed step of a truncated or damaged file into a new one.

    A process that is killed leaves its flight as NAME.mcap.partial. Whatever is intact in it, or in a
    truncated or damaged file, is written to a new file that every other command reads; messages whose writer
    gave no checksums are kept, and counted. The old file stays as it is.

    For example:

        python -m telemetry recover flight.mcap.partial
        python -m telemetry recover damaged.mcap -o rescued.mcap

    Parameters
    ----------
    file
        a flight, also one that ends in .mcap.partial
    output
        where to [default: NAME.recovered.mcap in the folder of FILE]
    """
    recovery = rescue(file, output)
    if recovery.output is None:
        cure = "there is nothing to rescue"
        if file.name.endswith(PARTIAL_SUFFIX):
            # killed between the last byte and the renaming
            cure = f"rename it to {file.name.removesuffix(PARTIAL_SUFFIX)}"
        print(f"{file} is intact, with {recovery.num_messages} messages: {cure}{_unchecked(recovery)}")
        return
    reach = "" if recovery.end_s is None else f", up to {recovery.end_s:g} s"
    print(
        f"{recovery.output} holds {recovery.num_messages} messages{reach}; "
        f"{recovery.num_damaged_records} damaged records and {recovery.num_bytes_lost} bytes at the end "
        f"were left out{_unchecked(recovery)}"
    )
    if recovery.refused:
        print(f"warning: some of {file} is not read: {recovery.refused}", file=sys.stderr)
    if recovery.num_messages == 0:
        print(
            f"warning: no step of the flight could be rescued from {file}, only its description "
            "(metadata and attachments); fly the episode again",
            file=sys.stderr,
        )


def _unchecked(recovery: Recovery) -> str:
    """Say how many messages the writer gave no checksum."""
    count = recovery.num_unchecked
    return f"; {count} messages have no checksum, so wrong bytes in them would not show" if count else ""


def export(file: Path, /, *, format: Literal["csv", "parquet"] = "csv", output: Output = None) -> None:
    """Write tables: one file per topic, units in the column names.

    One number per cell, time_s first; telemetry/README.md explains the topics and fields. In Python,
    telemetry.read(FILE) returns arrays and telemetry.flat_table these tables.

    For example:

        python -m telemetry export flight.mcap
        python -m telemetry export flight.mcap --format parquet -o tables

    Parameters
    ----------
    file
        a flight
    format
        of the tables
    output
        the folder [default: named after FILE and the format]
    """
    folder = output or file.with_name(f"{file.stem}-{format}")
    for path in tables.export(read(file), folder, format):
        print(path)


def compare(first: Path, second: Path, /, *, tolerance: float = 0.0) -> int:
    """Show at which sample, topic and field two flights first differ, and by how much.

    Exits with 0 if the flights are the same, 1 if they differ, 2 after a usage error.

    For example:

        python -m telemetry compare a.mcap b.mcap
        python -m telemetry compare a.mcap b.mcap --tolerance 1e-9

    Parameters
    ----------
    first
        a flight
    second
        another
    tolerance
        differences up to it count as equal, in each field's own unit
    """
    recordings = read(first), read(second)
    if not any(recording.topics for recording in recordings):
        raise RecordingError(
            f"neither {first} nor {second} holds messages of a flight, so nothing can "
            "be compared; give recordings that telemetry.EpisodeWriter wrote"
        )
    comparison = comparison_of(*recordings, tolerance)
    print("\n".join(comparison_in_words(comparison)))
    return 0 if comparison.is_equal else DIFFERENT


@Parameter(name="*")
@dataclass(frozen=True)
class Shown:
    """Where to show a scene: in a window, unless a file or the browser is chosen.

    Parameters
    ----------
    save
        write a rerun file (.rrd); open no window
    web
        serve a page to a browser on this machine
    """

    _: KW_ONLY
    save: Path | None = None
    web: bool = False

    def __post_init__(self) -> None:
        """Raise RecordingError if both are given."""
        if self.save is not None and self.web:
            raise RecordingError("--save opens no window and --web serves one to a browser; drop one of them")

    def look(self, scene: "Scene") -> None:
        """Show a scene."""
        from telemetry.scene import viewer  # noqa: PLC0415

        if self.save is None:
            viewer.show(scene, in_browser=self.web)
            return
        viewer.save(scene, self.save)
        print(f"{self.save} is written; open it with `rerun {shlex.quote(str(self.save))}`")


WINDOW = Shown()


def replay(files: tuple[Path, ...], /, shown: Shown = WINDOW) -> None:
    """Show flights in rerun, in our layout.

    Shows the scene around the chief, the curves with their limits, the rules that fired, and the events.
    Opens a window unless --save or --web is given. Space plays; drag the time line at the bottom.

    For example:

        python -m telemetry replay flight.mcap
        python -m telemetry replay flight.mcap --web
        python -m telemetry replay a.mcap b.mcap --save both.rrd

    Parameters
    ----------
    files
        flights; the first is shown in full
    """
    from telemetry.scene import replay  # noqa: PLC0415

    shown.look(replay.scene(files))


def page(files: tuple[Path, ...], /, *, output: Output = None) -> None:
    """Write a page that plays flights in any browser, and needs no other file.

    Scene, distance, fuel, points and reasons show one time; pictures and numbers can be saved. It shows what
    the recordings have, whoever wrote them, and says what they do not tell. Nothing is fetched.

    For example:

        python -m telemetry page flight.mcap
        python -m telemetry page flight.mcap -o flight.html
        python -m telemetry page deputy-1.mcap deputy-2.mcap

    Parameters
    ----------
    files
        flights, beside each other; deputies of one fleet show each other's paths
    output
        where to [default: NAME.html in the folder of the first of FILES]
    """
    from telemetry.page import recorded  # noqa: PLC0415 - as above

    path, content = output or files[0].with_suffix(".html"), recorded.write(*files).encode()
    cure = "make room, or choose another file with -o"
    with explained(f"{path} cannot be written", cure), replacing(path) as stream:
        stream.write(content)
    print(path)


def campaign(run: Path, /, shown: Shown = WINDOW) -> None:
    """Show all trajectories of an evaluation, coloured by outcome.

    Green paths reached the goal, orange ones fell short of it, red ones left the limits; the most telling
    cases are labelled.

    For example:

        python -m telemetry campaign outputs/evaluate/RUN
        python -m telemetry campaign outputs/evaluate/RUN --save cases.rrd

    Parameters
    ----------
    run
        the folder of a run, or its evaluate/trajectories.parquet
    """
    from telemetry.scene import campaign  # noqa: PLC0415

    shown.look(campaign.scene(run))


def _check_instants(_kind: object, instants: tuple[float, ...]) -> None:
    for instant in instants:
        if not 0.0 <= instant < inf:
            raise ValueError(f"{instant:g} is not a time within a flight; give seconds, 0 or more.")


def screenshot(
    paths: tuple[Path, ...],
    /,
    *,
    at: Annotated[
        tuple[float, ...], Parameter(consume_multiple=True, validator=_check_instants, show_default=True)
    ] = (60.0, 1200.0, 3000.0),
    output: Annotated[Path, Parameter(name=("--output", "-o"), show_default=False)] = Path(),
) -> None:
    """Draw pictures (PNG) of flights and runs, without a display.

    Draws what replay and campaign show, and lists the files. Needs a Vulkan driver; a software
    renderer will do (on Debian: apt-get install mesa-vulkan-drivers).

    For example:

        python -m telemetry screenshot flight.mcap -o pictures
        python -m telemetry screenshot flight.mcap outputs/evaluate/RUN --at 60 1200

    Parameters
    ----------
    paths
        flights, drawn over each other, and run folders
    at
        times of flights to draw, in seconds
    output
        the folder [default: this one]
    """
    from telemetry.scene import screenshot  # noqa: PLC0415

    for path in screenshot.take(screenshot.subjects(paths, at), output):
        print(path)


#: commands that there were, and what does their work
GONE = {"training": "a run's report.html draws the training, and logger=tensorboard shows it live."}
COMMANDS: tuple[Callable[..., int | None], ...] = (
    *(replay, page, campaign, screenshot),
    *(info, recover, export, compare),
)


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
        stream; 130 after Ctrl-C; 143 after SIGTERM.
    """
    with guarded():
        return _main(list(sys.argv[1:] if arguments is None else arguments))


def _main(words: Sequence[str]) -> int:
    """Run a command line; return its exit code, having printed why it failed if it did."""
    try:
        with _ended_in_order():
            status = command_line()(
                words or ["--help"], exit_on_error=False, print_error=False, result_action="return_value"
            )
        sys.stdout.flush()
    except _Terminated:
        return TERMINATED
    except CycloptsError as error:
        fault = f"{words[0]} is gone: {GONE[words[0]]}" if words[0] in GONE else error
        print(f"telemetry: {fault} `python -m telemetry --help` tells more.", file=sys.stderr)
        return MISTAKE
    except RecordingError as error:
        print(f"telemetry: {error}", file=sys.stderr)
        return MISTAKE
    except OSError as error:
        if error.filename is None:
            raise
        print(f"telemetry: {error.filename}: {error.strerror}", file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        print("telemetry: interrupted", file=sys.stderr)
        return INTERRUPTED
    return int(status or 0) if words else MISTAKE


class _Terminated(BaseException):
    """Raised on SIGTERM; no library catches it, as it is no `Exception`."""


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let SIGTERM unwind the block as Ctrl-C does, so that viewers end and temporary files go."""

    def end(_number: int, _frame: object) -> None:
        silence_finalizers()
        os.write(2, b"telemetry: ended by SIGTERM\n")  # not by print, which may be at work
        raise _Terminated

    if threading.current_thread() is not threading.main_thread():  # only the main thread may handle signals
        yield
        return
    before = signal.signal(signal.SIGTERM, end), sys.unraisablehook
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before[0])
        sys.unraisablehook = before[1]


def silence_finalizers() -> None:
    """Silence errors in finalizers, which objects raise that libraries left half made."""
    sys.unraisablehook = lambda _unraisable: None


def command_line() -> App:
    """Return the command line; functions are its commands, docstrings their help."""
    app = App(
        name="python -m telemetry",
        help=__doc__,
        help_format="markdown",
        version_flags=(),
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(negative=(), show_default=_shown),
    )
    for index, command in enumerate(COMMANDS):
        app.command(command, sort_key=index)
    return app


def _shown(default: object) -> str | None:
    """Return a default as help shows it; None for one left out."""
    return None if default in (None, False, (), "") else str(default)
