"""A controller's flight beside the plan of least fuel: read back from the axes, and on the page."""

import json
import re
import shutil
from dataclasses import asdict, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import is_color_like, to_hex
from matplotlib.text import Text

from fis_tools.render.theme import contrast
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation import comparison
from pipeline.evaluation.beside_optimum import beside_optimum
from pipeline.evaluation.comparison import ComparisonRow
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.control.controller import coast
from pipeline.optimum.solved import solved_for
from pipeline.report import comparisons
from pipeline.report.figures.comparison import ENDS, LEAST_MISSED, MARKS, ControllerMark, by_world, compared
from pipeline.report.figures.comparison import beside_optimum as drawn_beside
from pipeline.report.figures.style import PAPER, style
from pipeline.run import artifacts, tables
from pipeline.settings.experiment import Mission
from plain_files.document.html import template
from tests.browser import WIDTHS, assert_tables_fit
from tests.pipeline.report.runs import SMALL, page_of, run_of
from tests.policies import Page

COMPARED = (
    *("+experiment=baselines", "compare.controllers=[coast,lqr]"),
    "monte_carlo.confidence_percent=90.0",
)


@pytest.mark.slow
def test_the_page_shows_the_middle_and_the_greatest_ratio(tmp_path):
    words = ["+experiment=evaluate", "controller=coast", "report.dots_per_inch=40"]
    # a layer that would burn against many a plan, which is flown without it
    words += ["telemetry.record_start=true", "safety=filter", "safety.speed_limit_m_s=0.01"]
    experiment = compose_experiment(words).experiment
    solved = solved_for(experiment)
    episodes, _ = fly_cases(experiment.mission, coast(), solved.scenarios, 1)
    columns = beside_optimum(episodes, solved.cases)
    columns["times_optimum"] = np.random.default_rng(3).permutation(50).astype(float)
    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, columns)
    middle, greatest = (int(np.flatnonzero(columns["times_optimum"] == ratio)[0]) for ratio in (25, 49))

    pairs = comparisons.fly_pairs(experiment, coast(), comparisons.read_beside(tmp_path, {}))
    assert [(pair.case, pair.which) for pair in pairs] == [(middle, "the middle"), (greatest, "the greatest")]
    for pair in pairs:
        assert pair.plan.delta_v_m_s[-1] == pytest.approx(solved.cases["delta_v_m_s"][pair.case], rel=1e-9)
        assert pair.controller.delta_v_m_s[-1] > 0.0
        np.testing.assert_array_equal(pair.plan.position_m[0], pair.controller.position_m[0])

    names = {f"optimum-case-{case}" for case in (middle, greatest)}
    assert {f"figure-{name}" for name in names} < set(Page(page_of(experiment, tmp_path)).values("id"))
    assert names < {path.stem for path in (tmp_path / artifacts.FIGURES).iterdir()}

    gone = replace(experiment, optimum=replace(experiment.optimum, reference=str(tmp_path / "gone")))
    assert "no longer at hand" in Page(page_of(gone, tmp_path)).text["optimum"]
    assert not names & {path.stem for path in (tmp_path / artifacts.FIGURES).iterdir()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("compared")
    run_of(made, ("compare", "report"), *COMPARED)
    return made


def test_the_section_tells_the_rows(folder):
    page = (folder / artifacts.REPORT).read_text(encoding="utf-8")
    section = page.partition('<section id="comparison"')[2].partition("</section>")[0]
    assert section.count("<table ") == 2
    assert "90 % Wilson intervals" in section
    # where lines may break is no part of the words
    section = re.sub(r"</?span[^>]*>", "", section).replace("\u00a0", " ")
    for _, headings, lines in comparisons.tables_of(comparisons.read_comparison(folder)):
        assert all(f">{heading}</th>" in section for heading in headings)
        assert [line[0] for line in lines] == ["coast", "lqr"]
        for line in lines:
            assert f'<th scope="row">{line[0]}</th>' in section
            assert all(f">{word}</td>" in section for word in line[1:])
    assert 'href="#comparison"' in page
    assert "2 controllers, flown side by side from 30 random starts each." in page
    assert (folder / artifacts.FIGURES / "comparison.png").exists()
    sides = re.findall(r'<section class="side" aria-label="([^",]+)', page)
    assert set(sides) == {"coast", "lqr"}
    # of one controller's flights there are none to tell of
    assert "controller <strong>" not in page
    assert "This run has no" not in page
    assert re.findall(r'<section id="(\w+)"', page) == ["summary", "comparison", "provenance"]


@pytest.mark.slow
def test_no_column_of_a_comparison_is_hidden_at_any_width(folder, opened):
    page = opened((folder / artifacts.REPORT).read_text(encoding="utf-8"))
    assert page.locator("#comparison table.stacked").count() == 2
    assert_tables_fit(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= WIDTHS[-1]


def test_a_comparison_of_approaches_says_what_its_columns_mean(tmp_path):
    words = ("+experiment=compare_docking", "compare.controllers=[coast]")
    experiment = run_of(tmp_path, ("compare", "report"), *words)
    page = (tmp_path / artifacts.REPORT).read_text(encoding="utf-8")
    (description,) = comparison.describe_columns(experiment)
    assert f"same starts: {description}" in page
    assert description.startswith("30 cases of seed")
    assert "Sun random" not in page


def test_the_paper_stands_beside_its_own_mission_alone(folder, tmp_path):
    copy = Path(shutil.copytree(folder, tmp_path / "copy"))
    published = comparison.published_row(comparison.PAPER_TEST)
    summary = artifacts.read_json(copy, artifacts.COMPARISON)
    summary["rows"].insert(0, asdict(published))  # as in runs of earlier versions, whatever their mission
    (copy / artifacts.COMPARISON).write_text(json.dumps(summary))
    experiment = compose_experiment([*COMPARED, *SMALL]).experiment
    page, papers = (page_of(replace(experiment, mission=m), copy) for m in (experiment.mission, Mission()))
    for words in ("the paper*", f"* published ({comparison.PAPER_NAME})"):
        assert words in re.sub(r"</?span[^>]*>", "", papers).replace("\u00a0", " ")
    assert not re.search(r"\bpaper\*|published", page.partition('id="provenance"')[0])


def test_marks_are_means_and_spreads(folder):
    rows = comparisons.read_comparison(folder)
    panels = comparisons.marks_of(rows)
    assert [title for title, _ in panels] == ["Sun fixed", "Sun random"]
    for title, marks in panels:
        assert [mark.name for mark in marks] == ["coast", "lqr"]
        (row,) = [r for r in rows if (f"Sun {r.sun}", r.controller, r.safety) == (title, "lqr", "none")]
        measure = row.summary["delta_v_m_s"]
        assert marks[1].delta_v == (measure["mean"], measure["standard_deviation"])


def test_controllers_are_told_apart_without_colours():
    half = len(MARKS) // 2
    for marks in (MARKS[:half], MARKS[half:]):
        assert len({marker for _, marker, _ in marks}) == half
        assert len({colour for colour, _, _ in marks}) == half
    # filled, then open
    assert {colour == face for colour, _, face in MARKS[:half]} == {True}
    assert {face for _, _, face in MARKS[half:]} == {PAPER}
    assert all(is_color_like(colour) for colour, _, _ in MARKS)
    marks = [ControllerMark(f"c{i}", (0.05 * i, 0.05), (80.0 + i, 3.0)) for i in range(len(MARKS))]
    figure = compared([("one", marks), ("two", marks[:2])], 95.0)
    assert figure.axes[0].get_xlim()[1] > marks[-1].delta_v[0] + marks[-1].delta_v[1]
    names = figure.axes[0].texts
    assert {text.get_text() for text in names} == {mark.name for mark in marks}
    figure.draw_without_rendering()
    for text, other in combinations(names, 2):
        # without the line that leads from a name to its mark
        assert not Text.get_window_extent(text).overlaps(Text.get_window_extent(other))
    named = {line.get_label(): line for line in figure.axes[0].lines}
    for mark in marks:
        (delta_v,), (missed,) = named[mark.name].get_data()
        assert (delta_v, missed) == (mark.delta_v[0], 100.0 - mark.rate[0])
    # the intervals around them: delta-v from none on, points missed from the least that is drawn to all
    drawn = {tuple(map(tuple, np.round(line.get_data(), 9))) for line in figure.axes[0].lines}
    for (fuel, across), (rate, up) in ((mark.delta_v, mark.rate) for mark in marks):
        missed = 100.0 - rate
        assert (tuple(np.round([max(fuel - across, 0.0), fuel + across], 9)), (missed, missed)) in drawn
        ends = [max(missed - up, LEAST_MISSED), min(missed + up, 100.0)]
        assert ((np.round(fuel, 9),) * 2, tuple(np.round(ends, 9))) in drawn
    # whatever a controller misses, its mark is within the axes
    for rate in (0.0, 99.0, 100.0):
        (ax,) = compared([("one", [ControllerMark("c", (0.1, 0.05), (rate, 0.0))])], 95.0).axes
        for line in ax.lines:
            assert max(ax.get_ylim()) >= max(line.get_ydata())
            assert min(ax.get_ylim()) <= min(line.get_ydata())


def test_words_stand_out_from_the_squares_of_worlds():
    row = {"source": "flown", "sun": "random", "safety": "none", "num_cases": 4, "rules": None}
    rows = []
    for count in range(21):
        part = {"fraction": count / 20, "low": 0.0, "high": 1.0}
        summary = {"success_and_within_limits": part, "violated": part, "delta_v_m_s": {"mean": 1.0}}
        rows.append(ComparisonRow(controller=str(count), world="w", summary=summary, **row))
    (ax,) = by_world(rows).axes
    for text, square in zip(ax.texts, ax.patches, strict=True):
        assert contrast(text.get_color(), square.get_facecolor()[:3]) >= 4.5
        assert all(ax.viewLim.contains(*corner) for corner in square.get_corners())
    # a world more is a row more, of the same height
    heights = [
        by_world([replace(rows[world], world=str(world)) for world in range(count)]).get_figheight()
        for count in (1, 2, 7)
    ]
    assert heights[2] - heights[0] == pytest.approx(6.0 * (heights[1] - heights[0]))
    assert heights[1] - heights[0] > 0.3


@pytest.mark.parametrize(
    "content", ["[]", '{"rows": [{"controller": "x"}]}', '{"rows": 3}', '{"rows": []}', '{"a": 1}', "{"]
)
def test_a_damaged_comparison_is_refused_in_a_sentence(content, tmp_path):
    path = tmp_path / artifacts.COMPARISON
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(artifacts.ArtifactError, match=re.escape("repeat the stage")):
        comparisons.read_comparison(tmp_path)


def made_up(count: int = 4) -> dict[str, np.ndarray]:
    """Cases 10, 11, …, each with a ratio of its own: 3, 8, 2, 5, …"""
    times = np.array([3.0, 8.0, 2.0, 5.0, *np.linspace(9.0, 12.0, max(count - 4, 0))])[:count]
    least = np.linspace(0.1, 0.4, count)
    success, violated = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    success[1], violated[2] = False, True
    return {
        "case": np.arange(10, 10 + count),
        "sun_angle_rad": np.full(count, np.pi / 3.0),
        "delta_v_m_s": times * least,
        "optimum_delta_v_m_s": least,
        "times_optimum": times,
        "inspected_count": np.where(success, 97, 90),
        "optimum_inspected_count": np.full(count, 95),
        "min_distance_m": np.full(count, 20.0),
        "max_distance_m": np.full(count, 201.0),
        "success": success,
        "violated": violated,
    }


def test_the_picture_shows_each_case_by_its_ratio():
    columns = made_up()
    with style():
        spent, points = drawn_beside(columns, 95).axes
    order = [2, 0, 3, 1]
    numbers = {word.get_position()[0]: word.get_text() for word in points.texts}
    assert numbers == {0: "12", 1: "10", 2: "13", 3: "11"}
    plans, *ours = spent.lines
    np.testing.assert_allclose(plans.get_ydata(), columns["optimum_delta_v_m_s"][order])
    drawn = {}
    for line in ours:
        for x, y in line.get_xydata():
            drawn[int(x)] = (y, to_hex(line.get_color()), line.get_marker())
    ends = ["outside the distance limits", "success", "success", "too few points"]
    for column, (row, end) in enumerate(zip(order, ends, strict=True)):
        colour, marker = ENDS[end]
        assert drawn[column] == (columns["delta_v_m_s"][row], colour.lower(), marker)
    assert spent.get_yscale() == "log"
    assert {text.get_text() for text in spent.texts} == {"2×", "5×", "8×"}
    assert points.lines[0].get_ydata()[0] == 95
    np.testing.assert_array_equal(points.lines[1].get_ydata(), 95)


def test_a_controller_that_burns_nothing_can_be_drawn_and_many_cases_too():
    columns = made_up() | {"delta_v_m_s": np.zeros(4), "times_optimum": np.zeros(4)}
    with style():
        assert drawn_beside(columns, 95).axes[0].get_yscale() == "linear"
        crowded = drawn_beside(made_up(80), 95).axes[1]
    assert len(crowded.texts) == 0


def test_words_and_rows_are_those_of_the_table(tmp_path):
    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, made_up())
    beside = comparisons.read_beside(tmp_path, {})
    words = template("pipeline.report", "templates", "words.html").module.optimum(beside, "95")
    assert "On average over 4 solved cases it burns 4.50" in words
    assert "at least 95 points. The median is 4.00, the range 2.00 to 8.00 (case 11)." in words
    assert "In 2 of 4 it inspects at least 95 % of the points within the limits." in words
    rows = comparisons.optimum_rows(beside)
    assert [row[0] for row in rows] == ["11", "13", "10", "12"]
    assert rows[0] == ["11", "60.0", "1.600", "0.200", "8.00", "90", "95", "20.0 to 201.0", "too few points"]
    assert rows[3][-1] == "outside the limits"


def test_a_table_without_a_column_is_refused(tmp_path):
    for name in comparisons.COLUMNS:
        columns = {key: column for key, column in made_up().items() if key != name}
        tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, columns)
        with pytest.raises(artifacts.ArtifactError, match=f"has no {name}; repeat the stage evaluate"):
            comparisons.read_beside(tmp_path, {})


@pytest.mark.slow
def test_the_page_shows_the_table_the_reason_or_what_is_missing(tmp_path):
    overrides = ("+experiment=evaluate", "controller=coast", "telemetry.record_start=true")
    experiment = run_of(tmp_path, ("evaluate",), *overrides)
    words = " ".join(Page(page_of(experiment, tmp_path)).text["optimum"].split())
    assert "Not compared with plans of least fuel: duration_s is 600.0 here, and 3600.0 where" in words

    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, made_up())
    text = page_of(experiment, tmp_path)
    assert "#comparison" not in text
    page = Page(text)
    words = " ".join(page.text["optimum"].split())
    assert "it burns 4.50" in words
    assert "figure-optimum" in page.values("id")
    assert (tmp_path / artifacts.FIGURES / "optimum.png").is_file()
    assert "median 4.0 of 4" in page.text["summary"]

    (tmp_path / artifacts.BESIDE_OPTIMUM).unlink()
    (tmp_path / artifacts.SUMMARY).unlink()
    page = Page(page_of(experiment, tmp_path))
    assert "This run has no evaluate/optimum.parquet; the stage evaluate writes it" in page.text["optimum"]
    assert not (tmp_path / artifacts.FIGURES / "optimum.png").exists()
