"""What a report makes of small runs is as it was when somebody last looked: the page, and what it plays."""

import contextlib
import io
import re
from itertools import takewhile

import pytest

import telemetry.page.panel
from pipeline.stages import report
from tests import stored
from tests.pipeline.stored_runs import made, without_pictures

pytestmark = pytest.mark.slow
#: what differs from machine to machine, day to day and version to version
UNSTEADY = re.compile(r"\b[0-9a-f]{12,}(\+changes|…)?|\b\d+\.\d+\.\d+\b|\b\d+ [A-Z][a-z]+ 20\d\d\b")
#: scripts, and what a module that flies is given
OF_OTHERS = (
    "worker",
    "modules",
    "snapshot",
    "own",
    "systems",
    "quadrature",
    "points",
    "words",
    "motion",
    "texts",
)
PAGES = {
    "evaluation": "report.html",
    "fleet": "report.html",
    "docking": "report.html",
    "comparison": "report.html",
    "assurance": "assure/board.html",
}


@pytest.fixture
def played(monkeypatch):
    """What players are given."""
    kept, original = [], telemetry.page.panel.panel

    def panel(title, content, names, more=()):
        kept.append({"title": title, "names": names, "content": content})
        return original(title, content, names, more)

    monkeypatch.setattr(telemetry.page.panel, "panel", panel)
    return kept


@pytest.mark.parametrize("name", PAGES)
def test_a_report_is_as_it_was(name, played, tmp_path, monkeypatch, file_regression):
    without_pictures(monkeypatch)
    experiment, _ = made(tmp_path, name)
    if name != "assurance":
        with contextlib.redirect_stderr(io.StringIO()):
            report.run(experiment, tmp_path)
    lines = stored.page((tmp_path / PAGES[name]).read_text(encoding="utf-8")).splitlines()
    # where it was made is of the machine; other pages are stored from what is made up
    kept = takewhile(lambda line: name == "evaluation" and '<section id="provenance"' not in line, lines)
    text = UNSTEADY.sub("SO", "\n".join(kept) + "\n") + stored.text_of(played[0], OF_OTHERS)
    file_regression.check(text.replace(str(tmp_path), "RUN"), extension=".txt", basename=name)
