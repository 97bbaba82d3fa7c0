"""The tables of results hold what their runs gave, of the controllers that ship, from starts of their own."""

import hashlib
import json
import re

import pytest

from docs.scripts import tables
from pipeline.command_line.config import compose_experiment
from tests.places import PROJECT

EXPERIMENTS = sorted({table.experiment for table in tables.TABLES.values()})


def kept(name):
    return json.loads(tables.path_of(name).read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", tables.PAGES)
def test_a_page_prints_what_its_runs_gave(page):
    text = (PROJECT / page).read_text(encoding="utf-8")
    assert tables.MARK.search(text)
    assert tables.written(text, {name: kept(name) for name in EXPERIMENTS}) == text


def test_help_recommends_by_the_same_runs():
    text = (PROJECT / tables.CHOICES).read_text(encoding="utf-8")
    runs = {name: kept(name) for name in EXPERIMENTS}
    assert tables.chosen(text, runs) == text
    [fuel] = [
        row["summary"]["delta_v_m_s"]["mean"]
        for row in runs["reproduce"]["comparison"]["rows"]
        if (row["controller"], row["sun"], row["safety"]) == ("champion_81", "random", "none")
    ]
    assert f"champion_81,81,paper,any,{fuel:.3f}," in tables.chosen(
        text.replace(f"{fuel:.3f},", "9.999,"), runs
    )


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_run_is_of_what_ships(name):
    experiment = compose_experiment([f"+experiment={name}"]).experiment
    run = kept(name)
    assert run["controllers"] == tables.hashes(experiment.compare.controllers)
    counts = run["comparison"]["seed"], run["comparison"]["num_cases"]
    assert counts == (experiment.seed, experiment.monte_carlo.num_cases)


def test_the_test_seed_follows_from_the_release_and_is_used_for_nothing_else():
    drawn = int(hashlib.sha256(b"fuzzy-spacecraft-inspection 1.1.0").hexdigest()[:8], 16)
    assert {kept(name)["comparison"]["seed"] for name in EXPERIMENTS} == {drawn}
    written = re.compile(rf"\bseed[:=]\s*{drawn}\b")
    configured = [path for path in (PROJECT / "conf").rglob("*.yaml") if written.search(path.read_text())]
    assert [path.stem for path in configured] == ["reproduce"]


def test_a_figure_that_differs_is_told(monkeypatch, capsys, tmp_path):
    runs = {name: kept(name) for name in EXPERIMENTS}
    page = tmp_path / "page.md"
    lines = ["| | delta-v (m/s) |", "|---|---|", "| `lqr` | 0.123 |", "| other | 9 |"]
    page.write_text("\n".join(["<!-- table: headline -->", "", *lines, ""]))
    monkeypatch.setattr(tables, "PAGES", (str(page),))
    monkeypatch.setattr(tables, "KEPT", tmp_path)
    monkeypatch.setattr(tables, "CHOICES", str(tmp_path / "choosing.csv"))
    (tmp_path / "choosing.csv").write_text((PROJECT / "pipeline/command_line/choosing.csv").read_text())
    monkeypatch.setattr(tables, "run_of", lambda name, _folder: runs[name])
    monkeypatch.setattr("sys.argv", ["tables"])
    with pytest.raises(SystemExit, match="1 rows differ"):
        tables.main()
    assert "| `lqr` | 0.123 |" in capsys.readouterr().err
    monkeypatch.setattr("sys.argv", ["tables", "--write"])
    with pytest.raises(SystemExit, match=r"^0$"):
        tables.main()
    [fuel] = [
        row["summary"]["delta_v_m_s"]["mean"]
        for row in runs["headline"]["comparison"]["rows"]
        if row["controller"] == "lqr" and row["safety"] == "none"
    ]
    assert page.read_text().splitlines()[4:] == [f"| `lqr` | {fuel:.3f} |", "| other | 9 |"]
