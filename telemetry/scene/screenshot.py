"""Pictures of scenes, drawn by the viewer without a display."""

import io
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Final

from PIL import Image, ImageChops
from rerun.experimental import ViewerClient

from plain_files.file_access import read_bytes, replacing
from telemetry.file import RecordingError, explained
from telemetry.scene import blueprint, campaign, replay, viewer

#: of the viewer's window, in pixels
SIZE: Final = (1600, 900)
#: height of the viewer's menu bar, which shows details of the machine
_BAR: Final = 36
_COLOURS: Final = 128
#: how long a scene may take to come to rest
_PATIENCE_S: Final = 120.0
_PAUSE_S: Final = 0.6
#: how long a viewer that no longer answers may take to end
_END_S: Final = 10.0


#: a scene, and the times of it to draw, s, by the names of the pictures' files without their suffix
Subject = tuple[viewer.Scene, Mapping[str, float]]


def subjects(paths: Sequence[Path], instants_s: Sequence[float]) -> list[Subject]:
    """Choose the scenes of flights and runs.

    Parameters
    ----------
    paths : sequence of Path
        Flights, which are overlaid, and folders of runs: evaluations are drawn at their start.
    instants_s : sequence of float
        Times of the flights.

    Raises
    ------
    RecordingError
        If a file cannot be read, or a folder holds no evaluation.
    """
    shown: list[Subject] = []
    flights = [path for path in paths if not path.is_dir()]
    if flights:
        pictures = {f"replay-{instant:.12g}": instant for instant in instants_s}
        shown.append((replay.scene(flights), pictures))
    folders = [path for path in paths if path.is_dir()]
    taken: Counter[str] = Counter()
    for folder in folders:
        name = "campaign" if len(folders) == 1 else f"campaign-{folder.resolve().name}"
        taken[name] += 1
        name += f"-{taken[name]}" if taken[name] > 1 else ""
        shown.append((campaign.scene(folder), {name: 0.0}))
    return shown


def take(subjects: Sequence[Subject], folder: Path) -> Iterator[Path]:
    """Draw pictures of scenes, with one viewer for all.

    Parameters
    ----------
    subjects : sequence of Subject
    folder : Path
        For the PNG files; created if missing.

    Yields
    ------
    Path
        Each picture, once it is written.

    Raises
    ------
    RecordingError
        If the viewer does not start or reports a fault in a view, or a file cannot be written.
    """
    with tempfile.TemporaryDirectory() as scratch, headless() as client:
        for number, (scene, pictures) in enumerate(subjects):
            file = Path(scratch) / f"{number}.rrd"
            viewer.save(scene, file)
            load(client, file)
            for name, instant in pictures.items():
                image = _draw(client, instant, Path(scratch) / "shot.png")
                if problems := complaints(client):
                    raise RecordingError(f"the viewer cannot show all of {scene.name}: {'; '.join(problems)}")
                yield _write(image, folder / f"{name}.png")
            client.close("all")


@contextmanager
def headless() -> Iterator[ViewerClient]:
    """Start a viewer without a window that accepts connections of this machine only.

    Raises
    ------
    RecordingError
        If it does not start, for example without a Vulkan driver, or does not answer.
    """
    size = "x".join(str(pixels) for pixels in SIZE)
    with (
        tempfile.TemporaryFile() as log,  # file: one without a name
        viewer.started("--headless", "--window-size", size, log=log) as (process, url),
    ):
        try:
            yield ViewerClient.connect(url)
        except (OSError, RuntimeError) as error:
            # a viewer that is ending takes a moment
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(_END_S)
                raise RecordingError(
                    f"the viewer ended with exit code {code}: {_last_words(log)}; "
                    "without a render context it needs a Vulkan driver "
                    "(on Debian: apt-get install mesa-vulkan-drivers)"
                ) from error
            raise RecordingError(
                f"the viewer does not answer ({error}); it needs a Vulkan driver; a software "
                "renderer will do (on Debian: apt-get install mesa-vulkan-drivers)"
            ) from error


def _last_words(log: IO[bytes]) -> str:
    """Return the last error in a viewer's log."""
    log.seek(0)
    lines = log.read().decode(errors="replace").splitlines()
    return next((line for line in lines if "panicked" in line), "it did not say why")


def load(client: ViewerClient, file: Path) -> None:
    """Open an .rrd file and wait until it is loaded.

    Raises
    ------
    RecordingError
        If it does not load in time.
    """
    client.open(str(file))  # file: a scene in a folder of its own
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        state = client.get_state()
        if not state.loading and state.active_recording and state.views:
            return
        time.sleep(0.2)
    raise RecordingError(
        f"the viewer did not load its recording within {_PATIENCE_S:g} s; {viewer.WHEN_SLOW}"
    )


def complaints(client: ViewerClient) -> list[str]:
    """Return the errors of the views, and those in the viewer's log."""
    problems = [
        f"{view.name}: {report.summary} {report.details or ''}".strip()
        for view in client.get_state().views
        for report in view.reports
    ]
    return problems + [entry.message for entry in client.get_logs() if entry.level.lower() == "error"]


def _draw(client: ViewerClient, instant_s: float, file: Path) -> Image.Image:
    """Return a picture of the view at an instant, once two in a row are the same."""
    client.set_time(blueprint.TIME, duration=instant_s, play_state="paused")
    end = time.monotonic() + _PATIENCE_S
    before: Image.Image | None = None
    while time.monotonic() < end:
        time.sleep(_PAUSE_S)
        client.save_screenshot(str(file))  # file: in a folder of its own
        with Image.open(io.BytesIO(read_bytes(file))) as shot:  # file: drawn by our own viewer
            now = shot.convert("RGB")
        if before is not None and ImageChops.difference(before, now).getbbox() is None:
            return now
        before = now
    raise RecordingError(
        f"the view did not come to rest within {_PATIENCE_S:g} s, so there is no picture of it"
    )


def _write(image: Image.Image, path: Path) -> Path:
    """Write a picture as a small PNG without the viewer's bar."""
    # by octree: by median cut thin curves of two colours come out as one
    small = image.crop((0, _BAR, *image.size)).quantize(
        _COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )
    with explained(f"{path} cannot be written", "make room, or choose another folder"):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as stream:
            small.save(stream, "PNG", optimize=True)
    return path
