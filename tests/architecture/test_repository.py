"""The project's files agree with one another and name no machine."""

import re
import tomllib
from importlib import import_module
from itertools import chain
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from tests.places import PACKAGES, PROJECT

TABLE = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TOOLKIT = tomllib.loads((PROJECT / "fis_tools" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: `all` is what the pipeline needs, without the editor
EXTRAS = [extra for name, extra in TOOLKIT["optional-dependencies"].items() if name != "edit"]
#: what the project asks for from an index: all but its own toolkit, and with what that asks for
DECLARED = chain(TABLE["dependencies"], TOOLKIT["dependencies"], *EXTRAS)
NEEDED = [text for text in DECLARED if Requirement(text).name != TOOLKIT["name"]]
SKIPPED_FOLDERS = {".git", ".venv", "outputs", "build", "dist", "__pycache__"}
#: written in halves, for this file is looked at too
HALVES = (
    (r"(?<![\w.:/])/", r"(?:work|root|home|Users|opt|srv|mnt|data)/"),
    *((r"[A-Z]:\\", "Users"), ("pypi", r"\.org"), ("pythonhosted", r"\.org")),
    *(("--(?:extra-)?index-", "url"), ("file:", "///")),
)
MACHINES = re.compile("|".join(map("".join, HALVES)))


def texts() -> list[Path]:
    """The text files of the project, without what runs and tools leave behind."""
    files = []
    for path in PROJECT.rglob("*"):
        parts = path.relative_to(PROJECT).parts
        is_left_behind = any(part in SKIPPED_FOLDERS or part.endswith("_cache") for part in parts)
        if path.is_file() and not is_left_behind and parts[0] != ".hypothesis":
            files.append(path)
    return [path for path in files if b"\0" not in path.read_bytes()[:4096]]


def test_no_file_names_a_machine_or_a_registry():
    for path in texts():
        assert MACHINES.findall(path.read_text(encoding="utf-8")) == [], path


def test_a_machine_would_be_found():
    for text in ("/ho" + "me/jo/x", " /op" + "t/wheels", "--index-" + "url=https", "https://py" + "pi.org/x"):
        assert MACHINES.search(text), text
    for text in ("docs/homework/b", "../root/x", "https://mcap.dev/data/x"):
        assert not MACHINES.search(text), text


def test_versions_agree():
    citation = yaml.safe_load((PROJECT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == TABLE["version"] == TOOLKIT["version"]
    assert f"{TOOLKIT['name']}[all]=={TOOLKIT['version']}" in TABLE["dependencies"]
    assert citation["title"] == TABLE["name"]
    assert citation["license"] == TABLE["license"]
    changes = (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## {re.escape(TABLE['version'])}\b", changes, re.MULTILINE)


def read_lock(name: str) -> dict[str, tuple[str, int]]:
    """Versions and numbers of hashes by package."""
    text = (PROJECT / name).read_text(encoding="utf-8").replace("\\\n", " ")
    locked = {}
    for line in filter(None, (line.partition("#")[0].strip() for line in text.splitlines())):
        match = re.fullmatch(r"([a-z0-9-]+)==(\S+)( ; [^-]+)?((?: +--hash=sha256:[0-9a-f]{64})+)", line)
        assert match, line
        assert match[1] not in locked, f"{match[1]} is locked twice"
        locked[match[1]] = (match[2], match[4].count("--hash"))
    return locked


@pytest.mark.parametrize(
    ("name", "requirements"),
    [("requirements.txt", NEEDED), ("requirements-dev.txt", NEEDED + TABLE["optional-dependencies"]["dev"])],
)
def test_the_lock_holds_what_the_project_asks_for(name, requirements):
    locked = read_lock(name)
    for text in requirements:
        wanted = Requirement(text)
        version, num_hashes = locked[wanted.name.lower().replace("_", "-").replace(".", "-")]
        assert wanted.specifier.contains(version), f"{text} is locked at {version}"
        assert num_hashes > 0


def test_both_locks_have_the_same_versions():
    assert read_lock("requirements-dev.txt").items() >= read_lock("requirements.txt").items()


def test_fuzzy_tools_have_never_heard_of_space():
    words = re.compile(r"\b(chief|deputy|orbit|spacecraft|satellite|hill|thruster|camera)\b", re.IGNORECASE)
    for path in (path for name in ("fis_tools", "plain_files") for path in (PROJECT / name).rglob("*.py")):
        text = path.read_text(encoding="utf-8").replace("fuzzy-spacecraft-inspection", "")
        assert not words.search(text), path


def test_the_architecture_page_places_every_folder():
    page = next((PROJECT / "docs").rglob("architecture.md")).read_text(encoding="utf-8")
    for package in PACKAGES:
        for path in (PROJECT / package).iterdir():
            if (path / "__init__.py").exists():
                assert f"`{path.name}/`" in page, f"{path.relative_to(PROJECT)} has no place"


HEART = re.compile(r"## The heart.*?(?=\n## )", re.DOTALL)


def test_the_heart_names_functions_that_exist():
    page = (PROJECT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    names = re.findall(r"`([a-z_]+)\.(\w+)`", HEART.search(page)[0])
    names = [(module, name) for module, name in names if name != "py"]
    modules = {path.stem for path in (PROJECT / "pipeline" / "flight" / "reference").glob("[a-z]*.py")}
    for module, name in names:
        assert hasattr(import_module(f"pipeline.flight.reference.{module}"), name), f"{module}.{name}"
    assert modules - {module for module, _ in names} <= {"errors", "flight"}, "a law is not on the page"


def test_each_law_is_in_the_table_of_the_reference():
    text = import_module("pipeline.flight.reference").__doc__
    modules = {path.stem for path in (PROJECT / "pipeline" / "flight" / "reference").glob("[a-z]*.py")}
    assert modules - set(re.findall(r"`(\w+)`", text)) <= {"errors", "flight", "state"}
