"""Which tests a run takes that names none, and in what order.

================ ================================================================================
``--all``        all of them; with ``--shard 2/4``, the second of four parts that take equally long
``--changed``    those nearest to the change, as many as end within a minute
without either   the fast ones, and the slow ones nearest to the change: two minutes of processors
================ ================================================================================

What a run names (a file, ``-k``, ``-m``), it takes, slow or not. Git tells which files the change touches,
the import graph how far a test is from them (`tests.distance`), and `tests.durations` how long it takes.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import pytest

from tests import durations
from tests.distance import changed_files, distances, module_of

#: seconds after which no test of `--changed` begins, and those that go by before the first begins
MINUTE_S, START_S = 55.0, 15.0
#: recorded seconds of the slow tests that join the fast ones, on one processor
NEAR_S = 120.0
#: seconds of a file of tests of which nothing is recorded, and in which each process collects a file
OF_A_NEW_FILE_S, OF_COLLECTING_S = 5.0, 0.2
#: seconds of a test that no process shall begin last, while the others have nothing left to do
DEAR_S = 5.0

NONE: Final[Mapping[str, float]] = {}
#: functions of tests by their files, the nearest first; those of a file that is new have no names
Chosen = dict[str, list[str]]
PLAN: Final = pytest.StashKey["Plan"]()
#: until when at least the tests of a process begin
BEGUN: Final = pytest.StashKey[float]()


class Plan(NamedTuple):
    """What a run takes; every process of it has the same."""

    way: str  # "all", "changed", "fast" or "named"
    heading: str = ""
    chosen: Chosen = {}  # noqa: RUF012 - of a tuple, which nobody changes
    ends_at: float = float("inf")


def add_options(parser: pytest.Parser) -> None:
    """Add what a run is asked by."""
    group = parser.getgroup("selection", "which tests a run takes that names none; else the fast ones")
    group.addoption("--all", action="store_true", help="all tests, slow ones too")
    group.addoption("--shard", metavar="N/M", type=_shard, help="with --all: the N-th of M parts")
    meaning = "those nearest to what differs from COMMIT, or from where this branch left main, for a minute"
    group.addoption("--changed", nargs="?", const="", metavar="COMMIT", help=meaning)
    group.addoption("--record", action="store_true", help="measure how long tests take, for durations.json")


def _shard(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise ValueError(text)
    return int(number), int(count)


def planned(config: pytest.Config, num_processes: int) -> Plan:
    """Return what a run takes, from its options and the state of the working tree."""
    option = config.option
    is_named = config.args_source != pytest.Config.ArgsSource.TESTPATHS or option.keyword or option.markexpr
    if option.shard and not option.all:
        raise pytest.UsageError("--shard is a part of all tests; add --all")
    if option.all or (is_named and option.changed is None):
        return Plan("all" if option.all else "named")
    files = changed_files(option.changed)
    if files is None and option.changed is not None:
        raise pytest.UsageError(
            "--changed asks git what differs, which cannot tell; name files, or take --all"
        )
    change, known = f"{len(files or ())} changed files", durations.read()
    if option.changed is None:
        chosen = nearest(files, _slow(known), NEAR_S) if files else {}
        count = sum(map(len, chosen.values()))
        heading = (
            f"tests: the fast ones, and of the slow ones {count} functions near {change}; --all takes all"
        )
        return Plan("fast", heading, chosen)
    new = {file: OF_A_NEW_FILE_S for file in files or () if file not in known["fast"] | known["slow"]}
    budget_s = (MINUTE_S - START_S) * num_processes
    chosen = nearest(files or (), _merged(known), budget_s, new, OF_COLLECTING_S * num_processes)
    heading = f"tests: {sum(map(len, chosen.values()))} functions nearest to {change}, for a minute"
    return Plan("changed", heading, chosen, time.time() + MINUTE_S)


def _slow(known: durations.Durations) -> dict[str, dict[str, tuple[float, int]]]:
    """Return the durations of slow cases, those that are marked and those that are found slow."""
    merged: durations.Durations = {"fast": {}, "slow": known["slow"]}
    for file, name in durations.found_slow(known):
        merged["fast"].setdefault(file, {})[name] = known["fast"][file][name]
    return _merged(merged)


def _merged(known: durations.Durations) -> dict[str, dict[str, tuple[float, int]]]:
    """Return the durations of functions, slow and fast cases of one together."""
    merged: dict[str, dict[str, tuple[float, int]]] = {}
    for of_files in known.values():
        for file, functions in of_files.items():
            for name, (seconds, cases) in functions.items():
                before, num_before = merged.setdefault(file, {}).get(name, (0.0, 0))
                merged[file][name] = before + seconds, num_before + cases
    return merged


def nearest(
    changed: Sequence[str],
    known: dict[str, dict[str, tuple[float, int]]],
    budget_s: float,
    new: Mapping[str, float] = NONE,
    of_file_s: float = 0.0,
) -> Chosen:
    """Return the tests nearest to changed files that a budget of recorded seconds holds.

    Of equally near ones, those come first that are near to most of the changed files, then those whose path
    has most words of a changed file's, then those of files whose tests take least. Files of which nothing is
    recorded are taken whole.
    """
    rows = []
    for file, near in distances(changed).items():
        whole = {"": (new[file], 1)} if file in new else {}
        functions = known.get(file) or whole
        typical_s = sum(seconds for seconds, _ in functions.values()) / max(1, len(functions))
        for function, (seconds, cases) in functions.items():
            kin = near.steps, -near.neighbours, -kinship(file, changed)
            order = (*kin, typical_s, file, seconds / cases)
            rows.append((order, file, function, seconds))
    chosen: Chosen = {}
    for _, file, function, seconds in sorted(rows):
        needed = seconds + (file not in chosen) * of_file_s
        if needed <= budget_s:
            budget_s -= needed
            chosen.setdefault(file, []).append(function)
    return chosen


def kinship(file: str, changed: Iterable[str]) -> int:
    """Return how many words the path of a file of tests shares with that of a changed file, at most."""
    words = _words(file.removeprefix("tests/")) - {"test"}
    return max((len(words & _words(path)) for path in changed), default=0)


def _words(path: str) -> set[str]:
    return set(module_of(path).replace(".", "_").split("_"))


def shard_of(files: Iterable[str], count: int) -> dict[str, int]:
    """Return the part, from 1 on, of each file of tests: the dearest first, each into the emptiest part."""
    known = _merged(durations.read())
    seconds = {
        file: sum(s for s, _ in known[file].values()) if file in known else OF_A_NEW_FILE_S for file in files
    }
    parts, full_s = dict[str, int](), [0.0] * count
    for file in sorted(seconds, key=lambda each: (-seconds[each], each)):
        emptiest = full_s.index(min(full_s))
        parts[file], full_s[emptiest] = emptiest + 1, full_s[emptiest] + seconds[file]
    return parts


def dearest_first(files: Sequence[str]) -> list[str]:
    """Return files of tests in the order in which they begin: those with a dear test first, the dearest."""
    dearest = {
        file: max(seconds / cases for seconds, cases in functions.values())
        for file, functions in _merged(durations.read()).items()
    }
    return sorted(files, key=lambda file: -seconds if (seconds := dearest.get(file, 0.0)) >= DEAR_S else 0.0)


def select(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what was measured to be slow, and take what is planned out of what was collected, in its order."""
    plan, found_slow = config.stash[PLAN], durations.found_slow(durations.read())
    functions = [durations.function_of(item.nodeid) for item in items]
    for item, function in zip(items, functions, strict=True):
        if function in found_slow and not item.get_closest_marker("slow"):
            item.add_marker("slow")
            item.keywords[durations.FOUND_SLOW] = True
    if plan.way == "changed":
        order = {(file, name): n for n, (file, names) in enumerate(plan.chosen.items()) for name in names}
        ranks = [order.get(function, order.get((function[0], ""), -1)) for function in functions]
    elif plan.way == "fast":
        ranks = [
            -1 if item.get_closest_marker("slow") and name not in plan.chosen.get(file, ()) else 0
            for item, (file, name) in zip(items, functions, strict=True)
        ]
    elif plan.way == "all":
        number, count = config.option.shard or (1, 1)
        files = list(dict.fromkeys(file for file, _ in functions))
        parts, turns = shard_of(files, count), {file: n for n, file in enumerate(dearest_first(files))}
        ranks = [turns[file] if parts[file] == number else -1 for file, _ in functions]
    else:
        return
    config.hook.pytest_deselected(items=[item for item, rank in zip(items, ranks, strict=True) if rank < 0])
    kept = [(rank, n) for n, rank in enumerate(ranks) if rank >= 0]
    items[:] = [items[n] for _, n in sorted(kept)]


def skip_after_a_minute(config: pytest.Config) -> None:
    """Leave out a test of `--changed` that would begin too late; on a busy machine the nearest still run."""
    least_s = time.time() + (MINUTE_S - START_S) / 2.0
    ends_at = max(config.stash[PLAN].ends_at, config.stash.setdefault(BEGUN, least_s))
    if time.time() > ends_at:
        pytest.skip("the minute is over")
