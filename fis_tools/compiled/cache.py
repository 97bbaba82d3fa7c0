"""The cache of compiled code: its location, why stale code cannot be loaded, and whose code is never loaded.

numba's own cache would miss a change in a callee. Here every module with compiled functions has a folder
named after a hash of its own source and of all that it imports at its top level, directly or not, from
packages with compiled functions.

A cache is unpickled, so whoever can write to it can run code as its user. It is used only in a folder that
belongs to the user and that nobody else can write to or replace.
"""

import hashlib
import os
import platform
import re
import shutil
import stat
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

CACHE_NAME = "fis-tools"
KEPT_DAYS = 30
DAY_S = 86400.0

#: What the decorator loads when it first compiles: how vectors are compiled.
SHAPING_ALL = ("fis_tools.compiled.borrowed_code",)

#: The imports at the top level of a file: `from X import Y, …` and `import X`.
IMPORTS = re.compile(r"^(?:from\s+([\w.]+)\s+import\s+(\([^)]*\)|[^\n]*)|import\s+([^\n]*))", re.MULTILINE)

#: When this module was loaded. A source that has changed since may differ from the code that runs.
_loaded_ns = time.time_ns()

#: Packages with compiled functions, whose imports are followed.
packages = {"fis_tools"}


@dataclass(frozen=True)
class Sources:
    """The sources that a module's compiled functions depend on."""

    # its own and all that it imports from packages with compiled functions, directly or not
    files: tuple[str, ...]
    digest: str  # sixteen hexadecimal digits of a hash over the files and the versions of the compilers


def place_for(function: Callable[..., Any]) -> Path | str:
    """Return the folder for the compiled code of a function's module; it is made if missing.

    If there can be none, it returns why: the fact and its remedy, in a sentence without its full stop.
    """
    try:
        sources = sources_of(function.__module__, function.__code__.co_filename)
        changed = changed_since_loaded(sources.files)
        if changed is not None:
            return f"{changed} has changed since it was loaded; start Python anew"
    except OSError as error:
        return f"{error.filename} cannot be read; put the function into a file"
    try:
        root = cache_root()
    except RuntimeError:
        return "there is no home folder; set NUMBA_CACHE_DIR to a folder of your own"
    name = f"{function.__module__}-{sources.digest}"
    try:
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        refused = refusal(root)
        if refused is None:
            _make(root / name)
    except OSError as error:
        return f"{root} cannot be written ({error.strerror}); set NUMBA_CACHE_DIR to a folder of your own"
    return refused or root / name


def name_of(types: str) -> str:
    """Return the name of the folder of code that was compiled for arguments of these types."""
    return hashlib.sha256(types.encode()).hexdigest()[:16]


def is_kept(function: Callable[..., Any], types: str) -> bool:
    """Return whether code of a function for arguments of these types is in the cache.

    It may be of another kind of processor, for which it is compiled again.
    """
    place, name = place_for(function), f"*.{function.__qualname__}-*.nbc"
    return isinstance(place, Path) and any((place / name_of(types)).rglob(name))


#: For how long functions have run as plain Python in this process, with arguments of which types.
_plain_s: defaultdict[tuple[Callable[..., Any], str], float] = defaultdict(float)


def plain_s(function: Callable[..., Any], types: str) -> float:
    """Return the seconds for which a function has run as plain Python, in any process."""
    with suppress(OSError, ValueError):  # it was never written, or never whole
        return sum(map(float, _plain_file(function, types).read_text(encoding="ascii").split()))
    return _plain_s[function, types]


def add_plain_s(function: Callable[..., Any], types: str, seconds: float) -> None:
    """Add to the seconds for which a function has run as plain Python."""
    _plain_s[function, types] += seconds
    with suppress(OSError), _plain_file(function, types).open("a", encoding="ascii") as kept:
        kept.write(f"{seconds}\n")


def _plain_file(function: Callable[..., Any], types: str) -> Path:
    """Return the file with the seconds of plain Python; raise OSError if nothing can be kept."""
    place = place_for(function)
    if isinstance(place, str):
        raise FileNotFoundError(place)
    return place / f"{function.__qualname__}-{name_of(types)}.plain_s"


def cache_root() -> Path:
    """Return the folder that holds the cache folders of all modules.

    Raises
    ------
    RuntimeError
        If no environment variable names one and the user has no home.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    return (Path(chosen).absolute() if chosen else Path.home() / ".cache") / CACHE_NAME


def _make(folder: Path) -> None:
    """Make a folder, and remove old ones; mark an existing one as still in use."""
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        os.utime(folder)
    else:
        drop_old_caches(folder.parent)


def drop_old_caches(root: Path) -> None:
    """Remove the folders that have not been used for a month, so that edits do not fill the disk."""
    oldest = time.time() - KEPT_DAYS * DAY_S
    with suppress(OSError):
        for folder in root.iterdir():
            with suppress(OSError):  # another process may be doing the same
                if folder.is_dir() and folder.stat().st_mtime < oldest:
                    shutil.rmtree(folder, ignore_errors=True)


def refusal(folder: Path) -> str | None:
    """Return why a folder's content may come from somebody else, see `place_for`; None if it cannot.

    The folder must be the user's own, and nobody else may be able to replace anything in it or above it.
    """
    if not hasattr(os, "getuid"):  # Windows: everything below a user's profile is the user's
        return None
    resolved = folder.resolve()
    fact = f"{folder} is a link" if folder.is_symlink() else None
    for place in (resolved, *resolved.parents):
        status = place.stat()
        owners = {os.getuid()} if place == resolved else {0, os.getuid()}
        # in a sticky folder like /tmp nobody can replace another's files
        is_safe_above = place != resolved and status.st_mode & stat.S_ISVTX
        if status.st_uid not in owners:
            fact = fact or f"{place} belongs to somebody else"
        elif _others_may_write(status) and not is_safe_above:
            fact = fact or f"others may write to {place}"
    if fact is None:
        return None
    return f"{fact}; set NUMBA_CACHE_DIR to a folder of your own, in folders that only you can write to"


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


def changed_since_loaded(files: Iterable[str]) -> str | None:
    """Return the first of the files that is newer than this process's code; None if none is."""
    for file in files:
        status = os.stat(file)
        # the change time cannot be set back when a file is copied with its time
        if max(status.st_mtime_ns, status.st_ctime_ns) > _loaded_ns:
            return file
    return None


@cache
def sources_of(module: str, file: str) -> Sources:
    """Return the sources that a loaded module's compiled functions depend on, by its name and its path.

    Raises
    ------
    OSError
        If a source cannot be read.
    """
    digest = hashlib.sha256(_versions().encode())
    found: dict[str, str] = {}
    waiting = [(name, place) for name in SHAPING_ALL if (place := _file_of(name))]
    waiting.append((module, file))
    while waiting:
        name, path = waiting.pop()
        if name not in found:
            found[name] = path
            package = name if path.endswith("__init__.py") else name.rpartition(".")[0]
            words = (resolve_name(word, package) for word in _read(path)[1])
            waiting += [(word, place) for word in words if (place := _file_of(word))]
    for name in sorted(found):
        digest.update(f"{name} {_read(found[name])[0]}\n".encode())
    return Sources(tuple(found.values()), digest.hexdigest()[:16])


@cache
def _versions() -> str:
    """Return the versions that affect compiled code."""
    import numpy as np  # noqa: PLC0415 - as below

    from fis_tools.compiled.numba_parts import VERSIONS  # noqa: PLC0415 - numba, which is loaded by then

    return " ".join((platform.python_version(), *VERSIONS, np.__version__))


@cache
def _read(file: str) -> tuple[str, tuple[str, ...]]:
    """Return a hash of a source, and every name in its imports that may be a module, relative or not."""
    source = Path(file).read_bytes()
    text = source.decode("utf-8", "replace").replace("\r\n", "\n")
    words = []
    for parent, children, whole in IMPORTS.findall(text):
        names = [word.split()[0] for word in re.split(r"[,()\n]", children or whole) if word.strip()]
        joint = "" if parent.endswith(".") else "."
        words += [parent, *(f"{parent}{joint}{name}" for name in names)] if parent else names
    return hashlib.sha256(source).hexdigest(), tuple(words)


def _file_of(module: str) -> str | None:
    """Return the source of a loaded module of the packages with compiled functions; None for other names."""
    is_ours = module.partition(".")[0] in packages
    return getattr(sys.modules.get(module), "__file__", None) if is_ours else None
