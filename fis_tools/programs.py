"""Objects of Python programs, written ``module.py:object``: reading one runs the program."""

import re
import runpy
import sys
from pathlib import Path

from fis_tools.formats.error import ControllerFileError
from fis_tools.model.validate import nearest

#: the file, and what it calls the object
_WRITTEN = re.compile(r"(.+\.py)(?::(.*))?", re.DOTALL)


def is_program(path: Path | str) -> bool:
    """Return whether a path is that of a Python program, or of an object in one."""
    return _WRITTEN.fullmatch(str(path)) is not None


def read_object(path: Path | str) -> object:
    """Run a Python program and return an object of it; a function is called for what it returns.

    The program runs as if it were imported, with its folder on the path.

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
    sys.path.insert(0, str(file.resolve().parent))
    try:
        held = runpy.run_path(str(file), run_name=file.stem)
        if not name or name not in held:
            names = [each for each in held if not each.startswith("_")]
            raise ControllerFileError(f"{file} has no object {name or ''!r}; {nearest(name or '', names)}")
        return held[name]() if callable(held[name]) else held[name]
    except ControllerFileError:
        raise
    except (Exception, SystemExit) as error:
        raise ControllerFileError(
            f"{path} cannot be run ({type(error).__name__}: {error}); correct the program"
        ) from error
    finally:
        sys.path.pop(0)
