"""Editors for tests: a server of its own for each, and pages that open it."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.places import PROJECT

#: an answer may wait for others' work on the same processors, a saved copy for a busy disk
PATIENCE_MS = 300_000
expect.set_options(timeout=PATIENCE_MS)


@contextmanager
def served(*words: str, folder: Path, browser: Path | None = None) -> Iterator[str]:
    """Start an editor in a folder, with a program as its browser or none; yield its printed address."""
    command = [sys.executable, "-m", *words, *([] if browser else ["--no-browser"])]
    environment = {**os.environ, "PYTHONPATH": str(PROJECT), "BROWSER": f"{browser} %s &"}
    with subprocess.Popen(  # noqa: S603
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder, env=environment
    ) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            assert address.startswith("http://127.0.0.1:"), process.communicate()
            yield address
        finally:
            process.terminate()
            complaints = process.communicate(timeout=30)[1]
    assert "Traceback" not in complaints, complaints


@pytest.fixture(scope="session")
def window(browser: Browser) -> Iterator[BrowserContext]:
    """One window for all editors, which loads their library once."""
    with closing(browser.new_context()) as window:
        yield window


@pytest.fixture
def open_page(window: BrowserContext) -> Iterator[Callable[..., Page]]:
    """Open addresses as pages, as often as a test likes; nothing may be fetched elsewhere, or go wrong."""
    complaints: list[str] = []

    def open_page(address: str, width: int = 1280) -> Page:
        page = window.new_page()
        page.set_viewport_size({"width": width, "height": 900})
        page.set_default_timeout(PATIENCE_MS)
        page.on(
            "console",
            # the framework says so where a connection was lost for long
            lambda message: (
                message.text.startswith("reloading because")
                or complaints.append(f"{message.type}: {message.text}")
            ),
        )
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        base = address.partition("?")[0]
        origins = (base, base.replace("http:", "ws:"), "data:")
        page.on(
            "request",
            lambda request: request.url.startswith(origins) or complaints.append(f"request: {request.url}"),
        )
        page.goto(address)
        # where processors are busy the framework may reload a page that has not connected, and lose what was
        # typed
        page.wait_for_function("window.did_handshake")
        return page

    yield open_page
    for page in window.pages:
        page.close()
    assert not complaints, complaints
