"""What two processes do is what one does, in the same order, and also where one of them dies."""

import os

import pytest

from pipeline.run.second import second_process


@pytest.fixture
def share(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    with second_process("math") as share:
        yield share


def where(number: int) -> tuple[int, int]:
    return number, os.getpid()


def die_elsewhere(number: int, home: int) -> int:
    if os.getpid() != home:
        os._exit(1)
    return number


def test_every_second_part_is_done_by_another_process(share):
    numbers, processes = zip(*share(where, [(number,) for number in range(5)])(), strict=True)
    assert numbers == (0, 1, 2, 3, 4)
    assert set(processes[::2]) == {os.getpid()}
    (other,) = set(processes[1::2])
    assert other != os.getpid()


def test_a_process_that_dies_leaves_its_parts_to_the_other(share):
    assert share(die_elsewhere, [(number, os.getpid()) for number in range(4)])() == [0, 1, 2, 3]


def test_one_processor_does_all(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    with second_process("math") as share:
        assert share(where, [(1,), (2,)])() == [(1, os.getpid()), (2, os.getpid())]
