"""Locations of the program's own files."""

from pathlib import Path


def conf_folder() -> Path:
    """Return the folder of configurations: inside the package if installed, else beside it."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def requirements_path(name: str) -> Path:
    """Return the file of requirements: one that ships, by its name, or a path.

    Raises
    ------
    FileNotFoundError
        If there is none.
    """
    folder = conf_folder() / "requirements"
    shipped = folder / f"{name}.yaml"
    if shipped.is_file() and Path(name).name == name:
        return shipped
    path = Path(name).expanduser()
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in folder.glob("*.yaml")))
        raise FileNotFoundError(
            f"there are no requirements {name}; name those that ship ({known}) or give the path of a file"
        )
    return path
