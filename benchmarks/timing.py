"""What benchmarks share: the best of several repeats, and words of their tables."""

import time
from collections.abc import Callable

from pipeline.evaluation.statistics import percent_ahead
from pipeline.flight.state.log import Outcomes


def best_cpu_seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least processor time of several repeats after a warm-up, in the thread that calls this.

    Threads of OpenBLAS spin for a while after their work, and would count in the process's time.
    """
    work()
    times = []
    for _ in range(repeats):
        started = time.thread_time()
        work()
        times.append(time.thread_time() - started)
    return min(times)


def best_wall_seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least wall time of several repeats after a warm-up."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def fuel_by_rules(flown: Outcomes) -> str:
    """Return which share of fuel rules fire, in words; nothing where no push was chosen ahead."""
    ahead = percent_ahead(flown.delta_v_m_s, flown.ahead_delta_v_m_s)
    return f", rules fire {100.0 - ahead:.1f} %" if ahead > 0.0 else ""


def line(what: str, value: str) -> None:
    """Print one figure."""
    print(f"  {what:<66} {value}", flush=True)
