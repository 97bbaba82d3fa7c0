"""The package `kernels` with compiled functions, and programs that use it."""

import os
import subprocess
from pathlib import Path

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
    "more": f"{HEAD}from kernels.callee import step\n\n\n"
    "@compiled\ndef thrice(x):\n    return step(step(step(x)))\n",
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

    @property
    def variables(self) -> dict[str, str]:
        """The environment of a program that uses the package."""
        path = os.pathsep.join([str(self.folder), str(PROJECT)])
        cache, compiles = (
            str(self.folder / "cache"),
            {"NUMBA_DISABLE_JIT": "0", "PYTHONDONTWRITEBYTECODE": "1"},
        )
        return {"PYTHONPATH": path, "NUMBA_CACHE_DIR": cache, **compiles}

    def run(self, program: str, **variables: str) -> subprocess.CompletedProcess[str]:
        used = self.variables | variables
        return run_python("-c", program, folder=self.folder, path=used.pop("PYTHONPATH"), **used)

    def call(self) -> str:
        return self.run(CALL).stdout.strip()
