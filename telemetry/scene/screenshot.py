"""Pictures of scenes, drawn by the viewer without a display."""

import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from PIL import Image, ImageChops
from rerun.experimental import ViewerClient

from telemetry.file import RecordingError
from telemetry.file.partial_file import whole_file
from telemetry.scene import blueprint, campaign, replay, runs, training, viewer
from telemetry.scene.viewer import Scene

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


@dataclass(frozen=True)
class Picture:
    """A moment of a scene to draw.

    Parameters
    ----------
    name : str
        Of the file, without its suffix.
    timeline : str
        `blueprint.TIME` or `blueprint.GENERATION`.
    instant : float
        Seconds, or the number of a generation.
    """

    name: str
    timeline: str
    instant: float


@dataclass(frozen=True)
class Subject:
    """A scene and the moments of it to draw."""

    scene: Scene
    pictures: tuple[Picture, ...]


def subjects(paths: Sequence[Path], instants_s: Sequence[float]) -> list[Subject]:
    """Choose the scenes of flights and runs.

    Parameters
    ----------
    paths : sequence of Path
        Flights, which are overlaid, and folders of runs: evaluations are drawn at their start, trainings at
        their end.
    instants_s : sequence of float
        Times of the flights.

    Raises
    ------
    RecordingError
        If a file cannot be read, or a folder holds neither an evaluation nor a training.
    """
    found = []
    flights = [path for path in paths if not path.is_dir()]
    if flights:
        pictures = (Picture(f"replay-{instant:g}", blueprint.TIME, instant) for instant in instants_s)
        found.append(Subject(replay.scene(flights), tuple(pictures)))
    folders = [path for path in paths if path.is_dir()]
    for folder in folders:
        if not runs.has_evaluation(folder) and not runs.has_training(folder):
            raise RecordingError(
                f"{folder} holds neither an evaluation nor a training; give the folder of a run with "
                f"{runs.FILES['evaluation_trajectories']} or {runs.FILES['training_history']}"
            )
    evaluated = [folder for folder in folders if runs.has_evaluation(folder)]
    for folder in evaluated:
        picture = Picture(_name("campaign", folder, evaluated), blueprint.TIME, 0.0)
        found.append(Subject(campaign.scene(folder), (picture,)))
    trained = [folder for folder in folders if runs.has_training(folder)]
    for folder in trained:
        last = len(runs.read_training(folder)) - 1
        picture = Picture(_name("training", folder, trained), blueprint.GENERATION, last)
        found.append(Subject(training.scene(folder), (picture,)))
    return found


def _name(kind: str, folder: Path, folders: Sequence[Path]) -> str:
    return kind if len(folders) == 1 else f"{kind}-{folder.resolve().name}"


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
        for number, subject in enumerate(subjects):
            file = Path(scratch) / f"{number}.rrd"
            viewer.save(subject.scene, file)
            load(client, file)
            for picture in subject.pictures:
                image = _draw(client, picture, Path(scratch) / "shot.png")
                _require_sound(client, subject.scene)
                yield _write(image, folder / f"{picture.name}.png")
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
        tempfile.TemporaryFile() as log,
        viewer.started("--headless", "--window-size", size, log=log) as running,
    ):
        try:
            yield ViewerClient.connect(running.url)
        except (OSError, RuntimeError) as error:
            # a viewer that is ending takes a moment
            with suppress(subprocess.TimeoutExpired):
                code = running.process.wait(_END_S)
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
    """Return why a viewer ended, from its log."""
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
    client.open(str(file))
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        state = client.get_state()
        if not state.loading and state.active_recording and state.views:
            return
        time.sleep(0.2)
    raise RecordingError(f"the viewer did not load its recording within {_PATIENCE_S:g} s")


def complaints(client: ViewerClient) -> list[str]:
    """Return the faults of the views, and the errors in the viewer's log."""
    found = [
        f"{view.name}: {report.summary} {report.details or ''}".strip()
        for view in client.get_state().views
        for report in view.reports
    ]
    return found + [entry.message for entry in client.get_logs() if entry.level.lower() == "error"]


def _draw(client: ViewerClient, picture: Picture, file: Path) -> Image.Image:
    if picture.timeline == blueprint.TIME:
        client.set_time(picture.timeline, duration=picture.instant, play_state="paused")
    else:
        client.set_time(picture.timeline, sequence=int(picture.instant), play_state="paused")
    end = time.monotonic() + _PATIENCE_S
    before: Image.Image | None = None
    while time.monotonic() < end:
        time.sleep(_PAUSE_S)
        client.save_screenshot(str(file))
        with Image.open(file) as shot:
            now = shot.convert("RGB")
        if before is not None and ImageChops.difference(before, now).getbbox() is None:
            return now
        before = now
    raise RecordingError(
        f"the view did not come to rest within {_PATIENCE_S:g} s, so there is no picture of it"
    )


def _require_sound(client: ViewerClient, scene: Scene) -> None:
    found = complaints(client)
    if found:
        raise RecordingError(f"the viewer cannot show all of {scene.name}: {'; '.join(found)}")


def _write(image: Image.Image, path: Path) -> Path:
    # by octree: by median cut thin curves of two colours come out as one
    small = image.crop((0, _BAR, *image.size)).quantize(
        _COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as stream:
            small.save(stream, "PNG", optimize=True)
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be written: {error.strerror or error}; make room, or choose another folder"
        ) from error
    return path
