"""Functions compiled by our decorator: in caches of their own, anew where anything they depend on changed."""

import ast
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fis_tools.compiled.decorator import plainly
from fis_tools.compiled.three import same
from tests.fis_tools.compiled.kernels import CALL, HEAD, SOURCES, Package
from tests.places import PACKAGES, PROJECT


@pytest.fixture
def package(tmp_path):
    return Package(tmp_path)


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
        for package in PACKAGES
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
    folder = package.run(
        look, NUMBA_CACHE_DIR="", XDG_CACHE_HOME=str(package.folder / "cache")
    ).stdout.strip()
    assert Path(folder) == package.folder / "kernels" / "__pycache__"


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
        for package in PACKAGES
        for path in (PROJECT / package).rglob("*.py")
    }
    decorating = {path for path, text in texts.items() if re.search(r"\bn?jit\b(?!=)", text)}
    # the player's module is compiled apart, without an entry for Python
    assert decorating == {"fis_tools/compiled/decorator.py", "pipeline/player/webassembly.py"}
    inside = {
        path
        for path, text in texts.items()
        if re.search(r"numba\.core|numba\.np|import llvmlite|from llvmlite", text)
    }
    # llvmlite alone, whose binding is public: it links what ships, and describes the processor
    public = {f"fis_tools/compiled/shipped/{name}.py" for name in ("build", "load")} | {
        "pipeline/run/maker.py"
    }
    assert inside == {"fis_tools/compiled/numba_parts.py", "pipeline/player/webassembly.py"} | public


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
def test_code_of_a_function_without_a_file_is_kept_too(package):
    program = f"{HEAD}@compiled\ndef f(x):\n    return x + 1\nprint(f(3), sum(f.stats.cache_hits.values()))"
    runs = [package.run(program) for _ in range(2)]
    assert [done.stdout.split() for done in runs] == [["4", "0"], ["4", "1"]]
    assert package.run(program.replace("+ 1", "+ 2")).stdout.split() == ["5", "0"]


@pytest.mark.slow
def test_a_source_edited_under_a_running_process_poisons_no_cache(package):
    edit_then_call = (
        "from pathlib import Path\nimport kernels.callee\npath = Path(kernels.callee.__file__)\n"
        "text = path.read_text()\npath.write_text(text.replace('x + STEP', 'x * 3'))\n"
        "from kernels.caller import twice\nprint(twice(5))"
    )
    assert package.run(edit_then_call).stdout.strip() == "7"  # of the code that was loaded
    assert package.call() == "45 8 0 0"
    package.write("callee", SOURCES["callee"])
    assert package.call() == "7 8 1 1"


@pytest.mark.slow
def test_a_value_changed_in_a_running_process_poisons_no_cache(package):
    """numba keeps the callee that it has compiled with the value before."""
    change = (
        "from kernels import callee, caller, more\nprint(caller.twice(5))\n"
        "callee.STEP = 2\nprint(more.thrice(5))"
    )
    done = package.run(change)
    assert done.stdout.split() == ["7", "8"]
    assert re.search(r"kernels\.callee\.step.* has changed", done.stderr)
    after = "from kernels import callee, more\ncallee.STEP = {}\nprint(more.thrice(5))"
    assert [package.run(after.format(step)).stdout.strip() for step in (2, 1)] == ["11", "8"]


@pytest.mark.slow
def test_what_compiled_code_calls_is_compiled_without_an_entry_for_python(package):
    look = (
        "from kernels.callee import step\nfrom kernels.caller import twice\n"
        "print(twice(5), len(step.inside.signatures), len(step.signatures), step(5))"
    )
    assert package.run(look).stdout.strip() == "7 1 0 6"
    assert package.run(look).stdout.strip() == "7 0 0 6"  # found again


@pytest.mark.slow
def test_ctrl_c_ends_compiling_also_where_a_callback_of_llvm_would_swallow_it(package):
    program = (
        "import ctypes, signal, time\nfrom numba.core import event\n"
        "from fis_tools.compiled import dispatchers\nfrom kernels.other import double\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # those around may ignore it
        "callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))\n"
        "passes = []\n"
        "class Listener(event.Listener):\n"
        "    def on_start(self, event): passes.append(event.data['name'])\n"
        "    def on_end(self, event):\n"
        "        if len(passes) == 3:\n"
        "            callback()\n"
        "            while not dispatchers._interruption.thread: time.sleep(0.01)\n"
        "event.register('numba:run_pass', Listener())\n"
        "try: double(3)\n"
        "except KeyboardInterrupt: print('interrupted', len(passes))\n"
        "print(double(3))"
    )
    done = package.run(program)
    assert done.stdout in ("interrupted 3\n6\n", "interrupted 4\n6\n")
    assert "ignored" not in done.stderr
