"""The cache of compiled code: a file for each function and types of arguments, named by its fingerprint.

A cache is unpickled, so whoever can write to it can run code as its user. It is used only in a folder that
belongs to the user or to root, and that nobody else can write to or replace. Nothing that fails here ends
what compiles: code is then compiled anew, and a line on standard error says why.
"""

import hashlib
import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from fis_tools.compiled.fingerprint import UnknownPartError, fingerprint
from plain_files.file_access import read_bytes, write_bytes

CACHE_NAME = "fis-tools"
#: What is kept at most; what has not been used for the longest time is removed first.
LIMIT_BYTES = 1 << 30
#: The number of the user who may change everything anyway.
ROOT_USER = 0
#: Bytes of the hash at the head of each file.
HEAD = 32
#: Of a number of seconds.
MOST_DIGITS = 64


class NotKeptError(Exception):
    """Why code is not kept: the fact and its remedy, in a sentence without its full stop.

    Those of one `reason` are reported once.
    """

    def __init__(self, sentence: str, reason: object = None) -> None:
        super().__init__(sentence)
        self.reason = reason or sentence


def path_for(compiled: Any, kinds: Iterable[Any]) -> Path:
    """Return the file for the code of a compiled function with arguments of some numba types.

    Raises
    ------
    NotKeptError
        If the code may depend on something unknown, or if the folder cannot be trusted.
    """
    function = compiled.py_func
    try:
        name = fingerprint(compiled, tuple(kinds))
    except UnknownPartError as error:
        raise NotKeptError(f"{function.__module__}.{function.__qualname__}: {error}") from error
    words = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
    return trusted_root() / f"{words[-100:]}-{name}.code"


def read(path: Path) -> bytes | None:
    """Return the content of a cache file; None if it is missing, unreadable or damaged."""
    with suppress(OSError):
        content = read_bytes(path, LIMIT_BYTES)  # file: compiled by us
        if content[:HEAD] == hashlib.sha256(content[HEAD:]).digest():
            with suppress(OSError):  # a cache may be read-only
                os.utime(path)
            return content[HEAD:]
    return None


def write(path: Path, data: bytes) -> None:
    """Write a file of the cache, as a whole or not at all.

    Raises
    ------
    NotKeptError
        If it cannot be written.
    """
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        trusted_root()
        write_bytes(path, hashlib.sha256(data).digest() + data, mode=0o600)
        _remove_oldest(path.parent, path)
    except OSError as error:
        sentence = f"{path} cannot be written ({error.strerror}); {_remedy()}"
        raise NotKeptError(sentence, error.errno) from error


def _remove_oldest(root: Path, latest: Path) -> None:
    """Remove what was not used for the longest time, while the folder holds more than the limit.

    The latest stays, whatever the clock says: it may have jumped.
    """
    sizes: list[tuple[int, int, Path]] = []
    for path in root.iterdir():
        with suppress(OSError):  # another process may be doing the same
            status = path.lstat()
            if stat.S_ISREG(status.st_mode) and path != latest:
                sizes.append((status.st_mtime_ns, status.st_size, path))
    total = latest.stat().st_size + sum(size for _, size, _ in sizes)
    for _, size, path in sorted(sizes):
        if total <= LIMIT_BYTES:
            return
        total -= size
        with suppress(OSError):
            path.unlink()


def cache_root() -> Path:
    """Return the folder that holds the cache, by the environment.

    Raises
    ------
    NotKeptError
        If no environment variable names one and the user has no home.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(chosen).absolute() if chosen else Path.home() / ".cache") / CACHE_NAME
    except RuntimeError as error:
        raise NotKeptError(f"there is no home folder; {_remedy()}") from error


def trusted_root() -> Path:
    """Return the folder that holds the cache, which may not exist yet.

    Raises
    ------
    NotKeptError
        If its content may come from somebody else: it must belong to the user or to root, and nobody else may
        be able to replace anything in it or above it.
    """
    root = cache_root()
    if not hasattr(os, "getuid"):  # Windows: everything below a user's profile is the user's
        return root
    try:
        fact = _danger(root)
    except FileNotFoundError:
        return root
    except OSError as error:
        fact = f"{error.filename} cannot be looked at ({error.strerror})"
    if fact is None:
        return root
    raise NotKeptError(f"{fact}; {_remedy()}, in folders that only you can write to")


def _remedy() -> str:
    return "set NUMBA_CACHE_DIR to a folder of your own"


def _danger(root: Path) -> str | None:
    """Return why others could replace the content of an existing folder; None if they cannot."""
    if root.is_symlink():
        return f"{root} is a link"
    resolved = root.resolve(strict=True)
    for folder in (resolved, *resolved.parents):
        status = folder.stat()
        # in a sticky folder like /tmp nobody can replace another's files
        is_safe_above = folder != resolved and status.st_mode & stat.S_ISVTX
        if status.st_uid not in (ROOT_USER, os.getuid()):
            return f"{folder} belongs to somebody else"
        if _others_may_write(status) and not is_safe_above:
            return f"others may write to {folder}"
    return None


def _others_may_write(status: os.stat_result) -> bool:
    """Return whether the mode lets others write; a user's private group has no other members."""
    import grp  # noqa: PLC0415 - not on every system
    import pwd  # noqa: PLC0415

    if status.st_mode & stat.S_IWOTH or not status.st_mode & stat.S_IWGRP:
        return bool(status.st_mode & stat.S_IWOTH)
    try:
        group = grp.getgrgid(status.st_gid)
        user = pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return True
    return group.gr_name != user or any(member != user for member in group.gr_mem)
