"""Controllers side by side in the report: the section, its table and its figure, where the stage has run."""

import re

import pytest
from matplotlib import colors

from pipeline.report.comparisons import marks_of, read_comparison, tables_of
from pipeline.report.figures.comparison import MARKS, Mark, compared
from pipeline.report.figures.style import PAPER
from pipeline.run import artifacts
from pipeline.run.artifacts import ArtifactError
from tests.pipeline.report.runs import run_of

OVERRIDES = (
    "+experiment=baselines",
    "compare.controllers=[coast,lqr]",
    "monte_carlo.confidence_percent=90.0",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("compared")
    run_of(made, ("compare", "report"), *OVERRIDES)
    return made


def test_the_section_tells_the_rows(folder):
    page = (folder / artifacts.REPORT).read_text(encoding="utf-8")
    section = page[page.index('<section id="comparison"') :]
    section = section[: section.index("</section>")]
    assert section.count("<table>") == 2
    assert "90 % Wilson intervals" in section
    for _, lines in tables_of(read_comparison(folder)):
        assert [line[0] for line in lines] == ["the paper*", "coast", "lqr"]
        for line in lines:
            assert f'<th scope="row">{line[0]}</th>' in section
            assert all(f'<td class="number">{word}</td>' in section for word in line[1:])
    assert 'href="#comparison"' in page
    assert "2 controllers, flown side by side from 30 random starts each." in page
    assert (folder / artifacts.FIGURES / "comparison.png").exists()


def test_no_section_where_nothing_was_compared(tmp_path):
    run_of(tmp_path, ("report",), "+experiment=fly", "controller=coast")
    assert "#comparison" not in (tmp_path / artifacts.REPORT).read_text(encoding="utf-8")


def test_marks_are_means_and_spreads(folder):
    rows = read_comparison(folder)
    panels = marks_of(rows)
    assert [title for title, _ in panels] == ["Sun fixed", "Sun random"]
    for title, marks in panels:
        assert [mark.name for mark in marks] == ["the paper (published)", "coast", "lqr"]
        (row,) = [r for r in rows if (f"Sun {r.sun}", r.controller, r.safety) == (title, "lqr", "none")]
        told = row.summary["delta_v_m_s"]
        assert marks[2].delta_v == (told["mean"], told["standard_deviation"])


def test_controllers_are_told_apart_without_colours():
    half = len(MARKS) // 2
    for marks in (MARKS[:half], MARKS[half:]):
        assert len({marker for _, marker, _ in marks}) == half
        assert len({colour for colour, _, _ in marks}) == half
    # filled, then open
    assert {colour == face for colour, _, face in MARKS[:half]} == {True}
    assert {face for _, _, face in MARKS[half:]} == {PAPER}
    assert all(colors.is_color_like(colour) for colour, _, _ in MARKS)
    marks = [Mark(f"c{i}", (0.05 * i, 0.05), (80.0 + i, 3.0)) for i in range(len(MARKS))]
    figure = compared([("one", marks)], 95.0)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [mark.name for mark in marks]
    named = {line.get_label(): line for line in figure.axes[0].lines}
    for mark in marks:
        (delta_v,), (missed,) = named[mark.name].get_data()
        assert (delta_v, missed) == (mark.delta_v[0], 100.0 - mark.rate[0])


@pytest.mark.parametrize("content", ["[]", '{"rows": [{"controller": "x"}]}', '{"rows": 3}', '{"a": 1}', "{"])
def test_a_damaged_comparison_is_refused_in_a_sentence(content, tmp_path):
    path = tmp_path / artifacts.COMPARISON
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(ArtifactError, match=re.escape("repeat the stage")):
        read_comparison(tmp_path)
