"""Commands that read recordings and write text or files."""

import argparse
import json
import sys
from pathlib import Path

from telemetry.commands.command import argument, command
from telemetry.file import tables
from telemetry.file.compare import compare as comparison_of
from telemetry.file.compare import in_words as comparison_in_words
from telemetry.file.errors import RecordingError
from telemetry.file.partial_file import PARTIAL_SUFFIX
from telemetry.file.reader import read
from telemetry.file.recover import recover as rescue
from telemetry.file.summary import in_words as summary_in_words
from telemetry.file.summary import summarize

#: compared flights differ
DIFFERENT = 1

FLIGHT = argument("file", type=Path, metavar="FILE", help="a flight")


@command(
    FLIGHT,
    argument("--json", action="store_true", help="print JSON, for programs"),
    examples=("flight.mcap", "flight.mcap --json"),
)
def info(options: argparse.Namespace) -> None:
    """Describe a flight and what its file holds.

    Prints how the flight started and ended, the inputs and outputs of its fuzzy systems, and
    the number of messages on each topic.
    """
    told = summarize(read(options.file))
    if options.json:
        print(json.dumps(told, indent=2, ensure_ascii=False))
    else:
        print("\n".join(summary_in_words(told)))


@command(
    argument("file", type=Path, metavar="FILE", help="a flight, also one that ends in .mcap.partial"),
    argument(
        "-o", "--output", type=Path, metavar="OUT", help="default: NAME.recovered.mcap in the folder of FILE"
    ),
    examples=("flight.mcap.partial", "damaged.mcap -o rescued.mcap"),
)
def recover(options: argparse.Namespace) -> None:
    """Rescue every flushed step of a truncated or damaged file into a new one.

    A process that is killed leaves its flight as NAME.mcap.partial. Whatever is provably
    intact in it, or in a truncated or damaged file, is written to a new file that every other
    command reads. The old file stays as it is.
    """
    recovery = rescue(options.file, options.output)
    if recovery.output is None:
        cure = "there is nothing to rescue"
        if options.file.name.endswith(PARTIAL_SUFFIX):
            # killed between the last byte and the renaming
            cure = f"rename it to {options.file.name.removesuffix(PARTIAL_SUFFIX)}"
        print(f"{options.file} is intact, with {recovery.num_messages} messages: {cure}")
        return
    reach = "" if recovery.end_s is None else f", up to {recovery.end_s:g} s"
    print(
        f"{recovery.output} holds {recovery.num_messages} messages{reach}; "
        f"{recovery.num_damaged_records} damaged records and {recovery.num_bytes_lost} bytes at the end "
        "were left out"
    )
    if recovery.num_messages == 0:
        print(
            f"warning: no step of the flight could be rescued from {options.file}, only its description "
            "(metadata and attachments); fly the episode again",
            file=sys.stderr,
        )


@command(
    FLIGHT,
    argument("--format", choices=("csv", "parquet"), default="csv", help="default: csv"),
    argument(
        "-o", "--output", type=Path, metavar="DIR", help="default: a folder named after FILE and the format"
    ),
    examples=("flight.mcap", "flight.mcap --format parquet -o tables"),
)
def export(options: argparse.Namespace) -> None:
    """Write tables: one file per topic, units in the column names.

    One number per cell, time_s first; telemetry/README.md explains the topics and fields. In
    Python, telemetry.read(FILE) returns arrays and telemetry.flat_table these tables.
    """
    folder = options.output
    if folder is None:
        folder = options.file.with_name(f"{options.file.stem}-{options.format}")
    for path in tables.export(read(options.file), folder, options.format):
        print(path)


@command(
    argument("first", type=Path, metavar="A", help="a flight"),
    argument("second", type=Path, metavar="B", help="another"),
    argument(
        "--tolerance",
        type=float,
        default=0.0,
        metavar="NUMBER",
        help="differences up to it count as equal, in each field's own unit; default: 0",
    ),
    examples=("a.mcap b.mcap", "a.mcap b.mcap --tolerance 1e-9"),
)
def compare(options: argparse.Namespace) -> int:
    """Show at which sample, topic and field two flights first differ, and by how much.

    Exits with 0 if the flights are the same, 1 if they differ, 2 after a usage error.
    """
    first, second = read(options.first), read(options.second)
    if not first.topics and not second.topics:
        raise RecordingError(
            f"neither {options.first} nor {options.second} holds messages of a flight, so nothing can "
            "be compared; give recordings that telemetry.EpisodeWriter wrote"
        )
    comparison = comparison_of(first, second, options.tolerance)
    print("\n".join(comparison_in_words(comparison)))
    return 0 if comparison.is_equal else DIFFERENT
