"""What a job, a container or `taskset` was given counts, not what the machine has."""

import os
import subprocess
import sys

import pytest

from fis_tools.processors import num_processors
from tests.places import PROJECT


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="Linux alone has it")
def test_a_process_on_one_processor_counts_one():
    code = "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
    code += "from fis_tools.processors import num_processors; print(num_processors())"
    done = subprocess.run([sys.executable, "-c", code], cwd=PROJECT, capture_output=True, check=True)  # noqa: S603
    assert done.stdout == b"1\n"


@pytest.mark.parametrize(
    ("group", "files", "expected"),
    [
        ("0::/job/task", {"job/cpu.max": "250000 100000", "job/task/cpu.max": "max 100000"}, 3),
        ("0::/job", {"job/cpu.max": "400000 100000", "cpu.max": "200000 100000"}, 2),
        ("3:cpuacct,cpu:/x", {"cpu/x/cpu.cfs_quota_us": "50000", "cpu/x/cpu.cfs_period_us": "100000"}, 1),
        ("3:cpu:/x", {"cpu/x/cpu.cfs_quota_us": "-1", "cpu/x/cpu.cfs_period_us": "100000"}, 8),
        ("8:memory:/x", {"cpu/x/cpu.cfs_quota_us": "50000", "cpu/x/cpu.cfs_period_us": "100000"}, 8),
        ("0::/", {}, 8),
        ("nothing of the kind", {"cpu.max": "a b"}, 8),
    ],
)
def test_the_quota_of_a_control_group_counts(group, files, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    files = {f"sys/fs/cgroup/{name}": text for name, text in files.items()} | {"proc/self/cgroup": group}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    assert num_processors(tmp_path) == expected
