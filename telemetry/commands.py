"""The commands of ``python -m telemetry``: arguments in, sentences out."""

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from telemetry.file import compare, summary
from telemetry.file.errors import RecordingError
from telemetry.file.partial_file import PARTIAL_SUFFIX
from telemetry.file.reader import read
from telemetry.file.recover import recover
from telemetry.file.tables import export

if TYPE_CHECKING:
    from telemetry.scene.viewer import Scene

DESCRIPTION = """\
Look at recorded inspection flights (MCAP files).

A flight made by `python -m pipeline +experiment=fly` lies in its run folder as episodes/*.mcap.
Any MCAP tool reads it too: drop it on Foxglove, or run `rerun FILE.mcap`."""

EXAMPLES = """\
examples:
  python -m telemetry replay flight.mcap                  a window with scene, curves and rules
  python -m telemetry replay flight.mcap --web            the same in a browser
  python -m telemetry replay a.mcap b.mcap                b laid over a
  python -m telemetry replay flight.mcap --save x.rrd     a file to send; opens with `rerun x.rrd`
  python -m telemetry campaign outputs/evaluate/RUN       all cases of an evaluation at once
  python -m telemetry training outputs/train/RUN --follow the champions of a training, while it goes on
  python -m telemetry screenshot flight.mcap --at 60 1200 pictures, without a display
  python -m telemetry info flight.mcap                    what it was, how it went, what is recorded
  python -m telemetry recover flight.mcap.partial         rescue a flight whose process was killed
  python -m telemetry export flight.mcap --format csv     tables, one file a topic
  python -m telemetry compare a.mcap b.mcap               where two flights part, and by how much

exit codes: 0; 1 where compared flights differ; 2 after a mistake, said in one sentence; 130 after Ctrl-C"""

RAW = argparse.RawDescriptionHelpFormatter

DIFFERENT = 1
MISTAKE = 2
#: as shells do for SIGINT
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        0; 1 where compared flights differ; 2 after a user's mistake, which has been explained on the standard
        error stream; 130 after Ctrl-C.
    """
    options = _parser().parse_args(arguments)
    try:
        status = int(options.run(options) or 0)
        sys.stdout.flush()
    except BrokenPipeError:
        # whoever read the output has had enough, as `| head` has; nothing more can be told
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except RecordingError as error:
        print(f"telemetry: {error}", file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        print("telemetry: interrupted", file=sys.stderr)
        return INTERRUPTED
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m telemetry", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=RAW
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    command = _add(
        commands,
        "replay",
        _replay,
        "show flights in rerun, in our layout",
        "Shows the scene around the chief, the curves with their limits, the rules that fired, and what "
        "happened. Without --save or --web it opens a window. Space plays; drag the time at the bottom.",
        "flight.mcap",
        "flight.mcap --web",
        "a.mcap b.mcap --save both.rrd",
    )
    command.add_argument("files", nargs="+", type=Path, metavar="FILE", help="flights; the first one in full")
    _add_target(command)

    command = _add(
        commands,
        "campaign",
        _campaign,
        "show all trajectories of an evaluation, by outcome",
        "Green paths reached the goal, orange ones fell short of it, red ones left the limits; the "
        "telling cases are named.",
        "outputs/evaluate/RUN",
        "outputs/evaluate/RUN --save cases.rrd",
    )
    command.add_argument(
        "run_folder", type=Path, metavar="RUN", help="a run's folder, or its evaluate/trajectories.parquet"
    )
    _add_target(command)

    command = _add(
        commands,
        "training",
        _training,
        "show a training, generation by generation",
        "Shows fitness, its parts, and where each new champion flies. With --follow it waits for the "
        "first generation and goes on as the training does: a file until the training ends, a viewer "
        "until it is closed.",
        "outputs/train/RUN",
        "outputs/train/RUN --follow --web",
    )
    command.add_argument("run_folder", type=Path, metavar="RUN", help="a run's folder")
    command.add_argument("--follow", action="store_true", help="go on as the training does")
    _add_target(command)

    command = _add(
        commands,
        "screenshot",
        _screenshot,
        "draw pictures (PNG) of flights and runs, without a display",
        "Draws what replay, campaign and training show, and lists the files. It needs a Vulkan driver, "
        "which may be a program (on Debian: apt-get install mesa-vulkan-drivers).",
        "flight.mcap -o pictures",
        "flight.mcap outputs/train/RUN --at 60 1200",
    )
    command.add_argument(
        "paths",
        nargs="+",
        type=Path,
        metavar="PATH",
        help="flights, laid over each other, and folders of runs",
    )
    command.add_argument(
        "--at",
        nargs="+",
        type=_instant,
        default=[60.0, 1200.0, 3000.0],
        metavar="SECONDS",
        help="of flights; default: 60 1200 3000",
    )
    command.add_argument(
        "-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: this folder"
    )

    command = _add(
        commands,
        "info",
        _info,
        "say what a flight was and what its file holds",
        "Says where the flight started, how it went, what its fuzzy systems sense and drive, and how "
        "much is recorded on each topic.",
        "flight.mcap",
        "flight.mcap --json",
    )
    command.add_argument("file", type=Path, metavar="FILE", help="a flight")
    command.add_argument("--json", action="store_true", help="the same for programs")

    command = _add(
        commands,
        "recover",
        _recover,
        "rescue every flushed step of a cut or damaged file into a new one",
        "A flight whose process was killed is left as NAME.mcap.partial. What is provably whole in it, "
        "or in a cut or damaged file, is written to a new file that every other command reads; the old "
        "one is not touched.",
        "flight.mcap.partial",
        "damaged.mcap -o rescued.mcap",
    )
    command.add_argument("file", type=Path, metavar="FILE", help="also one that still ends in .mcap.partial")
    command.add_argument(
        "-o", "--output", type=Path, metavar="OUT", help="default: NAME.recovered.mcap beside FILE"
    )

    command = _add(
        commands,
        "export",
        _export,
        "write tables: one file a topic, units in the column names",
        "One number a cell, time_s first; the topics and fields are explained in telemetry/README.md. "
        "In Python, telemetry.read(FILE) gives arrays, and telemetry.flat_table these tables.",
        "flight.mcap",
        "flight.mcap --format parquet -o tables",
    )
    command.add_argument("file", type=Path, metavar="FILE", help="a flight")
    command.add_argument("--format", choices=("csv", "parquet"), default="csv", help="default: csv")
    command.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="default: a folder named after FILE and the format"
    )

    command = _add(
        commands,
        "compare",
        _compare,
        "say at which sample, topic and field two flights part, and by how much",
        "Exits with 0 where the flights are the same, 1 where they differ, 2 after a mistake.",
        "a.mcap b.mcap",
        "a.mcap b.mcap --tolerance 1e-9",
    )
    command.add_argument("first", type=Path, metavar="A", help="a flight")
    command.add_argument("second", type=Path, metavar="B", help="another")
    command.add_argument(
        "--tolerance",
        type=float,
        default=0.0,
        metavar="NUMBER",
        help="difference of quantities that does not count, in each field's own unit; default: 0",
    )
    return parser


def _add(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    name: str,
    run: Callable[[argparse.Namespace], int | None],
    summary: str,
    explanation: str,
    *examples: str,
) -> argparse.ArgumentParser:
    command = commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.\n\n{fill(explanation, 90)}",
        epilog="\n".join(["examples:", *(f"  python -m telemetry {name} {example}" for example in examples)]),
        formatter_class=RAW,
    )
    command.set_defaults(run=run)
    return command


def _instant(text: str) -> float:
    instant = float(text)
    if not 0.0 <= instant < inf:
        raise argparse.ArgumentTypeError(f"{text} is no instant of a flight; give seconds from 0 on")
    return instant


def _add_target(command: argparse.ArgumentParser) -> None:
    target = command.add_mutually_exclusive_group()
    target.add_argument("--save", type=Path, metavar="OUT.rrd", help="write a rerun file instead of a window")
    target.add_argument("--web", action="store_true", help="serve a page to this machine's browser")


def _replay(options: argparse.Namespace) -> None:
    # rerun takes half a second to import, which no other command should pay
    from telemetry.scene import replay  # noqa: PLC0415

    _look(replay.scene(options.files), options)


def _look(scene: "Scene", options: argparse.Namespace) -> None:
    from telemetry.scene import viewer  # noqa: PLC0415 - as above

    if options.save is None:
        viewer.show(scene, in_browser=options.web)
        return
    viewer.save(scene, options.save)
    print(f"{options.save} is written; look at it with `rerun {shlex.quote(str(options.save))}`")


def _campaign(options: argparse.Namespace) -> None:
    from telemetry.scene import campaign  # noqa: PLC0415 - as above

    _look(campaign.scene(options.run_folder), options)


def _training(options: argparse.Namespace) -> None:
    # once the viewer is closed, rerun would call it an error that it can send no more
    os.environ.setdefault(
        "RUST_LOG", "info,re_perf_telemetry=warn,re_grpc_client=off,re_sdk::recording_stream=off"
    )
    from telemetry.scene import training  # noqa: PLC0415 - as above

    if not options.follow:
        _look(training.scene(options.run_folder), options)
        return
    with suppress(KeyboardInterrupt):
        training.follow(
            options.run_folder,
            options.save,
            in_browser=options.web,
            told=lambda text: print(text, file=sys.stderr),
        )


def _screenshot(options: argparse.Namespace) -> None:
    from telemetry.scene import screenshot  # noqa: PLC0415 - as above

    for path in screenshot.take(screenshot.subjects(options.paths, options.at), options.output):
        print(path)


def _info(options: argparse.Namespace) -> None:
    told = summary.summarize(read(options.file))
    if options.json:
        print(json.dumps(told, indent=2, ensure_ascii=False))
    else:
        print("\n".join(summary.in_words(told)))


def _recover(options: argparse.Namespace) -> None:
    recovery = recover(options.file, options.output)
    if recovery.output is None:
        cure = "there is nothing to rescue"
        if options.file.name.endswith(PARTIAL_SUFFIX):
            # killed between the last byte and the renaming
            cure = f"rename it to {options.file.name.removesuffix(PARTIAL_SUFFIX)}"
        print(f"{options.file} is whole, with {recovery.num_messages} messages: {cure}")
        return
    reach = "" if recovery.end_s is None else f", up to {recovery.end_s:g} s"
    print(
        f"{recovery.output} holds {recovery.num_messages} messages{reach}; left behind were "
        f"{recovery.num_damaged_records} damaged records and {recovery.num_bytes_lost} bytes at the end"
    )
    if recovery.num_messages == 0:
        print(
            f"warning: no step of the flight could be rescued from {options.file}, only its description "
            "(metadata and attachments); fly the episode again",
            file=sys.stderr,
        )


def _export(options: argparse.Namespace) -> None:
    folder = options.output
    if folder is None:
        folder = options.file.with_name(f"{options.file.stem}-{options.format}")
    for path in export(read(options.file), folder, options.format):
        print(path)


def _compare(options: argparse.Namespace) -> int:
    first, second = read(options.first), read(options.second)
    if not first.topics and not second.topics:
        raise RecordingError(
            f"neither {options.first} nor {options.second} holds messages of a flight, so nothing can "
            "be compared; give recordings that telemetry.EpisodeWriter wrote"
        )
    comparison = compare.compare(first, second, options.tolerance)
    print("\n".join(compare.in_words(comparison)))
    return 0 if comparison.is_equal else DIFFERENT
