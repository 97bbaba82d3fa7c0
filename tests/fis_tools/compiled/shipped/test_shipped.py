"""Shipped machine code: is it of today's source, does it load, and does anything else compile?"""

import gc
import hashlib
import json
import os
import re
import subprocess
import sys
import threading
import weakref
from typing import NamedTuple

import numpy as np
import pytest

from benchmarks import objects
from fis_tools.compiled.decorator import Compiled, compiled
from fis_tools.compiled.shipped import arguments as shipped_arguments
from fis_tools.compiled.shipped import build, load
from fis_tools.compiled.shipped.arguments import Block, UnknownArgumentError, signature
from fis_tools.compiled.shipped.identity import digest
from tests import night
from tests.fis_tools.compiled.shipped.made import object_for
from tests.places import PROJECT

SCALE = 3.0


class Pair(NamedTuple):
    left: np.ndarray
    factor: float


@compiled(nogil=True, error_model="numpy")
def weigh(pair, count, is_doubled, nothing, out):
    """Sum rows of what is scaled."""
    room = np.empty(count)  # an array of its own
    for index in range(count):
        room[index] = SCALE * pair.left[index, 0] * pair.factor + np.sin(pair.left[index, 1])
        if is_doubled:
            room[index] *= 2.0
    for index in range(count):
        out[index] = room[index]


@compiled
def refuse(x):
    if x[0] > 0.0:
        raise ValueError("positive")


@compiled
def gather(x, out):
    """Sum by turns, in a list."""
    sums = [0.0, 0.0, 0.0]
    for index in range(len(x)):
        sums[index % 3] += x[index]
    for index in range(3):
        out[index] = sums[index]


def arguments(count=5, seed=1):
    left = np.random.default_rng(seed).normal(size=(count, 2))
    return Pair(left, 0.5), count, True, None, np.zeros(count)


def linked(function, given):
    """The code of a function, through an object file."""
    content, result = object_for(load.family(), function, given)
    return load.Call(load.link(content), Block(given), result)


needs_family = pytest.mark.skipif(not load.family(), reason="no code is shipped for this processor")


@needs_family
def test_an_object_gives_the_bits_of_the_function():
    given, again = arguments(), arguments()
    linked(weigh, given)(*given)
    weigh.py_func(*again)
    np.testing.assert_array_equal(given[-1], again[-1])


def test_code_for_another_processor_is_an_object_of_its_own_that_calls_what_is_known():
    """ELF's number for aarch64 is 183; ``.ci/aarch64`` flies by such objects under qemu."""
    content = {family: object_for(family, weigh, arguments())[0] for family in load.FAMILIES}
    machines = {family: int.from_bytes(held[18:20], "little") for family, held in content.items()}
    assert machines == {"x86-64-v4": 62, "x86-64-v3": 62, "aarch64": 183}
    assert b"x86" not in content["aarch64"]


@needs_family
def test_threads_have_arrays_of_their_own():
    call = linked(weigh, arguments())
    batches = [arguments(2000, seed) for seed in range(4)]
    calls = [load.Call(call._code, Block(batch)) for batch in batches]

    def work(call, batch):
        for _ in range(50):
            call(*batch)

    threads = [threading.Thread(target=work, args=pair) for pair in zip(calls, batches, strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for pair, count, is_doubled, nothing, out in batches:
        expected = np.zeros(count)
        weigh.py_func(pair, count, is_doubled, nothing, expected)
        np.testing.assert_array_equal(out, expected)


@needs_family
def test_lists_have_room():
    given = np.arange(10.0), np.zeros(3)
    linked(gather, given)(*given)
    np.testing.assert_array_equal(given[1], [18.0, 12.0, 15.0])


@compiled
def arrange(x, out):
    """Sort what is positive; sum columns of what is kept in a list that grows."""
    kept = [0.5]
    for value in np.sort(x[x > 0.0]):
        kept.append(value)
    table = out.reshape(3, -1)
    for index in range(len(kept)):
        table[index % 3, index // 3] = kept[index]


@compiled
def measure(x):
    return len(x), x.sum(), x[0] * 0.1


@compiled
def longest(x):
    return x.max()


@compiled
def is_longer(x):
    return x[1] > 2.0


@compiled
def count(x):
    return len(x)


@needs_family
def test_what_is_sorted_grows_or_takes_another_shape():
    x, out, again = np.random.default_rng(1).normal(size=40), np.zeros(45), np.zeros(45)
    linked(arrange, (x, out))(x, out)
    arrange.py_func(x, again)
    np.testing.assert_array_equal(out, again)


@compiled
def flatten(table, out):
    """Copy a table, which may be empty, to a row."""
    row = table.reshape(-1)
    out[0] = len(row)
    for index in range(len(row)):
        out[1 + index] = row[index]


@needs_family
@pytest.mark.parametrize("shape", [(2, 3), (0, 15), (15, 0), (0, 0), (1, 4), (4, 1)])
def test_tables_become_rows_also_empty_ones(shape):
    full, again = np.arange(1.0, 1.0 + np.prod(shape)).reshape(shape), np.full(8, -1.0)
    flatten.py_func(full, again)
    # NumPy gives an empty array any strides
    bare = np.lib.stride_tricks.as_strided(full, shape, (0, 0)) if full.size == 0 else full
    for table in (full, bare):
        out = np.full(8, -1.0)
        linked(flatten, (table, out))(table, out)
        np.testing.assert_array_equal(out, again)


@needs_family
@pytest.mark.parametrize("function", [measure, longest, is_longer, count])
def test_numbers_are_returned(function):
    for x in (np.array([0.3, 7.0, 1.5]), np.array([0.3, -7.0])):
        returned, expected = linked(function, (x,))(x), function.py_func(x)
        assert returned == expected
        assert type(returned) is type(expected) or isinstance(expected, np.generic)


@compiled
def doubled(x):
    return 2.0 * x


def test_arrays_that_are_returned_are_refused():
    doubled(np.ones(2))
    [overload] = doubled.inside.overloads.values() or doubled.dispatcher.overloads.values()
    with pytest.raises(build.NotShippedError, match="returns numba's type array"):
        build.result_kind(overload.signature.return_type)


@needs_family
def test_what_raises_says_so():
    given = (np.array([1.0]),)
    call = linked(refuse, given)
    call(np.array([-1.0]))
    with pytest.raises(RuntimeError, match="FIS_TOOLS_SHIPPED=0"):
        call(*given)


def test_types_are_told_apart():
    given = arguments()
    same = signature(given)
    assert signature(arguments(7)) == same  # lengths are no types
    for other in (
        (given[0], 5.0, *given[2:]),
        (given[0], 5, 1, *given[3:]),
        (tuple(given[0]), *given[1:]),
        (*given[:4], given[4].astype(np.float32)),
        (*given[:4], given[4][:, np.newaxis]),
        (*given[:3], np.zeros(1), given[4]),
    ):
        assert signature(other) != same
    with pytest.raises(UnknownArgumentError, match="contiguous"):
        signature((given[0].left.T,))
    with pytest.raises(UnknownArgumentError, match="str"):
        signature(("text",))


def test_a_block_holds_addresses_and_bits():
    given = arguments()
    numbers = Block(given).numbers
    assert numbers[4] == given[0].left.ctypes.data
    assert numbers[9:10].view(np.float64)[0] == 0.5
    assert numbers[10] == 5


def test_what_comes_again_is_taken_from_the_block_before():
    first = arguments()
    second = (first[0], 4, *first[2:4], np.zeros(7))
    numbers = Block(second, Block(first).parts).numbers
    np.testing.assert_array_equal(numbers, Block(second).numbers)
    assert numbers[10] == 4


def test_parts_of_tuples_come_again_too_and_live_no_longer_for_it(monkeypatch):
    first = arguments()
    before = Block(first).parts
    packed = []
    plain = shipped_arguments._leaves
    monkeypatch.setattr(shipped_arguments, "_leaves", lambda value: packed.append(value) or plain(value))
    again = (first[0]._replace(factor=0.75), *first[1:])
    block = Block(again, before)
    assert packed == [0.75]
    np.testing.assert_array_equal(block.numbers, Block(again).numbers)
    assert block.kinds == signature(again)
    array = weakref.ref(first[0].left)
    del first, again, block, packed[:]
    gc.collect()
    assert array() is None


@pytest.mark.parametrize(
    ("first", "second"),
    [((), (1, 2)), ((1, 2), ()), ((1, (2.0,)), (1, (2.5,))), ((1,), (True,)), ((Pair(1, 2),), ((1, 2),))],
)
def test_what_only_looks_like_the_block_before_is_told_anew(first, second):
    block = Block((second,), Block((first,)).parts)
    assert block.kinds == signature((second,))
    np.testing.assert_array_equal(block.numbers, Block((second,)).numbers)


def test_nothing_in_the_place_of_an_array_that_is_gone_is_nothing():
    before = Block((np.zeros(3),)).parts
    gc.collect()
    assert Block((None,), before).kinds == "none"


def source(body, constant="3.0", comment=""):
    return f'''
import numpy as np
from fis_tools.compiled.decorator import compiled
SCALE = {constant}
@compiled
def scaled(x):
    """A docstring{comment}."""
    {comment and "# " + comment}
    {body}
'''


def digest_of(folder, monkeypatch, name, **changes):
    (folder / f"{name}.py").write_text(source(**{"body": "return SCALE * x", **changes}))
    monkeypatch.syspath_prepend(str(folder))
    module = __import__(name)
    module.scaled.py_func.__module__ = "same"  # of modules the name is part of the identity
    return digest(module.scaled, {})


def test_words_and_constants_count_and_comments_do_not(tmp_path, monkeypatch):
    first = digest_of(tmp_path, monkeypatch, "shipped_one")
    assert digest_of(tmp_path, monkeypatch, "shipped_two", comment="another") == first
    assert digest_of(tmp_path, monkeypatch, "shipped_three", body="return  SCALE*x") == first
    assert digest_of(tmp_path, monkeypatch, "shipped_four", body="return x * SCALE") != first
    assert digest_of(tmp_path, monkeypatch, "shipped_five", constant="4.0") != first


def shipped_functions():
    content = json.loads(load.INDEX.read_text(encoding="utf-8"))
    return [
        (name, types, facts) for name, held in content["functions"].items() for types, facts in held.items()
    ]


def function_of(name) -> Compiled:
    module, _, attribute = name.rpartition(".")
    __import__(module)
    return getattr(sys.modules[module], attribute)


def test_what_is_shipped_is_of_todays_source():
    """Otherwise it is compiled; ``python -m benchmarks objects --write`` builds it again."""
    digests = {}
    for name, _, facts in shipped_functions():
        digests.setdefault(name, digest(function_of(name), {}))
        assert facts["digest"] == digests[name], name


def test_each_file_is_listed_with_its_hash_for_each_family():
    listed = {}
    for _, _, facts in shipped_functions():
        assert set(facts["families"]) == set(load.FAMILIES)
        for family, file in facts["families"].items():
            listed[load.CODE / family / file["name"]] = file["sha256"]
    files = {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in load.CODE.rglob("*.xz")}
    assert files == listed


@needs_family
def test_what_comes_compiled_is_told(monkeypatch):
    lines = [*load.shipped_words()]
    assert load.family() in lines[0]
    for name, held in load.index()["functions"].items():
        assert f"  {name}: {len(held)} of {len(held)} kinds of arguments" in lines
    monkeypatch.setattr(load, "_digest", lambda compiled: "another")
    assert all("so it is compiled" in line for line in [*load.shipped_words()][1:])
    monkeypatch.setattr(load, "index", lambda: {"functions": {}})
    assert load.SWITCH in "".join(load.shipped_words())


@needs_family
def test_a_file_that_is_not_as_listed_is_not_run(tmp_path, monkeypatch):
    name, types, facts = shipped_functions()[0]
    (tmp_path / load.family()).mkdir()
    file = facts["families"][load.family()]["name"]
    (tmp_path / load.family() / file).write_bytes(b"something else")
    monkeypatch.setattr(load, "CODE", tmp_path)
    monkeypatch.setattr(load, "_digest", lambda compiled: facts["digest"])
    shipped = load.Shipped(function_of(name), {"key": facts})
    monkeypatch.setattr(load.hashlib, "sha256", _keyed(types, load.hashlib.sha256))
    assert shipped._linked(types)[0] is None


def _keyed(types, plain):
    class Key:
        def hexdigest(self):
            return "key" + 13 * " "

    return lambda content: Key() if content == types.encode() else plain(content)


@needs_family
@pytest.mark.slow
def test_a_first_evaluation_compiles_nothing_and_flies_what_is_compiled(tmp_path):
    """What is written is the same as with numba's code, whose compiling of all that takes a minute."""
    outcomes = []
    for switch in ("1", "0") if night.IS_WHOLE else ("1",):
        folder = tmp_path / switch
        command = [sys.executable, "-m", "pipeline", "+experiment=evaluate", "controller=champion_27"]
        command += ["sun=random", "monte_carlo.num_cases=20", f"hydra.run.dir={folder}"]
        cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")} if switch == "1" else {}
        done = subprocess.run(  # noqa: S603
            command,
            check=True,
            capture_output=True,
            text=True,
            env=os.environ | {load.SWITCH: switch} | cache,
        )
        if switch == "1":
            assert "compiling" not in done.stderr
        outcomes.append((folder / "evaluate" / "episodes.parquet").read_bytes())
    assert len(set(outcomes)) == 1


#: one call of each kind of flight, by the champions
RUNS = night.by_day([*enumerate(objects.commands())], 8)
#: what numba compiles all the same: it calls LAPACK
NOT_SHIPPED = {"tabulate"}
FLOWN = """
from benchmarks import objects
from pipeline.__main__ import main

for name, options in objects.environments():
    objects.step_once(name, options)

for number, words in {runs!r}:
    assert main([*words, f"hydra.run.dir={folder}/{{number}}"]) == 0
"""


@needs_family
@pytest.mark.slow
def test_flights_of_champions_and_steps_of_environments_come_compiled(tmp_path):
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", FLOWN.format(runs=RUNS, folder=tmp_path)],
        check=True,
        capture_output=True,
        text=True,
        env=os.environ | {load.SWITCH: "1", "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        cwd=PROJECT,
    )
    compiled_here = set(re.findall(r"compiling [\w.]+\.(\w+):", done.stderr))
    assert compiled_here <= NOT_SHIPPED
