"""What two processes do is what one does, in the same order, and also where one of them dies."""

import os
import time
from collections.abc import Callable

import pytest

from pipeline.run.second import second_process


@pytest.fixture
def share(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    with second_process("math") as share:
        yield share


def where(number: int) -> tuple[int, int]:
    return number, os.getpid()


def where_when_both(number: int) -> tuple[int, int]:
    time.sleep(0.05)  # long enough for the other to begin
    return where(number)


def many(number: int, size: int) -> bytes:
    return bytes([number]) * size


def last_is_closure(number: int) -> int | Callable[[], int]:
    return number if number < 2 else lambda: number


def die_elsewhere(number: int, home: int) -> int:
    if os.getpid() != home:
        os._exit(1)
    return number


def test_parts_are_shared_from_both_ends(share):
    finish = share(where_when_both, [(number,) for number in range(5)])
    numbers, processes = zip(*finish(), strict=True)
    assert numbers == (0, 1, 2, 3, 4)
    assert processes[0] == os.getpid() != processes[-1]
    assert processes == tuple(sorted(processes, key=[os.getpid(), processes[-1]].index))


def test_a_single_part_is_done_by_the_other_process(share):
    ((_, process),) = share(where, [(1,)])()
    assert process != os.getpid()


def test_large_results_do_not_wait_for_their_receiver(share):
    parts = [(number, 1_000_000) for number in range(3)]
    assert share(many, parts)() == [many(*part) for part in parts]


def test_an_error_there_is_raised_here(share):
    with pytest.raises(ZeroDivisionError):
        share(divmod, [(1, 0), (1, 0)])()


def test_a_process_that_dies_leaves_its_parts_to_the_other(share):
    assert share(die_elsewhere, [(number, os.getpid()) for number in range(4)])() == [0, 1, 2, 3]


def test_a_result_that_cannot_be_sent_is_made_here(share):
    *numbers, closure = share(last_is_closure, [(number,) for number in range(3)])()
    assert [*numbers, closure()] == [0, 1, 2]


def test_one_processor_does_all(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    with second_process("math") as share:
        assert share(where, [(1,), (2,)])() == [(1, os.getpid()), (2, os.getpid())]
