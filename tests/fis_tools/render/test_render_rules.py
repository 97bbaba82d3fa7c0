"""Rules as tables, and how much they are used."""

import re
from dataclasses import replace
from itertools import accumulate

import numpy as np
import pytest
from matplotlib.figure import Figure

from fis_tools.analysis.flights import read_flight
from fis_tools.model import And, Consequent, Expression, FuzzyController, FuzzySystem, Is, Rule
from fis_tools.render import rule_matrix, rules_figures
from fis_tools.render.rules import firing_map, rule_names
from fis_tools.render.theme import contrast, term_colours
from fis_tools.words.text import outline
from plain_files.document import html, text
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.render.picture_systems import one_input_system
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, PAPER_LIKE, ROOM, with_input


def test_the_rule_matrix_holds_every_consequent_at_its_place() -> None:
    ax = rule_matrix(FORCE_X, Figure().subplots())
    assert [text.get_text() for text in ax.texts] == [rule.consequents[0].term for rule in FORCE_X.rules]
    # the rule of the third distance and the fourth velocity stands at column 3, row 2
    assert ax.texts[2 * 5 + 3].get_position() == (3, 2)
    assert [label.get_text().replace("\n", " ") for label in ax.get_xticklabels()][4] == "towards fast"
    assert [label.get_text() for label in ax.get_yticklabels()][1] == "near"
    assert ax.get_ylabel() == "distance"


def test_each_cell_has_the_colour_of_its_word_and_the_word_can_be_read() -> None:
    ax = rule_matrix(FORCE_X, Figure().subplots())
    names = [term.name for term in FORCE_X.outputs[0].terms]
    for label, cell in zip(ax.texts, ax.patches, strict=True):
        face = cell.get_facecolor()[:3]
        assert face == pytest.approx(tuple(term_colours(5)[names.index(label.get_text())]))
        assert contrast(face, label.get_color()) >= 4.5
        x, y = label.get_position()
        assert (cell.get_x() + 0.5, cell.get_y() + 0.5) == (x, y)  # type: ignore[attr-defined]


def test_a_third_input_needs_a_term() -> None:
    ax = rule_matrix(FORCE_Z, Figure().subplots(), {"eta_u": "right"})
    assert [text.get_text() for text in ax.texts] == [r.consequents[0].term for r in FORCE_Z.rules[30:]]
    with pytest.raises(ValueError, match="for one term of 'eta_u'; fix it to one of left, ahead, right"):
        rule_matrix(FORCE_Z, Figure().subplots())
    with pytest.raises(ValueError, match="no output 'force_y'; did you mean 'force_z'"):
        rule_matrix(FORCE_Z, Figure().subplots(), {"eta_u": "left"}, output="force_y")


def test_cells_without_a_rule_say_so_and_an_input_left_out_fills_a_row() -> None:
    far = Rule(Is("distance", "far"), (Consequent("force_x", "PS", 0.5),))
    rules = (*FORCE_X.rules[:7], *FORCE_X.rules[8:15], far)
    ax = rule_matrix(replace(FORCE_X, rules=rules), Figure().subplots())
    words = [text.get_text().replace("\n", " ") for text in ax.texts]
    assert words[7] == "no rule"
    assert words[15:20] == ["PS × 0.5"] * 5
    assert words[20:] == ["no rule"] * 5


def test_one_input_makes_one_row() -> None:
    ax = rule_matrix(one_input_system(), Figure().subplots())
    assert [text.get_text() for text in ax.texts] == ["PL", "PS", "ZE", "NS", "NL"]
    assert ax.get_ylabel() == ""


def with_rule(antecedent: Expression) -> FuzzySystem:
    """The force system with one more rule."""
    rule = Rule(antecedent, (Consequent("force_x", "NL"),))
    return replace(FORCE_X, rules=(*FORCE_X.rules, rule))


@pytest.mark.parametrize(
    "system",
    [
        ROOM,
        with_rule(FORCE_X.rules[0].antecedent),
        with_rule(And((Is("distance", "near"), Is("distance", "far")))),
        replace(FORCE_X, rules=FORCE_X.rules[:9]),
    ],
)
def test_rules_that_are_no_table_are_not_drawn(system: FuzzySystem) -> None:
    with pytest.raises(ValueError, match="not a full table; print them"):
        rule_matrix(system, Figure().subplots())
    assert list(rules_figures(system)) == []


def test_firing_along_a_flight_is_what_was_logged_the_most_used_rule_first(tmp_path) -> None:  # type: ignore[no-untyped-def]
    flown = read_flight(log_flight(tmp_path / "a.mcap", PAPER_LIKE, num_samples=12))[0]
    figure = Figure()
    ax = firing_map(flown.system, flown.time_s, flown.firing_strengths, figure.subplots(), most_rules=7)
    means = flown.firing_strengths.mean(axis=0)
    order = np.argsort(-means, kind="stable")[:7]
    drawn = np.asarray(ax.collections[0].get_array()).reshape(7, 12)
    np.testing.assert_array_equal(drawn, flown.firing_strengths[:, order].T)
    labels = [label.get_text().replace("\n", " ") for label in ax.get_yticklabels()]
    for label, index in zip(labels, order, strict=True):
        share = 100 * means[index] / means.sum()
        assert label.startswith(f"{index + 1}: ")
        assert label.endswith(f"({share:.0f}\xa0%)") or "…" in label
    assert ax.yaxis_inverted()
    rest = 100 * (1 - means[order].sum() / means.sum())
    assert ax.get_title(loc="right") == f"18 more rules share {rest:.1f} %"
    assert ax.get_ylabel() == "distance · velocity_body_x → force_x"
    # each strength holds until the next time, the last as long as the one before
    assert ax.get_xlim() == (0.0, 120.0)


def test_a_flight_on_which_nothing_fires_is_drawn_empty() -> None:
    ax = firing_map(FORCE_X, np.arange(2.0), np.zeros((2, 25)), Figure().subplots())
    assert not [label for label in ax.get_yticklabels() if label.get_text()]


def test_rules_are_named_in_few_words() -> None:
    first, second = rule_names(ROOM)
    assert second == "2: hot · any → heat low × 0.75, vent open"
    assert first.startswith("1: temperature is cold and (wind is calm or temperature is not hot) → heat high")


NASTY = 'a_b & 50 % <i>{x}</i> \\cmd $5^2$ #1 ~ | "q" *'


def assert_is_latex(source: str) -> None:
    """Braces and environments balance, commands are of LaTeX, booktabs and longtable, rows are whole."""
    bare = re.sub(r"(?m)^%.*$", "", source)
    commands = set(re.findall(r"\\([A-Za-z]+)", bare))
    assert commands <= {
        *("begin", "end", "section", "subsection", "subsubsection", "small", "scriptsize", "linewidth"),
        *("toprule", "midrule", "bottomrule", "cmidrule", "multicolumn", "endhead", "endlastfoot"),
        *("textbackslash", "textasciicircum", "textasciitilde", "textless", "textgreater", "textbar"),
    }
    characters = re.sub(r"\\[\\{}$&#%_]", " ", bare)
    assert not re.search(r"[$#~^_%]", characters)
    depths = list(accumulate((character == "{") - (character == "}") for character in characters))
    assert min(depths) >= 0 == depths[-1]
    opened: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{(\w+)\}", bare):
        if kind == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert opened == []
    table = r"\\begin\{(?:tabular|longtable)\}\{((?:[lr]|p\{[^}]*\})+)\}(.*?)\\end"
    for columns, body in re.findall(table, bare, re.DOTALL):
        width = len(re.sub(r"p\{[^}]*\}", "p", columns))
        rows = re.findall(r"(?m)^(.*) \\\\$", body)
        assert rows
        for row in rows:
            spanned = sum(int(number) - 1 for number in re.findall(r"\\multicolumn\{(\d+)\}", row))
            assert len(re.findall(r"(?<!\\)&", row)) + 1 + spanned == width


def test_latex_is_whole() -> None:
    written = text.write_latex(outline(PAPER_LIKE))
    assert_is_latex(written)
    assert r" & \multicolumn{5}{c}{velocity\_body\_x} \\" in written
    assert "\nfar & PL & PS & PS & ZE & NS \\\\\n" in written
    assert "longtable}{" not in written
    nasty = FuzzyController(NASTY, (with_input(ROOM, description=NASTY),), (("key", NASTY),))
    assert_is_latex(text.write_latex(outline(nasty)))


def test_latex_rows_that_begin_like_an_option_are_kept() -> None:
    starred = with_input(ROOM, terms=(replace(ROOM.inputs[0].terms[0], name="*"),))
    controller = FuzzyController("c", (starred,))
    written = text.write_latex(outline(controller))
    assert "\n{*} & trapezoid" in written
    assert "{[warm up] If" in written


def test_an_uneven_universe_is_told_as_one() -> None:
    uneven = with_input(FORCE_X, points=(0.0, 10.0, 50.0, 200.0), num_points=4)
    controller = FuzzyController("uneven", (uneven,))
    for write in (text.write, text.write_markdown, html.page, text.write_latex):
        assert write(outline(controller)).count("From 0 to 200, 4 uneven points") == 1
