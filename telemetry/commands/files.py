"""Commands that read recordings and write text or files."""

import sys
from json import dumps
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

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

    A process that is killed leaves its flight as NAME.mcap.partial. Whatever is provably intact in it, or in
    a truncated or damaged file, is written to a new file that every other command reads. The old file stays
    as it is.

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
        print(f"{file} is intact, with {recovery.num_messages} messages: {cure}")
        return
    reach = "" if recovery.end_s is None else f", up to {recovery.end_s:g} s"
    print(
        f"{recovery.output} holds {recovery.num_messages} messages{reach}; "
        f"{recovery.num_damaged_records} damaged records and {recovery.num_bytes_lost} bytes at the end "
        "were left out"
    )
    if recovery.num_messages == 0:
        print(
            f"warning: no step of the flight could be rescued from {file}, only its description "
            "(metadata and attachments); fly the episode again",
            file=sys.stderr,
        )


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
