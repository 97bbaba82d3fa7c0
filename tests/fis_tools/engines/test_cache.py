"""Compiled code is cached by the state of all sources: a changed callee is never missed."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

import fis_tools
import pipeline
from fis_tools.engines import cache
from pipeline.run.compile_notice import announce_compilation

DAY_S = 86400.0
PROJECT = Path(fis_tools.__file__).parents[1]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the fuzzy tools' sources."""
    folder = tmp_path / "fis_tools"
    shutil.copytree(Path(fis_tools.__file__).parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


#: What compiled code of the fuzzy tools depends on: the kernel, and all that it imports.
TAKING_PART = ["engines/kernel.py", "model/membership.py", "model/shapes.py", "model/validate.py"]


@pytest.mark.parametrize("name", TAKING_PART)
def test_a_change_of_a_file_that_compiled_code_depends_on_is_another_state(package: Path, name: str) -> None:
    before = cache.source_hash((package,))
    with (package / name).open("a") as file:
        file.write("\n")
    assert cache.source_hash((package,)) != before


def test_a_change_of_any_other_file_is_the_same_state(package: Path) -> None:
    before = cache.source_hash((package,))
    (package / "formats" / "serialize.py").write_text("")
    (package / "formats" / "new.py").write_text("x = 1\n")
    assert cache.source_hash((package,)) == before
    (package / "formats" / "new.py").write_text("@njit(cache=True)\ndef f():\n    return 1\n")
    assert cache.source_hash((package,)) != before


@pytest.mark.parametrize(
    "line",
    [
        "from kernels.inner import width",
        "from kernels import inner",
        "import kernels.inner",
        "from kernels import (\n    caller,\n    inner,\n)",
        "from kernels import inner as other, caller",
    ],
)
def test_imports_count_at_any_remove_and_in_any_form(tmp_path: Path, line: str) -> None:
    (tmp_path / "kernels").mkdir()
    texts = KERNELS | {"between": line + "\n", "inner": "width = 3\n"}
    texts["caller"] = "from kernels import between\n" + texts["caller"]
    for name, text in texts.items():
        (tmp_path / "kernels" / f"{name}.py").write_text(text)
    before = cache.source_hash((tmp_path / "kernels",))
    (tmp_path / "kernels" / "inner.py").write_text("width = 4\n")
    assert cache.source_hash((tmp_path / "kernels",)) != before


def test_other_files_and_the_place_do_not_count(package: Path, tmp_path: Path) -> None:
    (package / "notes.txt").write_text("x")
    shutil.copytree(package, tmp_path / "elsewhere" / "fis_tools")
    states = {cache.source_hash((p,)) for p in (package, tmp_path / "elsewhere" / "fis_tools")}
    assert states == {cache.source_hash((Path(fis_tools.__file__).parent,))}


def test_the_pipelines_cache_is_keyed_by_both_packages() -> None:
    packages = tuple(Path(module.__file__ or "").parent for module in (fis_tools, pipeline))
    assert Path(numba.config.CACHE_DIR) == cache.cache_root() / cache.source_hash(packages)


KERNELS = {
    "__init__": "from pathlib import Path\nfrom fis_tools.engines import cache\n"
    "cache.use_cache_keyed_by(Path(__file__).parent)\n",
    "callee": "from numba import njit\n\n\n@njit(cache=True)\ndef step(x):\n    return x + 1\n",
    "caller": "from numba import njit\nfrom kernels.callee import step\n\n\n"
    "@njit(cache=True)\ndef twice(x):\n    return step(step(x))\n",
}
CALL = "from kernels.caller import twice; print(twice(5), sum(twice.stats.cache_hits.values()))"


def test_a_changed_callee_in_another_file_is_compiled_anew(tmp_path: Path) -> None:
    (tmp_path / "kernels").mkdir()
    for name, text in KERNELS.items():
        (tmp_path / "kernels" / f"{name}.py").write_text(text)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(PROJECT)]),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "NUMBA_DISABLE_JIT": "0",
    }

    def call() -> str:
        command = [sys.executable, "-c", CALL]
        return subprocess.run(  # noqa: S603
            command, env=environment, check=True, capture_output=True, text=True
        ).stdout.strip()

    assert call() == "7 0"
    assert call() == "7 1"
    callee = tmp_path / "kernels" / "callee.py"
    callee.write_text(callee.read_text().replace("x + 1", "x * 3"))
    assert call() == "45 0"


@pytest.mark.parametrize(
    ("variables", "root"),
    [
        ({"NUMBA_CACHE_DIR": "/first", "XDG_CACHE_HOME": "/second"}, "/first"),
        ({"XDG_CACHE_HOME": "/second"}, "/second"),
        ({"NUMBA_CACHE_DIR": ""}, "~/.cache"),
    ],
)
def test_the_cache_lies_where_the_environment_says(
    variables: dict[str, str], root: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert cache.cache_root() == Path(root).expanduser() / "fuzzy-spacecraft-inspection"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where numba is told to cache, not made yet."""
    root = tmp_path / "fuzzy-spacecraft-inspection"
    path = root / "0123456789abcdef"
    monkeypatch.setattr(cache, "cache_root", lambda: root)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(path))
    return path


def test_it_is_cold_until_something_has_been_compiled(folder: Path) -> None:
    assert cache.is_cold()
    (folder / "episode_123").mkdir(parents=True)
    assert cache.is_cold()
    (folder / "episode_123" / "fly.nbc").write_text("code without an index")
    assert cache.is_cold()
    (folder / "episode_123" / "fly.nbi").write_text("index")
    assert not cache.is_cold()


def test_compilation_is_announced_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    announce_compilation()
    told = capsys.readouterr().err
    assert "compiling the flight kernel" in told
    assert told.count("\n") == 1
    folder.mkdir(parents=True)
    (folder / "fly.nbi").write_text("index")
    announce_compilation()
    assert capsys.readouterr().err == ""


def aged(path: Path, days: float) -> None:
    moment = time.time() - days * DAY_S
    os.utime(path, (moment, moment), follow_symlinks=False)


def test_caches_nothing_was_added_to_for_a_month_are_dropped(folder: Path) -> None:
    root = folder.parent
    for name, days in (("recent", 29.0), ("old", 31.0), ("touched", 31.0), ("empty", 31.0), ("broken", 31.0)):
        (root / name / "sub").mkdir(parents=True)
        if name == "broken":  # a file that is gone when one looks at it
            (root / name / "sub" / "fly.nbi").symlink_to(root / "nowhere")
        elif name != "empty":
            (root / name / "sub" / "fly.nbi").write_text("index")
            aged(root / name / "sub" / "fly.nbi", 1.0 if name == "touched" else days)
        aged(root / name / "sub", days)
        aged(root / name, days)
    (root / "note.txt").write_text("not a cache")
    aged(root / "note.txt", 400.0)
    cache.drop_old_caches()
    assert sorted(path.name for path in root.iterdir()) == ["note.txt", "recent", "touched"]


def test_without_any_cache_there_is_nothing_to_drop(folder: Path) -> None:
    cache.drop_old_caches()
    assert not folder.parent.exists()
