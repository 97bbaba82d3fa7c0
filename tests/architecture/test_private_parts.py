"""What is private to other packages is imported by one module each, and is where that module expects it."""

import ast
from collections.abc import Iterator
from importlib import import_module, metadata

import pytest

from tests.places import PACKAGES, PROJECT

#: the only modules that import a package's private parts
DOORS = {"hydra": "pipeline/command_line/hydra_parts.py"}


def private_imports() -> Iterator[tuple[str, str, str]]:
    """Files of the product, with the modules and the names that they import from ``_internal`` folders."""
    for package in PACKAGES:
        for path in sorted((PROJECT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(text)) if "_internal" in text else ():
                if isinstance(node, ast.ImportFrom) and "_internal" in (node.module or "").split("."):
                    for alias in node.names:
                        yield path.relative_to(PROJECT).as_posix(), str(node.module), alias.name
                elif isinstance(node, ast.Import):
                    for alias in node.names:
                        if "_internal" in alias.name.split("."):
                            yield path.relative_to(PROJECT).as_posix(), alias.name, ""


IMPORTS = list(private_imports())


def test_each_package_has_one_door():
    assert {(module.partition(".")[0], path) for path, module, _ in IMPORTS} == set(DOORS.items())


@pytest.mark.parametrize(("path", "module", "name"), IMPORTS)
def test_what_a_door_imports_is_there(path, module, name):
    package = module.partition(".")[0]
    release = metadata.version({"hydra": "hydra-core"}.get(package, package))
    said = f"{package} {release} has changed {module}.{name}, which {path} imports"
    try:
        there = import_module(module)
    except ImportError:
        pytest.fail(said)
    assert hasattr(there, name), said
