"""The command ``merge RUN_A RUN_B ...``: one run of the shards of a campaign, flown on any machines."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from pipeline.command_line import runs
from pipeline.command_line.arguments import CommandParser
from pipeline.command_line.config import Job
from pipeline.evaluation import merging
from pipeline.preflight import check_before
from pipeline.run import configuration
from pipeline.run.lock import held
from pipeline.settings import schema


def merge(given: Sequence[str]) -> int:
    """Make one run of the shards of a campaign, whose files are those of a campaign that was flown whole.

    Usage: python -m pipeline merge RUN_A RUN_B ... [-o FOLDER]

    Shards are runs of the same experiment with monte_carlo.only_cases=[first,past] each, of the cases from
    the first up to the one before `past`. They may overlap where they agree. None is flown again, but the
    recordings and the report of the whole are made.

    Raises
    ------
    ValueError, OSError
        User errors: also if shards are of several campaigns or programs, leave cases out, or differ.
    """
    parser = CommandParser("python -m pipeline merge")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER")
    parser.add_argument("shards", type=Path, nargs="+", metavar="RUN")
    chosen = parser.parse_args(list(given))
    shards = [merging.read_shard(folder, runs.stored(folder).config) for folder in chosen.shards]
    config = merging.whole_of(shards)
    now = datetime.now(UTC).astimezone().strftime("%Y%m%d-%H%M%S-%f")
    folder = chosen.output or Path("outputs", f"{config['name']}-merged", now)
    # what is there in parts is not flown again
    job = Job(config, replace(schema.experiment_from(config), resume=True), folder)
    check_before(job.experiment)
    with held(folder):
        runs.check_vacant(job)
        configuration.write(folder, config)
        merging.write_parts(shards, folder)
        return runs.run(job, command=["merge", *given])
