"""Controllers from wherever a person has them: a file of any kind, the folder of a run, a logged flight."""

from pathlib import Path

from fis_tools.analysis import flights
from fis_tools.formats import serialize
from fis_tools.formats.error import ControllerFileError
from fis_tools.model import FuzzyController

CHAMPION = "champion.json"


def read_controller(path: Path | str) -> FuzzyController:
    """Read a controller from a controller file, a file of another program, a run's folder or a logged flight.

    Raises
    ------
    ControllerFileError
        If there is none that can be read.
    """
    path = Path(path)
    if not path.suffix and not path.exists():
        raise ControllerFileError(
            f"{path}: cannot be read (no such file or directory), and a bare name is not looked up; give the "
            f"path of a controller file, such as FOLDER/{path.name}.yaml, of a run's folder or of a logged "
            "flight (.mcap)"
        )
    if path.is_dir():
        if not (path / CHAMPION).is_file():
            raise ControllerFileError(
                f"{path} is a folder without {CHAMPION}; give the folder of a run that has trained, or a file"
            )
        return serialize.load(path / CHAMPION)
    if flights.is_flight(path):
        return flights.read_controller(path)
    return serialize.load(path)
