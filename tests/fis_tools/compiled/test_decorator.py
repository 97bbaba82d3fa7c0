"""Functions compiled by our decorator: in caches of their own, anew where anything they depend on changed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fis_tools
from fis_tools.compiled.decorator import plainly
from fis_tools.compiled.three import same

PROJECT = Path(fis_tools.__file__).parents[1]

#: Sources of a package by file; `caller` reaches `callee`, and a number in `constants`, at one more remove.
SOURCES = {
    "__init__": "",
    "constants": "STEP = 1\n",
    "callee": "from fis_tools.compiled.decorator import compiled\nfrom kernels.constants import STEP\n\n\n"
    "@compiled\ndef step(x):\n    return x + STEP\n",
    "caller": "from fis_tools.compiled.decorator import compiled\nfrom kernels.callee import step\n\n\n"
    '@compiled(error_model="numpy")\ndef twice(x):\n    """Take two steps."""\n    return step(step(x))\n',
    "other": "from fis_tools.compiled.decorator import compiled\n\n\n"
    "@compiled\ndef double(x):\n    return 2 * x\n",
}
CALL = (
    "from kernels.caller import twice\nfrom kernels.other import double\n"
    "print(twice(5), double(4), *(sum(f.stats.cache_hits.values()) for f in (twice, double)))"
)


#: announces what is compiled at once
AT_ONCE = "from fis_tools.compiled import notice\nnotice.SHORTEST_S = 0.0\n"


class Package:
    """The package `kernels` in a folder, and programs that use it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "kernels").mkdir()
        for name, text in SOURCES.items():
            self.write(name, text)

    def write(self, name: str, text: str) -> None:
        (self.folder / "kernels" / f"{name}.py").write_text(text)

    def run(
        self, program: str, stderr: int = subprocess.PIPE, **variables: str
    ) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(self.folder), str(PROJECT)]),
            "NUMBA_CACHE_DIR": str(self.folder / "cache"),
            "NUMBA_DISABLE_JIT": "0",
            **variables,
        }
        command = [sys.executable, "-c", program]
        return subprocess.run(  # noqa: S603
            command,
            env=environment,
            check=True,
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
            cwd=self.folder,
        )

    def call(self) -> str:
        return self.run(CALL).stdout.strip()


@pytest.fixture
def package(tmp_path):
    return Package(tmp_path)


@pytest.mark.slow
def test_what_is_wanted_once_is_not_compiled_until_it_is_wanted_again(package):
    ask = (
        "from fis_tools.compiled.decorator import sparingly\nfrom kernels.caller import twice\n"
        "for x in (5, 6, 0.5):\n    print(sparingly(twice)(x), len(twice.signatures), end=' ')"
    )
    assert package.run(ask).stdout.split() == ["7", "0", "8", "1", "2.5", "1"]
    # whole numbers were wanted twice, others once
    assert package.run(ask).stdout.split() == ["7", "1", "8", "1", "2.5", "2"]


def test_what_takes_vectors_runs_as_plain_python_with_the_package_that_calls_it():
    """Compiled code takes the number of lanes as a constant, which a call from Python does not give it."""
    with plainly("kernels"):
        assert [component.tolist() for component in same(2.0, 4)] == [[2.0] * 4] * 3


@pytest.mark.slow
def test_an_edit_compiles_anew_what_depends_on_it_and_no_more(package):
    package.call()
    for name, old, new, answer in (
        ("callee", "x + STEP", "x * 3", 45),
        ("constants", "1", "10", 25),
        ("caller", "step(step(x))", "step(x)", 6),
    ):
        package.write(name, SOURCES[name].replace(old, new))
        assert package.call() == f"{answer} 8 0 1"
        package.write(name, SOURCES[name])
    assert package.call() == "7 8 1 1"


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


def test_they_are_plain_functions_where_numba_is_switched_off(package):
    call = "from kernels.caller import twice; print(twice(5), twice.dispatcher is twice.py_func)"
    assert package.run(call, NUMBA_DISABLE_JIT="1").stdout.strip() == "7 True"


def test_they_are_plain_functions_without_numba_and_long_work_says_so_once(package):
    compute = (
        "import importlib.util as u, sys\nsys.modules['numba'] = None\n"
        "find = u.find_spec\nu.find_spec = lambda name: None if name == 'numba' else find(name)\n"
        "from kernels.caller import twice\nfrom fis_tools.compiled.decorator import advise_numba\n"
        "print(twice(5), twice.dispatcher is twice.py_func)\nadvise_numba()\nadvise_numba()"
    )
    done = package.run(compute)
    assert done.stdout.strip() == "7 True"
    assert done.stderr.count("python -m pip install numba") == 1
    assert (
        "numba" not in package.run("from fis_tools.compiled.decorator import advise_numba as a; a()").stderr
    )


@pytest.mark.slow
def test_a_function_without_a_file_is_compiled_and_not_kept(package):
    define = (
        "from fis_tools.compiled.decorator import compiled\n@compiled\ndef f(x):\n    return x\nprint(f(3))"
    )
    done = package.run(define)
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
def test_a_compilation_is_announced_and_a_warm_start_is_silent(package):
    assert package.run(AT_ONCE + CALL).stderr == (
        "  compiling kernels.caller.twice: about 1 s, once\n"
        "  compiling kernels.other.double: about 1 s, once\n"
    )
    assert package.run(AT_ONCE + CALL).stderr == ""


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
