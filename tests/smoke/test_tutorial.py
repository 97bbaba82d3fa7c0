"""The first tutorial tells what happens to somebody who follows it."""

import re

import pytest

import fis_tools.__main__ as review
from pipeline.command_line import cli
from tests.smoke.command_line import PROJECT
from tests.smoke.pages import DOCS

PAGE = (DOCS / "tutorial" / "fly-and-review.md").read_text(encoding="utf-8")
FEWER_STAGES = "stages=[scenario,evaluate]"


@pytest.mark.slow
def test_the_changed_rule_does_what_the_tutorial_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shipped = (PROJECT / "conf" / "controller" / "paper_champion.yaml").read_text(encoding="utf-8")
    (row,) = re.findall(r"^.*# distance near$", PAGE, re.MULTILINE)
    changed, num_rows = re.subn(r"^.*# distance near$", row, shipped, flags=re.MULTILINE)
    assert num_rows == 1
    (tmp_path / "mine.yaml").write_text(changed, encoding="utf-8")

    assert review.main(["diff", str(PROJECT / "conf/controller/paper_champion.yaml"), "mine.yaml"]) == 0
    assert PAGE.partition("```text\nforce_x: 1 of 25")[2].partition("```")[0] in capsys.readouterr().out

    for name, expected in (("paper_champion", "1.079 m/s"), ("mine.yaml", "1.084 m/s")):
        assert cli.main(["+experiment=fly", f"controller={name}"]) == 0
        assert f"episodes/start.mcap: 98 of 99 points, {expected}" in "".join(capsys.readouterr())
        assert f"98 of 99 points, {expected}" in PAGE
        words = ("+experiment=evaluate", f"controller={name}", "monte_carlo.num_cases=200", FEWER_STAGES)
        assert cli.main(list(words)) == 0
        (line,) = re.findall(r"200 cases in \S+ s, (.*)", "".join(capsys.readouterr()))
        assert line in PAGE


def test_the_gallery_has_never_heard_of_space():
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    words = r"\b(chief|deputy|orbit|space\w*|satellite|flights?|thrusters?|camera)\b"
    assert re.findall(words, text, re.IGNORECASE) == []
