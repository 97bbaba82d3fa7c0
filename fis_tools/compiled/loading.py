"""Loads compiled code from numba's cache; gets numba ready to compile only if something is missing there.

numba gets ready first: it imports and lists all that it can compile, which takes a tenth of a second, and so
do our vectors. It also does so whenever it compiles, so that code which is loaded can do without.
"""

import sys
import threading
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from numba import version_info
from numba.core.runtime.nrt import rtsys

#: Whether this release of numba is one whose inner parts are known to work as `fis_tools.engines` uses them.
IS_KNOWN = version_info.short in {(0, 67), (0, 68)}


def get_ready() -> None:
    """Get numba ready to compile functions that use `fis_tools.compiled.vectors`."""
    _import_without_blas()
    from fis_tools.compiled import borrowed_code  # noqa: F401, PLC0415 - registers vectors with numba


def load_first(dispatcher: Any) -> None:
    """Let a dispatcher look into its cache before numba gets ready to compile."""
    if not IS_KNOWN:
        get_ready()
        return
    _import_without_blas()  # code that sums arrays refers to it
    cache = dispatcher._cache

    def load_overload(signature: Any, context: Any) -> Any:
        rtsys.initialize(context)  # the code allocates arrays with it
        with cache._guard_against_spurious_io_errors():
            if (code := cache._load_overload(signature, context)) is not None:
                return code
        get_ready()
        return None

    cache.load_overload = load_overload


def _import_without_blas() -> None:
    """Import the part of numba that imports SciPy's linear algebra to check whether it is there.

    That takes a fifth of a second, and code that uses it checks again. So an empty
    module replaces it for this moment, unless another thread might import it at the same time.
    """
    asked = "scipy.linalg.cython_blas"
    is_known = asked in sys.modules or "numba.np.arraymath" in sys.modules
    if is_known or threading.active_count() > 1 or find_spec("scipy") is None:
        return
    sys.modules[asked] = ModuleType(asked)
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules[asked]
