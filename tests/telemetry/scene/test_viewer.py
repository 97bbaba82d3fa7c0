"""rerun's viewer itself, without a display: that it shows all of each recording, and to whom it listens."""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
import psutil
import pytest
import rerun as rr
import rerun.blueprint as rrb
import rerun_notebook
from PIL import Image

import telemetry
from telemetry import RecordingError
from telemetry.commands import main
from telemetry.scene import campaign, replay, screenshot, viewer
from telemetry.scene.curves import drawable
from telemetry.scene.viewer import Scene
from tests.places import PROJECT
from tests.programs import library
from tests.telemetry import synthetic_flight, synthetic_run
from tests.telemetry.scene.rrd_content import Content

VULKAN = "/usr/share/vulkan/icd.d/lvp_icd.x86_64.json"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return synthetic_run.write_evaluation(tmp_path_factory.mktemp("run") / "evaluated")


@pytest.fixture(scope="module")
def client():
    library(VULKAN, "mesa-vulkan-drivers")
    with screenshot.headless() as client:
        yield client


@pytest.fixture
def complaints(client, tmp_path):
    """Draw something; return what the viewer complains of."""

    def drawn(scene):
        viewer.save(scene, tmp_path / "x.rrd")
        screenshot.load(client, tmp_path / "x.rrd")
        client.save_screenshot(str(tmp_path / "x.png"))
        problems = screenshot.complaints(client)
        client.close("all")
        return problems

    return drawn


@pytest.mark.slow
def test_the_viewer_can_write_every_sign_that_is_kept(complaints):
    """In both of its fonts: the viewer ends at a sign for which it has no glyph."""
    signs = "".join(sign for sign in map(chr, range(0x21, 0x3000)) if drawable(sign) == sign)
    assert len(signs) > 600
    lines = [signs[start : start + 60] for start in range(0, len(signs), 60)]
    plain = "\n\n".join(re.sub(r"([^\w\s])", r"\\\1", line, flags=re.ASCII) for line in lines)
    code = "\n".join(f"    {line}" for line in lines)

    def send(stream):
        for name, text in (("plain", plain), ("code", code)):
            stream.log(name, rr.TextDocument(text, media_type="text/markdown"), static=True)

    views = [rrb.TextDocumentView(origin=name, name=name) for name in ("plain", "code")]
    assert complaints(Scene("signs", "signs", rrb.Blueprint(rrb.Horizontal(*views)), send)) == []


@pytest.mark.slow
def test_flights_and_rules_are_shown_whatever_they_are_called(complaints, flight_file, tmp_path):
    flight = synthetic_flight.fly(12)
    words = synthetic_flight.metadata(flight)
    for name in words:
        if name.startswith("fis."):
            words[name] = {key: text.replace("is", "は") for key, text in words[name].items()}
    words["episode"]["scenario_id"] = "🚀"
    path = synthetic_flight.record(flight, tmp_path / "飛行.mcap", metadata=words)
    assert complaints(replay.scene([path])) == []
    assert complaints(replay.scene([flight_file, path])) == []


@pytest.mark.slow
def test_a_viewer_that_ends_is_not_taken_for_one_without_a_driver(tmp_path):
    library(VULKAN, "mesa-vulkan-drivers")

    def send(stream):
        stream.log("text", rr.TextDocument("🚀"), static=True)

    scene = Scene("text", "text", rrb.Blueprint(rrb.TextDocumentView(origin="text")), send)
    with pytest.raises(RecordingError, match=r"the viewer ended with exit code -?\d+: .*glyph"):
        list(screenshot.take([(scene, {"x": 0.0})], tmp_path))


@pytest.mark.slow
def test_a_view_that_fails_is_noticed(complaints, short_file, run):
    """The layout of a flight over a recording without one: nothing to look from as the deputy does."""
    scene = Scene("empty", "empty", replay.scene([short_file]).layout, campaign.scene(run).send)
    assert any(text.startswith("As the deputy sees it: ") for text in complaints(scene))


@pytest.mark.slow
def test_pictures_show_what_they_are_asked_for(flight_file, run, tmp_path, capsys):
    library(VULKAN, "mesa-vulkan-drivers")
    at = ["--at", "60", "3000"]
    assert main(["screenshot", str(flight_file), str(run), *at, "-o", str(tmp_path / "p")]) == 0
    names = ["replay-60", "replay-3000", "campaign"]
    assert capsys.readouterr().out.split() == [str(tmp_path / "p" / f"{name}.png") for name in names]
    pixels = {}
    for name in names:
        file = tmp_path / "p" / f"{name}.png"
        assert file.stat().st_size < 400 * 1024
        with Image.open(file) as image:
            assert image.width == 1600
            pixels[name] = np.asarray(image.convert("RGB")).astype(int)
        # no colour fills the whole picture, as it does where nothing has been drawn
        assert len(np.unique(pixels[name].reshape(-1, 3), axis=0)) > 30
    # the points inspected in between have turned green
    colours = [np.moveaxis(pixels[name], -1, 0) for name in names[:2]]
    before, after = (np.sum((green > red + 60) & (green > blue + 20)) for red, green, blue in colours)
    assert after > 1.5 * before


@pytest.mark.slow
def test_a_missing_driver_and_nothing_to_draw_are_said(run, tmp_path, monkeypatch, ran):
    message = ran("screenshot", tmp_path, code=2).err
    assert "does not exist" in message
    for variable in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(variable, str(tmp_path / "none.json"))
    assert "needs a Vulkan driver" in ran("screenshot", run, "-o", tmp_path, code=2).err


@pytest.mark.slow
def test_a_viewer_that_cannot_start_is_said():
    with (
        tempfile.TemporaryFile() as log,
        pytest.raises(RecordingError, match=r"ended with exit code \d+ before it was ready"),
        viewer.started("--no-such-option", log=log),
    ):
        pass


@pytest.mark.slow
def test_nothing_of_a_viewer_is_left_behind():
    with tempfile.TemporaryFile() as log, viewer.started("--web-viewer", log=log) as (process, _):
        launcher = psutil.Process(process.pid)
        processes = [launcher, *launcher.children(recursive=True)]
    assert len(processes) > 1
    _, alive = psutil.wait_procs(processes, 60)
    assert alive == []


DEAF = """
import signal, sys, time
for number in (signal.SIGTERM, signal.SIGINT):
    signal.signal(number, signal.SIG_IGN)
print("deaf", flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a break ends it there")
def test_a_viewer_that_does_not_end_is_killed(monkeypatch):
    monkeypatch.setattr(viewer, "_END_LIMIT_S", 0.1)
    with tempfile.TemporaryFile() as log:
        with viewer._running([sys.executable, "-c", DEAF], log) as process:
            while os.fstat(log.fileno()).st_size == 0 and process.poll() is None:
                time.sleep(0.01)
        assert process.returncode == -signal.SIGKILL


@pytest.mark.slow
def test_web_listens_to_this_machine_alone_and_ends_in_order(flight_file, tmp_path):
    command = [sys.executable, "-m", "telemetry", "replay", str(flight_file), "--web"]
    # a browser that opens nothing
    environment = {**os.environ, "BROWSER": "true", "TMPDIR": str(tmp_path)}
    log_path = tmp_path.parent / f"{tmp_path.name}.log"
    with (
        log_path.open("wb") as log,
        subprocess.Popen(command, cwd=PROJECT, env=environment, stdout=log, stderr=log) as process,  # noqa: S603
    ):
        try:
            listening = _await_listeners(process.pid, 2)
        finally:
            children = psutil.Process(process.pid).children(recursive=True)
            process.terminate()
            code = process.wait(60)
    assert set(listening) == {"127.0.0.1"}
    assert code == 143
    assert "telemetry: ended by SIGTERM" in log_path.read_text()
    assert psutil.wait_procs(children, 60)[1] == []
    assert list(tmp_path.glob("tmp*")) == []


def _await_listeners(pid: int, count: int) -> list[str]:
    """The addresses at which the descendants of a process listen, once there are so many."""

    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        children = psutil.Process(pid).children(recursive=True)
        connections = [connection for child in children for connection in child.net_connections()]
        addresses = [
            connection.laddr.ip for connection in connections if connection.status == psutil.CONN_LISTEN
        ]
        if len(addresses) >= count:
            return addresses
        time.sleep(0.1)
    pytest.fail("nothing has come for a minute")


@pytest.fixture
def shown(monkeypatch, tmp_path):
    """Show something and return the content of what a notebook's page receives."""
    received: list[bytes] = []
    monkeypatch.setattr(rerun_notebook.Viewer, "send_rrd", lambda _, chunk: received.append(bytes(chunk)))

    def show(*paths):
        widget = telemetry.show(*paths)
        assert hasattr(widget, "_ipython_display_")
        for number, chunk in enumerate(received):
            (tmp_path / f"{number}.rrd").write_bytes(chunk)
        return Content(*(tmp_path / f"{number}.rrd" for number in range(len(received))))

    return show


def test_flights_are_shown(shown, flight_file, short_file):
    content = shown(str(flight_file), short_file)
    assert len(content.column("/rules/words", "TextDocument:text")) == 361
    assert "/scene/flights/1/trail" in content.batches


def test_an_evaluation_is_shown(shown, run):
    assert "/scene/paths/outside" in shown(run).batches


def test_nothing_to_show_or_a_missing_notebook_part_is_said(tmp_path, short_file, monkeypatch):
    with pytest.raises(RecordingError, match="nothing to show"):
        telemetry.show()
    with pytest.raises(RecordingError, match="that has been evaluated"):
        telemetry.show(tmp_path)
    monkeypatch.setattr("rerun.notebook.HAS_NOTEBOOK", False)
    with pytest.raises(RecordingError, match=r"pip install 'rerun-sdk\[notebook\]'"):
        telemetry.show(short_file)
