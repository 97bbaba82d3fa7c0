"""The state of this process that others rely on, and that no function of ours leaves changed."""

import decimal
import gc
import hashlib
import locale
import logging
import os
import resource
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from plain_files.streams import Output

#: what pytest, and scikit-learn as it is imported, write to the environment
OF_OTHERS = {"PYTEST_CURRENT_TEST", "KMP_DUPLICATE_LIB_OK", "KMP_INIT_AT_FORK"}


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def _hash(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()


def _of_numpy() -> object:
    kind, keys, *rest = np.random.get_state()  # noqa: NPY002 - of whoever calls us
    return np.geterr(), np.get_printoptions(), _hash((kind, np.asarray(keys).tobytes(), rest))


def _filters() -> list[Any]:
    """Return the filters of all warnings of a kind; those of one message, or of its own, a library adds."""
    return [each for each in warnings.filters if each[1] is None and each[2].__module__ == "builtins"]


#: of each part: how it is told
PARTS: Mapping[str, Callable[[], Any]] = {
    "signals": lambda: {number: signal.getsignal(number) for number in sorted(signal.valid_signals())},
    "timer": lambda: signal.getitimer(signal.ITIMER_REAL),
    "warnings": lambda: (_filters(), warnings.showwarning),
    "hooks": lambda: (sys.excepthook, sys.unraisablehook, threading.excepthook, sys.displayhook),
    "streams": lambda: [isinstance(stream, Output) for stream in (sys.stdout, sys.stderr)],
    "arguments": lambda: list(sys.argv),
    "path": lambda: list(sys.path),
    "folder": os.getcwd,
    "environment": lambda: {name: value for name, value in os.environ.items() if name not in OF_OTHERS},
    "umask": _umask,
    "locale": lambda: locale.setlocale(locale.LC_ALL),
    "garbage": lambda: (gc.isenabled(), gc.get_threshold(), list(gc.callbacks)),
    "interpreter": lambda: (
        sys.getrecursionlimit(),
        sys.getswitchinterval(),
        sys.get_int_max_str_digits(),
        sys.gettrace(),
    ),
    "decimal": lambda: repr(decimal.getcontext()),
    "numpy": _of_numpy,
    "log": lambda: (logging.root.level, list(logging.root.handlers), logging.root.manager.disable),
    "limits": lambda: {
        name: resource.getrlimit(getattr(resource, name)) for name in dir(resource) if "RLIMIT_" in name
    },
}
#: of libraries, once they are loaded
OF_LIBRARIES: Mapping[str, Callable[[Any], Any]] = {
    # not numba.get_num_threads, which starts them
    "numba": lambda numba: [
        getattr(numba.config, name) for name in ("NUMBA_NUM_THREADS", "CACHE_DIR", "DISABLE_JIT")
    ],
    "matplotlib": lambda matplotlib: {
        key: value
        for key, value in dict.items(matplotlib.rcParams)
        if key != "backend"  # found when needed
    },
    "flint": lambda flint: flint.ctx.prec,
    "dask": lambda dask: dict(dask.config.config),
    "pyarrow": lambda pyarrow: (pyarrow.cpu_count(), pyarrow.io_thread_count()),
    "hydra.core.global_hydra": lambda hydra: hydra.GlobalHydra.instance().is_initialized(),
    "optuna": lambda optuna: optuna.logging.get_verbosity(),
    "threadpoolctl": lambda pools: {
        each["filepath"]: each["num_threads"] for each in pools.threadpool_info()
    },
}


#: parts that may gain keys, of what was loaded
GROWING = ("threadpoolctl",)


def state() -> dict[str, Any]:
    """Return the state, by the names of its parts."""
    loaded = {
        name: tell(sys.modules[name])
        for name, tell in OF_LIBRARIES.items()
        if name in sys.modules and hasattr(sys.modules[name], "__file__")
    }
    return {name: tell() for name, tell in PARTS.items()} | loaded


@contextmanager
def unchanged() -> Iterator[None]:
    """Fail if a block leaves a part of the state changed; what it loads is not compared."""
    before = state()
    yield
    after = state()
    for name, part in before.items():
        now = after[name]
        if name in GROWING:
            now = {key: value for key, value in now.items() if key in part}
        if now != part:
            if isinstance(part, dict):
                keys = [key for key in {**part, **now} if part.get(key) != now.get(key)]
                now = {key: (part.get(key), now.get(key)) for key in keys}
            pytest.fail(f"{name} is left changed: {now}")
