"""The processors that this process may use."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from plain_files.file_access import read_text

#: of a control group, microseconds of processor time in a period, and the period: of version 2, of version 1
QUOTAS = (("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us"))
#: of a file of the kernel
MOST_BYTES = 16 * 1024


def num_processors(root: Path = Path("/")) -> int:
    """Return the number of processors that this process may use, at least 1.

    A job of a cluster, a container or `taskset` may have fewer than the machine: those that the scheduler may
    run it on, and no more than the quotas of its control groups, rounded up.

    Parameters
    ----------
    root : Path
        Where the file systems ``proc`` and ``sys`` are.
    """
    try:
        number = len(os.sched_getaffinity(0))
    except AttributeError:  # Linux alone has it
        number = os.cpu_count() or 1
    return max(1, min([number, *_quotas(root)]))


def _quotas(root: Path) -> Iterator[int]:
    """Yield the quotas of the control groups that this process is in, in processors."""
    for folder in _control_groups(root):
        for names in QUOTAS:
            # "max", or -1, where there is no limit
            with suppress(OSError, ValueError):
                quota, period = (
                    int(word) for name in names for word in read_text(folder / name, MOST_BYTES).split()
                )
                if quota > 0:
                    yield -(-quota // period)


def _control_groups(root: Path) -> Iterator[Path]:
    """Yield the folders of the control groups of this process, each with those above it."""
    with suppress(OSError, ValueError):
        for line in read_text(root / "proc/self/cgroup", MOST_BYTES).splitlines():
            _, controllers, path = line.split(":", 2)
            if not controllers or "cpu" in controllers.split(","):
                mounted = root / "sys/fs/cgroup" / (controllers and "cpu")
                inside = PurePosixPath(path.strip("/"))
                yield from (mounted / parent for parent in (inside, *inside.parents))
