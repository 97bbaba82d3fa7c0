"""Firefox for tests of pages, by WebDriver BiDi (W3C): Playwright drives a build of its own alone.

A page that asks for anything, or complains, fails.
"""

import json
import re
import subprocess
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.programs import program

#: nothing is asked of anybody
PREFERENCES = """
user_pref("app.update.enabled", false);
user_pref("browser.shell.checkDefaultBrowser", false);
user_pref("browser.startup.page", 0);
user_pref("datareporting.policy.dataSubmissionEnabled", false);
user_pref("network.captive-portal-service.enabled", false);
user_pref("remote.active-protocols", 1);
user_pref("toolkit.telemetry.enabled", false);
"""
#: how long a busy machine may take for an answer, s
PATIENCE_S = 300
KEYS = {"ArrowLeft": "\ue012", "ArrowRight": "\ue014", "Enter": "\ue007", "End": "\ue010", "Home": "\ue011"}


class FirefoxPage:
    """A page in Firefox."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket, self._number = socket, 0
        self._events: deque[dict[str, Any]] = deque()
        self._send("session.new", capabilities={})
        events = ["log.entryAdded", "network.beforeRequestSent", "browsingContext.userPromptOpened"]
        self._send("session.subscribe", events=events)
        self._context = self._send("browsingContext.getTree")["contexts"][0]["context"]

    def _send(self, method: str, **params: Any) -> Any:
        """Send a command and return its result; what comes before that is kept."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while (answer := json.loads(self._socket.recv(PATIENCE_S))).get("id") != self._number:
            self._events.append(answer)
        assert answer["type"] == "success", answer
        return answer["result"]

    def open(self, path: Path, width: int, height: int) -> None:
        """Open a file, and wait until it has loaded."""
        viewport = {"width": width, "height": height}
        self._send("browsingContext.setViewport", context=self._context, viewport=viewport)
        self._send("browsingContext.navigate", context=self._context, url=path.as_uri(), wait="complete")

    def evaluate(self, expression: str) -> Any:
        """Return what a JavaScript expression or its promise gives, through JSON."""
        result = self._send(
            "script.evaluate",
            expression=f"Promise.resolve({expression}).then(value => JSON.stringify(value ?? null))",
            target={"context": self._context},
            awaitPromise=True,
        )
        assert result["type"] == "success", result
        return json.loads(result["result"]["value"])

    def wait_for(self, expression: str) -> None:
        """Wait until an expression is true."""
        self.evaluate(
            "(async () => { while (!(" + expression + ")) await new Promise(end => setTimeout(end, 50)); })()"
        )

    def click(self, x: float, y: float) -> None:
        """Press and release the mouse at a place of the viewport."""
        move = {"type": "pointerMove", "x": round(x), "y": round(y)}
        presses = [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self._act({"type": "pointer", "id": "mouse", "actions": [move, *presses]})

    def press(self, key: str) -> None:
        """Press and release a key."""
        self._act(
            {
                "type": "key",
                "id": "keys",
                "actions": [{"type": kind, "value": KEYS[key]} for kind in ("keyDown", "keyUp")],
            }
        )

    def _act(self, source: dict[str, Any]) -> None:
        self._send("input.performActions", context=self._context, actions=[source])

    def complaints(self) -> list[str]:
        """Return what was logged, asked for from elsewhere, or shown as a dialog."""
        self.evaluate("0")  # what came before has arrived
        said = []
        for event in self._events:
            params = event["params"]
            url = params.get("request", {}).get("url", "file:")
            if event["method"] != "network.beforeRequestSent":
                said.append(f"{event['method']}: {params.get('text') or params.get('message')}")
            elif not url.startswith(("file:", "blob:", "data:")):
                said.append(f"request: {url}")
        return said


@contextmanager
def firefox(folder: Path) -> Iterator[FirefoxPage]:
    """Start Firefox without a window, with a profile in a folder; in the end nothing was wrong."""
    path = program("firefox-esr", "firefox-esr")
    profile = folder / "profile"
    profile.mkdir()
    (profile / "user.js").write_text(PREFERENCES, encoding="utf-8")
    command = [path, "--headless", "--no-remote", "--profile", str(profile), "--remote-debugging-port=0"]
    with (folder / "firefox.log").open("w+", encoding="utf-8") as log:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)  # noqa: S603
        try:
            with connect(f"{_address(process, folder / 'firefox.log')}/session", max_size=None) as socket:
                page = FirefoxPage(socket)
                yield page
                assert page.complaints() == []
        finally:
            process.terminate()
            process.wait(PATIENCE_S)


def _address(process: "subprocess.Popen[bytes]", log: Path) -> str:
    """Return where Firefox listens, once it says so."""
    while process.poll() is None:
        if match := re.search(r"ws://\S+", log.read_text(encoding="utf-8", errors="replace")):
            return match[0].rstrip("/")
        try:
            process.wait(0.1)
        except subprocess.TimeoutExpired:
            continue
    raise AssertionError(log.read_text(encoding="utf-8", errors="replace"))
