"""What is declared of Pythons, systems and versions is said in the same way everywhere."""

import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from tests.places import PROJECT

PROJECTS = {
    name: tomllib.loads((PROJECT / folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for name, folder in (("product", "."), ("toolkit", "fis_tools"))
}
PYTHON = "Programming Language :: Python :: "
#: pages that tell a reader where it runs
PAGES = ("README.md", "SUPPORT.md", "docs/overview.md")


def requirements(project):
    """All requirements of a project, those of its extras included."""
    extras = project.get("optional-dependencies", {}).values()
    return [
        Requirement(text)
        for text in [*project["dependencies"], *(text for extra in extras for text in extra)]
    ]


def test_both_distributions_declare_the_same_pythons_and_systems():
    declared = [
        (
            project["requires-python"],
            [text for text in project["classifiers"] if "Python ::" in text or "System" in text],
        )
        for project in PROJECTS.values()
    ]
    assert declared[0] == declared[1]


def test_classifiers_and_pages_name_the_pythons_that_are_allowed():
    allowed = SpecifierSet(PROJECTS["product"]["requires-python"])
    minors = [f"3.{minor}" for minor in range(30) if f"3.{minor}" in allowed]
    classifiers = PROJECTS["product"]["classifiers"]
    assert [text.removeprefix(PYTHON) for text in classifiers if text.startswith(PYTHON + "3.")] == minors
    words = f"{', '.join(minors[:-1])} (or|and) {minors[-1]}"
    assert "Operating System :: POSIX :: Linux" in classifiers
    for page in PAGES:
        text = " ".join((PROJECT / page).read_text(encoding="utf-8").split())
        assert re.search(words, text), page
        assert "Linux" in text, page


def test_a_package_is_allowed_in_the_same_versions_wherever_it_is_named():
    allowed: dict[str, set[str]] = {}
    for project in PROJECTS.values():
        for requirement in requirements(project):
            if requirement.name != "fis-tools":
                allowed.setdefault(requirement.name, set()).add(str(requirement.specifier))
    assert {name: versions for name, versions in allowed.items() if len(versions) > 1} == {}


@pytest.mark.parametrize("lock", ["requirements.txt", "requirements-dev.txt"])
def test_what_is_locked_is_allowed(lock):
    pins = dict(
        re.findall(r"^([\w.-]+)==([\w.]+)", (PROJECT / lock).read_text(encoding="utf-8"), re.MULTILINE)
    )
    for project in PROJECTS.values():
        for requirement in requirements(project):
            if version := pins.get(requirement.name.lower()):
                assert version in requirement.specifier, requirement


def test_the_cure_for_another_numba_is_what_is_declared():
    (numba,) = {str(r.specifier) for r in requirements(PROJECTS["toolkit"]) if r.name == "numba"}
    text = (PROJECT / "fis_tools" / "compiled" / "numba_parts.py").read_text(encoding="utf-8")
    (cure,) = re.findall(r"pip install 'numba(\S+)'", text)
    assert SpecifierSet(cure) == SpecifierSet(numba)
