"""Which tests a run takes: none is lost between shards, and those near a change come first."""

import re
from collections import Counter
from types import SimpleNamespace

import pytest

from benchmarks import planted
from tests import durations
from tests.distance import distances
from tests.places import PROJECT
from tests.selection import DEAR_S, PLAN, Plan, dearest_first, nearest, select, shard_of

FILES = sorted(path.relative_to(PROJECT).as_posix() for path in (PROJECT / "tests").rglob("test_*.py"))


@pytest.mark.parametrize("count", [1, 2, 4, 7])
def test_each_file_is_in_one_shard_and_no_shard_is_empty(count):
    parts = shard_of(FILES, count)
    assert parts.keys() == set(FILES)
    assert set(parts.values()) == set(range(1, count + 1))


def test_shards_take_equally_long():
    known = durations.read()
    seconds = Counter()
    for file, part in shard_of(FILES, 4).items():
        seconds[part] += sum(s for speed in durations.SPEEDS for s, _ in known[speed].get(file, {}).values())
    assert max(seconds.values()) < 1.1 * min(seconds.values())


def test_no_dear_test_is_begun_when_others_have_nothing_left_to_do(monkeypatch):
    cheap, dear, dearer = ({"test_it": (each, 1)} for each in (0.1, DEAR_S, 2.0 * DEAR_S))
    known = {"fast": {"b": cheap, "c": dear}, "slow": {"d": dearer, "e": {"test_it": (2.0 * DEAR_S, 10)}}}
    monkeypatch.setattr(durations, "read", lambda: known)
    assert dearest_first(["a", "b", "c", "d", "e"]) == ["d", "c", "a", "b", "e"]


def test_all_tests_are_taken_once_each_with_those_of_its_file():
    functions = [(file, str(n)) for n in range(3) for file in FILES]
    items = [SimpleNamespace(nodeid="::".join(function)) for function in functions]
    option, deselected = SimpleNamespace(shard=None), []
    hook = SimpleNamespace(pytest_deselected=lambda *, items: deselected.extend(items))
    config = SimpleNamespace(stash={PLAN: Plan("all")}, option=option, hook=hook)
    select(config, items)
    assert not deselected
    taken = [durations.function_of(item.nodeid) for item in items]
    assert sorted(taken) == sorted(functions)
    assert taken == [(file, str(n)) for file in dearest_first(FILES) for n in range(3)]


@pytest.mark.parametrize(
    "module",
    ["pipeline/evaluation/statistics.py", "pipeline/recording/events.py", "telemetry/file/reader.py"],
)
def test_what_imports_a_module_is_one_step_from_it(module):
    """By the words of the imports, which the graph is not asked for."""
    folder, name = module.removesuffix(".py").replace("/", ".").rsplit(".", 1)
    imports = re.compile(
        rf"^\s*(from {folder} import .*\b{name}\b|(from|import) {folder}\.{name}\b)", re.MULTILINE
    )
    direct = {file for file in FILES if imports.search((PROJECT / file).read_text(encoding="utf-8"))}
    steps = distances([module])
    assert direct
    assert {steps[file] for file in direct} == {(1, 1)}


def test_a_changed_test_comes_first_and_another_file_leads_to_those_that_name_it():
    assert distances([FILES[0]])[FILES[0]] == (0, 1)
    near = distances(["conf/controller/champion_leo.yaml"])
    assert near["tests/pipeline/command_line/test_conf.py"].steps <= 2
    assert not distances(["no/such/file.bin"]).keys() - set(FILES)


def test_the_nearest_come_first_and_the_budget_holds():
    module = "pipeline/evaluation/statistics.py"
    known, steps = durations.read()["fast"], distances([module])
    chosen = nearest([module], known, 10.0)
    assert sum(known[file][name][0] for file, names in chosen.items() for name in names) <= 10.0
    assert [steps[file] for file in chosen] == sorted(steps[file] for file in chosen)
    assert next(iter(chosen)) == "tests/pipeline/evaluation/test_statistics.py"
    assert not nearest([module], known, 0.0, of_file_s=1.0)


def test_what_is_near_to_more_of_the_changed_files_comes_first():
    """A law of thrusters without its bound: what compares the two imports most of what the law changes."""
    patch, bound = planted.LAW
    changed = re.findall(r"^\+\+\+ b/(\S+)", (PROJECT / patch).read_text(encoding="utf-8"), re.MULTILINE)
    assert bound in changed
    first = next(iter(nearest([path for path in changed if path != bound], durations.read()["slow"], 100.0)))
    assert first == "tests/pipeline/flight/test_bounds_hold.py"


def test_what_collecting_takes_is_no_test_s():
    recorder = object.__new__(durations.Recorder)  # one that measures nothing itself
    recorder._last_s, recorder._spent = 1.0, iter((21.0, 24.0)).__next__
    recorder.pytest_collection_finish()
    made = recorder.pytest_runtest_makereport(None)
    next(made)
    with pytest.raises(StopIteration) as ended:
        made.send(SimpleNamespace())
    assert ended.value.value.processor_s == 3.0


class _Item:
    """A test of pytest's, as far as it is selected."""

    def __init__(self, nodeid):
        self.nodeid, self.marked, self.keywords = nodeid, [], {}
        self.add_marker, self.get_closest_marker = self.marked.append, lambda name: name in self.marked


def test_what_takes_long_is_slow_though_nobody_marked_it_and_fast_again_once_it_is_quick(monkeypatch):
    limit = durations.SLOW_S
    known = {"fast": {"a": {"long": (2.1 * limit, 2), "short": (0.9 * limit, 1)}}, "slow": {"a": {}}}
    monkeypatch.setattr(durations, "read", lambda: known)
    items = [_Item(f"a::{name}") for name in ("long[0]", "short", "long[1]", "new")]
    hook = SimpleNamespace(pytest_deselected=lambda *, items: None)
    select(SimpleNamespace(stash={PLAN: Plan("fast")}, option=None, hook=hook), items)
    assert [item.nodeid for item in items] == ["a::short", "a::new"]

    (item,) = items = [_Item("a::long[0]")]
    select(SimpleNamespace(stash={PLAN: Plan("named")}, option=None, hook=hook), items)
    assert item.marked == ["slow"]
    recorder = object.__new__(durations.Recorder)
    recorder._measured = {speed: {} for speed in durations.SPEEDS}
    recorder.pytest_runtest_logreport(
        SimpleNamespace(nodeid=item.nodeid, keywords=item.keywords | {"slow": 1}, processor_s=0.1)
    )
    assert recorder._measured == {"fast": {item.nodeid: 0.1}, "slow": {}}


def test_a_file_without_durations_is_taken_whole():
    assert nearest([FILES[0]], {}, 10.0, {FILES[0]: 5.0}) == {FILES[0]: [""]}


def test_most_files_of_tests_are_measured():
    known = durations.read()
    assert len(known["fast"].keys() | known["slow"].keys()) > 0.8 * len(FILES)


@pytest.mark.parametrize(("name", "before", "after"), planted.BUGS)
def test_each_bug_can_be_planted(name, before, after):
    assert (PROJECT / name).read_text(encoding="utf-8").count(before) == 1
    assert before != after
