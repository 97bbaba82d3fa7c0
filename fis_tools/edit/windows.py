"""The editor's windows: what each edits outlasts its page, loaded again or with its connection lost."""

import secrets
from collections import defaultdict
from collections.abc import Callable
from typing import Protocol

from nicegui import ui

from fis_tools.edit.session import Session

#: the part of a page's address that names its window
KEY = "window"


class Connection(Protocol):
    """A browser's tab that shows a window, as NiceGUI's client."""

    @property
    def has_socket_connection(self) -> bool:
        """Whether it is open."""


class Windows:
    """The sessions of all windows, by the names that stand in their addresses.

    Parameters
    ----------
    make : callable
        Returns the session of a new window.
    """

    def __init__(self, make: Callable[[], Session]) -> None:
        self._make = make
        self._sessions: dict[str, Session] = {}
        self._connections: defaultdict[str, list[Connection]] = defaultdict(list)

    @property
    def num_unsaved(self) -> int:
        """How many windows, open or closed, hold changes that nobody saved."""
        return sum(session.is_unsaved for session in self._sessions.values())

    def open_page(self) -> Session:
        """Return the session of the page that is being built; offer there what a closed window holds."""
        client = ui.context.client
        request = client.request
        window_name = request.query_params.get(KEY, "") if request is not None else ""
        abandoned = "" if window_name in self._sessions else self.abandoned()
        name = self.connect(window_name, client)
        ui.add_body_html(f'<script>history.replaceState(null, "", "?{KEY}={name}")</script>')
        if abandoned:
            with ui.element("p").classes("notice"):
                ui.label("A window that was closed holds changes that are not saved.")
                ui.link("Show them", f"?{KEY}={abandoned}")  # file: none, of the page
        return self._sessions[name]

    def connect(self, stated: str, connection: Connection) -> str:
        """Return the name of a page's window: that which its address states, or a new one."""
        name = stated
        if name not in self._sessions:
            name = secrets.token_urlsafe(9)
            self._sessions[name] = self._make()
        self._connections[name].append(connection)
        return name

    def abandoned(self) -> str:
        """Return the name of the newest window that is closed and holds unsaved changes; none: empty."""
        for name, session in reversed(self._sessions.items()):
            is_shown = any(connection.has_socket_connection for connection in self._connections[name])
            if session.is_unsaved and not is_shown:
                return name
        return ""

    def __getitem__(self, name: str) -> Session:
        """Return the session of a window."""
        return self._sessions[name]
