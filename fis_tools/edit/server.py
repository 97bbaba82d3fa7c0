"""The page's server: on this machine alone, for who knows its address, in answer to nobody else's page.

Every address begins with a random token, so that other users and programs of the machine do not find the
page. Requests are refused whose host is not this machine's name (a page of another site that renames itself)
or whose origin is another page, websockets included. All that the page needs is served from here.
"""

import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from fis_tools.errors import MissingExtra

try:
    import uvicorn
    from fastapi import FastAPI
    from fastapi.responses import PlainTextResponse
    from nicegui import app as pages
    from nicegui import ui
except ImportError as error:
    raise MissingExtra("the editor", "NiceGUI", "nicegui") from error

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
    """Return an ASGI application that lets through to another what comes from this machine's own page."""
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


def serve(page: Callable[[], object], title: str, port: int = 0, opens: bool = True) -> None:
    """Serve a page until Ctrl-C; each window that opens it has its own.

    Parameters
    ----------
    page : callable
        Puts the elements on the page.
    title : str
    port : int
        0 for any that is free.
    opens : bool
        Whether a browser is opened.

    Raises
    ------
    OSError
        If the port is taken.
    """
    token = secrets.token_urlsafe(24)
    listening = socket.create_server((HOST, port))
    port = listening.getsockname()[1]
    address = f"http://{HOST}:{port}/{token}/"
    outer = FastAPI(openapi_url=None)
    ui.run_with(
        outer,
        root=page,
        title=title,
        mount_path=f"/{token}",
        language="en-US",
        show_welcome_message=False,
        reconnect_timeout=30.0,
    )

    def tell() -> None:
        print(address, flush=True)  # noqa: T201
        sys.stderr.write("the editor is at this address until Ctrl-C\n")
        if opens:
            webbrowser.open(address)  # file: none, a browser

    pages.on_startup(tell)
    guarded = _guarded(outer, port, token)
    config = uvicorn.Config(
        guarded, log_level="warning", server_header=False, headers=HEADERS, ws_max_size=1 << 20
    )
    config.ws_per_message_deflate = False  # nothing leaves this machine
    sys.setswitchinterval(5e-4)  # an answer that is computed does not hold up what is sent
    with suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listening])
