"""Hatchling's backend, but that ``pip install .`` finds the toolkit in its folder beside and needs no index.

What a front end resolves names that folder; what is built and installed names a version, as everywhere.
"""

import os

os.environ.pop("PIP_BUILD_TRACKER", None)  # without it hatchling prepares metadata for pip, too

from pathlib import Path
from typing import Any

from hatchling import build
from hatchling.build import *  # noqa: F403 - all other hooks are hatchling's

TOOLKIT = Path(__file__).resolve().parent / "fis_tools"


def _from_beside(metadata: Path) -> str:
    """Let metadata require the toolkit from its folder, where there is one: not in a source distribution."""
    if (TOOLKIT / "pyproject.toml").is_file():
        path, start = metadata / "METADATA", "Requires-Dist: fis-tools[all]"
        lines = path.read_text(encoding="utf-8").split("\n")
        lines = [f"{start} @ {TOOLKIT.as_uri()}" if line.startswith(f"{start}==") else line for line in lines]
        path.write_text("\n".join(lines), encoding="utf-8")
    return metadata.name


def prepare_metadata_for_build_wheel(folder: str, config_settings: dict[str, Any] | None = None) -> str:
    """Write the metadata of an installation below a folder, and return the name of its own."""
    return _from_beside(Path(folder, build.prepare_metadata_for_build_wheel(folder, config_settings)))


def prepare_metadata_for_build_editable(folder: str, config_settings: dict[str, Any] | None = None) -> str:
    """Do the same for an editable installation."""
    return _from_beside(Path(folder, build.prepare_metadata_for_build_editable(folder, config_settings)))
