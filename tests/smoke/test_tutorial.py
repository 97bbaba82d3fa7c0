"""The tutorials about flights, and the first hour, tell what happens to somebody who follows them."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from glob import glob
from pathlib import Path

import pytest

import fis_tools.__main__ as review
from docs.scripts.shown import BLOCK, LEFT_OUT, WIDTH, shown
from pipeline.command_line import cli
from telemetry import commands as telemetry
from tests import night
from tests.places import PROJECT
from tests.smoke.pages import DOCS, FOLLOWED

PAGE = (DOCS / "tutorial" / "fly-and-review.md").read_text(encoding="utf-8")
FEWER_STAGES = "stages=[scenario,evaluate]"
#: what a reader waits for: by day a shorter training, and short searches, of which the page shows no number
SHORTER = {
    "+experiment=train_station": ["starts.num_cases=80", "optimizer.validation_cases=200"],
    "+experiment=assure": ["assurance.searches=1", "assurance.search_generations=4"],
}
FEWER = {"+experiment=evaluate": [FEWER_STAGES]} | ({} if night.IS_WHOLE else SHORTER)


@pytest.mark.slow
def test_the_changed_rule_does_what_the_tutorial_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", WIDTH)
    shipped = (PROJECT / "conf" / "controller" / "paper_champion.yaml").read_text(encoding="utf-8")
    (row,) = re.findall(r"^.*# distance near$", PAGE, re.MULTILINE)
    changed, num_rows = re.subn(r"^.*# distance near$", row, shipped, flags=re.MULTILINE)
    assert num_rows == 1
    (tmp_path / "mine.yaml").write_text(changed, encoding="utf-8")

    texts = [text for language, _, text in BLOCK.findall(PAGE) if language == "text"]
    explained, compared, *_ = (text for text in texts if "force_x" in text)
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
                fewer = [each for name, more in FEWER.items() if name in words for each in more]
                assert mains[module]([*words, *fewer]) == 0
                of_numbers = r"[\d.,]+" if "+experiment=train_station" in words else of_numbers
            out = "".join(capsys.readouterr())
            successes += re.findall(r"cases in .* success (\S+) %", out)
            printed = re.sub(of_numbers, "#", out)
        elif language == "text":
            for part in text.split(LEFT_OUT):
                assert re.sub(of_numbers, "#", part) in printed
                num_compared += bool(part)
    assert num_compared == 9
    before, after = map(float, successes)
    assert after > before + 15.0


@pytest.mark.slow
@pytest.mark.parametrize("steps", [("flight", "start", "rule"), ("sweep", "evidence"), ("review", "learn")])
def test_the_first_hour_goes_as_its_script_plays_it(steps, tmp_path):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"FIRST_HOUR": str(tmp_path), "FIRST_HOUR_CASES": "20", "PATH": path}
    script = [str(PROJECT / "docs" / "scripts" / "first_hour.sh"), *steps]
    done = subprocess.run(script, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    measured = r"^== .+: [\d.]+ s of processor time, \d+ MB of memory, [\d.]+ MB written$"
    assert len(re.findall(measured, done.stdout, re.MULTILINE)) >= len(steps)
    # a flight says how to watch it
    replays = re.findall(r"python -m telemetry (replay \S+\.mcap)", done.stderr + done.stdout)
    assert replays or "flight" not in steps
    for command in replays[:1]:
        assert telemetry.main([*shlex.split(command), "--save", str(tmp_path / "flight.rrd")]) == 0
        assert (tmp_path / "flight.rrd").stat().st_size > 0
