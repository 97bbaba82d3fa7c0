"""What a notebook shows of fuzzy systems, and the names that the package offers."""

import subprocess
import sys

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell

import fis_tools
from fis_tools.findings.audit import audit
from fis_tools.findings.difference import difference
from fis_tools.findings.explanation import explain, shares
from fis_tools.findings.simplification import Budget, simplify
from fis_tools.model import FuzzyController
from tests.fis_tools.sample_controllers import force_z_system, general_controller


@pytest.fixture
def shell() -> InteractiveShell:
    shell = InteractiveShell()
    shell.display_formatter.active_types = ["text/plain", "text/html", "image/svg+xml"]
    fis_tools.show_in(shell)
    return shell


def shown(shell: InteractiveShell, thing: object) -> dict[str, str]:
    bundle, _ = shell.display_formatter.format(thing)
    return bundle


def test_a_controller_and_a_system_show_their_tables(shell: InteractiveShell) -> None:
    controller = general_controller()
    page = shown(shell, controller)["text/html"]
    assert f"<h1>{controller.name}</h1>" in page
    assert page.count("<h2>") == len(controller.systems)
    assert "<table" in shown(shell, controller.systems[0])["text/html"]


def test_a_variable_shows_its_terms(shell: InteractiveShell) -> None:
    variable = force_z_system().inputs[0]
    picture = shown(shell, variable)["image/svg+xml"]
    assert picture.lstrip().startswith("<?xml")
    assert all(term.name in picture for term in variable.terms)


def test_what_is_no_fuzzy_noun_is_shown_as_ever(shell: InteractiveShell) -> None:
    assert shown(shell, 1) == {"text/plain": "1"}


def test_results_show_themselves_in_words_where_there_is_no_notebook() -> None:
    system = force_z_system()
    inputs = [0.5 * (variable.minimum + variable.maximum) for variable in system.inputs]
    controller = FuzzyController("one", (system,))
    results = [
        audit(controller),
        difference(controller, controller),
        explain(system, inputs),
        shares(system, np.array([inputs])),
        simplify(controller, {system.name: np.array([inputs])}, Budget(flights_only=True)),
    ]
    for result in results:
        told = repr(result)
        assert not told.startswith(type(result).__name__ + "(")
        assert "Gaussian(" not in told
        assert len(told) < 5000


def test_the_package_offers_what_it_names() -> None:
    assert fis_tools.compile(force_z_system()).system == force_z_system()
    assert callable(fis_tools.read_controller)
    with pytest.raises(AttributeError, match="has no attribute 'compiles'"):
        fis_tools.compiles  # noqa: B018


def test_importing_the_package_brings_in_neither_pictures_nor_recordings() -> None:
    code = (
        "import sys, fis_tools; print({'matplotlib', 'telemetry', 'skfuzzy', 'pyarrow'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603
    assert done.stdout == "set()\n"
