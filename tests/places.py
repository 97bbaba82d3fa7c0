"""Where the project lies, and its packages."""

import tomllib
from pathlib import Path
from typing import Final

PROJECT = Path(__file__).resolve().parents[1]
_TOOLS = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
#: those that the product consists of, as the walls name them
PACKAGES: Final = tuple[str, ...](_TOOLS["importlinter"]["root_packages"])
