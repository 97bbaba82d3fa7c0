"""Rule tables for other readers: whole, escaped, and in the order of importance where that is given."""

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fis_tools.__main__ import main
from fis_tools.analysis.contribution import importance
from fis_tools.analysis.flights import inputs_along
from fis_tools.document import html, text
from fis_tools.engines.compiler import compile as compiled
from fis_tools.formats import csv as csv_format
from fis_tools.formats.serialize import dump_yaml
from fis_tools.model import FuzzyController
from fis_tools.words.text import outline, ranked, rule_list
from tests.fis_tools.analysis.test_flights import log_flight
from tests.fis_tools.sample_controllers import force_x_system, general_controller, paper_like_controller

NASTY = 'a_b & 50 % <i>{x}</i> \\cmd $5^2$ #1 ~ | "q" *'


def shares() -> dict[str, np.ndarray]:
    """Rule 25 of force_x matters most, then 24, and so on; force_z is left as it is."""
    return {"force_x": np.linspace(0.0, 0.12, 25)}


def nasty_controller() -> FuzzyController:
    system = general_controller().systems[0]
    described = replace(system.inputs[0], description=NASTY)
    return FuzzyController(
        NASTY, (replace(system, inputs=(described, *system.inputs[1:])),), (("key", NASTY),)
    )


def test_rules_keep_their_order_without_importance() -> None:
    assert [entry.number for entry in ranked(force_x_system(), None)] == list(range(1, 26))
    assert [entry.number for entry in ranked(force_x_system(), {"other": np.zeros(3)})] == list(range(1, 26))


def test_rules_that_matter_most_come_first() -> None:
    system = general_controller().systems[0]
    entries = ranked(system, {"room": np.array([[0.01, 0.02], [0.3, 0.0]])})
    assert [(entry.number, entry.importance) for entry in entries] == [(2, 0.3), (1, 0.02)]
    assert [entry.importance_words for entry in entries] == ["30.00 %", "2.00 %"]
    tiny = ranked(system, {"room": np.array([0.0, 1e-6])})
    assert [entry.importance_words for entry in tiny] == ["< 0.01 %", "0.00 %"]
    tied = ranked(system, {"room": np.zeros(2)})
    assert [entry.number for entry in tied] == [1, 2]
    with pytest.raises(ValueError, match="one number for each of its 2 rules"):
        ranked(system, {"room": np.zeros(3)})


def test_csv_has_a_column_and_the_order() -> None:
    plain = list(csv.DictReader(io.StringIO(csv_format.write(paper_like_controller()))))
    assert "importance" not in plain[0]
    rows = list(csv.DictReader(io.StringIO(csv_format.write(paper_like_controller(), shares()))))
    of_x = [row for row in rows if row["system"] == "force_x"]
    assert [int(row["rule"]) for row in of_x] == list(range(25, 0, -1))
    assert float(of_x[0]["importance"]) == 0.12
    assert [row["rule"] for row in rows[25:]] == [str(number) for number in range(1, 46)]
    assert {row["importance"] for row in rows[25:]} == {""}


def test_text_and_markdown_list_rules_by_importance() -> None:
    told = text.write(rule_list(paper_like_controller(), shares()))
    assert re.search(r"sentence\n +12.00 %    25  If distance is very far and velocity_body_x is to", told)
    assert "   1  If eta_u is left" in told
    written = text.write_markdown(outline(paper_like_controller(), shares()))
    rows = [line for line in written.splitlines() if re.match(r"\| +[\d.]+ %", line)]
    assert len(rows) == 25
    assert re.match(r"\| +12.00 % \| +25 \|", rows[0])
    described = text.write(outline(paper_like_controller(), shares()))
    assert described.count("By importance: ") == 1
    ranking = described[described.index("\n    By importance") : described.index("\nforce_z\n")]
    assert described.replace(ranking, "") == text.write(outline(paper_like_controller()))


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
    assert_is_latex(text.write_latex(outline(nasty_controller(), {"room": np.array([0.1, 0.2])})))


def test_long_latex_tables_break_across_pages() -> None:
    written = text.write_latex(outline(paper_like_controller(), {"force_z": np.linspace(0.0, 1.0, 45)}))
    assert_is_latex(written)
    start = written.index(r"\begin{longtable}")
    assert written.index(r"\endhead", start) < written.index(r"100.00 \% & 45 &", start)
    assert r"\begin{tabular}{rrp" not in written


def test_latex_rows_that_begin_like_an_option_are_kept() -> None:
    system = general_controller().systems[0]
    starred = replace(system.inputs[0], terms=(replace(system.inputs[0].terms[0], name="*"),))
    written = text.write_latex(
        outline(FuzzyController("c", (replace(system, inputs=(starred, system.inputs[1])),)))
    )
    assert "\n{*} & trapezoid" in written
    assert "{[warm up] If" in written


def test_show_lists_rules_by_importance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    controller = paper_like_controller()
    path = tmp_path / "c.yaml"
    path.write_text(dump_yaml(controller), encoding="utf-8")
    flight = log_flight(tmp_path / "a.mcap", controller, num_samples=9)
    sensed = inputs_along([flight])
    along = {s.name: importance(compiled(s), sensed[s.name]) for s in controller.systems}
    assert main(["show", str(path), "--by", "importance", "--flights", str(flight)]) == 0
    assert capsys.readouterr().out == text.write(outline(controller, along))
    assert main(["show", str(flight), "--by", "importance"]) == 0
    assert capsys.readouterr().out == text.write(outline(controller, along))
    assert main(["show", str(path), "--by", "importance", "--system", "force_x"]) == 0
    spread = capsys.readouterr().out
    assert "By importance: " in spread
    assert spread != text.write(outline(controller, along))
    assert main(["show", str(path), "--flights", str(flight)]) == 2
    assert "--by importance; add it" in capsys.readouterr().err


def test_export_orders_by_importance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    controller = paper_like_controller()
    path = tmp_path / "c.yaml"
    path.write_text(dump_yaml(controller), encoding="utf-8")
    flight = log_flight(tmp_path / "a.mcap", controller, num_samples=9)
    sensed = inputs_along([flight])
    along = {s.name: importance(compiled(s), sensed[s.name]) for s in controller.systems}
    told = outline(controller, along)
    for form, expected in (
        ("csv", csv_format.write(controller, along)),
        ("latex", text.write_latex(told)),
        ("html", html.page(told)),
    ):
        words = ["export", str(path), "--format", form, "--by", "importance", "--flights", str(flight)]
        assert main(words) == 0
        assert capsys.readouterr().out == expected


def test_an_uneven_universe_is_told_as_one() -> None:
    system = force_x_system()
    points = (0.0, 10.0, 50.0, 200.0)
    uneven = replace(system.inputs[0], points=points, num_points=4)
    controller = FuzzyController("uneven", (replace(system, inputs=(uneven, *system.inputs[1:])),))
    for write in (text.write, text.write_markdown, html.page, text.write_latex):
        assert write(outline(controller)).count("From 0 to 200, 4 uneven points.") == 1
