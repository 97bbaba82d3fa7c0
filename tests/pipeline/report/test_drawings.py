"""Drawings of evidence, read back by their numbers: bars, lines and limits stand where their values are."""

import math
import re
from dataclasses import replace
from itertools import product
from xml.etree import ElementTree

import numpy as np
import pytest

from fis_tools.model import And, Consequent, FuzzySystem, Is, Rule, Term, Triangular, Variable
from pipeline.report.board import grid_of
from pipeline.report.board_flights import BoardFlights, Limit, draw_distances, in_words, limits_of
from pipeline.report.evidence import draw_margins

HISTOGRAM = {"edges": [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0], "counts": [1, 0, 20, 300, 9]}
#: the first flight moves away by 1 m/s, the second stays; free motion goes on for two minutes
TIMES, AFTER = np.arange(0.0, 61.0, 10.0), np.arange(0.0, 121.0, 30.0)
FLIGHTS = BoardFlights(
    2, TIMES, np.array([40.0 + TIMES, np.full(7, 50.0)]), AFTER, np.array([100.0 + AFTER, np.full(5, 50.0)])
)
LIMITS = (Limit(15.0, ("R1",), ("Keep out",)), Limit(150.0, ("R2", "R7"), ("Keep in", "Stays")))


def read(drawing):
    """Return the elements of an SVG, and its width and height."""
    svg = ElementTree.fromstring(str(drawing))  # noqa: S314 - drawn here
    width, height = map(float, svg.get("viewBox").split()[2:])
    return list(svg.iter()), width, height


def numbers(text):
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text)]


@pytest.mark.parametrize(
    "drawing", [draw_margins(HISTOGRAM, "m", "R1"), draw_distances(FLIGHTS, LIMITS)], ids=["margins", "board"]
)
def test_all_that_is_drawn_lies_in_the_picture(drawing):
    elements, width, height = read(drawing)
    for element in elements:
        for names, most in ((("x", "x1", "x2"), width), (("y", "y1", "y2"), height)):
            assert all(0.0 <= float(element.get(name, 0.0)) <= most for name in names), element.attrib
        if element.tag == "rect":
            assert float(element.get("x")) + float(element.get("width")) <= width
            assert float(element.get("y")) + float(element.get("height")) <= height
        locations = np.array(numbers(element.get("points", ""))).reshape(-1, 2)
        assert ((locations >= 0.0) & (locations <= [width, height])).all()


def test_bars_of_margins_are_as_high_as_the_logarithm_of_their_counts():
    elements, _, _ = read(draw_margins(HISTOGRAM, "m", "R1"))
    bars = [element for element in elements if element.tag == "rect"]
    assert [numbers(bar[0].text) for bar in bars] == [[1, -2, -1], [20, 0, 1], [300, 1, 2], [9, 2, 3]]
    assert ["refuted" in bar.get("class") for bar in bars] == [True, False, False, False]
    floor = float(bars[0].get("y")) + float(bars[0].get("height"))
    heights = np.array([float(bar.get("height")) for bar in bars])
    # half a flight is the floor
    np.testing.assert_allclose(heights / heights[2], np.log([2, 40, 600, 18]) / math.log(600), atol=1e-3)
    labels = {element.text: element for element in elements if element.get("class") == "end small"}
    assert list(labels) == ["1", "10", "100"]
    lines = [element for element in elements if element.get("class") == "tick"]
    for line, (count, label) in zip(lines, labels.items(), strict=True):
        level = numbers(line.get("d"))[1]
        expected = floor - heights[2] * math.log(2 * int(count)) / math.log(600)
        assert level == pytest.approx(expected, abs=0.06)
        assert float(label.get("y")) - level == pytest.approx(4.0, abs=0.11)  # its middle, about
    ends = {element.get("class"): element for element in elements if element.tag == "text"}
    assert (ends["start"].text, ends["end"].text) == ("−2", "3")
    assert float(ends["start"].get("x")) == float(bars[0].get("x"))


def test_distances_on_the_board_are_where_their_axes_say():
    elements, _, _ = read(draw_distances(FLIGHTS, LIMITS))
    across = {
        float(element.text.removesuffix(" min")): float(element.get("x"))
        for element in elements
        if element.get("class") == "middle"
    }
    up = {
        float(element.text): float(element.get("y")) - 4.0
        for element in elements
        if element.get("class") == "end"
    }
    minutes, levels = (
        np.polyfit(*zip(*across.items(), strict=True), 1),
        np.polyfit(*zip(*up.items(), strict=True), 1),
    )
    drawn = [element for element in elements if element.tag == "polyline"]
    assert [element.get("class") for element in drawn] == ["one", "one free", "first", "first free"]
    for element, (times, distances) in zip(
        drawn,
        [
            (TIMES, FLIGHTS.distance_m[1]),
            (60.0 + AFTER[::2], FLIGHTS.after_m[1, ::2]),
            (TIMES, FLIGHTS.distance_m[0]),
            (60.0 + AFTER[::2], FLIGHTS.after_m[0, ::2]),
        ],
        strict=True,
    ):
        locations = np.array(numbers(element.get("points"))).reshape(-1, 2)
        expected = np.column_stack([np.polyval(minutes, times / 60.0), np.polyval(levels, distances)])
        np.testing.assert_allclose(locations, expected, atol=0.2)
    limits = [element for element in elements if element.get("class") == "limit" and element.tag == "line"]
    for element, limit in zip(limits, LIMITS, strict=True):
        assert float(element.get("y1")) == pytest.approx(np.polyval(levels, limit.value_m), abs=0.2)
    words = [element.text for element in elements if element.get("class") == "limit" and element.text]
    assert words == ["15 m", "R1", "150 m", "R2, R7"]


def test_the_share_beyond_a_distance_counts_flights_until_then():
    assert FLIGHTS.percent_beyond(150.0, 0.5) == 0.0
    assert FLIGHTS.percent_beyond(150.0, 2.0) == 50.0
    assert FLIGHTS.percent_beyond(40.0, 0.5) == 100.0


def test_limits_are_distances_whatever_the_formulas_multiply_them_by():
    formulas = ["always(2 * distance <= 300 m)", "always(-distance <= -15 m)", "always(speed <= 1 m/s)", ""]
    requirements = [
        {"id": f"R{number}", "title": f"T{number}", "formula": text} for number, text in enumerate(formulas)
    ]
    assert limits_of(requirements) == [Limit(15.0, ("R1",), ("T1",)), Limit(150.0, ("R0",), ("T0",))]


@pytest.mark.parametrize(("num_cases", "which"), [(2, "Each case; "), (5, "The first 2 of 5 cases; ")])
def test_words_say_whether_all_flights_are_drawn(num_cases, which):
    assert in_words(replace(FLIGHTS, num_cases=num_cases), LIMITS).startswith(which)


def test_a_grid_has_a_row_for_each_term_of_the_first_input_and_a_column_for_each_of_the_second():
    low, high = Triangular(0.0, 0.0, 1.0), Triangular(0.0, 1.0, 1.0)
    down = Variable("down", "m", 0.0, 1.0, terms=(Term("near", low), Term("far", high)))
    middle = Term("middle", Triangular(0.0, 0.5, 1.0))
    across = Variable("across", "m", 0.0, 1.0, terms=(Term("left", low), middle, Term("right", high)))
    output = Variable("push", "N", 0.0, 1.0, terms=(Term("little", low), Term("much", high)), default=0.0)
    names = list(product(("near", "far"), ("left", "middle", "right")))
    rules = tuple(
        Rule(And((Is("down", i), Is("across", j))), (Consequent("push", "much" if i == "far" else "little"),))
        for i, j in names
    )
    grid = grid_of(FuzzySystem("push", (down, across), (output,), rules))
    assert [head[0] for head, _ in grid.rows] == ["near", "far"]
    assert [head[0] for head in grid.heads] == ["left", "middle", "right"]
    assert [[cell.number for cell in cells] for _, cells in grid.rows] == [[1, 2, 3], [4, 5, 6]]
    assert [{cell.term for cell in cells} for _, cells in grid.rows] == [{"little"}, {"much"}]


def test_the_share_beyond_a_distance_reaches_to_the_minute_that_is_told():
    after = np.arange(0.0, 601.0, 40.0)  # no sample at five minutes
    flights = replace(
        FLIGHTS, after_s=after, after_m=np.array([100.0 + 0.5 * after, np.full(len(after), 50.0)])
    )
    assert [flights.percent_beyond(limit, 5) for limit in (245.0, 251.0)] == [50.0, 0.0]
