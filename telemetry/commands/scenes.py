"""Commands that show or draw scenes; each imports rerun when it runs, which takes half a second."""

import argparse
import os
import shlex
import sys
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from telemetry.commands.command import argument, command

if TYPE_CHECKING:
    from telemetry.scene.viewer import Scene


def _instant(text: str) -> float:
    instant = float(text)
    if not 0.0 <= instant < inf:
        raise argparse.ArgumentTypeError(f"{text} is not a time within a flight; give seconds, 0 or more")
    return instant


@command(
    argument("files", nargs="+", type=Path, metavar="FILE", help="flights; the first is shown in full"),
    examples=("flight.mcap", "flight.mcap --web", "a.mcap b.mcap --save both.rrd"),
    opens_viewer=True,
)
def replay(options: argparse.Namespace) -> None:
    """Show flights in rerun, in our layout.

    Shows the scene around the chief, the curves with their limits, the rules that fired, and
    the events. Opens a window unless --save or --web is given. Space plays; drag the time at
    the bottom.
    """
    from telemetry.scene import replay  # noqa: PLC0415

    _look(replay.scene(options.files), options)


def _look(scene: "Scene", options: argparse.Namespace) -> None:
    from telemetry.scene import viewer  # noqa: PLC0415

    if options.save is None:
        viewer.show(scene, in_browser=options.web)
        return
    viewer.save(scene, options.save)
    print(f"{options.save} is written; open it with `rerun {shlex.quote(str(options.save))}`")


@command(
    argument(
        "run_folder",
        type=Path,
        metavar="RUN",
        help="the folder of a run, or its evaluate/trajectories.parquet",
    ),
    examples=("outputs/evaluate/RUN", "outputs/evaluate/RUN --save cases.rrd"),
    opens_viewer=True,
)
def campaign(options: argparse.Namespace) -> None:
    """Show all trajectories of an evaluation, coloured by outcome.

    Green paths reached the goal, orange ones fell short of it, red ones left the limits; the
    most telling cases are labelled.
    """
    from telemetry.scene import campaign  # noqa: PLC0415

    _look(campaign.scene(options.run_folder), options)


@command(
    argument("run_folder", type=Path, metavar="RUN", help="the folder of a run"),
    argument("--follow", action="store_true", help="keep up with a training that is running"),
    examples=("outputs/train/RUN", "outputs/train/RUN --follow --web"),
    opens_viewer=True,
)
def training(options: argparse.Namespace) -> None:
    """Show a training, generation by generation.

    Shows the fitness, its parts, and the flight of each new champion. --follow waits for the
    first generation and adds each new one: to a file until the training ends, to a viewer
    until it is closed.
    """
    # when its viewer is closed, rerun logs an error because it can send no more
    os.environ.setdefault(
        "RUST_LOG", "info,re_perf_telemetry=warn,re_grpc_client=off,re_sdk::recording_stream=off"
    )
    from telemetry.scene import training  # noqa: PLC0415

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


@command(
    argument(
        "paths", nargs="+", type=Path, metavar="PATH", help="flights, drawn over each other, and run folders"
    ),
    argument(
        "--at",
        nargs="+",
        type=_instant,
        default=[60.0, 1200.0, 3000.0],
        metavar="SECONDS",
        help="times of flights to draw; default: 60 1200 3000",
    ),
    argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: this folder"),
    examples=("flight.mcap -o pictures", "flight.mcap outputs/train/RUN --at 60 1200"),
)
def screenshot(options: argparse.Namespace) -> None:
    """Draw pictures (PNG) of flights and runs, without a display.

    Draws what replay, campaign and training show, and lists the files. Needs a Vulkan driver;
    a software renderer will do (on Debian: apt-get install mesa-vulkan-drivers).
    """
    from telemetry.scene import screenshot  # noqa: PLC0415

    for path in screenshot.take(screenshot.subjects(options.paths, options.at), options.output):
        print(path)
