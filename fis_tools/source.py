"""Controllers from any source: a file of any kind, a run's folder, a flight, a program.

Objects of Python programs are written ``module.py:object``; reading one runs the program.
"""

import os
import re
import runpy
import sys
import tomllib
from collections.abc import Iterable
from contextlib import redirect_stdout, suppress
from importlib.metadata import entry_points
from pathlib import Path

from fis_tools.analysis import flights
from fis_tools.errors import ControllerFileError, raised_as, suggestion
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem
from plain_files.file_access import read_text
from plain_files.plain_text import parse_json

MANIFEST = "manifest.json"
#: where a folder whose manifest names no champion has it
CHAMPION = "champion.json"
#: the group of entry points by which installed packages name folders of controllers
CONTROLLERS = "fis_tools.controllers"
#: of a project's file, and the folders of controllers that it may name
MOST_BYTES, MOST_FOLDERS = 1024**2, 100


def read_controller(path: Path | str, trust: bool = False) -> FuzzyController:
    """Read a controller from a controller file, a file of another program, a run's folder or a logged flight.

    Parameters
    ----------
    path : path
        Also the name of a controller of this project, see `named`, or ``module.py:object``: a system, a
        controller or a scikit-fuzzy control system of a Python program, or a function that returns one.
    trust : bool
        Whether Python programs may be run.

    Raises
    ------
    ControllerFileError
        If there is none that can be read, or a program is not to be run.
    """
    if is_program(path):
        return _of_program(path, trust)
    path = Path(path)
    if not path.suffix and not os.path.exists(path):  # true, too, of names that no file can have
        path = named(str(path))
    if os.path.isdir(path):
        champion = path / _champion_of(path)
        if not champion.resolve().is_relative_to(path.resolve()):
            raise ControllerFileError(
                f"{path / MANIFEST} names a champion outside the folder, {champion}; give that file itself"
            )
        if not os.path.isfile(champion):
            raise ControllerFileError(
                f"{path} is a folder without {CHAMPION}; give the folder of a run that has trained, or a file"
            )
        return serialize.load(champion)
    if flights.is_flight(path):
        return flights.read_controller(path)
    return serialize.load(path)


def named(name: str) -> Path:
    """Return the file of a controller that the current folder's project knows by this name, or a package.

    A project tells where its controllers are in its ``pyproject.toml``: ``[tool.fis_tools] controllers =
    ["FOLDER"]``. An installed package does so by an entry point of the group ``fis_tools.controllers``, as
    ``mine = "mypackage.controllers"`` for the folder ``mypackage/controllers``; the project's come first.

    Raises
    ------
    ControllerFileError
        If there is none of this name, or several.
    """
    files = _controllers_in(_folders())
    if name not in {path.stem for path in files}:
        files += _controllers_in(_installed_folders())
    matches = [path for path in files if path.stem == name]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise ControllerFileError(f"{name} may be {' or '.join(map(str, matches))}; give one of these paths")
    known = sorted({path.stem for path in files})
    cure = f"; {suggestion(name, known)}" if known else ""
    raise ControllerFileError(
        f"{name}: no such file or folder, and no controller of that name; give the path of a controller "
        f"file, of a run's folder or of a logged flight (.mcap){cure}"
    )


def _controllers_in(folders: Iterable[Path]) -> list[Path]:
    """Return the files of controllers in some folders."""
    paths = [path for folder in folders for path in _content(folder)]
    return [path for path in paths if path.suffix in serialize.ENDINGS and path.is_file()]


def _installed_folders() -> list[Path]:
    """Return the folders of controllers of installed packages, without importing these."""
    folders = {
        Path(str(point.dist.locate_file(point.value.replace(".", "/"))))
        for point in entry_points(group=CONTROLLERS)
        if point.dist is not None
    }
    return sorted(folders)


def _folders() -> list[Path]:
    """Return the folders of controllers of the project that contains the current folder."""
    here = Path.cwd()
    for project in (here, *here.parents):
        with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
            settings = tomllib.loads(read_text(project / "pyproject.toml", MOST_BYTES))
            folders = settings["tool"]["fis_tools"]["controllers"][:MOST_FOLDERS]
            return [project / str(folder) for folder in folders]
    return []


def _content(folder: Path) -> list[Path]:
    """Return the paths in a folder, sorted; none if it cannot be read."""
    with suppress(OSError, ValueError):
        return sorted(folder.iterdir())
    return []


def _of_program(path: Path | str, trust: bool) -> FuzzyController:
    """Return the controller that a Python program defines; it is run only if it is trusted."""
    if not trust:
        raise ControllerFileError(
            f"{path} is a Python program, and reading it runs its code with all your rights; add --trust if "
            "you trust whoever wrote it, or export the system to a file"
        )
    program_object = read_object(path)
    if isinstance(program_object, str | Path):  # a path is read when it is given, not when a program names it
        raise ControllerFileError(
            f"{path} is the text {str(program_object)!r}; name a system or a controller"
        )
    with raised_as(ControllerFileError, ValueError, TypeError, where=f"{path}: "):
        return as_controller(program_object, str(path).rpartition(":")[2])


def _champion_of(folder: Path) -> str:
    """Return the name of the champion of a folder, as its manifest says."""
    try:
        return str(parse_json(read_text(folder / MANIFEST))["files"]["champion"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return CHAMPION


def as_controller(thing: object, name: str = "control system") -> FuzzyController:
    """Return a controller from a controller, a system, a path, or a control system of scikit-fuzzy.

    Parameters
    ----------
    thing : object
    name : str
        What a control system is called, which has no name of its own.

    Raises
    ------
    ControllerFileError
        If a path leads to none that can be read.
    fis_tools.scikit_fuzzy.read.UnreadableControlSystem
        If it is nothing of these; the text says what is taken.
    """
    if isinstance(thing, FuzzyController):
        return thing
    if isinstance(thing, str | Path):
        return read_controller(thing)
    if not isinstance(thing, FuzzySystem):
        from fis_tools.scikit_fuzzy.read import read_control_system  # noqa: PLC0415 - imports scikit-fuzzy

        thing = read_control_system(thing, name)
    return FuzzyController(thing.name, (thing,))


#: the file, and what it calls the object
_WRITTEN = re.compile(r"(.+\.py)(?::(.*))?", re.DOTALL)


def is_program(path: Path | str) -> bool:
    """Return whether a path is that of a Python program, or of an object in one."""
    return _WRITTEN.fullmatch(str(path)) is not None


def read_object(path: Path | str) -> object:
    """Run a Python program and return an object of it; a function is called, its result returned.

    The program runs as if it were imported, with its folder on the path. What it prints goes to standard
    error.

    Parameters
    ----------
    path : path
        The file, a colon, and the name at the top of the program.

    Raises
    ------
    ControllerFileError
        If there is no such file or name, or the program fails.
    """
    written = _WRITTEN.fullmatch(str(path))
    if written is None or not Path(written[1]).is_file():
        raise ControllerFileError(f"{path}: there is no such file; write FILE.py:NAME")
    file, name = Path(written[1]), written[2]
    before = list(sys.path)
    sys.path.insert(0, str(file.resolve().parent))
    try:
        with redirect_stdout(sys.stderr):  # standard output is the command's own
            held = runpy.run_path(str(file), run_name=file.stem)
        if not name or name not in held:
            names = [each for each in held if not each.startswith("_")]
            raise ControllerFileError(f"{file} has no object {name or ''!r}; {suggestion(name or '', names)}")
        with redirect_stdout(sys.stderr):
            return held[name]() if callable(held[name]) else held[name]
    except ControllerFileError:
        raise
    except (Exception, SystemExit) as error:
        raise ControllerFileError(
            f"{path} cannot be run ({type(error).__name__}: {error}); correct the program"
        ) from error
    finally:
        sys.path[:] = before
