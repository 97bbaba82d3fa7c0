"""Where compiled kernels are cached, and why a stale one cannot be loaded.

numba's own cache looks at the file that holds a compiled function, not at the files of the functions it
calls, so a change in a callee would be missed. The cache folder is therefore named after a hash of every
source file that compiled code can depend on: the files that compile, and whatever they import from the same
packages, at any remove. Any change of any of them starts an empty folder.
"""

import hashlib
import os
import re
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba

CACHE_NAME = "fuzzy-spacecraft-inspection"
KEPT_DAYS = 30

#: What marks a file that compiles, and the imports of a file: `from X import Y, …` and `import X`.
COMPILES = re.compile(rb"^@(numba\.)?n?jit\b", re.MULTILINE)
IMPORTS = re.compile(
    rb"^\s*(?:from\s+([\w.]+)\s+import\s+(\([^)]*\)|[^\n]*)|import\s+([^\n]*))", re.MULTILINE
)

#: numba makes its attributes at run time, out of a type checker's sight
_numba_config: Any = numba.config


def source_hash(packages: tuple[Path, ...]) -> str:
    """Hash the sources that compiled code depends on, together with the versions that shape it.

    Parameters
    ----------
    packages : tuple of Path
        Package folders. Of the ``*.py`` below them those count that hold a compiled function, and those that
        they import.

    Returns
    -------
    str
        Sixteen hexadecimal digits.
    """
    digest = hashlib.sha256(f"{sys.version_info[:3]} {numba.__version__}".encode())
    contents = {
        path.relative_to(package.parent).as_posix(): path.read_bytes()
        for package in packages
        for path in package.rglob("*.py")
    }
    for name in sorted(_taking_part(contents)):
        digest.update(name.encode())
        digest.update(contents[name])
    return digest.hexdigest()[:16]


def _taking_part(contents: dict[str, bytes]) -> set[str]:
    """Return the files that compile and all that these import from among the same files."""
    modules = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): name for name in contents
    }
    found: set[str] = set()
    waiting = [name for name, content in contents.items() if COMPILES.search(content)]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += [modules[word] for word in _imported(contents[name]) if word in modules]
    return found


def _imported(content: bytes) -> list[str]:
    """Return every dotted name that may be a module among the imports of a file."""
    words = []
    for parent, children, whole in IMPORTS.findall(content):
        names = [word.split()[0] for word in re.split(rb"[,()\n]", children or whole) if word.strip()]
        words += [parent, *(parent + b"." + name for name in names)] if parent else names
    return [word.decode() for word in words]


def cache_root() -> Path:
    """Return the folder that holds one cache folder for each state of the sources."""
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    return (Path(chosen) if chosen else Path.home() / ".cache") / CACHE_NAME


def use_cache_keyed_by(*packages: Path) -> Path:
    """Point numba's on-disk cache at a folder of its own for this exact state of the sources.

    Call it in a package's ``__init__``, before any module with a compiled function is imported.

    Parameters
    ----------
    *packages : Path
        The package folders that compiled functions come from.

    Returns
    -------
    Path
        The cache folder, which need not exist yet.
    """
    folder = cache_root() / source_hash(packages)
    _numba_config.CACHE_DIR = str(folder)
    return folder


def is_cold() -> bool:
    """Tell whether nothing has been compiled yet for the present state of the sources."""
    folder = Path(_numba_config.CACHE_DIR)
    return not (folder.is_dir() and any(folder.rglob("*.nbi")))


def drop_old_caches() -> None:
    """Remove caches that nothing was added to for a month, so that edits do not fill the disk."""
    root = cache_root()
    if not root.is_dir():
        return
    oldest = time.time() - KEPT_DAYS * 86400.0
    for folder in (path for path in root.iterdir() if path.is_dir()):
        if _last_change(folder) < oldest:
            shutil.rmtree(folder, ignore_errors=True)


def _last_change(folder: Path) -> float:
    """Return when a folder or anything in it was last written; files may vanish under our eyes."""
    newest = 0.0
    for parent, _, names in os.walk(folder):
        for name in ("", *names):
            with suppress(FileNotFoundError):
                newest = max(newest, Path(parent, name).stat().st_mtime)
    return newest
