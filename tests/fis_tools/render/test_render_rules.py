"""Rules as tables, and how much they are used."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from fis_tools.analysis.flights import read_flight
from fis_tools.document import html, text
from fis_tools.model import And, Consequent, FuzzyController, FuzzySystem, Is, Rule
from fis_tools.render import rule_matrix, rules_figures
from fis_tools.render.rules import firing_map, rule_names
from fis_tools.render.theme import contrast, luminance, term_colours
from fis_tools.words.text import outline
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.render.picture_systems import one_input_system, room_system
from tests.fis_tools.sample_controllers import (
    force_x_system,
    force_z_system,
    general_controller,
    paper_like_controller,
)


def test_the_rule_matrix_holds_every_consequent_at_its_place() -> None:
    system = force_x_system()
    ax = rule_matrix(system, Figure().subplots())
    assert [text.get_text() for text in ax.texts] == [rule.consequents[0].term for rule in system.rules]
    # the rule of the third distance and the fourth velocity stands at column 3, row 2
    assert ax.texts[2 * 5 + 3].get_position() == (3, 2)
    assert [label.get_text().replace("\n", " ") for label in ax.get_xticklabels()][4] == "towards fast"
    assert [label.get_text() for label in ax.get_yticklabels()][1] == "near"
    assert ax.get_ylabel() == "distance"


def test_each_cell_has_the_colour_of_its_word_and_the_word_can_be_read() -> None:
    system = force_x_system()
    ax = rule_matrix(system, Figure().subplots())
    names = [term.name for term in system.outputs[0].terms]
    for label, cell in zip(ax.texts, ax.patches, strict=True):
        face = cell.get_facecolor()[:3]
        assert face == pytest.approx(tuple(term_colours(5)[names.index(label.get_text())]))
        assert contrast(face, label.get_color()) >= 4.5
        x, y = label.get_position()
        assert (cell.get_x() + 0.5, cell.get_y() + 0.5) == (x, y)  # type: ignore[attr-defined]


def test_brightness_alone_orders_the_terms() -> None:
    ax = rule_matrix(force_x_system(), Figure().subplots())
    place = {name: index for index, name in enumerate(("NL", "NS", "ZE", "PS", "PL"))}
    pairs = {
        (place[label.get_text()], round(luminance(cell.get_facecolor()[:3]), 6))
        for label, cell in zip(ax.texts, ax.patches, strict=True)
    }
    brightness = [value for _, value in sorted(pairs)]
    assert len(brightness) == 5
    assert brightness == sorted(brightness)


def test_a_third_input_needs_a_term() -> None:
    system = force_z_system()
    ax = rule_matrix(system, Figure().subplots(), {"eta_u": "right"})
    assert [text.get_text() for text in ax.texts] == [r.consequents[0].term for r in system.rules[30:]]
    with pytest.raises(ValueError, match="for one term of 'eta_u'; fix it to one of left, ahead, right"):
        rule_matrix(system, Figure().subplots())
    with pytest.raises(ValueError, match="no output 'force_y'; did you mean 'force_z'"):
        rule_matrix(system, Figure().subplots(), {"eta_u": "left"}, output="force_y")


def test_cells_without_a_rule_say_so_and_an_input_left_out_fills_a_row() -> None:
    system = force_x_system()
    rules = (
        *(rule for rule in system.rules[:15] if rule != system.rules[7]),
        Rule(Is("distance", "far"), (Consequent("force_x", "PS", 0.5),)),
    )
    ax = rule_matrix(replace(system, rules=rules), Figure().subplots())
    words = [text.get_text().replace("\n", " ") for text in ax.texts]
    assert words[7] == "no rule"
    assert words[15:20] == ["PS × 0.5"] * 5
    assert words[20:] == ["no rule"] * 5


def test_one_input_makes_one_row() -> None:
    ax = rule_matrix(one_input_system(), Figure().subplots())
    assert [text.get_text() for text in ax.texts] == ["PL", "PS", "ZE", "NS", "NL"]
    assert ax.get_ylabel() == ""


def contradicting() -> FuzzySystem:
    system = force_x_system()
    return replace(
        system, rules=(*system.rules, replace(system.rules[0], consequents=(Consequent("force_x", "NL"),)))
    )


def repeated() -> FuzzySystem:
    system = force_x_system()
    twice = And((Is("distance", "near"), Is("distance", "far")))
    return replace(system, rules=(*system.rules, Rule(twice, (Consequent("force_x", "NL"),))))


@pytest.mark.parametrize(
    "system",
    [room_system(), contradicting(), repeated(), replace(force_x_system(), rules=force_x_system().rules[:9])],
)
def test_rules_that_are_no_table_are_not_drawn(system: FuzzySystem) -> None:
    with pytest.raises(ValueError, match="not a full table; print them"):
        rule_matrix(system, Figure().subplots())
    assert list(rules_figures(system)) == []


def test_firing_along_a_flight_is_what_was_logged_the_most_used_rule_first(tmp_path) -> None:  # type: ignore[no-untyped-def]
    flown = read_flight(log_flight(tmp_path / "a.mcap", paper_like_controller(), num_samples=12))[0]
    figure = Figure()
    ax = firing_map(flown.system, flown.time_s, flown.firing_strengths, figure.subplots(), most_rules=7)
    means = flown.firing_strengths.mean(axis=0)
    order = np.argsort(-means, kind="stable")[:7]
    drawn = np.asarray(ax.collections[0].get_array()).reshape(7, 12)
    np.testing.assert_array_equal(drawn, flown.firing_strengths[:, order].T)
    labels = [label.get_text().replace("\n", " ") for label in ax.get_yticklabels()]
    for label, place in zip(labels, order, strict=True):
        share = 100 * means[place] / means.sum()
        assert label.startswith(f"{place + 1}: ")
        assert label.endswith(f"({share:.0f}\xa0%)") or "…" in label
    assert ax.yaxis_inverted()
    rest = 100 * (1 - means[order].sum() / means.sum())
    assert ax.get_title(loc="right") == f"18 more rules share {rest:.1f} %"
    assert ax.get_ylabel() == "distance · velocity_body_x → force_x"
    # each strength holds until the next time, the last as long as the one before
    assert ax.get_xlim() == (0.0, 120.0)


def test_a_flight_on_which_nothing_fires_is_drawn_empty() -> None:
    ax = firing_map(force_x_system(), np.arange(2.0), np.zeros((2, 25)), Figure().subplots())
    assert not [label for label in ax.get_yticklabels() if label.get_text()]


def test_rules_are_named_in_few_words() -> None:
    first, second = rule_names(room_system())
    assert second == "2: hot · any → heat low × 0.75, vent open"
    assert first.startswith("1: temperature is cold and (wind is calm or temperature is not hot) → heat high")


NASTY = 'a_b & 50 % <i>{x}</i> \\cmd $5^2$ #1 ~ | "q" *'


def nasty_controller() -> FuzzyController:
    system = general_controller().systems[0]
    described = replace(system.inputs[0], description=NASTY)
    return FuzzyController(
        NASTY, (replace(system, inputs=(described, *system.inputs[1:])),), (("key", NASTY),)
    )


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
    depth = 0
    for character in characters:
        depth += (character == "{") - (character == "}")
        assert depth >= 0
    assert depth == 0
    opened: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{(\w+)\}", bare):
        if kind == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert opened == []
    for columns, body in re.findall(
        r"\\begin\{(?:tabular|longtable)\}\{((?:[lr]|p\{[^}]*\})+)\}(.*?)\\end", bare, re.DOTALL
    ):
        width = len(re.sub(r"p\{[^}]*\}", "p", columns))
        rows = re.findall(r"(?m)^(.*) \\\\$", body)
        assert rows
        for row in rows:
            spanned = sum(int(number) - 1 for number in re.findall(r"\\multicolumn\{(\d+)\}", row))
            assert len(re.findall(r"(?<!\\)&", row)) + 1 + spanned == width


def test_latex_is_whole() -> None:
    written = text.write_latex(outline(paper_like_controller()))
    assert_is_latex(written)
    assert r" & \multicolumn{5}{c}{velocity\_body\_x} \\" in written
    assert "\nfar & PL & PS & PS & ZE & NS \\\\\n" in written
    assert "longtable}{" not in written
    assert_is_latex(text.write_latex(outline(nasty_controller())))


def test_latex_rows_that_begin_like_an_option_are_kept() -> None:
    system = general_controller().systems[0]
    starred = replace(system.inputs[0], terms=(replace(system.inputs[0].terms[0], name="*"),))
    written = text.write_latex(
        outline(FuzzyController("c", (replace(system, inputs=(starred, system.inputs[1])),)))
    )
    assert "\n{*} & trapezoid" in written
    assert "{[warm up] If" in written


def test_an_uneven_universe_is_told_as_one() -> None:
    system = force_x_system()
    points = (0.0, 10.0, 50.0, 200.0)
    uneven = replace(system.inputs[0], points=points, num_points=4)
    controller = FuzzyController("uneven", (replace(system, inputs=(uneven, *system.inputs[1:])),))
    for write in (text.write, text.write_markdown, html.page, text.write_latex):
        assert write(outline(controller)).count("From 0 to 200, 4 uneven points.") == 1
