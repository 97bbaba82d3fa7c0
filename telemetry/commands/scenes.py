"""Commands that show or draw scenes; each imports rerun when it runs, which takes half a second."""

import os
import shlex
import sys
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from telemetry.file.errors import RecordingError

if TYPE_CHECKING:
    from telemetry.scene.viewer import Scene


@Parameter(name="*")
@dataclass(frozen=True)
class Shown:
    """Where a scene is shown: in a window, unless one of these is given.

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
    Opens a window unless --save or --web is given. Space plays; drag the time at the bottom.

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


def training(run: Path, /, shown: Shown = WINDOW, *, follow: bool = False) -> None:
    """Show a training, generation by generation.

    Shows the fitness, its parts, and the flight of each new champion. --follow waits for the first generation
    and adds each new one: to a file until the training ends, to a viewer until it is closed.

    For example:

        python -m telemetry training outputs/train/RUN
        python -m telemetry training outputs/train/RUN --follow --web

    Parameters
    ----------
    run
        the folder of a run
    follow
        keep up with a training that is running
    """
    # when its viewer is closed, rerun logs an error because it can send no more
    os.environ.setdefault(
        "RUST_LOG", "info,re_perf_telemetry=warn,re_grpc_client=off,re_sdk::recording_stream=off"
    )
    from telemetry.scene import training  # noqa: PLC0415

    if not follow:
        shown.look(training.scene(run))
        return
    with suppress(KeyboardInterrupt):
        training.follow(
            run, shown.save, in_browser=shown.web, report=lambda text: print(text, file=sys.stderr)
        )


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

    Draws what replay, campaign and training show, and lists the files. Needs a Vulkan driver; a software
    renderer will do (on Debian: apt-get install mesa-vulkan-drivers).

    For example:

        python -m telemetry screenshot flight.mcap -o pictures
        python -m telemetry screenshot flight.mcap outputs/train/RUN --at 60 1200

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
