"""Figures as files that are the same each time: text stays text, no date and no maker is told."""

import io
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")

_OPTIONS: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "fis_tools", "pdf.fonttype": 42}
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def encode(figure: Figure, form: str, dots_per_inch: int = 150) -> bytes:
    """Return a figure as a file of one of `FORMATS`.

    Raises
    ------
    ValueError
        If the format is another.
    """
    if form not in FORMATS:
        raise ValueError(f"{form!r} is not a picture format; choose one of {', '.join(FORMATS)}")
    content = io.BytesIO()
    with mpl.rc_context(_OPTIONS):
        figure.savefig(content, format=form, dpi=dots_per_inch, metadata=_METADATA[form])
    return content.getvalue()


def save(figure: Figure, path: Path | str, dots_per_inch: int = 150) -> None:
    """Write a figure to a file, in the format that the name ends with.

    Raises
    ------
    ValueError
        If the name ends with no format that there is.
    """
    path = Path(path)
    path.write_bytes(encode(figure, path.suffix.removeprefix(".").lower(), dots_per_inch))
