"""What hatchling asks while it builds the distribution fis-tools: which files make up its two packages.

The folder of `plain_files` lies beside this one; in a source distribution it lies inside.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BELOW = "plain_files"
#: files of the package fis_tools that are no modules
BESIDE_MODULES = {"LICENSE", "py.typed"}


def get_build_hook() -> "type[BuildHookInterface[Any]]":
    """Return the hook; hatchling, which calls this, is nothing that an installed toolkit needs."""
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface  # noqa: PLC0415

    class PackagesHook(BuildHookInterface[Any]):
        """Names files to hatchling, with their paths in what is built."""

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            """Add both packages to a wheel, and to a source distribution the one that lies beside."""
            root = Path(self.root)
            inside, beside = root / BELOW, root.parent / BELOW
            paths = {inside if inside.is_dir() else beside: BELOW}
            if self.target_name == "wheel":
                paths |= {path: f"fis_tools/{path.name}" for path in root.iterdir() if _is_installed(path)}
            build_data["force_include"] |= {str(path): name for path, name in paths.items()}

    return PackagesHook


def _is_installed(path: Path) -> bool:
    """Return whether a file or folder beside this file is part of fis_tools."""
    is_package = (path / "__init__.py").is_file() and path.name != BELOW
    return is_package or path.suffix == ".py" or path.name in BESIDE_MODULES
