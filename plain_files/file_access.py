"""How every file is opened and written: regular files of a known size are read, whole files are written.

Readers are given files that other people made, so nothing but a regular file is opened: a pipe would hang a
reader, a device has no end, and a link leads to a file that nobody named. Writers may share a folder with
other people, so a file gets a random name that did not exist before, and takes its own name once it is
complete and on disk. The operating system's errors are raised, so that callers handle one kind.
"""

import errno
import io
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, TextIO

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

#: the end of a hidden name, which a file has until it is complete
UNFINISHED: Final = ".unfinished"
#: of a file that is read at once, unless its format needs more: plain data takes 20 times this in memory
MAX_BYTES: Final = 32 * 1024**2
#: by which a file may grow while it is read
_GROWTH_BYTES: Final = 1024**2
#: what paths lead to besides regular files
KINDS: Final = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


class RefusedFileError(OSError):
    """A path that leads to something that is not read or replaced; its text says what, and what to do."""

    def __str__(self) -> str:
        """Return the reason alone."""
        return str(self.strerror)


def open_regular(path: Path | str, most_bytes: int | None = None) -> BufferedReader:
    """Open a regular file for reading.

    Parameters
    ----------
    path : Path or str
        Of the file itself; a link is refused, though not one among its folders.
    most_bytes : int, optional
        The greatest size that is accepted; any by default.

    Raises
    ------
    OSError
        If it is missing, no regular file, or too large; ``strerror`` says what was expected.
    """
    _require_regular(os.lstat(path), path, most_bytes)
    # between the two calls another file may have taken the name
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    descriptor = os.open(path, flags)
    try:
        _require_regular(os.fstat(descriptor), path, most_bytes)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_bytes(path: Path | str, most_bytes: int = MAX_BYTES) -> bytes:
    """Return the content of a regular file.

    Raises
    ------
    OSError
        As `open_regular`, and if it grows beyond `most_bytes` meanwhile.
    """
    with open_regular(path, most_bytes) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = stream.read(min(most_bytes, size + _GROWTH_BYTES) + 1)
    if len(content) > most_bytes:
        raise _too_large(path, most_bytes)
    return content


def open_text(path: Path | str, most_bytes: int = MAX_BYTES, encoding: str = "utf-8") -> TextIO:
    """Open a regular file as text, its line ends unchanged, as `csv` needs it; see `open_regular`."""
    return io.TextIOWrapper(open_regular(path, most_bytes), encoding=encoding, newline="")


def read_text(path: Path | str, most_bytes: int = MAX_BYTES, encoding: str = "utf-8") -> str:
    """Return the content of a regular file as text.

    Raises
    ------
    OSError
        As `read_bytes`.
    UnicodeDecodeError
        If it is no text of that encoding.
    """
    return read_bytes(path, most_bytes).decode(encoding)


def read_shipped(path: "Path | Traversable") -> str:
    """Return the text of a file that is part of the program; an installer may have made it a link."""
    return path.read_text(encoding="utf-8")


def _require_regular(status: os.stat_result, path: Path | str, most_bytes: int | None) -> None:
    """Raise RefusedFileError for what is no regular file, or a file that is too large."""
    kind = stat.S_IFMT(status.st_mode)
    if kind == stat.S_IFLNK:
        raise _link(path)
    if kind != stat.S_IFREG:
        number = errno.EISDIR if kind == stat.S_IFDIR else errno.EINVAL
        text = f"{KINDS.get(kind, 'something')}, where a file is expected"
        raise RefusedFileError(number, text, str(path))
    if most_bytes is not None and status.st_size > most_bytes:
        raise _too_large(path, most_bytes)


def _link(path: Path | str) -> RefusedFileError:
    text = f"a link to {os.readlink(path)}; give the path of the file itself"
    return RefusedFileError(errno.ELOOP, text, str(path))


def _too_large(path: Path | str, most_bytes: int) -> RefusedFileError:
    return RefusedFileError(errno.EFBIG, f"larger than {most_bytes} bytes", str(path))


@contextmanager
def replacing(path: Path, mode: int | None = None) -> Iterator[BinaryIO]:
    """Yield a new file that takes a path once the block is over and its content is safely on disk.

    At every moment the path holds the old content or the new, never a part. It keeps the permissions of what
    it replaces, unless a mode is given.

    Raises
    ------
    OSError
        If the disk is full, the folder may not be written to, or the path is a link or no file.
    """
    kept = _mode_to_keep(path)
    mode = kept if mode is None else mode
    unfinished = path.with_name(f".{path.name[:100]}.{secrets.token_hex(4)}{UNFINISHED}")
    try:
        with create(unfinished) as stream:
            if mode is not None:
                os.fchmod(stream.fileno(), mode)
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """Yield a folder whose content moves into another, new or empty one, once the block is over.

    If the block fails, nothing is left of what it wrote, nor of folders that were made for it. What a killed
    program left there is removed.

    Raises
    ------
    OSError
        If the folder holds something, or cannot be made or filled.
    """
    for leftover in folder.glob(f".????????{UNFINISHED}/") if folder.is_dir() else ():
        shutil.rmtree(leftover)
    if folder.exists() and any(folder.iterdir()):
        raise RefusedFileError(errno.ENOTEMPTY, "it is not empty", str(folder))
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    unfinished = folder / f".{secrets.token_hex(4)}{UNFINISHED}"
    try:
        unfinished.mkdir(parents=True)
        yield unfinished
        for path in sorted(unfinished.iterdir()):
            path.replace(folder / path.name)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
        with suppress(OSError):  # it is filled
            for each in made:
                each.rmdir()


def _mode_to_keep(path: Path) -> int | None:
    """Return the permissions of a file that is to be replaced; refuse what is no file."""
    try:
        status = os.lstat(path)
    except FileNotFoundError:
        return None
    _require_regular(status, path, None)
    return stat.S_IMODE(status.st_mode)


def create(path: Path) -> BinaryIO:
    """Return a new file for writing under its own name, which others may read while it grows.

    An earlier file or link of that name is removed, not followed.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    path.unlink(missing_ok=True)
    return path.open("xb")


def rename(path: Path, name: Path) -> None:
    """Give a complete file another name in its folder, replacing what has it; a power cut keeps the name."""
    path.replace(name)
    sync_folder(name.parent)


def sync_folder(path: Path) -> None:
    """Have the names in a folder survive a power cut."""
    if os.name != "nt":  # where folders cannot be opened
        descriptor = open_folder(path)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def open_folder(path: Path) -> int:
    """Return a descriptor of a folder."""
    return os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)


def open_lock(path: Path) -> TextIO:
    """Open a file that is locked, and says by whom, for reading and appending; it is made if missing."""
    flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
    return os.fdopen(os.open(path, flags, 0o666), "a+", encoding="utf-8")


def write_bytes(path: Path, content: bytes, mode: int | None = None) -> None:
    """Write a file as `replacing` does."""
    with replacing(path, mode) as stream:
        stream.write(content)


def write_text(path: Path, content: str) -> None:
    """Write text as UTF-8, its line ends unchanged, as `replacing` does."""
    write_bytes(path, content.encode("utf-8"))
