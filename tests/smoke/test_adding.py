"""The patches of the guide on adding apply to the tree, all of them together, and what they add works."""

import re
from types import SimpleNamespace
from typing import Any

import pytest

from docs.scripts import hooks
from pipeline.evaluation.assurance.quantities import SHIPPED
from pipeline.flight.state.signals import CONSTANTS, SIGNALS
from tests import night
from tests.programs import run_python
from tests.smoke.additions import MOST, copy_with_additions, patch_of, section_of, touched
from tests.smoke.pages import DOCS

#: tests that know what there is of what a patch adds; `python -m benchmarks additions` runs all others, too
KNOWING = (
    "tests/architecture/test_lists.py",
    "tests/architecture/test_names.py",
    "tests/architecture/test_repository.py",
    "tests/architecture/test_walls.py::test_the_walls_stand",
    "tests/fis_tools/formats/test_serialize.py",
    "tests/fis_tools/model",
    "tests/pipeline/command_line/test_conf.py",
    "tests/pipeline/run/test_artifacts.py",
    "tests/pipeline/settings",
    "tests/pipeline/training/test_genome.py",
    "tests/smoke/test_state.py::test_every_stage_is_watched",
)
#: of these what no patch touches waits for the night: experiments that are not added, orbits, drawn missions
BY_NIGHT = (
    "tests/pipeline/command_line/test_conf.py::test_every_experiment_composes",
    "tests/pipeline/settings/test_orbit.py",
    "tests/pipeline/settings/test_relations.py",
)


def test_every_section_has_a_patch_that_touches_few_files() -> None:
    patches = {path.stem for path in (DOCS / "how-to").glob("*.diff")}
    assert patches == {f"add-a-{what}" for what in MOST}
    for what, most in MOST.items():
        assert f"({patch_of(what).name})" in section_of(what)
        assert len(touched(what)) <= most, f"{what}: {touched(what)}"


def on_the_site(name: str) -> str:
    page: Any = SimpleNamespace(file=SimpleNamespace(src_uri=name))
    return hooks.on_page_markdown((DOCS / name).read_text(encoding="utf-8"), page)


def test_the_site_shows_patches_keys_quantities_signals_and_constants() -> None:
    assert hooks.tables_of_keys() in on_the_site("reference/keys.md")
    adding = on_the_site("how-to/adding.md")
    for what in MOST:
        assert patch_of(what).read_text(encoding="utf-8") in adding
    formulas = on_the_site("how-to/assure-a-controller.md")
    for name, quantity in SHIPPED.items():
        assert f"| `{name}` | {quantity.unit} | {quantity.description} |" in formulas
    rows = on_the_site("reference/signals.md").splitlines()
    for name, signal in SIGNALS.items():
        assert [row for row in rows if row.startswith(f"| `{name}` | {signal.unit} | {signal.description} |")]
    for name, constant in CONSTANTS.items():
        assert f"| `{name}` | {constant.description} |" in rows


@pytest.mark.slow
def test_what_the_patches_add_works_and_nothing_lists_it_twice(tmp_path):
    tests = copy_with_additions(tmp_path / "copy")
    assert len(tests) == len(MOST), tests
    words = ("-m", "pytest", "-q", "-rpf", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow")
    words += tuple(f"--deselect={name}" for name in BY_NIGHT if not night.IS_WHOLE)
    run = {"folder": tmp_path / "copy", "path": tmp_path / "copy", "NUMBA_DISABLE_JIT": "1"}
    done = run_python(*words, *tests, *KNOWING, **run)
    passed = re.findall(r"^PASSED (.+?)::", done.stdout, re.MULTILINE)
    assert {name: passed.count(name) for name in tests} == dict.fromkeys(tests, 1)
