"""Functions compiled by our decorator: in caches of their own, anew where anything they depend on changed."""

import ast
import os
import re
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from fis_tools.compiled import borrowed_code, cache  # noqa: F401 - as the decorator loads it
from fis_tools.compiled.decorator import plainly
from fis_tools.compiled.three import same
from pipeline.flight.fly import many
from pipeline.flight.period.act import attitude, safety
from pipeline.physics import quaternion
from tests.places import PROJECT
from tests.programs import run_python

HEAD = "from fis_tools.compiled.decorator import compiled\n"
#: Sources of a package by file; `caller` reaches `callee`, and a number in `constants`, at one more remove.
SOURCES = {
    "__init__": "",
    "constants": "STEP = 1\n",
    "callee": f"{HEAD}from kernels.constants import STEP\n\n\n@compiled\ndef step(x):\n    return x + STEP\n",
    "caller": f"{HEAD}from kernels.callee import step\n\n\n"
    '@compiled(error_model="numpy")\ndef twice(x):\n    """Take two steps."""\n    return step(step(x))\n',
    "other": f"{HEAD}\n\n@compiled\ndef double(x):\n    return 2 * x\n",
}
CALL = (  # announces what is compiled at once
    "from fis_tools.compiled import notice\nnotice.SHORTEST_S = 0.0\n"
    "from kernels.caller import twice\nfrom kernels.other import double\n"
    "print(twice(5), double(4), *(sum(f.stats.cache_hits.values()) for f in (twice, double)))"
)


class Package:
    """The package `kernels` in a folder, and programs that use it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "kernels").mkdir()
        for name, text in SOURCES.items():
            self.write(name, text)

    def write(self, name: str, text: str) -> None:
        (self.folder / "kernels" / f"{name}.py").write_text(text)

    def run(self, program: str, **variables: str) -> subprocess.CompletedProcess[str]:
        path = os.pathsep.join([str(self.folder), str(PROJECT)])
        usual = {"NUMBA_CACHE_DIR": str(self.folder / "cache"), "NUMBA_DISABLE_JIT": "0"}
        return run_python("-c", program, folder=self.folder, path=path, **usual | variables)

    def call(self) -> str:
        return self.run(CALL).stdout.strip()


@pytest.fixture
def package(tmp_path):
    return Package(tmp_path)


@pytest.mark.slow
def test_what_is_wanted_once_is_not_compiled_until_that_would_have_taken_no_longer(package):
    ask = (
        "from fis_tools.compiled import notice\nfrom fis_tools.compiled.decorator import sparingly\n"
        "from kernels.caller import twice\n{}\n"
        "for x in (5, 6, 0.5):\n    print(sparingly(twice)(x), len(twice.signatures), end=' ')"
    )
    slow, quick = ask.format(""), ask.format("notice.expected_s = lambda _: 1e-9")
    for _ in range(2):
        assert package.run(slow, COMPILE_AT_ONCE="0").stdout.split() == ["7", "0", "8", "0", "2.5", "0"]
    # what has run as plain Python before, in any process, has taken longer than a nanosecond
    assert package.run(quick, COMPILE_AT_ONCE="0").stdout.split() == ["7", "1", "8", "1", "2.5", "2"]


@pytest.mark.slow
def test_the_first_call_is_compiled_where_that_is_asked_for_and_later_ones_where_code_is_kept(package):
    ask = (
        "from fis_tools.compiled.decorator import sparingly\nfrom kernels.caller import twice\n"
        "print(sparingly(twice)(5), len(twice.signatures))"
    )
    for at_once, compiled in (("0", "0"), ("1", "1"), ("0", "1")):
        assert package.run(ask, COMPILE_AT_ONCE=at_once).stdout.split() == ["7", compiled]


#: Compiles functions for numbers of one type, and keeps the code of each as another process keeps its own.
KEEP = """
import time
from pathlib import Path
from numba.core import event
from kernels import several

class Meeting(event.Listener):
    def on_start(self, event):
        pass

    def on_end(self, event):
        name = event.data["dispatcher"].py_func.__name__
        Path(f"{name}-TYPE").touch()
        while not (Path(f"{name}-int").exists() and Path(f"{name}-float").exists()):
            time.sleep(0.0)

event.register("numba:compile", Meeting())
for name in several.NAMES:
    getattr(several, name)(TYPE(3))
"""


@pytest.mark.slow
def test_processes_that_keep_code_at_once_do_not_take_one_for_the_other(package):
    names = [f"half_{n}" for n in range(6)]
    functions = [f"@compiled\ndef {name}(x):\n    return x / 2\n" for name in names]
    package.write("several", "\n\n\n".join([f"{HEAD}NAMES = {names}", *functions]))
    with ThreadPoolExecutor() as pool:
        list(pool.map(package.run, [KEEP.replace("TYPE", kind) for kind in ("int", "float")]))
    look = (
        "from kernels import several\nfor name in several.NAMES:\n    f = getattr(several, name)\n"
        "    print(f(3), f(5.0), sum(f.stats.cache_hits.values()))"
    )
    assert package.run(look).stdout.split() == ["1.5", "2.5", "2"] * len(names)


def test_what_takes_vectors_runs_as_plain_python_with_the_package_that_calls_it():
    """Compiled code takes the number of lanes as a constant, which a call from Python does not give it."""
    with plainly("kernels"):
        assert [component.tolist() for component in same(2.0, 4)] == [[2.0] * 4] * 3


def test_no_compiled_function_raises_to_a_power():
    """numba multiplies where Python asks the C library for a power, which rounds otherwise."""
    functions = {
        f"{path.name} {node.name}": list(map(type, ast.walk(node)))
        for package in ("fis_tools", "pipeline")
        for path in (PROJECT / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
        and "compiled" in str(list(map(ast.unparse, node.decorator_list)))
    }
    assert len(functions) > 200
    assert [name for name, parts in functions.items() if ast.Pow in parts] == []


@pytest.mark.slow
def test_an_edit_compiles_anew_what_depends_on_it_and_no_more_and_compilations_are_announced(package):
    announced = "  compiling kernels.caller.twice: about 1 s, once\n"
    assert package.run(CALL).stderr == announced + announced.replace("caller.twice", "other.double")
    for name, old, new, answer in (
        ("callee", "x + STEP", "x * 3", 45),
        ("constants", "1", "10", 25),
        ("caller", "step(step(x))", "step(x)", 6),
    ):
        package.write(name, SOURCES[name].replace(old, new))
        assert package.call() == f"{answer} 8 0 1"
        package.write(name, SOURCES[name])
    warm = package.run(CALL)
    assert (warm.stdout, warm.stderr) == ("7 8 1 1\n", "")


@pytest.mark.slow
def test_the_caches_of_other_functions_stay_where_they_are(package):
    package.write("foreign", "from numba import njit\n\n\n@njit(cache=True)\ndef f(x):\n    return x\n")
    look = (
        "import numba\nbefore = dict(vars(numba.config))\nimport kernels.foreign\n"
        "import fis_tools, pipeline\nfrom kernels.caller import twice\ntwice(5)\n"
        "import kernels.foreign as late\nimport importlib\nlate = importlib.reload(late)\n"
        "assert vars(numba.config) == before, 'changed'\nprint(late.f.stats.cache_path)"
    )
    place = package.run(look, NUMBA_CACHE_DIR="", XDG_CACHE_HOME=str(package.folder / "cache")).stdout.strip()
    assert Path(place) == package.folder / "kernels" / "__pycache__"


@pytest.mark.slow
def test_nothing_imports_numba_before_the_first_call(package):
    look = (
        "import sys\nfrom kernels.caller import twice\nbefore = 'numba' in sys.modules\n"
        "print(before, twice(5), 'numba' in sys.modules, twice.__doc__, twice.__name__)"
    )
    assert package.run(look).stdout.strip() == "False 7 True Take two steps. twice"


def test_numba_is_used_in_one_way_and_its_inner_parts_are_named_in_one_file():
    texts = {
        path.relative_to(PROJECT).as_posix(): path.read_text(encoding="utf-8")
        for package in ("fis_tools", "pipeline", "telemetry")
        for path in (PROJECT / package).rglob("*.py")
    }
    decorating = {path for path, text in texts.items() if re.search(r"\bn?jit\b", text)}
    assert decorating == {"fis_tools/compiled/decorator.py"}
    inside = {path for path, text in texts.items() if re.search(r"numba\.core|numba\.np|llvmlite", text)}
    assert inside == {"fis_tools/compiled/numba_parts.py"}


@pytest.mark.slow
def test_compiled_functions_of_others_can_call_ours(package):
    call = (
        "from numba import njit\nfrom kernels.caller import twice\n"
        "@njit\ndef thrice(x):\n    return twice(x) + 1\n\n\nprint(thrice(5), twice(5))"
    )
    assert package.run(call).stdout.strip() == "8 7"
    assert package.run(call.replace("@njit", "twice(5)\n\n\n@njit")).stdout.strip() == "8 7"  # found again


def test_they_are_plain_functions_without_numba_and_long_work_says_so_once(package):
    compute = (
        "import importlib.util as u, sys\nsys.modules['numba'] = None\n"
        "find = u.find_spec\nu.find_spec = lambda name: None if name == 'numba' else find(name)\n"
        "from kernels.caller import twice\nfrom fis_tools.compiled.decorator import advise_numba\n"
        "print(twice(5), twice.dispatcher is twice.py_func)\nadvise_numba()\nadvise_numba()"
    )
    done = package.run(compute)
    assert done.stdout.strip() == "7 True"
    without_head = "\n".join(compute.splitlines()[4:])
    assert package.run(without_head, NUMBA_DISABLE_JIT="1").stdout.strip() == "7 True"
    assert done.stderr.count("python -m pip install numba") == 1
    advise = "from fis_tools.compiled.decorator import advise_numba; advise_numba()"
    assert "numba" not in package.run(advise).stderr


@pytest.mark.slow
def test_a_function_without_a_file_is_compiled_and_not_kept(package):
    done = package.run(f"{HEAD}@compiled\ndef f(x):\n    return x\nprint(f(3))")
    assert done.stdout == "3\n"
    assert "compiled code is not kept: <string> cannot be read" in done.stderr


@pytest.mark.slow
def test_a_source_edited_under_a_running_process_poisons_no_cache(package):
    edit_then_call = (
        "from pathlib import Path\nimport kernels.callee\npath = Path(kernels.callee.__file__)\n"
        "text = path.read_text()\npath.write_text(text.replace('x + STEP', 'x * 3'))\n"
        "from kernels.caller import twice\nprint(twice(5))"
    )
    done = package.run(edit_then_call)
    assert done.stdout.strip() == "7"  # of the code that was loaded
    assert "callee.py has changed since it was loaded" in done.stderr
    assert package.call() == "45 8 0 0"


@pytest.mark.slow
def test_what_compiled_code_calls_is_compiled_without_an_entry_for_python(package):
    look = (
        "from kernels.callee import step\nfrom kernels.caller import twice\n"
        "print(twice(5), len(step.inside.signatures), len(step.signatures), step(5))"
    )
    assert package.run(look).stdout.strip() == "7 1 0 6"
    assert package.run(look).stdout.strip() == "7 0 0 6"  # found again


@pytest.mark.slow
def test_ctrl_c_that_a_callback_of_llvm_swallows_comes_again(package):
    program = (
        "import ctypes, signal, time, numba.core.event as event\n"
        "from kernels.other import double\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # those around may ignore it
        "swallowing = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))\n"
        "class Listener(event.Listener):\n"
        "    def on_start(self, event): pass\n"
        "    def on_end(self, event):\n"
        "        swallowing()\n"
        "        for _ in range(600): time.sleep(0.1)\n"
        "event.register('numba:compile', Listener())\n"
        "try: double(3)\n"
        "except KeyboardInterrupt: print('interrupted')"
    )
    done = package.run(program)
    assert done.stdout == "interrupted\n"
    assert "ignored" not in done.stderr


def sources(function: Callable[..., object]) -> set[str]:
    module = sys.modules[function.__module__]
    found = cache.sources_of(module.__name__, str(module.__file__)).files
    return {Path(file).relative_to(PROJECT).as_posix() for file in found}


def test_a_kernel_depends_on_its_file_and_on_all_that_it_imports_and_on_nothing_else():
    names = ("__init__", "borrowed_code", "cache", "decorator", "numba_parts", "vector_code", "vectors")
    decorator = {f"fis_tools/compiled/{name}.py" for name in names}
    own = {"pipeline/physics/quaternion.py", "pipeline/array_types.py", "fis_tools/compiled/three.py"}
    assert sources(quaternion.normalised) == own | decorator
    flight = sources(many.fly_many)
    assert flight > sources(attitude.turn_deputies) | sources(safety.assure) | sources(quaternion.normalised)
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


def placed() -> Any:
    return cache.place_for(quaternion.normalised.py_func)  # type: ignore[attr-defined]


def test_a_new_cache_is_closed_to_others(root):
    place = placed()
    assert place.parent == root
    assert place.name.startswith("pipeline.physics.quaternion-")
    for folder in (root, place):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


posix = pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes are those of POSIX systems")


def refused() -> str:
    place = str(placed())
    assert "set NUMBA_CACHE_DIR to a folder of your own" in place
    return place


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
    assert isinstance(placed(), Path)


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
        assert isinstance(placed(), Path)
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


def test_caches_that_nobody_has_used_for_a_month_are_dropped(root):
    for name, days in (("recent", 29.0), ("old", 31.0)):
        (root / name / "sub").mkdir(parents=True)
        (root / name / "sub" / "fly.nbi").write_text("index")
        moment = time.time() - days * 86400.0
        os.utime(root / name, (moment, moment))
    (root / "note.txt").write_text("not a cache")
    os.utime(root / "note.txt", (0.0, 0.0))
    root.chmod(0o700)
    used = placed()
    os.utime(used, (0.0, 0.0))
    placed()  # using it keeps it
    cache.drop_old_caches(root)
    assert sorted(path.name for path in root.iterdir()) == ["note.txt", used.name, "recent"]


@posix
@pytest.mark.slow
def test_a_stale_answer_is_not_found_where_the_folder_cannot_be_made(package):
    """numba would fall back to `__pycache__` beside the sources, which ignores a changed callee."""
    blocked = package.folder / "blocked"
    blocked.write_text("a file where a folder should be")
    program = "from kernels.caller import twice; print(twice(5))"
    first = package.run(program, NUMBA_CACHE_DIR=str(blocked))
    assert first.stdout == "7\n"
    assert first.stderr.startswith(f"  compiled code is not kept: {blocked / 'fis-tools'} cannot")
    assert first.stderr.count("is not kept") == 1
    package.write("callee", SOURCES["callee"].replace("x + STEP", "3 * x + 0"))
    assert package.run(program, NUMBA_CACHE_DIR=str(blocked)).stdout == "45\n"
    assert not list(package.folder.rglob("*.nbi"))
