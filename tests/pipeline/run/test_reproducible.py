"""Results that do not depend on the processor: what we compile, and what libraries choose."""

import os
import platform
import subprocess
import sys

import pytest

from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.run import maker, manifests
from pipeline.run.runner import run_stages
from tests.places import PROJECT

WORDS = ["+experiment=evaluate", "controller=coast", "stages=[scenario]", "reproducible=true"]

#: products beside sums and calls, by the kernel's vectors; prints the bytes of what they give
COMPILED = """\
import numpy as np
from pipeline.flight.state.lanes import arctangent, exponential
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import load, store

@compiled(error_model="numpy")
def several(x, y, out):
    for i in range(0, len(x), 16):
        a, b = load(x, i, 16), load(y, i, 16)
        store(out, i, exponential(a) * b + arctangent(a * b - 1.0, b * b + a) * a)

rng = np.random.default_rng(1)
out = np.empty(4096)
several(rng.normal(size=4096), rng.normal(size=4096), out)
print(out.tobytes().hex())
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names processors of this kind")
def test_compiled_code_gives_the_same_bits_on_every_processor(tmp_path):
    (tmp_path / "several.py").write_text(COMPILED)
    told = []
    for chosen in ({}, {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}):
        env = {**os.environ, "PYTHONPATH": str(PROJECT), "NUMBA_CACHE_DIR": str(tmp_path), **chosen}
        done = subprocess.run(  # noqa: S603
            [sys.executable, tmp_path / "several.py"], env=env, capture_output=True, check=True
        )
        told.append(done.stdout)
    assert len(told[0]) > 4096
    assert told[0] == told[1]


def test_no_kernel_lets_the_compiler_round_as_it_likes():
    places = [path for package in ("pipeline", "fis_tools") for path in (PROJECT / package).rglob("*.py")]
    assert [path.name for path in places if "fastmath" in path.read_text(encoding="utf-8")] == []


@pytest.mark.slow
def test_a_run_starts_anew_with_what_it_asks_of_libraries(tmp_path):
    command = [sys.executable, "-m", "pipeline", *WORDS, f"hydra.run.dir={tmp_path / 'run'}"]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stderr.count("run folder:") == 1
    processor = manifests.read(tmp_path / "run")["makers"][0]["processor"]
    assert processor["reproducible"] is True
    assert (processor["numpy"], processor["blas"]) == ("baseline", "Nehalem x1")
    assert processor["libm"].endswith("without fma")


def test_settings_of_the_user_are_kept(monkeypatch):
    monkeypatch.setenv("GLIBC_TUNABLES", "glibc.malloc.check=1")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "AVX512F")
    assert not maker.is_in_force()
    told = maker.environment()
    assert told["GLIBC_TUNABLES"] == f"glibc.malloc.check=1:{maker.LIBM}"
    assert told["NPY_DISABLE_CPU_FEATURES"].startswith("AVX512F")
    for name, value in told.items():
        monkeypatch.setenv(name, value)
    assert maker.is_in_force()


def test_only_a_process_started_for_it_runs_it(tmp_path, monkeypatch):
    started = []

    def execve(path, words, env):
        started.append((path, words, env))
        raise SystemExit(0)

    monkeypatch.setattr(os, "execve", execve)
    folder = tmp_path / "run"
    with pytest.raises(SystemExit):
        main([*WORDS, f"hydra.run.dir={folder}"])
    ((path, words, env),) = started
    assert (path, words[:3], words[3:7]) == (sys.executable, [sys.executable, "-m", "pipeline"], WORDS)
    assert maker.environment().items() <= env.items()
    run = compose_experiment(WORDS)
    with pytest.raises(maker.NotInForce, match="start it with OPENBLAS_CORETYPE='Nehalem' "):
        run_stages(run.experiment, run.config, folder)
    assert not folder.exists()
