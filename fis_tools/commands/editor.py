"""`edit`: a page on which a touch of a term or a rule is answered at once."""

from pathlib import Path
from typing import Annotated

from fis_tools.commands.arguments import Asked, expected


def edit(
    asked: Asked,
    *,
    port: Annotated[int, expected("a port from 0 to 65535", lambda port: 0 <= port < 1 << 16)] = 0,
    no_browser: bool = False,
) -> None:
    """Edit a controller on a page that answers every touch; nothing is written but the copies you save.

    Drag the terms, or type their numbers; click through the terms of the rules. The page shows at once how
    the surface and the findings of `audit` change, and what differs from the file. It is served on this
    machine alone, at an address that is printed, until Ctrl-C.

    For example:

        python -m fis_tools edit controller.yaml
        python -m fis_tools edit tipper.fis --no-browser --port 8700

    Parameters
    ----------
    port
        of the page; 0 for any that is free
    no_browser
        print the address and open no browser
    """
    controller = asked.read()
    from fis_tools.edit.server import serve  # noqa: PLC0415, I001 - says first what is not installed
    from fis_tools.edit.page import Editor  # noqa: PLC0415 - the other commands do without a server

    serve(lambda: Editor(Path(asked.controller), controller), controller.name, port, not no_browser)
