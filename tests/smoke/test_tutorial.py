"""The tutorials about flights tell what happens to somebody who follows them."""

import re
import shlex
import shutil
from glob import glob
from pathlib import Path

import pytest

import fis_tools.__main__ as review
from docs.shown import BLOCK, LEFT_OUT, WIDTH, shown
from pipeline.command_line import cli
from tests.smoke.command_line import PROJECT
from tests.smoke.pages import DOCS, FOLLOWED

PAGE = (DOCS / "tutorial" / "fly-and-review.md").read_text(encoding="utf-8")
FEWER_STAGES = "stages=[scenario,evaluate]"


@pytest.mark.slow
def test_the_changed_rule_does_what_the_tutorial_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", WIDTH)
    shipped = (PROJECT / "conf" / "controller" / "paper_champion.yaml").read_text(encoding="utf-8")
    (row,) = re.findall(r"^.*# distance near$", PAGE, re.MULTILINE)
    changed, num_rows = re.subn(r"^.*# distance near$", row, shipped, flags=re.MULTILINE)
    assert num_rows == 1
    (tmp_path / "mine.yaml").write_text(changed, encoding="utf-8")

    explained, compared, *_ = (
        text for language, _, text in BLOCK.findall(PAGE) if "force_x" in text and language == "text"
    )
    assert review.main(["diff", str(PROJECT / "conf/controller/paper_champion.yaml"), "mine.yaml"]) == 0
    assert shown(compared, capsys.readouterr().out)

    for name, expected in (("paper_champion", "1.079 m/s"), ("mine.yaml", "1.084 m/s")):
        assert cli.main(["+experiment=fly", f"controller={name}"]) == 0
        assert f"episodes/start.mcap: 98 of 99 points, {expected}" in "".join(capsys.readouterr())
        assert f"98 of 99 points, {expected}" in PAGE
        if name == "paper_champion":
            assert review.main(["explain", *glob("outputs/fly/*/episodes/start.mcap")]) == 0
            assert shown(explained, capsys.readouterr().out)
        words = ("+experiment=evaluate", f"controller={name}", "monte_carlo.num_cases=200", FEWER_STAGES)
        assert cli.main(list(words)) == 0
        (line,) = re.findall(r"200 cases in \S+ s, (.*)", "".join(capsys.readouterr()))
        assert line in PAGE


@pytest.mark.slow
def test_your_own_case_goes_as_the_tutorial_says(tmp_path, monkeypatch, capsys):
    """Its training may end elsewhere on another processor: from there on, numbers may differ."""
    shutil.copytree(PROJECT / "conf" / "controller", tmp_path / "conf" / "controller")
    monkeypatch.chdir(tmp_path)
    mains = {"pipeline": cli.main, "fis_tools": review.main}
    printed, num_compared, successes, of_numbers = "", 0, [], r"(?<=cases in )\S+"
    for language, title, text in BLOCK.findall(FOLLOWED.read_text(encoding="utf-8")):
        if title:
            Path(title).parent.mkdir(parents=True, exist_ok=True)
            Path(title).write_text(text, encoding="utf-8")
        elif language == "sh":
            for _, _, module, *words in map(shlex.split, text.replace("\\\n", "").splitlines()):
                fewer = [FEWER_STAGES] if "+experiment=evaluate" in words else []
                assert mains[module]([*words, *fewer]) == 0
                of_numbers = r"[\d.,]+" if "+experiment=train_station" in words else of_numbers
            out = "".join(capsys.readouterr())
            successes += re.findall(r"cases in .* success (\S+) %", out)
            printed = re.sub(of_numbers, "#", out)
        elif language == "text":
            for part in text.split(LEFT_OUT):
                assert re.sub(of_numbers, "#", part) in printed
                num_compared += bool(part)
    assert num_compared == 7
    before, after = map(float, successes)
    assert after > before + 15.0


def test_the_gallery_has_never_heard_of_space():
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    words = r"\b(chief|deputy|orbit|space\w*|satellite|flights?|thrusters?|camera)\b"
    assert re.findall(words, text, re.IGNORECASE) == []
