"""The page's server: on this machine alone, for who knows its address, in answer to nobody else's page.

Every address begins with a random token, so that other users and programs of the machine do not find the
page. Everybody can read the words of a command, so a browser is given a file that leads to the address and
that only this user can read. Requests are refused whose host is not this machine's name (a page of another
site that renames itself) or whose origin is another page, websockets included. All that the page needs is
served from here.
"""

import secrets
import signal
import socket
import sys
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

from fis_tools.errors import MissingExtra
from plain_files.file_access import write_bytes

try:
    import uvicorn
    from fastapi import FastAPI
    from fastapi.responses import PlainTextResponse
    from nicegui import app as pages
    from nicegui import ui
except ImportError as error:
    raise MissingExtra("the editor", "NiceGUI", "nicegui") from error

from fis_tools.edit.session import Session
from fis_tools.edit.windows import Windows

HOST = "127.0.0.1"
#: nothing is fetched from elsewhere, and no other page holds this one; the framework compiles its templates
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; font-src 'self' data:; frame-ancestors 'none'; base-uri 'self'; form-action 'none'"
)
HEADERS = [
    ("content-security-policy", POLICY),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
]


def _guarded(inside: Any, port: int, token: str) -> Any:
    """Wrap an ASGI application so that it answers only requests of this machine's own page."""
    hosts, start = {f"{name}:{port}" for name in (HOST, "localhost")}, f"/{token}/".encode()

    def is_own(scope: Any) -> bool:
        headers = dict(scope["headers"])
        host, origin = (headers.get(name, b"").decode("latin-1") for name in (b"host", b"origin"))
        is_told = secrets.compare_digest(scope["path"].encode()[: len(start)], start)
        return is_told and host in hosts and origin in ("", f"http://{host}")

    async def answer(scope: Any, receive: Any, send: Any) -> None:
        is_let_in = scope["type"] == "lifespan" or is_own(scope)
        refusal = PlainTextResponse("open the address that the editor printed\n", 403)
        await (inside if is_let_in else refusal)(scope, receive, send)

    return answer


class Server(uvicorn.Server):
    """A server that ends on Ctrl-C; with unsaved changes, on the second."""

    def __init__(self, config: uvicorn.Config, windows: Windows) -> None:
        super().__init__(config)
        self._windows, self._is_warned = windows, False

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the server, or warn first of unsaved changes."""
        if sig == signal.SIGINT and not self._is_warned and (unsaved := self._windows.num_unsaved):
            self._is_warned = True
            windows = f"{unsaved} window{'s' if unsaved > 1 else ''}"
            sys.stderr.write(f"changes in {windows} are not saved; save them, or press Ctrl-C again\n")
            return
        super().handle_exit(sig, frame)


def _redirect(folder: Path, address: str) -> Path:
    """Write a page that leads to an address, for this user alone; return its path."""
    path = folder / "open.html"
    page = f'<!doctype html><meta http-equiv="refresh" content="0; url={address}">\n'
    write_bytes(path, page.encode(), mode=0o600)
    return path


def serve(
    session: Callable[[], Session],
    page: Callable[[Session], object],
    title: str,
    port: int = 0,
    opens: bool = True,
    reconnect_s: float = 30.0,
) -> None:
    """Serve a page until Ctrl-C; each window that opens it has a session of its own.

    Parameters
    ----------
    session : callable
        Returns what a new window edits.
    page : callable
        Puts the elements of a session on the page.
    title : str
    port : int
        0 for any that is free.
    opens : bool
        Whether a browser is opened.
    reconnect_s : float
        A connection that is lost for longer loads its page again.

    Raises
    ------
    OSError
        If the port is taken.
    Mistake
        If the controller cannot be edited.
    """
    session()
    windows, token = Windows(session), secrets.token_urlsafe(24)
    listening = socket.create_server((HOST, port))
    port = listening.getsockname()[1]
    address = f"http://{HOST}:{port}/{token}/"
    outer = FastAPI(openapi_url=None)
    ui.run_with(
        outer,
        root=lambda: page(windows.open_page()),
        title=title,
        dark=None,
        mount_path=f"/{token}",
        language="en-US",
        show_welcome_message=False,
        reconnect_timeout=reconnect_s,
    )

    def announce() -> None:
        print(address, flush=True)  # noqa: T201
        sys.stderr.write("the editor is at this address until Ctrl-C\n")
        if opens:
            webbrowser.open(_redirect(Path(folder), address).as_uri())  # file: none, a browser

    pages.on_startup(announce)
    guarded = _guarded(outer, port, token)
    config = uvicorn.Config(
        guarded, log_level="warning", server_header=False, headers=HEADERS, ws_max_size=1 << 20
    )
    config.ws_per_message_deflate = False  # nothing leaves this machine
    sys.setswitchinterval(5e-4)  # an answer that is computed does not hold up what is sent
    server = Server(config, windows)
    for number in (signal.SIGTERM, signal.SIGHUP):  # the folder goes however the program ends
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: sys.exit(1))
    with suppress(KeyboardInterrupt), TemporaryDirectory(prefix="editor-") as folder:
        server.run(sockets=[listening])
