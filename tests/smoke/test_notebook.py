"""The notebooks run as they are written, on a shorter flight, and after fewer generations."""

import os
import re
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from skfuzzy import control

from docs.scripts.shown import PAGES, rerun, shown
from tests.places import PROJECT
from tests.smoke.pages import DOCS, blocks

NOTEBOOKS = PROJECT / "docs" / "notebooks"
#: seconds for a busy machine; output that is late fails the run instead of being lost in silence
PATIENT = {"timeout": 600, "startup_timeout": 300, "iopub_timeout": 300, "raise_on_iopub_timeout": True}
#: parameters as they are written, and as they are run: a shorter flight, fewer generations
LESS = {"DURATION_S = 3600.0": "DURATION_S = 600.0", "GENERATIONS = 50": "GENERATIONS = 3"}
#: what each prints near its end, and how many pictures it holds
ENDS = {
    "from_flight_to_rules.ipynb": ("rules never fire on this flight", 3),
    "review_a_controller.ipynb": ("control system: ", 2),
    "train_judge_fly.ipynb": ("beyond the best plan (m/s)", 2),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [path.name for path in NOTEBOOKS.glob("*.ipynb")])
def test_a_notebook_runs_and_ships_with_small_results(name, monkeypatch, tmp_path):
    monkeypatch.setenv("PYDEVD_DISABLE_FILE_VALIDATION", "1")
    # no history and no settings that it shares with other kernels
    monkeypatch.setenv("IPYTHONDIR", os.fspath(tmp_path))
    notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert [output for output in shown if output.output_type == "error"] == []
    assert sum("image/png" in output.get("data", {}) for output in shown) == ENDS[name][1]
    assert (NOTEBOOKS / name).stat().st_size < 300_000
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    for long, short in LESS.items():
        parameters.source = parameters.source.replace(long, short)
    assert not re.search("3600|50", parameters.source)
    NotebookClient(notebook, resources={"metadata": {"path": os.fspath(NOTEBOOKS)}}, **PATIENT).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert ENDS[name][0] in "".join(output.get("text", "") for output in shown)


def test_a_million_tips_are_computed_as_the_page_says() -> None:
    (code,) = blocks(DOCS / "how-to" / "speed-up-scikit-fuzzy.md", "python")
    names: dict[str, Any] = {}
    exec(code, names)  # noqa: S102 - our own page
    simulation = control.ControlSystemSimulation(control.ControlSystem(names["rules"]))
    simulation.input["service"], simulation.input["food"] = 1.3, 6.5
    simulation.compute()
    tip = names["infer"]({"service": 1.3, "food": 6.5})["tip"]
    assert tip == pytest.approx(simulation.output["tip"], abs=25e-12)
    assert names["tips"].shape == (1_000_000,)
    assert 0.0 < names["tips"].min() < names["tips"].max() < 25.0


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_what_its_commands_print(name, tmp_path):
    """If this fails after a change that is meant: ``python -m docs shown``."""
    page = (DOCS / name).read_text(encoding="utf-8")
    assert rerun(page, tmp_path) == page


def test_a_page_may_leave_lines_out():
    printed = "one\ntwo\nthree\nfour\n"
    assert shown("stale\n", printed) == printed
    assert shown("one\n…\nfour\n", printed) == "one\n…\nfour\n"
    with pytest.raises(ValueError, match="which is not among what is printed"):
        shown("one\n…\nfive\n", printed)


def test_pictures_of_the_gallery_are_shown_and_those_shown_exist():
    folder = DOCS / "images" / "gallery"
    text = "".join((DOCS / name).read_text(encoding="utf-8") for name in PAGES)
    assert sorted(path.name for path in folder.iterdir() if path.name not in text) == []
