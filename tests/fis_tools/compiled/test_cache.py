"""Where compiled code is kept, what it depends on, and whose code is refused."""

import os
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

import fis_tools
from fis_tools.compiled import borrowed_code, cache  # noqa: F401 - as the decorator loads it
from pipeline.flight.fly import many
from pipeline.flight.period.act import attitude, safety
from pipeline.physics import quaternion

DAY_S = 86400.0
FOLDER = Path(fis_tools.__file__).parent
PROJECT = FOLDER.parent


def sources(function: Callable[..., object]) -> set[str]:
    module = sys.modules[function.__module__]
    found = cache.sources_of(module.__name__, str(module.__file__)).files
    return {Path(file).relative_to(PROJECT).as_posix() for file in found}


def test_a_kernel_depends_on_its_file_and_on_all_that_it_imports_and_on_nothing_else():
    names = ("__init__", "borrowed_code", "cache", "decorator", "numba_parts", "vector_code", "vectors")
    decorator = {f"fis_tools/compiled/{name}.py" for name in names}
    own = {"pipeline/physics/quaternion.py", "pipeline/array_types.py"}
    assert sources(quaternion.dot) == own | decorator
    flight = sources(many.fly_many)
    assert flight > sources(attitude.turn_deputies) | sources(safety.assure) | sources(quaternion.dot)
    assert "fis_tools/engines/kernel.py" in flight
    assert not {file for file in flight if "reference" in file or "formats" in file or "notice" in file}


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Writes modules of a package `kernels`, loads them, and looks up what `caller` depends on."""
    monkeypatch.setattr(cache, "packages", {"fis_tools", "kernels"})

    def written(folder=tmp_path, **texts):
        for name, text in texts.items():
            path = folder / "kernels" / f"{name}.py"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
            module = ModuleType(f"kernels.{name}")
            module.__file__ = str(path)
            monkeypatch.setitem(sys.modules, module.__name__, module)
        cache.sources_of.cache_clear()
        cache._read.cache_clear()
        return cache.sources_of("kernels.caller", str(folder / "kernels" / "caller.py"))

    return written


def stems(sources: cache.Sources) -> list[str]:
    """The modules of the package `kernels` among the sources."""
    return sorted(Path(file).stem for file in sources.files if Path(file).parent.name == "kernels")


@pytest.mark.parametrize(
    "line",
    [
        "from kernels.inner import width",
        "from kernels import inner",
        "import kernels.inner",
        "from kernels import (\n    caller,\n    inner,\n)",
        "from kernels import inner as other, caller",
        "from . import inner",
        "from .inner import width",
        "import numpy as np\nimport os, kernels.inner",
    ],
)
def test_imports_count_at_any_remove_and_in_any_form(kernels, line):
    before = kernels(caller="from kernels import between\n", between=f"{line}\n", inner="width = 3\n")
    assert stems(before) == ["between", "caller", "inner"]
    assert kernels(inner="width = 4\n").digest != before.digest
    assert kernels(inner="width = 3\n").digest == before.digest


def test_imports_for_type_checkers_in_functions_and_from_other_packages_do_not_count(kernels):
    text = (
        "from typing import TYPE_CHECKING\nimport numpy as np\n\n"
        "if TYPE_CHECKING:  # x\n    from kernels import inner\n\n    from kernels import between\n\n"
        "def late():\n    from kernels import inner\n"
    )
    assert stems(kernels(caller=text, between="", inner="")) == ["caller"]


def test_the_place_of_the_sources_does_not_count(kernels, tmp_path):
    texts = {"caller": "from kernels import inner\n", "inner": ""}
    here, there = kernels(**texts), kernels(folder=tmp_path / "elsewhere", **texts)
    assert there.digest == here.digest


@pytest.mark.parametrize(
    ("variables", "root"),
    [
        ({"NUMBA_CACHE_DIR": "/first", "XDG_CACHE_HOME": "/second"}, "/first"),
        ({"XDG_CACHE_HOME": "/second"}, "/second"),
        ({"NUMBA_CACHE_DIR": ""}, "~/.cache"),
    ],
)
def test_the_cache_lies_where_the_environment_says(variables, root, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert cache.cache_root() == Path(root).expanduser() / "fis-tools"


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Where compiled code is kept, not made yet."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "own"))
    monkeypatch.setattr(cache, "_loaded_ns", time.time_ns())
    return tmp_path / "own" / "fis-tools"


def test_a_new_cache_is_closed_to_others(root):
    place = cache.place_for(quaternion.dot.py_func)  # type: ignore[attr-defined]
    assert isinstance(place, Path)
    assert place.parent == root
    assert place.name.startswith("pipeline.physics.quaternion-")
    for folder in (root, place):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


posix = pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes are those of POSIX systems")


def refused() -> str:
    place = cache.place_for(quaternion.dot.py_func)  # type: ignore[attr-defined]
    assert isinstance(place, cache.Refused)
    assert "set NUMBA_CACHE_DIR to a folder of your own" in place.reason
    return place.reason


@posix
@pytest.mark.parametrize("mode", [0o777, 0o702])
def test_a_folder_that_others_may_write_to_is_refused(root, mode):
    root.mkdir(parents=True)
    root.chmod(mode)
    assert f"others may write to {root}" in refused()
    root.chmod(0o700)
    root.parent.chmod(mode)
    assert f"others may write to {root.parent}" in refused()
    root.parent.chmod(mode | stat.S_ISVTX)  # as /tmp is: nobody can replace what belongs to another
    assert isinstance(cache.place_for(quaternion.dot.py_func), Path)  # type: ignore[attr-defined]


@posix
@pytest.mark.parametrize("is_private", [True, False])
def test_a_group_may_write_where_nobody_else_is_in_it(root, is_private, monkeypatch):
    import grp  # noqa: PLC0415 - not on every system
    import pwd  # noqa: PLC0415

    user = pwd.getpwuid(os.getuid()).pw_name
    group = grp.struct_group((user, "x", os.getgid(), [user] if is_private else [user, "somebody"]))
    monkeypatch.setattr(grp, "getgrgid", lambda _: group)
    root.mkdir(parents=True)
    root.chmod(0o770)
    if is_private:
        assert isinstance(cache.place_for(quaternion.dot.py_func), Path)  # type: ignore[attr-defined]
    else:
        assert f"others may write to {root}" in refused()


@posix
def test_a_folder_of_somebody_else_and_a_link_are_refused(root, tmp_path, monkeypatch):
    (tmp_path / "planted").mkdir(mode=0o700)
    root.parent.mkdir()
    root.symlink_to(tmp_path / "planted")
    assert f"{root} is a link" in refused()
    root.unlink()
    root.mkdir(mode=0o700)
    monkeypatch.setattr(os, "getuid", lambda: root.stat().st_uid + 1)
    assert f"{root} belongs to somebody else" in refused()


def test_where_no_folder_can_be_made_code_is_not_kept(root):
    root.parent.write_text("a file where a folder should be")
    assert f"{root} cannot be written" in refused()


def test_a_source_that_is_newer_than_the_process_is_not_kept(root, monkeypatch):
    monkeypatch.setattr(cache, "_loaded_ns", 0)
    place = cache.place_for(quaternion.dot.py_func)  # type: ignore[attr-defined]
    assert isinstance(place, cache.Refused)
    assert "quaternion.py has changed since it was loaded" in place.reason


def test_caches_that_nobody_has_used_for_a_month_are_dropped(root):
    for name, days in (("recent", 29.0), ("old", 31.0)):
        (root / name / "sub").mkdir(parents=True)
        (root / name / "sub" / "fly.nbi").write_text("index")
        moment = time.time() - days * DAY_S
        os.utime(root / name, (moment, moment))
    (root / "note.txt").write_text("not a cache")
    os.utime(root / "note.txt", (0.0, 0.0))
    root.chmod(0o700)
    used = cache.place_for(quaternion.dot.py_func)  # type: ignore[attr-defined]
    assert isinstance(used, Path)
    assert sorted(path.name for path in root.iterdir()) == ["note.txt", used.name, "recent"]


def test_using_a_cache_keeps_it(root):
    used = cache.place_for(quaternion.dot.py_func)  # type: ignore[attr-defined]
    assert isinstance(used, Path)
    os.utime(used, (0.0, 0.0))
    cache.place_for(quaternion.dot.py_func)  # type: ignore[attr-defined]
    cache.drop_old_caches(root)
    assert used.is_dir()


@posix
@pytest.mark.slow
def test_a_stale_answer_is_not_found_where_the_folder_cannot_be_made(tmp_path):
    """numba would fall back to `__pycache__` beside the sources, which ignores a changed callee."""
    (tmp_path / "kernels").mkdir()
    head = "from fis_tools.compiled.decorator import compiled\n"
    callee = head + "\n\n@compiled\ndef step(x):\n    return x + 1\n"
    (tmp_path / "kernels" / "__init__.py").touch()
    (tmp_path / "kernels" / "callee.py").write_text(callee)
    (tmp_path / "kernels" / "caller.py").write_text(
        head + "from kernels.callee import step\n\n\n@compiled\ndef twice(x):\n    return step(step(x))\n"
    )
    (tmp_path / "cache").write_text("a file where a folder should be")

    def call():
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(tmp_path), str(PROJECT)]),
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "NUMBA_DISABLE_JIT": "0",
        }
        command = [sys.executable, "-c", "from kernels.caller import twice; print(twice(5))"]
        return subprocess.run(command, env=environment, check=True, capture_output=True, text=True)  # noqa: S603

    first = call()
    assert first.stdout == "7\n"
    assert first.stderr.startswith(f"  compiled code is not kept: {tmp_path / 'cache' / 'fis-tools'} cannot")
    assert first.stderr.count("is not kept") == 1
    (tmp_path / "kernels" / "callee.py").write_text(callee.replace("x + 1", "3 * x + 0"))
    assert call().stdout == "45\n"
    assert not list(tmp_path.rglob("*.nbi"))
