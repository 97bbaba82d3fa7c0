"""Scenes in rerun: saved to a file, in a window, a browser or a notebook."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import rerun as rr
import rerun.blueprint as rrb

from plain_files.file_access import replacing
from telemetry.file import RecordingError, explained

APPLICATION: Final = "fuzzy-spacecraft-inspection"
#: suffix of rerun's files
ENDING: Final = ".rrd"
#: by default the viewer would listen on every network interface
LOOPBACK: Final = "127.0.0.1"
_START_LIMIT_S: Final = 60.0
#: what it takes a viewer to end in order
_END_LIMIT_S: Final = 10.0
#: how to mend that a viewer is too slow
WHEN_SLOW: Final = "end what else keeps this machine busy, and try again"
#: `-P` keeps a file called rerun.py in the current folder from being run instead
_RERUN: Final = (sys.executable, "-P", "-m", "rerun", "--bind", LOOPBACK)


@dataclass(frozen=True)
class Scene:
    """A scene to show.

    Parameters
    ----------
    kind : str
        One word; recordings of a kind share a layout, which the user may change.
    name : str
        Name of the recording in the viewer.
    layout : rerun.blueprint.Blueprint
    send : callable
        Sends the scene to a stream.
    """

    kind: str
    name: str
    layout: rrb.Blueprint
    send: Callable[[rr.RecordingStream], None]


def save(scene: Scene, output: Path) -> None:
    """Write a scene to an .rrd file that opens in our layout.

    Parameters
    ----------
    scene : Scene
    output : Path
        An existing file is replaced when the new one is complete.

    Raises
    ------
    RecordingError
        If the output's name does not end in .rrd, or it cannot be written.
    """
    if output.suffix != ENDING:
        # rerun would not open it, and it may be a flight
        raise RecordingError(
            f"{output} does not end in {ENDING}, but rerun recognises recordings by it; "
            f"choose a name such as {output.with_suffix(ENDING)}"
        )
    cure = "choose an existing folder with free space"
    # RuntimeError where the library cannot encode
    with explained(f"{output} cannot be written", cure, RuntimeError), replacing(output) as file:
        file.write(_content(scene))


def _content(scene: Scene) -> bytes:
    """Return the content of a scene's file; the library's own writer may wait for ever on a full disk."""
    stream = _stream(scene)
    memory = stream.memory_recording()
    stream.send_blueprint(scene.layout, make_active=False, make_default=True)
    _fill(stream, scene)
    content = memory.drain_as_bytes()
    stream.disconnect()
    return content


def _fill(stream: rr.RecordingStream, scene: Scene) -> None:
    """Send a scene to a stream, and wait until all has arrived."""
    stream.send_recording_name(scene.name)
    scene.send(stream)
    stream.flush()


def show(scene: Scene, *, in_browser: bool) -> None:
    """Open a scene in rerun, in a window or in a browser, until the user ends it.

    Parameters
    ----------
    scene : Scene
    in_browser : bool
        Serve a page to this machine only, instead of opening a window.

    Raises
    ------
    RecordingError
        If the viewer cannot open.
    """
    is_x11_or_wayland = sys.platform.startswith(("linux", "freebsd"))
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not in_browser and is_x11_or_wayland and not has_display:
        raise RecordingError(
            "this machine has no display to open the viewer on; "
            "use a browser with --web, or write a file with --save FILE.rrd"
        )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.rrd"
        save(scene, file)
        in_page = ("--web-viewer", "--web-viewer-port", "0") if in_browser else ()
        command = [*_RERUN, "--port", "auto", *in_page, str(file)]
        with suppress(KeyboardInterrupt), _running(command) as process:
            if code := process.wait():
                raise RecordingError(
                    f"the viewer ended with exit code {code}; see its message above; "
                    "write a file with --save FILE.rrd and open that elsewhere"
                )


@contextmanager
def started(*options: str, log: IO[bytes]) -> Iterator[tuple["subprocess.Popen[bytes]", str]]:
    """Start a viewer that listens on the loopback interface only; it ends with the block.

    Parameters
    ----------
    *options : str
        Options of rerun's command line.
    log : binary file
        For the viewer's output.

    Yields
    ------
    process, url
        The viewer, and its address for clients.

    Raises
    ------
    RecordingError
        If it does not start.
    """
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port = probe.getsockname()[1]
    with _running([*_RERUN, "--port", str(port), *options], log) as process:
        _await_port(process, port)
        yield process, f"rerun+http://{LOOPBACK}:{port}/proxy"


@contextmanager
def _running(command: Sequence[str], log: IO[bytes] | None = None) -> Iterator["subprocess.Popen[bytes]"]:
    """Run a viewer that ends with the block, however that is left."""
    process = subprocess.Popen(  # noqa: S603 - the viewer, with options and a file of ours
        command,
        stdout=log,
        stderr=log,
        # a group of their own, so that the viewer ends together with the launcher that waits for it
        process_group=0,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )
    try:
        yield process
    finally:
        _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End all processes of a viewer's group; those that do not heed it within a while are killed."""
    if sys.platform == "win32":
        process.send_signal(signal.CTRL_BREAK_EVENT)
    else:
        _tell_group(process, signal.SIGTERM)
    try:
        process.wait(_END_LIMIT_S)
    except subprocess.TimeoutExpired:
        if sys.platform == "win32":
            process.kill()
        else:
            _tell_group(process, signal.SIGKILL)
        process.wait()


def _tell_group(process: "subprocess.Popen[bytes]", number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def in_notebook(scene: Scene) -> Any:
    """Return a rerun viewer that Jupyter and marimo display, holding a scene.

    Raises
    ------
    RecordingError
        If rerun's notebook extra is not installed.
    """
    from rerun import notebook  # noqa: PLC0415 - only notebooks need it
    from rerun.error_utils import RerunMissingDependencyError  # noqa: PLC0415

    stream = _stream(scene)
    try:
        widget = notebook.Viewer(recording=stream, blueprint=scene.layout, width="auto", height="auto")
    except RerunMissingDependencyError as error:
        raise RecordingError(
            "rerun's notebook extra is not installed, which notebooks need; "
            "install it with: pip install 'rerun-sdk[notebook]'"
        ) from error
    _fill(stream, scene)
    return widget


def _stream(scene: Scene) -> rr.RecordingStream:
    return rr.RecordingStream(f"{APPLICATION}-{scene.kind}")


def _await_port(process: "subprocess.Popen[bytes]", port: int) -> None:
    """Wait until a viewer accepts connections; raise RecordingError if it ends or takes too long."""
    end = time.monotonic() + _START_LIMIT_S
    while time.monotonic() < end:
        if process.poll() is not None:
            raise RecordingError(
                f"the viewer ended with exit code {process.returncode} before it was ready; it needs a "
                "Vulkan driver even where it has no display (on Debian: apt-get install mesa-vulkan-drivers)"
            )
        with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1.0):
            return
        time.sleep(0.1)
    raise RecordingError(f"the viewer was not ready within {_START_LIMIT_S:g} s; {WHEN_SLOW}")
