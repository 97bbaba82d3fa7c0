"""Where the program's own files lie."""

from pathlib import Path


def conf_folder() -> Path:
    """Return the folder of configurations: inside the package where it is installed, else beside it."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"
