"""What is told of a long step: lines where nobody watches, a bar on a terminal."""

import pytest

from pipeline.run import progress
from pipeline.run.progress import Progress


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Seconds, as the test sets them."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    return now


def test_lines_are_told_now_and_then_with_the_time_left(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with Progress("solved", 10, done=2) as shown:
        for done in (3, 4, 5, 9, 10):
            clock[0] += 2.0
            shown.show(done, f"case {done}")
    # eight are left at the start: one in two seconds, then three in six, all in ten
    assert capsys.readouterr().err.splitlines() == [
        "  solved 3/10, case 3, 14 s left",
        "  solved 9/10, case 9, 1 s left",
        "  solved 10/10, case 10, 0 s left",
    ]


def test_what_was_done_before_is_counted_from_what_is_shown_first(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with Progress("generation", 8) as shown:
        clock[0] += 3.0
        shown.show(5)
    assert capsys.readouterr().err == "  generation 5/8, 9 s left\n"


def test_a_terminal_shows_a_bar(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with Progress("solved", 4, done=0) as shown:
        shown.show(2, "case 1")
    told = capsys.readouterr().err
    assert "case 1" in told
    assert "2/4" in told
    assert "s left\n" not in told
