"""Who made a run, with what processor: makers are named and told, files checked, results reproduced."""

import errno
import fcntl
import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.run import artifacts, configuration, maker, manifests
from pipeline.run.lock import LOCK, HeldError, held
from pipeline.run.maker import present_maker
from pipeline.run.runner import run_stages
from tests.pipeline.command_line.cases import EVALUATE, FLY, use_stages
from tests.places import PACKAGES, PROJECT
from tests.programs import run_python


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run of whose stages the second failed, and will not any more."""

    def fail(_experiment, _folder):
        raise OSError("disk full")

    with monkeypatch.context() as patched:
        use_stages(patched, evaluate=fail)
        assert main([*EVALUATE, f"hydra.run.dir={tmp_path / 'run'}"]) == 2
    use_stages(monkeypatch)
    return tmp_path / "run"


def test_a_run_that_another_maker_goes_on_with_names_both(folder, monkeypatch, ran):
    first = manifests.read(folder)
    assert first["made_by"] == {"scenario": [0], "evaluate": [0]}
    other = {**present_maker(), "sources": "0" * 64}
    monkeypatch.setattr(maker, "present_maker", lambda: other)
    assert "another maker began this run (other sources)" in ran(f"resume={folder}").err
    manifest = manifests.read(folder)
    assert manifest["makers"] == [*first["makers"], other]
    assert manifest["made_by"] == {"scenario": [0], "evaluate": [0, 1], "record": [1], "report": [1]}


def test_the_same_maker_is_named_once_and_nothing_is_told(folder, ran):
    assert "another maker" not in ran(f"resume={folder}").err
    manifest = manifests.read(folder)
    assert len(manifest["makers"]) == 1
    names = {"machine", "compiled_for", "features", "libm", "numpy", "blas", "reproducible"}
    assert set(manifest["makers"][0]["processor"]) == names
    assert manifest["made_by"]["evaluate"] == [0]


def test_a_run_of_a_version_without_makers_keeps_what_it_told(folder, ran):
    manifest = json.loads((folder / artifacts.MANIFEST).read_text())
    for name in ("makers", "made_by"):
        del manifest[name]
    manifest["versions"]["numpy"] = "1.0"
    (folder / artifacts.MANIFEST).write_text(json.dumps(manifest))
    assert "(numpy 1.0, now " in ran(f"resume={folder}").err
    assert manifests.read(folder)["makers"][0]["versions"]["numpy"] == "1.0"


def test_verify_tells_each_file_that_is_not_what_was_written(folder, ran):
    ran(f"resume={folder}")
    assert ran("verify", folder).out == "files: 5 as they were written\nflights: none is recorded\n"
    (folder / "evaluate.txt").write_text("better")
    (folder / "record.txt").unlink()
    (folder / "more.txt").write_text("x")
    printed = ran("verify", folder, code=1).out
    for words in ("files: 3 as", "evaluate.txt has CHANGED", "record.txt is MISSING", "more.txt is not in"):
        assert words in printed
    for words in ([], ["a", "b", "c"], ["nowhere"]):
        assert ran("verify", *words, code=2).err.startswith("error: ")


def test_two_runs_are_compared_with_what_may_make_them_differ(folder, tmp_path, ran):
    assert main([f"resume={folder}"]) == 0
    other = Path(shutil.copytree(folder, tmp_path / "other"))
    assert ran("verify", folder, other).out == "files: 4 equal to the last bit\n"
    manifest = json.loads((other / artifacts.MANIFEST).read_text())
    manifest["makers"][0]["processor"] |= {"libm": "glibc 2.99 with fma", "compiled_for": "znver9"}
    manifest["sha256"] |= {"evaluate.txt": "0", "more.txt": "0"}
    (other / artifacts.MANIFEST).write_text(json.dumps(manifest))
    configuration.write(other, {**configuration.read(other), "seed": 5})
    libm = present_maker()["processor"]["libm"]
    assert ran("verify", folder, other, code=1).out.splitlines() == [
        "configuration: seed (here 1, there 5)",
        "files: 3 equal to the last bit",
        "  evaluate.txt differs",
        "  more.txt is in one of them alone",
        f"makers differ (libm {libm}, now glibc 2.99 with fma): results may differ in the last digits",
    ]


HOLD = "import sys, time; from pathlib import Path; from pipeline.run.lock import held\n" + (
    "with held(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)\n"
)


def test_one_process_holds_a_folder_until_it_is_gone(tmp_path, monkeypatch, ran):
    called = use_stages(monkeypatch)
    folder = tmp_path / "run"
    command = [sys.executable, "-c", HOLD, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=PROJECT) as process:  # noqa: S603
        try:
            assert process.stdout.readline() == "held\n"
            with pytest.raises(HeldError, match=rf"run is held by process {process.pid} on \S+ since 20"):
                held(folder).__enter__()
            assert f"is held by process {process.pid} on" in ran(*FLY, f"hydra.run.dir={folder}", code=2).err
        finally:
            process.kill()
    assert called == []
    assert not (folder / artifacts.CONFIG).exists()
    # the lock of a killed process is told and taken over
    assert (folder / LOCK).exists()
    printed = ran(*FLY, f"hydra.run.dir={folder}").err
    assert f"was held by process {process.pid} on" in printed
    assert "its lock is taken over" in printed
    assert not (folder / LOCK).exists()


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_folder_without_locks_is_refused(number, tmp_path, monkeypatch, ran):
    def flock(_descriptor, _how):
        raise OSError(number, os.strerror(number))

    called = use_stages(monkeypatch)
    monkeypatch.setattr(fcntl, "flock", flock)
    words = ran(*FLY, f"hydra.run.dir={tmp_path / 'run'}", code=2).err
    assert f"run cannot be locked by its file system ({os.strerror(number)}), so that a second" in words
    assert "gone" not in words
    assert called == []


def test_a_second_run_of_another_seed_leaves_the_first_ones_results_alone(tmp_path, monkeypatch, capsys):
    """Started while the first is in a stage."""
    folder, codes = tmp_path / "run", []

    def meanwhile(_experiment, _folder):
        codes.append(main([*FLY, "seed=2", f"hydra.run.dir={folder}"]))
        codes.append(main([f"resume={folder}"]))

    use_stages(monkeypatch, record=meanwhile)
    assert main([*FLY, "seed=1", f"hydra.run.dir={folder}"]) == 0
    assert codes == [2, 2]
    assert f"is held by process {os.getpid()} on" in capsys.readouterr().err
    assert configuration.read(folder)["seed"] == 1
    assert manifests.read(folder)["seed"] == 1


@pytest.mark.parametrize("resumed", [True, False])
def test_a_run_killed_before_its_manifest_goes_on_or_begins_anew(resumed, tmp_path, monkeypatch):
    called = use_stages(monkeypatch)
    folder = tmp_path / "run"
    words = [*FLY, "seed=4", f"hydra.run.dir={folder}"]
    with monkeypatch.context() as patched:
        patched.setattr(manifests, "write", lambda *_, **__: (_ for _ in ()).throw(SystemExit(9)))
        with pytest.raises(SystemExit):
            main(words)
    assert [path.name for path in folder.iterdir()] == [artifacts.CONFIG]
    assert main([f"resume={folder}"] if resumed else words) == 0
    assert [(name, e.seed) for name, e, _ in called] == [("record", 4)]
    assert manifests.read(folder)["finished_stages"] == ["record"]


WORDS = [*EVALUATE, "stages=[scenario]", "reproducible=true"]

#: products beside sums and calls, by the kernel's vectors; prints the bytes of what they give
COMPILED = """\
import numpy as np
from fis_tools.compiled.elementary import exponential
from pipeline.flight.state.lanes import arctangent
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
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="compiles for x86-64 processors")
def test_compiled_code_gives_the_same_bits_on_every_processor(tmp_path):
    (tmp_path / "several.py").write_text(COMPILED)
    outputs = []
    for chosen in ({}, {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}):
        outputs.append(run_python(tmp_path / "several.py", NUMBA_CACHE_DIR=str(tmp_path), **chosen).stdout)
    assert len(outputs[0]) > 4096
    assert outputs[0] == outputs[1]


def test_no_kernel_lets_the_compiler_round_as_it_likes():
    paths = [path for package in PACKAGES for path in (PROJECT / package).rglob("*.py")]
    assert [path.name for path in paths if "fastmath" in path.read_text(encoding="utf-8")] == []


@pytest.mark.slow
def test_a_run_starts_anew_with_what_it_asks_of_libraries(tmp_path):
    done = run_python("-m", "pipeline", *WORDS, f"hydra.run.dir={tmp_path / 'run'}")
    assert done.stderr.count("run folder:") == 1
    processor = manifests.read(tmp_path / "run")["makers"][0]["processor"]
    assert processor["reproducible"] is True
    assert (processor["numpy"], processor["blas"]) == ("baseline", "Nehalem x1")
    assert processor["libm"].endswith("without fma")


def test_settings_of_the_user_are_kept(monkeypatch):
    monkeypatch.setenv("GLIBC_TUNABLES", "glibc.malloc.check=1")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "AVX512F")
    assert not maker.is_in_force()
    environment = maker.environment()
    assert environment["GLIBC_TUNABLES"] == f"glibc.malloc.check=1:{maker.LIBM}"
    assert environment["NPY_DISABLE_CPU_FEATURES"].startswith("AVX512F")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert maker.is_in_force()


#: a script that runs words, is interrupted where its standard error names the first argument, and goes on
SCRIPT = """
import io, os, signal, sys
from pipeline.command_line.cli import main

class Listening(io.StringIO):
    def write(self, text):
        if sys.argv[1] in text:
            os.kill(os.getpid(), signal.SIGINT)
        return sys.__stderr__.write(text)

sys.stderr = Listening()
environment = dict(os.environ)
print("code", main(sys.argv[2:]))
handler = signal.getsignal(signal.SIGINT)
print("goes on", environment == dict(os.environ), handler is signal.default_int_handler)
"""


@pytest.mark.slow
def test_in_a_script_it_runs_in_a_child_process_and_the_script_goes_on(tmp_path):
    folder = tmp_path / "run"
    words = [*WORDS, "reproducible=true", f"hydra.run.dir={folder}"]
    done = run_python("-c", SCRIPT, "never", *words, folder=tmp_path)
    assert done.stdout == "run\ncode 0\ngoes on True True\n"
    assert done.stderr.startswith("run folder: run\n[1/1] scenario\n")
    assert manifests.read(folder)["makers"][0]["processor"]["reproducible"] is True


@pytest.mark.slow
def test_an_interrupt_comes_to_the_child_and_the_script_goes_on(tmp_path):
    folder = tmp_path / "run"
    # an hour of flights, of which nothing is compiled for the processor of reproducible runs
    flights = ["flight=reference", "duration_s=60", "monte_carlo.num_cases=20000"]
    words = [*EVALUATE, "reproducible=true", *flights, f"hydra.run.dir={folder}"]
    done = run_python("-c", SCRIPT, "[2/", *words, folder=tmp_path)
    assert done.stdout == "code 130\ngoes on True True\n"
    assert "interrupted" in done.stderr


def test_only_a_process_started_for_it_runs_it(tmp_path, monkeypatch, capsys):
    started = []

    def execve(path, words, env):
        started.append((path, words, env))
        raise SystemExit(0)

    monkeypatch.setattr(os, "execve", execve)
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "pipeline", *WORDS])
    folder = tmp_path / "run"
    with pytest.raises(SystemExit):
        main([*WORDS, f"hydra.run.dir={folder}"], replaces_process=True)
    ((path, words, env),) = started
    assert (path, words) == (sys.executable, [sys.executable, "-m", "pipeline", *WORDS])
    assert maker.environment().items() <= env.items()
    run = compose_experiment(WORDS)
    with pytest.raises(maker.NotInForce, match="start it with OPENBLAS_CORETYPE='Nehalem' "):
        run_stages(run.experiment, run.config, folder)
    assert not folder.exists()
    # of a child, what it prints comes to this process's streams, and its code is returned
    capsys.readouterr()
    code = maker.run_anew(["-c", "import sys; print(1); print(2, file=sys.stderr); sys.exit(3)"])
    assert (code, *capsys.readouterr()) == (3, "1\n", "2\n")
