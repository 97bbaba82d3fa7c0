"""A controller beside the plans of least fuel: the table read back, the picture, the words."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from pipeline.report.comparisons import COLUMNS, optimum_in_words, optimum_rows, read_beside
from pipeline.report.figures.optimum import ENDS, beside_optimum
from pipeline.report.figures.style import style
from pipeline.run import artifacts, tables
from tests.pipeline.report.runs import Page, page_of, run_of


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


@pytest.fixture
def folder(tmp_path):
    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, made_up())
    return tmp_path


def test_the_picture_shows_each_case_by_its_ratio():
    columns = made_up()
    with style():
        spent, points = beside_optimum(columns, 95).axes
    order = [2, 0, 3, 1]
    assert [label.get_text() for label in points.get_xticklabels()] == ["12", "10", "13", "11"]
    plans, *ours = spent.lines
    np.testing.assert_allclose(plans.get_ydata(), columns["optimum_delta_v_m_s"][order])
    drawn = {}
    for line in ours:
        for x, y in line.get_xydata():
            drawn[int(x)] = (y, to_hex(line.get_color()), line.get_marker())
    ends = ["outside the distance limits", "success", "success", "too few points"]
    for place, (row, end) in enumerate(zip(order, ends, strict=True)):
        colour, marker = ENDS[end]
        assert drawn[place] == (columns["delta_v_m_s"][row], colour.lower(), marker)
    assert spent.get_yscale() == "log"
    assert {text.get_text() for text in spent.texts} == {"2×", "5×", "8×"}
    assert points.lines[0].get_ydata()[0] == 95
    np.testing.assert_array_equal(points.lines[1].get_ydata(), 95)


def test_a_controller_that_burns_nothing_can_be_drawn_and_many_cases_too():
    columns = made_up() | {"delta_v_m_s": np.zeros(4), "times_optimum": np.zeros(4)}
    with style():
        assert beside_optimum(columns, 95).axes[0].get_yscale() == "linear"
        crowded = beside_optimum(made_up(80), 95).axes[1]
    assert len(crowded.get_xticks()) == 0


def test_words_and_rows_are_those_of_the_table(folder):
    beside = read_beside(folder)
    words = optimum_in_words(beside, 95.0)
    assert "In the mean of 4 solved cases it burns 4.50 times the optimum" in words
    assert "at least 95 points. The median is 4.00, the range 2.00 to 8.00 (case 11)." in words
    assert "In 2 of 4 it inspects at least 95 % of the points within the limits." in words
    rows = optimum_rows(beside)
    assert [row[0] for row in rows] == ["11", "13", "10", "12"]
    assert rows[0] == ["11", "60.0", "1.600", "0.200", "8.00", "90", "95", "20.0 to 201.0", "too few points"]
    assert rows[3][-1] == "outside the limits"


@pytest.mark.parametrize("name", COLUMNS)
def test_a_table_without_a_column_is_refused(tmp_path, name):
    columns = made_up()
    del columns[name]
    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, columns)
    with pytest.raises(artifacts.ArtifactError, match=f"has no {name}; repeat the stage evaluate"):
        read_beside(tmp_path)


@pytest.mark.slow
def test_the_page_shows_the_table_the_reason_or_what_is_missing(tmp_path):
    overrides = ("+experiment=evaluate", "controller=coast", "telemetry.record_start=true")
    experiment = run_of(tmp_path, ("evaluate",), *overrides)
    words = " ".join(Page(page_of(experiment, tmp_path)).text["optimum"].split())
    assert "Not compared with plans of least fuel: duration_s is 600.0 here, and 3600.0 where" in words

    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, made_up())
    page = Page(page_of(experiment, tmp_path))
    words = " ".join(page.text["optimum"].split())
    assert "it burns 4.50 times the optimum" in words
    assert "figure-optimum" in page.ids()
    assert (tmp_path / artifacts.FIGURES / "optimum.png").is_file()
    assert "median 4.0 of 4" in page.text["summary"]

    (tmp_path / artifacts.BESIDE_OPTIMUM).unlink()
    (tmp_path / artifacts.SUMMARY).unlink()
    page = Page(page_of(experiment, tmp_path))
    assert "This run has no evaluate/optimum.parquet; the stage evaluate writes it" in page.text["optimum"]
    assert not (tmp_path / artifacts.FIGURES / "optimum.png").exists()
