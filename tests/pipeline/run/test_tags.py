"""What a user notes about a run stands beside its results; no result depends on it, and it is data."""

import json
import re
from pathlib import Path

import pytest

from pipeline.command_line.results import PAGE, RUNS
from pipeline.run import artifacts, configuration, manifests, sweep, tables
from pipeline.settings.schema import differences
from pipeline.settings.types import MOST_TAG, MOST_TAG_NAME
from plain_files.plain_text import MISSING_SIGN
from tests.pipeline.command_line.cases import EVALUATE, FLY, use_stages


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_tags_are_kept_and_no_result_depends_on_them(ran, monkeypatch):
    use_stages(monkeypatch)
    ran(*EVALUATE, "hydra.run.dir=plain")
    ran(*EVALUATE, "+tags.campaign=spring", "+tags.number=7", "+tags.why='a, b'", "hydra.run.dir=noted")
    plain, noted = (manifests.read(Path(name)) for name in ("plain", "noted"))
    assert noted["tags"] == {"campaign": "spring", "number": "7", "why": "a, b"}
    assert "tags" not in plain
    assert plain["config_hash"] == noted["config_hash"]
    # the same run: it may be begun again by either command
    ran(*EVALUATE, "stages=[report]", "hydra.run.dir=noted")
    folder = Path(ran("again", "noted").out.strip())
    assert manifests.read(folder)["tags"] == noted["tags"]


def test_a_resumed_run_takes_further_tags(ran, monkeypatch):
    def stop(_experiment, _folder):
        raise KeyboardInterrupt

    use_stages(monkeypatch, evaluate=stop)
    ran(*EVALUATE, "+tags.campaign=spring", "hydra.run.dir=run", code=130)
    use_stages(monkeypatch)
    ran("resume=run", "+tags.late=yes")
    assert manifests.read(Path("run"))["tags"] == {"campaign": "spring", "late": "yes"}


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("tags.campaign=spring", "write +tags..., with a plus"),
        ("+tags.a.b=1", "tags.a is \"{'b': 1}\"; it must be a text of one line"),
        ("tags=spring", "tags is 'spring'; it must be a group of names"),
        ("+tags.a=[1,2]", "tags.a is '[1, 2]'; it must be a text of one line"),
        ("+tags.a='x\x1b[31m'", "printable characters"),
        ("+tags.a='x\u202e'", "printable characters"),
        (f"+tags.a={'x' * (MOST_TAG + 1)}", f"of at most {MOST_TAG} printable characters"),
        (f"+tags.{'a' * (MOST_TAG_NAME + 1)}=x", "a name is a letter and at most"),
        ("+tags._a=x", "tags has the name '_a'; a name is a letter"),
    ],
)
def test_what_is_no_note_is_refused(word, message, ran, monkeypatch):
    use_stages(monkeypatch)
    said = ran(*EVALUATE, word, code=2).err
    assert message in said
    assert not set(said) & {"\x1b", "\u202e"}
    assert not Path("outputs").exists()


def test_a_sweep_tells_its_tags(ran, monkeypatch):
    use_stages(monkeypatch)
    ran("-m", *FLY, "seed=1,2", "+tags.campaign=spring", "hydra.sweep.dir=laws")
    ran("-m", *FLY, "+tags.attempt=first,second", "seed=3", "hydra.sweep.dir=laws")
    assert [run.folder for run in sweep.read(Path("laws"))] == [
        *("seed=1", "seed=2", "tags.attempt=first", "tags.attempt=second")
    ]
    # what somebody else wrote there
    path = Path("laws", "seed=2", artifacts.MANIFEST)
    forged = {"campaign": "<b>\x1b[31m\u202e", "more": "=1+1"}
    path.write_text(json.dumps(json.loads(path.read_text()) | {"tags": forged}))
    printed, columns = ran("summary", "laws").out, tables.read_parquet(Path("laws"), RUNS)
    cleaned = f"<b>{MISSING_SIGN}[31m{MISSING_SIGN}"
    assert list(columns["tags.campaign"]) == ["spring", cleaned, "", ""]
    assert list(columns["tags.more"]) == ["", "=1+1", "", ""]
    assert list(columns["tags.attempt"]) == ["", "", "first", "second"]
    assert re.search(r"run +tags\.campaign +tags\.more +state", printed)
    assert re.search(r"seed=1 +spring +done", printed)
    page = Path("laws", PAGE).read_text(encoding="utf-8")
    for text in (printed, page):
        assert not set(text) & {"\x1b", "\u202e"}
    assert "<b>" not in page
    path.write_text(json.dumps(json.loads(path.read_text()) | {"tags": {"campaign": ["x"]}}))
    assert "left out: seed=2: " in (left_out := ran("summary", "laws").out)
    assert "is damaged, it has no proper tags" in left_out


def test_two_runs_side_by_side_tell_their_tags(ran):
    small = ["stages=[scenario,evaluate]", "monte_carlo.num_cases=3", "duration_s=300"]
    for name in ("spring", "autumn"):
        ran(*EVALUATE, *small, f"+tags.campaign={name}", f"hydra.run.dir={name}")
        assert artifacts.read_json(Path(name), artifacts.SUMMARY)["tags"] == {"campaign": name}
    assert "they differ in tags.campaign (A spring, B autumn)\n" in ran("compare=spring,autumn").out
    ran("repeat", "spring", "report")
    page = Path("spring", artifacts.REPORT).read_text(encoding="utf-8")
    assert re.search(r"Noted about this run:.*?campaign.*?spring", page, re.DOTALL)
    assert configuration.read(Path("spring"))["tags"] == {"campaign": "spring"}


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"name": "b"}, ["controller (A a, B b)"]),
        ({"name": "a", "x": 1}, ["controller (A {'name': 'a'}, B {'name': 'a', 'x': 1})"]),
    ],
)
def test_controllers_are_told_by_their_names_unless_these_are_the_same(other, words):
    runs = {"controller": {"name": "a"}}, {"controller": other}
    assert differences(*runs, but=(), words=("A", "B")) == words
