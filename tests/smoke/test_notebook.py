"""The notebooks run as they are written, on a shorter flight."""

import os

import nbformat
import pytest
from nbclient import NotebookClient

from tests.places import PROJECT

pytestmark = pytest.mark.slow

NOTEBOOKS = PROJECT / "docs" / "notebooks"
#: seconds for a busy machine; output that is late fails the run instead of being lost in silence
PATIENT = {"timeout": 600, "startup_timeout": 300, "iopub_timeout": 300, "raise_on_iopub_timeout": True}
#: what each prints near its end, and how many pictures it holds
ENDS = {
    "from_flight_to_rules.ipynb": ("rules never fire on this flight", 3),
    "review_a_controller.ipynb": ("control system: ", 2),
}


def test_every_notebook_is_tried():
    assert sorted(path.name for path in NOTEBOOKS.glob("*.ipynb")) == sorted(ENDS)


@pytest.mark.parametrize("name", ENDS)
def test_a_notebook_runs(name, monkeypatch, tmp_path):
    monkeypatch.setenv("PYDEVD_DISABLE_FILE_VALIDATION", "1")
    # no history and no settings that it shares with other kernels
    monkeypatch.setenv("IPYTHONDIR", os.fspath(tmp_path))
    notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    assert "DURATION_S = 3600.0" in parameters.source
    parameters.source = parameters.source.replace("3600.0", "900.0")
    NotebookClient(notebook, resources={"metadata": {"path": os.fspath(NOTEBOOKS)}}, **PATIENT).execute()
    told = "".join(
        output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", []) if output
    )
    assert ENDS[name][0] in told


@pytest.mark.parametrize("name", ENDS)
def test_it_ships_with_small_results(name):
    path = NOTEBOOKS / name
    notebook = nbformat.read(path, as_version=4)
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert [output for output in shown if output.output_type == "error"] == []
    assert sum("image/png" in output.get("data", {}) for output in shown) == ENDS[name][1]
    assert path.stat().st_size < 300_000
