"""A file that gets its final name only when it is complete and synced to disk."""

import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from plain_files import file_access

PARTIAL_SUFFIX: Final = ".partial"


class PartialFile:
    """A binary file called ``<path>.partial`` until it is committed; replaces an earlier partial file.

    Parameters
    ----------
    path : Path
        The final name.

    Raises
    ------
    OSError
        If the file cannot be opened.
    """

    def __init__(self, path: Path):
        self.path = path
        self.partial_path = path.with_name(path.name + PARTIAL_SUFFIX)
        self.stream = file_access.create(self.partial_path)

    def commit(self) -> None:
        """Flush the file to disk and give it its final name, replacing a file of that name.

        Raises
        ------
        OSError
            If writing fails; the partial file is then left as it is.
        """
        try:
            self.stream.flush()
            os.fsync(self.stream.fileno())
        except OSError:
            self.abandon()
            raise
        self.stream.close()
        file_access.rename(self.partial_path, self.path)

    def abandon(self) -> None:
        """Close the file and leave it under its provisional name."""
        # closing writes what is buffered; the first error is the one to report
        with suppress(OSError):
            self.stream.close()
